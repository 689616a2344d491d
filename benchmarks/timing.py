"""Measuring time."""

from __future__ import annotations

import statistics
import subprocess
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]


def as_own(function: Callable) -> Callable:
    """Let a function be compiled as those of SAND are, with the longest vectors of the processor where these are fast.

    Functions of other packages are first optimised alone, by numba's own rules.
    """
    function.__module__ = f"sand.{function.__module__}"
    return function


class Pair(NamedTuple):
    """Ours beside a peer's, measured in turns."""

    ours: float  # the least of all rounds, as whatever else runs on the machine only adds
    peer: float
    ratio: float  # the median of the rounds' ratios, peer's over ours


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


def thread(call: Callable[[], object]) -> float:
    """Thread time [s] of one call."""
    start = time.thread_time()
    call()
    return time.thread_time() - start


def of_command(words: Sequence[str], repeat: int = 3) -> float:
    """Least CPU time [s] of a program, from its start to its end; wall time where Python cannot tell it (Windows)."""
    return min(ran(words)[0] for _ in range(repeat))


def ran(words: Sequence[str], **options: Any) -> tuple[float, str]:
    """CPU time [s] of one run of a program, as `of_command` has it, and what it prints.

    Raises CalledProcessError where the program fails.
    """

    def spent() -> float:
        if resource is None:
            return time.perf_counter()
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    before = spent()
    done = subprocess.run(words, capture_output=True, text=True, check=True, **options)
    return spent() - before, done.stdout


def per_step(sim: Any, steps: int) -> float:
    """Thread time [s] of each of about so many steps of a simulation, which may go on to the end of a cycle."""
    first = sim.steps
    spent = thread(lambda: sim._engine.advance(np.inf, steps))
    if sim.steps < first + steps:
        raise RuntimeError(f"the world that is timed stopped after {sim.steps - first} of {steps} steps")
    return spent / (sim.steps - first)


def replayed(sim: Any, steps: int) -> Callable[[], float]:
    """`per_step` that goes over the same steps, from where the world is now, in every call.

    A copied world is in no cache: a tenth as many steps go before those that count.
    """
    start = sim.state.copy()

    def again() -> float:
        sim._engine.regular_state = start.copy()
        per_step(sim, steps // 10 + 1)
        return per_step(sim, steps)

    return again


def fitting(sim: Any, budget: float = 0.15) -> int:
    """Steps that take about `budget` seconds, after some to warm up."""
    sim.run(steps=20)
    rough = per_step(sim, 5)
    rough = per_step(sim, min(max(int(0.1 * budget / rough), 5), 1_000_000))
    return min(max(int(budget / rough), 5), 10_000_000)


def in_turns(ours: Callable[[], float], peer: Callable[[], float] | None, rounds: int = 5) -> Pair:
    """Call both alternately; each returns seconds. Without a peer its time and the ratio are nan."""
    mine, other = [], []
    for _ in range(rounds):
        mine.append(ours())
        other.append(peer() if peer else np.nan)
    ratios = [b / a for a, b in zip(mine, other, strict=True)]
    return Pair(min(mine), min(other), statistics.median(ratios))
