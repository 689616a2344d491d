"""Compact spheres cut from a random ballistic deposit."""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arguments import checked
from ..box import Box
from ..errors import BadInput
from ..grains import Grains
from ..material import Material
from ._kernels.deposition import deposit
from .ballistic import ADVICE
from .growing import CELL, TRIES, require_all_placed, room
from .moments import magnetised
from .population import (
    Lognormal,
    Population,
    PowerLaw,
    centred_grains,
    grain_set_of,
    population,
    radii_of,
    streams,
    whole,
)

FILLING = 0.23
"""Of a deposit of equal grains that roll once, about."""
SPARE = 1.6
"""A deposit has this many times the grains that the sphere needs."""
DOUBLED = 6
"""Deposits of twice the size each that are tried."""


@checked
def rbd(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """A compact sphere cut from a random ballistic deposit: grains fall one by one onto a plane and stay.

    A deposit in which nothing rolls fills 0.15 of space, but with separate trees, of which no sphere can be cut in one
    piece.  Each grain therefore rolls on the one it has landed on to the nearest place where it touches a second, once,
    as in the BAM1 aggregates of Shen, Draine & Johnson (2008); about 0.23 of space is filled then.  The sphere is the
    smallest about the middle that holds a cluster of N grains; outermost grains with a single contact go until it is N.

    Parameters
    ----------
    grains, radius, …: as for `bpca`; but N radii or materials cannot be given one by one, since most grains of
        the deposit are cut off.

    Raises
    ------
    BadInput
        as for `bpca`.
    """
    count, chance = whole(grains, "grains of an aggregate"), streams(seed)
    law = radii_of(radius)
    if isinstance(law, np.ndarray) or not isinstance(material, (str, Material, Mapping)):
        raise BadInput("an rbd is cut from more grains than it has; give one radius or a law, and no list of materials")
    for doubled in range(DOUBLED):
        spare = SPARE * 2**doubled
        every, side = _of_deposit(count, law, material, chance.population, spare)
        columns = max(3, int(side / (CELL * every.grain_set.largest)))
        position, crowd = np.zeros((3, len(every.radius))), room(every.grain_set, side / columns)
        done = deposit(crowd, position, every.grain_set, side, columns, chance.places, TRIES)
        require_all_placed(done, len(every.radius), f"grain {done} of the deposit", ADVICE)
        kept = cut_sphere(position.T, every.radius, count)
        if len(kept):
            break
    else:
        raise BadInput(f"no deposit had a cluster of {count} grains; take another seed")
    kinds = [every.material[k] for k in kept]
    cut = Population(every.radius[kept], kinds, grain_set_of(every.radius[kept], kinds))
    return magnetised(centred_grains(position.T[kept], cut), moment, moments, magnetic, chance.moments)


def _of_deposit(
    count: int, law: float | Lognormal | PowerLaw, material: Any, rng: np.random.Generator, spare: float
) -> tuple[Population, float]:
    """Grains that fill a cube, and its side [m]: larger than the sphere by a part, and by a rim of large grains."""
    few = population(max(count, 100), law, material, rng)
    volume = 4.0 / 3.0 * math.pi * float((few.radius**3).mean())
    side = (spare * count * volume / FILLING) ** (1.0 / 3.0) + 3.0 * CELL * few.grain_set.largest
    return population(int(FILLING * side**3 / volume) + 10, law, material, rng), side


def cut_sphere(position: np.ndarray, radius: np.ndarray, count: int) -> np.ndarray:
    """Numbers (count,) of grains in one cluster, as compact as can be about the middle of a heap of grains.

    Of length 0 if there is no cluster that large.

    Parameters
    ----------
    position, radius : ndarray
        (M, 3) and (M,) [m] of the heap.
    """
    pairs = Box.open().close_pairs(position, 2.0 * float(radius.max()))
    apart = np.linalg.norm(position[pairs[:, 0]] - position[pairs[:, 1]], axis=1)
    pairs = pairs[apart < radius[pairs].sum(axis=1) * (1.0 + 1e-9)]
    centre = np.median(position[_largest(pairs, len(position))], axis=0)
    order = np.argsort(np.linalg.norm(position - centre, axis=1), kind="stable")
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    bonds = place[pairs]  # by rank of the distance from the centre
    low, high = count, len(order)
    if len(_largest(bonds, high)) < count:
        return np.zeros(0, dtype=np.int64)
    while low < high:  # the smallest ball whose largest cluster has enough
        trial = (low + high) // 2
        low, high = (low, trial) if len(_largest(bonds, trial)) >= count else (trial + 1, high)
    return np.sort(order[_trimmed(bonds, _largest(bonds, high), count)])


def _largest(bonds: np.ndarray, ranks: int) -> np.ndarray:
    """The largest cluster among the first so many grains."""
    from scipy.sparse import csr_array  # slow to load, and few runs begin with a deposit
    from scipy.sparse.csgraph import connected_components

    inside = bonds[(bonds < ranks).all(axis=1)]
    graph = csr_array((np.ones(len(inside)), (inside[:, 0], inside[:, 1])), shape=(ranks, ranks))
    _, label = connected_components(graph, directed=False)
    return np.flatnonzero(label == np.bincount(label).argmax())


def _trimmed(bonds: np.ndarray, cluster: np.ndarray, count: int) -> np.ndarray:
    """`count` of the cluster: its outermost grains go, one by one, unless that would break it in two."""
    mates: dict[int, set[int]] = {int(k): set() for k in cluster}
    for i, j in bonds[np.isin(bonds, cluster).all(axis=1)].tolist():
        mates[i].add(j)
        mates[j].add(i)
    # grains may go if they have one contact; later also if their mates stay connected without them, which is costly
    ends = [-k for k, others in mates.items() if len(others) <= 1]
    heapq.heapify(ends)
    while len(mates) > count:
        gone = -heapq.heappop(ends) if ends else _dispensable(mates)
        for mate in mates.pop(gone):
            mates[mate].discard(gone)
            if len(mates[mate]) == 1:
                heapq.heappush(ends, -mate)
    return np.array(sorted(mates))


def _dispensable(mates: dict[int, set[int]]) -> int:
    """The outermost grain without which the others stay one cluster."""
    for gone in sorted(mates, reverse=True):
        start = next(iter(mates[gone]))
        seen, front = {start, gone}, [start]
        while front:
            front = [k for i in front for k in mates[i] if k not in seen and not seen.add(k)]  # type: ignore[func-returns-value]
        if len(seen) == len(mates):
            return gone
    raise BadInput("the cluster cannot be cut to size")  # pragma: no cover
