"""Measuring time."""

from __future__ import annotations

import time
from collections.abc import Callable


def best(call: Callable[[], object], repeat: int = 7) -> float:
    """Least thread time [s] of several calls, after one to warm up."""
    call()
    times = []
    for _ in range(repeat):
        start = time.thread_time()
        call()
        times.append(time.thread_time() - start)
    return min(times)


def wall(call: Callable[[], object], repeat: int = 3) -> float:
    """Least wall time [s]."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)
