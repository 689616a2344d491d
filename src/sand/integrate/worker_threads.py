"""Python threads that run a compiled worker kernel next to the driver."""

from __future__ import annotations

import os
import queue
import threading
import weakref
from collections.abc import Callable
from typing import Any

from ..compiler.jit import COMPILED
from ..threads import threads


class WorkerThreads:
    """A pool of threads that run one compiled kernel, without the GIL, at the same time.

    Threads start on first use and end with the pool.  After a fork the child process starts its own.

    Parameters
    ----------
    kernel : Callable
        It processes blocks of a `TaskQueue` until the driver ends the work.
    """

    def __init__(self, kernel: Callable[..., None]):
        self._kernel, self._process = kernel, os.getpid()
        self._inboxes: list[queue.SimpleQueue] = []
        self._finalizer = weakref.finalize(self, _stop_all, self._inboxes)

    def __deepcopy__(self, memo: dict[int, Any]) -> WorkerThreads:
        """A new pool for the same kernel."""
        return WorkerThreads(self._kernel)

    def start(self, arguments: tuple[Any, ...]) -> None:
        """Run the kernel with `arguments` on all threads but the caller's; returns at once."""
        if not COMPILED:  # without the compiler nothing is atomic
            return
        if self._process != os.getpid():  # threads do not survive a fork
            self._inboxes.clear()
            self._process = os.getpid()
        workers = threads() - 1
        while len(self._inboxes) < workers:
            inbox: queue.SimpleQueue = queue.SimpleQueue()
            threading.Thread(target=_run, args=(inbox, self._kernel), name="sand-worker", daemon=True).start()
            self._inboxes.append(inbox)
        for inbox in self._inboxes[:workers]:
            inbox.put(arguments)


def _run(inbox: queue.SimpleQueue, kernel: Callable[..., None]) -> None:
    while (arguments := inbox.get()) is not None:
        kernel(*arguments)
        del arguments  # do not keep the arrays of a finished run alive


def _stop_all(inboxes: list[queue.SimpleQueue]) -> None:
    for inbox in inboxes:
        inbox.put(None)
