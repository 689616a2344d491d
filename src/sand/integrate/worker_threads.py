"""Python threads that run a stage next to the driver."""

from __future__ import annotations

import os
import queue
import threading
import weakref
from typing import Any

from ..basics.threads import threads
from ..compiler.jit import COMPILED
from ..compiler.stage import Stage
from ..compiler.table import Table


class WorkerThreads:
    """A pool of threads that run one stage, without the GIL, at the same time.

    Threads start on first use and end with the pool.  After a fork the child process starts its own.

    Parameters
    ----------
    work : Stage
        It processes blocks of a `TaskQueue` until the driver ends the work.
    """

    def __init__(self, work: Stage):
        self._work, self._process = work, os.getpid()
        self._inboxes: list[queue.SimpleQueue] = []
        self._finalizer = weakref.finalize(self, _stop_all, self._inboxes)

    def __deepcopy__(self, memo: dict[int, Any]) -> WorkerThreads:
        """A new pool for the same stage."""
        return WorkerThreads(self._work)

    @property
    def have_started(self) -> bool:
        """Whether any thread has started."""
        return bool(self._inboxes)

    def start(self, table: Table) -> None:
        """Run the stage with the parts in a table on all threads but the caller's; returns at once."""
        workers = threads() - 1
        if not COMPILED or workers == 0:  # without the compiler nothing is atomic
            return
        if self._process != os.getpid():  # threads do not survive a fork
            self._inboxes.clear()
            self._process = os.getpid()
        while len(self._inboxes) < workers:
            inbox: queue.SimpleQueue = queue.SimpleQueue()
            threading.Thread(target=_run, args=(inbox,), name="sand-worker", daemon=True).start()
            self._inboxes.append(inbox)
        call = self._work.prepare(table)
        for inbox in self._inboxes[:workers]:
            inbox.put(call)


def _run(inbox: queue.SimpleQueue) -> None:
    while (call := inbox.get()) is not None:
        call()
        del call  # do not keep the arrays of a finished run alive


def _stop_all(inboxes: list[queue.SimpleQueue]) -> None:
    for inbox in inboxes:
        inbox.put(None)
