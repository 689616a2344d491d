"""Rows of what a crew of threads gains over one, by the clock on the wall."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

import sand
from sand.basics.threads import cores

from . import worlds
from .table import row
from .timing import fitting, in_turns


def by_the_clock(sim: Any, threads: int, steps: int) -> float:
    """Seconds of a step with so many threads."""
    sand.set_threads(threads)
    first, start = sim.state.steps, time.perf_counter()
    sim._engine.advance(np.inf, steps)
    spent = time.perf_counter() - start
    sand.set_threads(1)
    return spent / (sim.state.steps - first)


def gain(name: str, sim: Any, quick: bool) -> dict[str, Any]:
    """All cores and one thread in turns."""
    steps = fitting(sim, 0.1 if quick else 0.3)
    number = cores()
    pair = in_turns(lambda: by_the_clock(sim, number, steps), lambda: by_the_clock(sim, 1, steps), 3 if quick else 7)
    return row(f"{number} threads, {name}", pair, "us per step", scale=1e6, of="one thread")


def all_rows(quick: bool) -> Iterator[dict[str, Any]]:
    """Contacts, dipoles of all pairs, both with lists; nothing where there is one core."""
    if cores() == 1:
        return
    count = 2000 if quick else 10_000
    for kind in ("loose", "fcc"):
        grains = worlds.shaken(worlds.PLACES[kind](count), speed=worlds.SLOW)
        yield gain(f"contacts, {kind}, {count} grains", sand.Simulation(grains, [sand.Contact()]), quick)
    yield gain("dipoles of all pairs, 1000 grains", worlds.cloud(1000), quick)
    yield gain(f"contacts + dipoles in a gas, {count} grains", worlds.gas(count), quick)
