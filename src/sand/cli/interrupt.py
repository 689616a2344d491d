"""Ctrl-C and SIGTERM while kernels are compiled or files are closed."""

from __future__ import annotations

from typing import Any

from ..simulation.observers import Observer
from ..simulation.signals import STOPS
from .interrupts import Interrupts


class InterruptObserver(Interrupts, Observer):
    """Raises KeyboardInterrupt on both signals in the block; during steps `simulation.signals` handles them.

    An exception raised while the compiler calls back into Python is lost. As an observer, this class raises it again at
    the first frame, after everything has been compiled.
    """

    def __init__(self) -> None:
        super().__init__(STOPS)

    def see(self, simulation: Any, row: dict[str, float]) -> None:
        """Raise an exception that was lost."""
        if self.received:
            raise KeyboardInterrupt
