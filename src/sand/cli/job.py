"""Shared part of `sand collide`, `sand grow` and `sand scatter`: worker processes, Ctrl-C, and how to continue."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from pathlib import Path

from ..errors import BadInput
from ..experiments.executors import executor_for
from . import report
from .interrupt import InterruptObserver


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
