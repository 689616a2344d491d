"""Notes on compilation: what is being compiled, and how long that took the last time."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from filelock import BaseFileLock, FileLock, Timeout
from numba.core import event

from .cache import read_record, write_record

__all__ = [
    "LONGEST_WAIT",
    "CompilationListener",
    "Timeout",
    "acquire_lock",
    "announce",
    "compilation_notes",
    "compilation_seconds",
]
__all__ += ["compile_times", "describe", "free_lock", "making_code", "shown_line", "suppress_notes"]

LONGEST_WAIT = 300.0
"""Wall time [s] to wait for a process that compiles the same code."""
SHORT = 1.0
"""Wall time [s] of the last compilation below which no note is worth it."""

REWRITE, REPEAT = 0.5, 30.0
"""Wall times [s] after which a line of progress is shown again, on a terminal and elsewhere."""

Notify = Callable[[str], None]


def describe(what: str, seconds: float | None) -> str:
    """The note on one compilation; `seconds` is its last duration, None if that is not known."""
    last = "" if seconds is None else f" (last time {seconds:.0f} s)"
    return f"compiling {what}{last} …"


def _on_terminal(note: str) -> None:
    """Show a note of a script or an interactive session, only if stderr is a terminal."""
    if sys.stderr is not None and sys.stderr.isatty():
        print(f"sand: {note}", file=sys.stderr, flush=True)


def _nowhere(note: str) -> None:
    """Show no note."""


_notify: list[Notify] = [_on_terminal]
"""Functions that show notes; the last one is used."""


@contextmanager
def compilation_notes(notify: Notify | None) -> Iterator[None]:
    """Within the block, pass the notes on compilation to `notify`; None: no notes."""
    _notify.append(notify or _nowhere)
    try:
        yield
    finally:
        _notify.pop()


def announce(what: str) -> None:
    """Show a note on what a wait is for, such as "drawing the figure", where notes on compilation are shown."""
    _notify[-1](f"{what} …")


def suppress_notes() -> None:
    """Show no notes in this process, for workers whose parent reports progress."""
    _notify.append(_nowhere)


def acquire_lock(path: Path, what: str) -> BaseFileLock | None:
    """Take the lock of some compiled code, with a note if another process holds it; None if there are no locks here.

    A process that waits longer than LONGEST_WAIT compiles without the lock.
    """
    try:
        return free_lock(path)
    except Timeout:
        _notify[-1](f"another process compiles {what}; waiting for it …")
        try:
            return free_lock(path, LONGEST_WAIT)
        except Timeout:
            return None


@contextmanager
def shown_line(describe: Callable[[], str]) -> Iterator[None]:
    """Within the block, show `describe()`: on a terminal in one line that is rewritten, else as a note now and then.

    The notes on single compilations are left out.
    """
    show, ended = _notify[-1], threading.Event()
    if show is _nowhere:
        yield
        return
    rewrites = sys.stderr is not None and sys.stderr.isatty()

    def keep_showing() -> None:
        width = 0
        while not ended.wait(REWRITE if rewrites else REPEAT):
            if rewrites:
                text = f"sand: {describe()}"
                print(f"\r{text:<{width}}", end="", file=sys.stderr, flush=True)
                width = len(text)
            else:
                show(describe())
        if width:
            print(f"\r{'':<{width}}\r", end="", file=sys.stderr, flush=True)

    if not rewrites:
        show(describe())
    thread = threading.Thread(target=keep_showing, daemon=True)
    _notify.append(_nowhere)
    thread.start()
    try:
        yield
    finally:
        _notify.pop()
        ended.set()
        thread.join()


def free_lock(path: Path, wait: float = 0.0) -> BaseFileLock | None:
    """Take a lock for which one waits so long [s]; None if there are no locks here.  Raises Timeout."""
    lock = FileLock(path, thread_local=False, fallback_to_soft=False)
    try:
        lock.acquire(timeout=wait)
    except Timeout:
        raise
    except (OSError, NotImplementedError):
        return None
    return lock


class _Spent:
    """Wall time of all compilations in this process, and of loading compiled code; nested ones count once."""

    def __init__(self) -> None:
        self.seconds, self._depth, self._began = 0.0, 0, 0.0

    def __enter__(self) -> None:
        if not self._depth:
            self._began = time.perf_counter()
        self._depth += 1

    def __exit__(self, *_: object) -> None:
        self._depth -= 1
        if not self._depth:
            self.seconds += time.perf_counter() - self._began


making_code = _Spent()
"""Measures blocks in which machine code is made, or loaded from the disk."""


def compilation_seconds() -> float:
    """Wall time [s] that this process has spent on compilation and on loading compiled code."""
    return making_code.seconds


def compile_times(record: Path) -> dict[str, float]:
    """Last duration [s] of the compilation of each kernel, from a record; an unreadable one counts as empty."""
    try:
        return {str(name): float(seconds) for name, seconds in read_record(record).items()}
    except (ValueError, AttributeError, TypeError):
        return {}


class CompilationListener(event.Listener):
    """Listener for numba's compilation events: notes for the kernels of SAND, and a record of their durations.

    Parameters
    ----------
    purposes : dict[int, str]
        What each kernel computes, by the id of its dispatcher.
    record : Path
        JSON file with the last duration [s] of each kernel; an unreadable file counts as empty.
    """

    def __init__(self, purposes: dict[int, str], record: Path):
        self._purposes, self._record = purposes, record
        self._current, self._depth, self._began = "", 0, 0.0

    def _durations(self) -> dict[str, float]:
        return compile_times(self._record)

    def on_start(self, event: Any) -> None:
        """Note the start of a kernel; the functions that it calls are compiled within."""
        self._depth += 1
        what = self._purposes.get(id(event.data.get("dispatcher")), "")
        if self._current or not what:
            return
        self._current, self._began, self._depth = what, time.perf_counter(), 1
        last = self._durations().get(what)
        if last is None or last >= SHORT:
            _notify[-1](describe(what, last))

    def on_end(self, event: Any) -> None:
        """Record the duration of a kernel, unless its compilation failed."""
        self._depth -= 1
        if self._current and self._depth == 0:
            seconds = time.perf_counter() - self._began
            what, self._current = self._current, ""
            if sys.exc_info()[0] is not None:  # numba's `event.is_failed` is true for every compilation
                return
            lock = acquire_lock(self._record.with_suffix(".lock"), "")  # several processes compile side by side
            write_record(self._record, self._durations() | {what: round(seconds, 3)})
            if lock is not None:
                lock.release()
