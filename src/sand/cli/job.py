"""Shared part of commands that compute for long: worker processes, signals, the wall time, and how to continue."""

from __future__ import annotations

import _thread
import math
import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..basics.errors import BadInput
from ..basics.units import format_quantity
from ..compiler.program import before_first_calls
from ..experiments.executors import executor_for
from ..simulation.observers import Observer
from ..simulation.signals import STOPS, Signals
from . import report
from .exits import WALL_TIME
from .interrupts import BEGAN, Interruption, Interrupts


class WallTimeUsed(Interruption):
    """The wall time that the user allows is used up, and the work is saved."""

    exit_code = WALL_TIME


class InterruptObserver(Interrupts, Observer):
    """Raises KeyboardInterrupt on all stop signals in the block; during steps `simulation.signals` handles them.

    An exception raised while the compiler calls back into Python is lost. It is raised again before the next
    compilation, while a job waits for its tasks, or, as this class is an observer, at the first frame.

    Attributes
    ----------
    why : str
        Why the command was interrupted.
    is_late : bool
        Whether the wall time is used up.
    """

    def __init__(self) -> None:
        super().__init__(STOPS)
        self.why, self.is_late = "interrupted", False
        self._timer: threading.Timer | None = None

    def __enter__(self) -> InterruptObserver:
        super().__enter__()
        before_first_calls.append(self._check)
        return self

    def __exit__(self, *problem: object) -> None:
        if self._timer is not None:
            self._timer.cancel()
        before_first_calls.remove(self._check)
        super().__exit__(*problem)

    def limit(self, wall_time: float | None) -> None:
        """Interrupt the block, as by a signal, after the wall time `wall_time` [s] of the command; None: no limit."""
        if wall_time is not None:
            left = min(max(BEGAN + wall_time - time.monotonic(), 0.0), threading.TIMEOUT_MAX)
            late = f"the wall time of {format_quantity(wall_time, 's')} is used up"
            self._timer = threading.Timer(left, self._end_wall_time, [late])
            self._timer.daemon = True
            self._timer.start()

    def _end_wall_time(self, why: str) -> None:
        """Interrupt the main thread, also where it waits."""
        self.is_late, self.why = True, why
        # Ctrl-C is ignored in a background job of a shell
        number = next((one for one in STOPS if one != signal.SIGINT and one in self._before), signal.SIGINT)
        if hasattr(signal, "pthread_kill"):
            signal.pthread_kill(threading.main_thread().ident or 0, number)
        else:
            _thread.interrupt_main(number)

    def _raise(self, number: int, frame: Any) -> None:
        try:
            super()._raise(number, frame)
        except KeyboardInterrupt:
            raise (WallTimeUsed(self.why) if self.is_late else Interruption) from None

    def _check(self) -> None:
        Signals.check()
        self.see(None, {})

    def see(self, simulation: Any, row: dict[str, float]) -> None:
        """Raise an exception that was lost."""
        if self.received:
            raise Interruption


@contextmanager
def running_job(
    folder: Path,
    workers: int,
    scheduler: str | None = None,
    threads: int | None = None,
    wall_time: float | None = None,
    *,
    quiet: bool,
    again: str = "",
) -> Iterator[tuple[Executor | None, InterruptObserver]]:
    """Executor of a job in a folder, and an observer for simulations that run in this process.

    Raises
    ------
    BadInput
        If a worker process dies, or `executor_for` refuses the arguments.
    KeyboardInterrupt
        After a signal, or as `WallTimeUsed` after the wall time `wall_time` [s]; its text says how to continue.
    """
    interrupts = InterruptObserver()
    try:
        with report.compiling(quiet), interrupts:
            interrupts.limit(wall_time)
            with executor_for(workers, scheduler, threads) as executor:
                yield executor, interrupts
    except (KeyboardInterrupt, BrokenExecutor) as error:
        if isinstance(error, BrokenExecutor) and not (interrupts.received or interrupts.is_late):
            raise BadInput(f"a worker process died; {report.how_to_continue(folder)}") from None
        text = f"{interrupts.why}; {again or report.how_to_continue(folder)}"
        raise (WallTimeUsed if interrupts.is_late else KeyboardInterrupt)(text) from None


def run_job(
    job: Any, *, workers: int, quiet: bool, as_json: bool, lines: bool = False, **execution: Any
) -> dict[str, Any]:
    """Run an `experiments.job.Job` with a line of progress; returns what its `run` does.

    Parameters
    ----------
    lines : bool, optional
        Whether lines that stay show the progress where there is no terminal.
    **execution
        As for `running_job`.

    Raises
    ------
    BadInput
        As the job; or if a worker process has died.
    """
    from .progress import Progress

    hidden, single = quiet or as_json, job.is_single
    observers = [Progress(math.inf, math.inf)] if single and not hidden else []
    is_first = True
    no_bar = hidden or single or (lines and not sys.stderr.isatty())
    with (
        report.progress_bar(1.0, no_bar, bar_format=report.LAYOUT, every=report.JOB_LINE_EVERY) as bar,
        running_job(job.folder, 1 if single else workers, quiet=quiet, again=job.AGAIN, **execution) as (
            executor,
            interrupts,
        ),
    ):

        def progress(text: str, part: float, line: str = "") -> None:
            interrupts.see(None, {})
            if line and not hidden:
                report.write_line(line)
            nonlocal is_first
            if is_first:  # what was done before says nothing about the time left
                bar.initial = bar.n = part
                is_first = False
            bar.set_description_str(text, refresh=False)
            bar.update(part - bar.n)

        try:
            return job.run(executor, [interrupts, *observers], progress)
        finally:
            for each in observers:
                each.finish()
