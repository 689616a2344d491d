"""How the cost of a grain's step grows with the number of grains, numbered as built, at random and along a curve."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import sand

from . import worlds
from .timing import per_step

COUNTS = (100, 1000, 10_000, 100_000, 1_000_000)
ROOM = 12_000
"""Bytes that a grain may take while its world is built and timed."""
GRAIN_STEPS = 1_000_000
"""Grains times steps of a timed piece."""
PIECES = 3
PATIENCE = 120.0
"""Longest time [s] that one world may take to be built."""
WAYS = {"as built": "as given", "at random": "as given", "in order": "curve"}
"""How grains are numbered, and where they stand; in order: along a curve through space, from random numbers."""
KINDS = {"loose": "loose BPCA", "fcc": "dense fcc", "gas": "gas"}


def available() -> float:
    """Bytes of memory that this machine has to spare; infinite where it does not tell."""
    told = Path("/proc/meminfo")
    lines = told.read_text("utf-8").splitlines() if told.exists() else []
    return next((1024.0 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable")), np.inf)


class Tree(NamedTuple):
    """Cost of one sum of dipoles in an open cube with the density of the first run."""

    seconds: float  # thread time per grain
    memory: int  # of the tree [bytes]


def tree(count: int, accuracy: float = 1e-3) -> Tree:
    """The least of some sums by a tree of multipoles; nothing moves."""
    sites = int(np.ceil(count ** (1.0 / 3.0) - 1e-9))
    grid = np.stack(np.meshgrid(*[np.arange(sites)] * 3, indexing="ij"), -1).reshape(-1, 3)
    rng = np.random.default_rng(9)
    place = 1.2e-6 / 100 ** (1.0 / 3.0) * (rng.permutation(grid)[:count] + 0.8 * rng.random((count, 3)))
    moment = 6.6e-18 * rng.normal(size=(count, 3))
    grains = sand.Grains(place, 1e-8, sand.IRON, moment=moment)
    sim = sand.Simulation(grains, [sand.Dipoles(open="tree", accuracy=accuracy)], stepping=sand.Verlet(step="1 fs"))
    sim.run(steps=1)
    (_, parameters) = sim._engine.content.pair_forces[0]
    memory = sum(array.nbytes for group in (parameters.cells, parameters.scratch) for array in group)
    return Tree(min(per_step(sim, max(100_000 // count, 1)) for _ in range(PIECES)) / count, memory)


class Cost(NamedTuple):
    """Of one world."""

    step: float  # thread time of a step of each grain [s]
    building: float  # thread time until the first loads are there [s]


def cost(kind: str, count: int, numbered: str) -> Cost:
    """The best of some short pieces; contacts alone, calm."""
    place = worlds.PLACES[kind](count)
    if numbered != "as built":
        place = np.random.default_rng(8).permutation(place)
    begun = time.thread_time()
    grains = worlds.shaken(place, speed=worlds.SLOW)
    how = sand.Neighbours(order=WAYS[numbered])
    sim = sand.Simulation(grains, [sand.Contact()], stepping=worlds.stepping(kind), neighbours=how)
    sim.run(steps=1)
    built = time.thread_time() - begun
    steps = max(GRAIN_STEPS // count, 5)
    return Cost(min(per_step(sim, steps) for _ in range(PIECES)) / count, built)


def rows(quick: bool) -> Iterator[dict[str, Any]]:
    """One for each kind and number of grains; `quick` ends at 10⁴."""
    cost(next(iter(KINDS)), COUNTS[0], "as built")  # compiled before anything is timed
    for kind, name in KINDS.items():
        building = 0.0
        for count in COUNTS[:3] if quick else COUNTS:
            one: dict[str, Any] = {"kind": name, "grains": count, "skipped": ""}
            if ROOM * count > available():
                one["skipped"] = f"needs {1e-9 * ROOM * count:.2g} GB of free memory"
            elif 10.0 * building > PATIENCE:
                one["skipped"] = f"would take {10.0 * building:.0f} s to build"
            else:
                costs = {way: cost(kind, count, way) for way in WAYS}
                building = max(each.building for each in costs.values())
                one |= {way: 1e9 * each.step for way, each in costs.items()} | {"building": building}
            yield one
    yield from tree_rows(quick)


def tree_rows(quick: bool) -> Iterator[dict[str, Any]]:
    """Sums by the tree from 10³ grains on; `quick` ends at 10⁴."""
    tree(COUNTS[1])  # compiled before anything is timed
    for count in COUNTS[1:3] if quick else COUNTS[1:]:
        if ROOM * count > available():
            yield {"kind": "tree", "grains": count, "skipped": f"needs {1e-9 * ROOM * count:.2g} GB of free memory"}
        else:
            found = tree(count)
            yield {"kind": "tree", "grains": count, "skipped": "", "us": 1e6 * found.seconds, "memory": found.memory}


def tell(told: Iterable[dict[str, Any]]) -> None:
    """Print them as they come."""
    ways = " ".join(f"{way:>10}" for way in WAYS)
    print(f"{'':12} {'grains':>8} {ways}  ns per grain and step {'building':>10}  s")
    for one in told:
        text = one["skipped"]
        if not text and one["kind"] == "tree":
            text = f"{one['us']:10.3g} us per grain and sum of dipoles, {1e-6 * one['memory']:.3g} MB"
        elif not text:
            text = " ".join(f"{one[way]:10.3g}" for way in WAYS) + f" {'':22} {one['building']:10.3g}"
        print(f"{one['kind']:12} {one['grains']:8d} {text}", flush=True)
