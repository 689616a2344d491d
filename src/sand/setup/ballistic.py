"""Aggregates from straight flights: particle–cluster, cluster–cluster, and spheres cut from a deposit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ..core.box import Box
from ..core.errors import BadInput
from ..core.grains import Grains
from ..kernels.aggregation import begin_crowd, deposit, grow_ballistic
from ..kernels.meeting import join_ballistic
from .growing import CELL, TRIES, halves, refuse_unmet, room
from .moments import magnetised
from .population import Lognormal, Population, PowerLaw, at_home, population, radii_of, streams, stuff_of, whole

FILLING = 0.15
"""Of a random ballistic deposit of equal grains, about (Watson, Mather & Bee 1997: 0.1469)."""
SPARE = 1.5
"""A deposit has this many times the grains that the sphere needs."""
ADVICE = "take larger grains, stiffer ones, or a narrower law of radii"


def bpca(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """Ballistic particle–cluster aggregate: grains fly in one by one, from all sides on straight lines, and stay.

    A dense ball with a fractal dimension near 3: N − 1 contacts, each at rest.

    Args:
        grains: N ≥ 1.
        radius: [m], one, (N,), or a law: `Lognormal`, `PowerLaw`, or text as for `radii_of`.
        material: one, N of them, or parts of each, {"silica": 0.7, "iron": 0.3}.
        moment: size of each moment, as for `sand.Grains`; none by default.
        moments: "random", "aligned" (along z) or "relaxed" (in each other's field, a minimum of the energy).
        magnetic: part of the grains that have the moment, 0 … 1.
        seed: same seed, same aggregate.

    Raises:
        BadInput: wrong numbers, or grains that cannot touch one at a time.
    """
    chance = streams(seed)
    made = population(whole(grains, "grains of an aggregate"), radius, material, chance.population)
    position, crowd = np.zeros((3, len(made.radius))), room(made.stuff)
    begin_crowd(crowd, position)
    count, size = len(made.radius), float(made.radius[0])
    done, _ = grow_ballistic(crowd, position, made.stuff, 1, count, size, chance.places, TRIES)
    refuse_unmet(done, count, f"grain {done}", ADVICE)
    return magnetised(at_home(position.T, made), moment, moments, magnetic, chance.moments)


def bcca(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """Ballistic cluster–cluster aggregate: halves, made the same way, turned at random, fly into each other.

    Fractal dimension about 1.9.  Arguments and errors as for `bpca`; N need not be a power of 2.
    """
    chance = streams(seed)
    made = population(whole(grains, "grains of an aggregate"), radius, material, chance.population)
    position = joined(made, halves(0, len(made.radius)), None, chance.places, 1)
    return magnetised(at_home(position, made), moment, moments, magnetic, chance.moments)


def joined(
    made: Population, joins: list[tuple[int, int, int]], goals: np.ndarray | None, seed: np.uint64, choices: int
) -> np.ndarray:
    """Places (N, 3) [m] of grains whose clusters fly into each other, see `kernels.meeting.join_ballistic`.

    Args:
        goals: radius of gyration [m] wanted after each join; None: whatever chance gives.
        choices: meetings to choose from where one is wanted.

    Raises:
        BadInput: two clusters did not meet in a single contact.
    """
    position = np.zeros((3, len(made.radius)))
    plan = np.array(joins, dtype=np.int64).reshape(-1, 3).T.copy()
    aims = np.full(plan.shape[1], np.inf) if goals is None else goals
    table = room(made.stuff, 2.0 * made.stuff.largest)
    done = join_ballistic(table, position, np.zeros_like(position), made.stuff, plan, aims, seed, TRIES, choices)
    refuse_unmet(done, plan.shape[1], f"a cluster of {_size(joins, done)} grains", ADVICE)
    return position.T


def _size(joins: list[tuple[int, int, int]], done: int) -> int:
    return joins[done][2] - joins[done][1] if done < len(joins) else 0


def rbd(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """A compact sphere cut from a random ballistic deposit: grains fall one by one onto a plane and stay.

    The sphere's filling is that of the deposit, 0.15 for equal grains.  What the cut leaves without a contact to the
    rest is dropped, then the outermost grains with a single contact, until N are left.  Arguments and errors as for
    `bpca`, but N radii or materials cannot be given one by one, since most grains of the deposit are cut off.
    """
    count, chance = whole(grains, "grains of an aggregate"), streams(seed)
    law = radii_of(radius)
    if isinstance(law, np.ndarray) or not isinstance(material, (str, dict)) and np.ndim(material) > 0:
        raise BadInput("an rbd is cut from more grains than it has; give one radius or a law, and no list of materials")
    every = _of_deposit(count, law, material, chance.population)
    size = _side(every, count)
    columns = max(3, int(size / (CELL * every.stuff.largest)))
    position, crowd = np.zeros((3, len(every.radius))), room(every.stuff, size / columns)
    done = deposit(crowd, position, every.stuff, 0, len(every.radius), size, columns, chance.places, TRIES)
    refuse_unmet(done, len(every.radius), f"grain {done} of the deposit", ADVICE)
    kept = cut_sphere(position.T, every.radius, count)
    kinds = [every.material[k] for k in kept]
    cut = Population(every.radius[kept], kinds, stuff_of(every.radius[kept], kinds))
    return magnetised(at_home(position.T[kept], cut), moment, moments, magnetic, chance.moments)


def _side(made: Population, count: int) -> float:
    """Side of the square: the diameter of the sphere, and a rim of two of the largest grains [m]."""
    volume = 4.0 / 3.0 * math.pi * float((made.radius**3).mean()) * count
    ball = 2.0 * (volume / FILLING * 3.0 / (4.0 * math.pi)) ** (1.0 / 3.0)
    return SPARE ** (1.0 / 3.0) * ball + 4.0 * CELL * made.stuff.largest


def _of_deposit(count: int, law: float | Lognormal | PowerLaw, material: Any, rng: np.random.Generator) -> Population:
    """As many grains as fill the square to a height that is its side."""
    few = population(max(count, 100), law, material, rng)
    volume = 4.0 / 3.0 * math.pi * float((few.radius**3).mean())
    return population(int(FILLING * _side(few, count) ** 3 / volume) + 10, law, material, rng)


def cut_sphere(position: np.ndarray, radius: np.ndarray, count: int) -> np.ndarray:
    """Numbers (count,) of grains in one cluster, the most compact about the middle of a heap of such clusters.

    Args:
        position, radius: (M, 3) and (M,) [m] of the heap.

    Raises:
        BadInput: there is no cluster that large.
    """
    centre = 0.5 * (position.min(axis=0) + position.max(axis=0))
    order = np.argsort(np.linalg.norm(position - centre, axis=1), kind="stable")
    pairs = Box.open().close_pairs(position, 2.0 * float(radius.max()))
    apart = np.linalg.norm(position[pairs[:, 0]] - position[pairs[:, 1]], axis=1)
    pairs = pairs[apart < radius[pairs].sum(axis=1) * (1.0 + 1e-9)]
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    bonds = place[pairs]  # by rank of the distance from the centre
    low, high = count, len(order)
    if len(_largest(bonds, high)) < count:
        raise BadInput(f"no cluster of {count} grains was found in the deposit")
    while low < high:  # the smallest ball whose largest cluster has enough
        trial = (low + high) // 2
        low, high = (low, trial) if len(_largest(bonds, trial)) >= count else (trial + 1, high)
    kept = np.zeros(len(order), dtype=bool)
    kept[_largest(bonds, high)] = True
    return np.sort(order[_trimmed(bonds, kept, count)])


def _largest(bonds: np.ndarray, ranks: int) -> np.ndarray:
    """Grains of the largest cluster among those of the first ranks."""
    inside = bonds[(bonds < ranks).all(axis=1)]
    graph = csr_array((np.ones(len(inside)), (inside[:, 0], inside[:, 1])), shape=(ranks, ranks))
    _, label = connected_components(graph, directed=False)
    return np.flatnonzero(label == np.bincount(label).argmax())


def _trimmed(bonds: np.ndarray, kept: np.ndarray, count: int) -> np.ndarray:
    """Ranks of `count` of the kept grains: the outermost with a single contact go, one by one; contacts make trees."""
    import heapq

    inside = bonds[kept[bonds].all(axis=1)]
    mates: dict[int, set[int]] = {int(k): set() for k in np.flatnonzero(kept)}
    for i, j in inside.tolist():
        mates[i].add(j)
        mates[j].add(i)
    ends = [-k for k, of in mates.items() if len(of) == 1]
    heapq.heapify(ends)
    while len(mates) > count and ends:
        gone = -heapq.heappop(ends)
        (mate,) = mates.pop(gone)
        mates[mate].discard(gone)
        if len(mates[mate]) == 1:
            heapq.heappush(ends, -mate)
    return np.array(sorted(mates))
