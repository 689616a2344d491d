"""Shared part of `sand collide`, `sand grow` and `sand scatter`: worker processes, Ctrl-C, and how to continue."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import BadInput
from ..experiments.executors import executor_for
from ..simulation.observers import Observer
from ..simulation.signals import STOPS
from . import report
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


@contextmanager
def running_job(
    folder: Path, workers: int, scheduler: str | None = None, threads: int | None = None, *, quiet: bool
) -> Iterator[tuple[Executor | None, InterruptObserver]]:
    """Executor of a job in a folder, and an observer for simulations that run in this process.

    Raises
    ------
    BadInput
        If a worker process dies, or `executor_for` refuses the arguments.
    KeyboardInterrupt
        After Ctrl-C; its text says how to continue.
    """
    try:
        with (
            report.compiling(quiet),
            InterruptObserver() as interrupts,
            executor_for(workers, scheduler, threads) as executor,
        ):
            yield executor, interrupts
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted; {report.how_to_continue(folder)}") from None
    except BrokenExecutor:
        raise BadInput(f"a worker process died; {report.how_to_continue(folder)}") from None
