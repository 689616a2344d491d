"""Signals that stop a program: a run stops after the current step instead of being torn out of it."""

from __future__ import annotations

import signal
import threading
from types import FrameType
from typing import Any, ClassVar

_ALWAYS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name))
"""Ctrl-C, SIGTERM, and Ctrl-Break on Windows, which other programs can send."""
_OF_SYSTEMS = tuple(
    getattr(signal, name) for name in ("SIGUSR1", "SIGUSR2", "SIGHUP", "SIGXCPU") if hasattr(signal, name)
)
"""Signals of batch systems before a time limit, of a terminal that is closed, and of a limit of the processor time. By
default they end a program at once; a handler of the user stays."""
STOPS = _ALWAYS + _OF_SYSTEMS
"""Signals that ask a program to stop."""


class Signals:
    """Context manager that records the first stop signal; a further Ctrl-C interrupts at once.

    Python handles signals in the main thread only; in other threads nothing is changed.

    Attributes
    ----------
    received : int or None
        The signal.
    """

    saving: ClassVar[set[Any]] = set()
    """Writers of runs that have taken steps and have not yet written their last checkpoint and summary; of all other
    runs nothing is lost if this process ends at once."""
    _present: ClassVar[list[Signals]] = []

    def __init__(self) -> None:
        self.received: int | None = None
        self._before: dict[int, Any] = {}

    @classmethod
    def check(cls) -> None:
        """Raise KeyboardInterrupt if a signal has arrived and nothing is lost by it; the run cannot continue then."""
        if not cls.saving and any(each.received is not None for each in cls._present):
            raise KeyboardInterrupt

    def __enter__(self) -> Signals:
        self._present.append(self)
        if threading.current_thread() is threading.main_thread():
            for number in STOPS:
                if _is_free(number):
                    self._before[number] = signal.signal(number, self._note)
        return self

    def _note(self, number: int, _frame: FrameType | None) -> None:
        if self.received is None:
            self.received = number
        elif number == signal.SIGINT:  # other signals may come from several programs
            self._restore()
            signal.raise_signal(number)

    def _restore(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before.clear()

    def __exit__(self, *_: object) -> None:
        self._present.remove(self)
        self._restore()


def _is_free(number: int) -> bool:
    """Whether a run may handle a signal: it is not ignored, as Ctrl-C is in a background job of a shell."""
    handler = signal.getsignal(number)
    if handler in (signal.SIG_IGN, None):
        return False
    ours = getattr(getattr(handler, "__self__", None), "stops_runs", False)
    return number in _ALWAYS or handler is signal.SIG_DFL or ours or handler is left_to_thread


def left_to_thread(_number: int, _frame: FrameType | None) -> None:
    """Handler of a worker process outside of its runs: a thread of the worker gets the signal."""
