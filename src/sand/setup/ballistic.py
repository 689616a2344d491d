"""Aggregates from straight flights: particle–cluster and cluster–cluster."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arguments import checked
from ..grains import Grains
from ._kernels.aggregation import begin_hash_grid, grow_ballistic
from ._kernels.cluster_cluster import join_ballistic
from .growing import TRIES, halves, require_all_placed, room
from .moments import magnetised
from .population import Population, centred_grains, population, streams, whole

ADVICE = "take larger grains, stiffer ones, or a narrower law of radii"


@checked
def bpca(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """Ballistic particle–cluster aggregate: grains fly in one by one, from all sides on straight lines, and stay.

    A dense ball with a fractal dimension near 3: N − 1 contacts, each at rest.

    Parameters
    ----------
    grains : int
        N ≥ 1.
    radius
        [m], one, (N,), or a law: `Lognormal`, `PowerLaw`, or text as for `radii_of`.
    material
        one, N of them, or parts of each, {"silica": 0.7, "iron": 0.3}.
    moment : optional
        size of each moment, as for `sand.Grains`, or one vector (3,) [A m²], which all then have whatever
        `moments` says, but for "relaxed"; none by default.
    moments : str, optional
        "random", "aligned" (along z) or "relaxed" (in each other's field, a minimum of the energy).
    magnetic : optional
        part of the grains that have the moment, 0 … 1.
    seed : int, optional
        same seed, same aggregate.

    Raises
    ------
    BadInput
        wrong numbers, or grains that cannot touch one at a time.
    """
    chance = streams(seed)
    made = population(whole(grains, "grains of an aggregate"), radius, material, chance.population)
    position, crowd = np.zeros((3, len(made.radius))), room(made.grain_set)
    begin_hash_grid(crowd, position)
    count, size = len(made.radius), float(made.radius[0])
    done, _ = grow_ballistic(crowd, position, made.grain_set, 1, count, size, chance.places, TRIES)
    require_all_placed(done, count, f"grain {done}", ADVICE)
    return magnetised(centred_grains(position.T, made), moment, moments, magnetic, chance.moments)


@checked
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
    return magnetised(centred_grains(position, made), moment, moments, magnetic, chance.moments)


def joined(
    made: Population, joins: list[tuple[int, int, int]], goals: np.ndarray | None, seed: np.uint64, choices: int
) -> np.ndarray:
    """Places (N, 3) [m] of grains whose clusters fly into each other, see
    `setup._kernels.cluster_cluster.join_ballistic`.

    Parameters
    ----------
    goals : ndarray or None
        radius of gyration [m] wanted after each join; None: whatever chance gives.
    choices : int
        meetings to choose from where one is wanted.

    Raises
    ------
    BadInput
        two clusters did not meet in a single contact.
    """
    position = np.zeros((3, len(made.radius)))
    plan = np.array(joins, dtype=np.int64).reshape(-1, 3).T.copy()
    aims = np.full(plan.shape[1], np.inf) if goals is None else goals
    table = room(made.grain_set, 2.0 * made.grain_set.largest)
    done = join_ballistic(table, position, np.zeros_like(position), made.grain_set, plan, aims, seed, TRIES, choices)
    require_all_placed(done, plan.shape[1], f"a cluster of {_size(joins, done)} grains", ADVICE)
    return position.T


def _size(joins: list[tuple[int, int, int]], done: int) -> int:
    return joins[done][2] - joins[done][1] if done < len(joins) else 0
