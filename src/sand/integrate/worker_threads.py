"""The helping threads of a simulation's crew."""

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
    """Threads that run a kernel beside the driver whenever it is called; started when first needed.

    Parameters
    ----------
    worker_loop : Callable
        the kernel, which ends when the driver says so.
    """

    def __init__(self, worker_loop: Callable):
        self._help, self._process = worker_loop, os.getpid()
        self._queues: list[queue.SimpleQueue] = []
        self._end = weakref.finalize(self, _send_home, self._queues)

    def __deepcopy__(self, memo: dict[int, Any]) -> WorkerThreads:
        """Others of the same kind."""
        return WorkerThreads(self._help)

    def start(self, arrays: tuple[Any, ...]) -> None:
        """Let all threads but the caller's own run the kernel on these arguments."""
        if not COMPILED:  # without the compiler nothing is atomic
            return
        if self._process != os.getpid():  # threads do not come along into a fork
            self._queues.clear()
            self._process = os.getpid()
        while len(self._queues) < threads() - 1:
            line: queue.SimpleQueue = queue.SimpleQueue()
            threading.Thread(target=_work, args=(line, self._help), name="sand-crew", daemon=True).start()
            self._queues.append(line)
        for line in self._queues[: threads() - 1]:
            line.put(arrays)


def _work(line: queue.SimpleQueue, worker_loop: Callable) -> None:
    while (arrays := line.get()) is not None:
        worker_loop(*arrays)
        del arrays


def _send_home(queues: list[queue.SimpleQueue]) -> None:
    for line in queues:
        line.put(None)
