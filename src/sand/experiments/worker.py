"""Worker processes: they stop by SIGTERM, and when their parent dies; their warnings go to the parent."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable
from multiprocessing.connection import wait
from typing import Any, TypeVar

from ..basics.threads import set_threads
from ..forces.own import import_modules
from ..simulation.signals import STOPS, Signals, left_to_thread

Item = TypeVar("Item")
Result = TypeVar("Result")

STOPPERS = frozenset({signal.SIGTERM, getattr(signal, "SIGXCPU", signal.SIGTERM)})
"""Signals that stop a worker: that of the parent, and that of a process whose own processor time is used up."""
SHIELDED = frozenset(STOPS) - STOPPERS
"""Signals that workers ignore: they are sent to the parent, too, which then stops its workers."""
LONGEST_STOP = 60.0
"""Wall time [s] that workers get to write their checkpoints; they need it only on a very slow disk."""
SHORT = 0.02
"""Wall time [s] between two looks whether the checkpoint is written."""
STOPPED = 1
"""Exit code of a worker that was stopped."""

_stopping = threading.Event()
_collected = threading.local()


def begin_worker(threads: int, imports: list[str]) -> None:
    """Prepare a new worker process: signals, its end with the parent, threads, modules of the user."""
    from ..compiler.progress import suppress_notes

    for number in SHIELDED:
        signal.signal(number, signal.SIG_IGN)
    for number in STOPPERS:
        signal.signal(number, left_to_thread)
    reader = None
    if os.name != "nt":  # Windows ends a process without a signal
        reader, writer = os.pipe()  # also while compiled code runs, in which Python calls no handler
        os.set_blocking(writer, False)
        signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    threading.Thread(target=_end_with_parent, args=(reader,), daemon=True).start()
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPPERS)
    set_threads(threads)
    suppress_notes()
    import_modules(imports)


def _end_with_parent(reader: int | None) -> None:
    """Stop this process after a signal, whose number is read from the pipe `reader`, or when its parent has died.

    A run with files ends with a checkpoint; everything else, also a compilation, ends at once.
    """
    parent = multiprocessing.parent_process()
    sources = [each for each in (reader, None if parent is None else parent.sentinel) if each is not None]
    while True:
        ready = wait(sources)
        has_signal = reader is not None and reader in ready and not STOPPERS.isdisjoint(os.read(reader, 64))
        if has_signal or ready != [reader]:
            break
    _stopping.set()
    if Signals.saving and not has_signal:  # the run knows of no signal yet
        signal.raise_signal(signal.SIGTERM)
    end = time.monotonic() + LONGEST_STOP
    while Signals.saving and time.monotonic() < end:
        time.sleep(SHORT)
    os._exit(STOPPED)


def do_task(work: Callable[..., Any], *given: Any, **named: Any) -> Any:
    """Do one task in a worker process, which ends after it if it was stopped meanwhile."""
    try:
        if not _stopping.is_set():
            return work(*given, **named)
    finally:
        if _stopping.is_set():
            os._exit(STOPPED)


def done_apart(parent: int, work: Callable[[Item], Result], item: Item) -> tuple[Result, list[str]]:
    """The result of `work(item)`, and the texts of its warnings unless it is done in the process `parent`."""
    if os.getpid() == parent:
        return work(item), []
    _collect_warnings()
    _collected.texts = []
    try:
        return work(item), _collected.texts
    finally:
        _collected.texts = None


def _collect_warnings() -> None:
    """From now on, warnings of tasks are collected, each text once; those of other threads are shown as before."""
    show = warnings.showwarning
    if getattr(show, "collects", False):
        return

    def collect(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        texts = getattr(_collected, "texts", None)
        if texts is None:
            show(message, category, *where, **more)
        elif issubclass(category, UserWarning) and str(message) not in texts:
            texts.append(str(message))

    collect.collects = True  # type: ignore[attr-defined]
    warnings.showwarning = collect
