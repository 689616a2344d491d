"""Rows of single pieces: motion, lists of pairs, memory."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

import sand
from sand.basics.arrays import empty_long_range_arrays
from sand.compiler.stage import stage
from sand.integrate.motion import drift_for
from sand.neighbours.cell_list import rebuild_verlet_list

from . import decks, machine, worlds
from .steps import beside
from .table import row
from .timing import as_own, best, in_turns, thread

BYTES_MOVED = 8 * (3 * (2 + 2) + 2 + 3 * 2 * 2 + 4 * 2 + 3 * 2)
"""Bytes per grain of a kick (v and ω read and written, F and M, m and I read) and a drift (x, ϱ; μ from the body's)."""
CANDIDATE = 17.0
"""Operations per pair that a list looks at: 3 for r, 9 for the nearest image, 5 for r²."""
NEIGHBOURS = (14, 50, 200)


drift = drift_for(True)


@stage("kicks and drifts", cached=False)
@as_own
def move(grains, span, parameters):
    """Kick and drift, `times` over."""
    dt, times = parameters
    for _ in range(times):
        drift(grains, np.uint64(0), np.uint64(grains.mass.size), span, dt)
    return 0


def motion(count: int = 1000) -> dict[str, Any]:
    """A kick and a drift of free grains that spin, in a periodic box."""
    side = 3.0 * worlds.RADIUS * math.ceil(count ** (1 / 3))
    grains = worlds.shaken(worlds.sparse(count), "1 A m^2/kg")
    spin = np.random.default_rng(6).normal(size=(count, 3))
    world = sand.Simulation(
        sand.Grains(grains.position, worlds.RADIUS, worlds.PEER, moment=grains.moment, spin=spin),
        box=sand.Box.periodic(side),
    ).state
    times = 400_000 // count
    arrays = world.grains.arrays
    seconds = best(lambda: move(arrays, world.box.span, (1e-12, times))) / times / count
    share = machine.share_of_bandwidth(BYTES_MOVED, BYTES_MOVED * count, seconds)
    return row(f"motion, {count} grains", seconds, "ns per grain", 2.5, scale=1e9, **share)


def list_build(count: int, neighbours: int, quick: bool) -> dict[str, Any]:
    """The list of all pairs within a reach, of points in random order in a periodic box."""
    place, side = worlds.points(count)
    reach = (3.0 * neighbours / (4.0 * math.pi)) ** (1 / 3)
    points = sand.Grains(place, 0.2, worlds.PEER)
    span, far = sand.Box.periodic(side).span, empty_long_range_arrays(len(place), int(1.3 * neighbours * len(place)))
    where = np.ascontiguousarray(place.T)

    def ours() -> float:
        def build() -> None:
            far.anchor[...] = where
            if rebuild_verlet_list(far, span, reach) < 0:
                raise RuntimeError("no room for the list")

        return thread(build)

    ours()
    steps = 3 if quick else 10
    with beside(decks.lists(points, side, reach)) as program:
        if program is not None:
            program.run(3)
        peer = None if program is None else lambda: program.run(steps).neighbour
        pair = in_turns(ours, peer, 3 if quick else 5)
    width = side / int(side / reach)
    looked = CANDIDATE * len(place) * (27.0 * width**3 - 1.0)
    return row(
        f"pair list, {len(place)} grains, {neighbours} neighbours",
        pair,
        "ms",
        scale=1e3,
        of="LAMMPS",
        ratio_asked=1.0,
        **machine.share_of_flops(looked, pair.ours),
    )


def bytes_of(thing: Any) -> int:
    """Of all arrays in it."""
    if isinstance(thing, np.ndarray):
        return thing.nbytes
    if isinstance(thing, (tuple, dict)):
        return sum(bytes_of(part) for part in (thing.values() if isinstance(thing, dict) else thing))
    if dataclasses.is_dataclass(thing):
        return sum(bytes_of(getattr(thing, part.name)) for part in dataclasses.fields(thing))
    return bytes_of(thing.arrays) if isinstance(thing, sand.Grains) else 0


def memory(quick: bool) -> list[dict[str, Any]]:
    """All arrays of a world of grains with three contacts each, after a few steps."""
    rows = []
    for name, most in (("contacts", 1.0), ("contacts of unequal grains", None), ("contacts + dipoles", None)):
        start = worlds.lattice(10 if quick else 22)
        grains, radius, forces = start.grains, np.full(len(start.grains), 3e-7), [sand.Contact()]
        if "unequal" in name:  # by less than changes anything else
            radius[::2] *= 1.0 - 1e-9
        moment = None
        if "dipoles" in name:
            moment = 1e-20 * np.random.default_rng(7).normal(size=grains.position.shape)
            forces.append(sand.Dipoles())
        moved = sand.Grains(grains.position, radius, sand.SILICA, velocity=grains.velocity, moment=moment)
        sim = sand.Simulation(moved, forces)
        sim.run(steps=20)
        rows.append(row(f"memory, {name}", bytes_of(sim.state) / len(grains), "kB per grain", most, scale=1e-3))
    return rows


def all_rows(quick: bool) -> Iterator[dict[str, Any]]:
    """Motion, lists, memory."""
    yield motion()
    for neighbours in NEIGHBOURS:
        yield list_build(100_000, neighbours, quick)
    yield from memory(quick)
