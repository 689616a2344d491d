"""Ctrl-C and SIGTERM while kernels are compiled or files are closed."""

from __future__ import annotations

import signal
import sys
import threading
from typing import Any

from ..simulation.observers import Observer
from ..simulation.signals import STOPS


class Watch(Observer):
    """Both signals raise KeyboardInterrupt in the block; the steps of a run have a watch of their own inside it.

    An exception that is raised while the compiler calls back into Python gets lost.  Therefore it is raised again
    when this observer first sees the simulation, which is when everything has been compiled.
    """

    def __init__(self) -> None:
        self.asked = False
        self._before: dict[int, Any] = {}
        self._hook = sys.unraisablehook

    def __enter__(self) -> Watch:
        if threading.current_thread() is threading.main_thread():
            for number in STOPS:
                if signal.getsignal(number) != signal.SIG_IGN:  # a shell's `sand run … &` is not for Ctrl-C
                    self._before[number] = signal.signal(number, self._raise)
            sys.unraisablehook = self._lost
        return self

    def _raise(self, _number: int, _frame: Any) -> None:
        self.asked = True
        raise KeyboardInterrupt

    def _lost(self, unraisable: Any) -> None:
        if not isinstance(unraisable.exc_value, KeyboardInterrupt):
            self._hook(unraisable)

    def see(self, simulation: Any, row: dict[str, float]) -> None:
        """The exception that was lost."""
        if self.asked:
            raise KeyboardInterrupt

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if sys.unraisablehook == self._lost:
            sys.unraisablehook = self._hook
