"""Ballistic aggregation: particle–cluster (BPCA) and cluster–cluster (BCCA)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arguments import checked
from ..grains import Grains
from ._kernels.aggregation import grow_ballistic, place_first_grain
from ._kernels.cluster_cluster import join_ballistic
from .growing import TRIES, empty_hash_grid, halves, require_all_placed
from .moments import assign_moments
from .population import Population, centred_grains, grain_count, population, random_streams


@checked
def bpca(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """Ballistic particle–cluster aggregate: grains arrive on random straight lines and stay at first contact.

    A compact aggregate with a fractal dimension near 3 and N − 1 contacts, each in mechanical equilibrium.

    Parameters
    ----------
    grains : int
        Number of grains N ≥ 1.
    radius : float or str or array_like or Lognormal or PowerLaw
        One radius [m], (N,) radii, or a distribution: `Lognormal`, `PowerLaw`, or text as for `radii_of`.
    material : Material or str or sequence or mapping
        One material, N of them, or fractions, {"silica": 0.7, "iron": 0.3}.
    moment : float or str or array_like, optional
        Magnitude of each moment, as for `sand.Grains`, or one vector (3,) [A m²] for all grains, which replaces the
        directions of `moments` except for "relaxed". Default: no moments.
    moments : str, optional
        Directions: "random", "aligned" (along z) or "relaxed" (a local minimum of the magnetic energy).
    magnetic : float, optional
        Fraction of the grains that have a moment, 0 … 1.
    seed : int, optional
        Seed of the random numbers; equal seeds give equal aggregates.

    Raises
    ------
    BadInput
        If an argument is invalid, or grains cannot be placed with a single contact.
    """
    rng = random_streams(seed)
    sample = population(grain_count(grains, "grains of an aggregate"), radius, material, rng.population)
    position, grid = np.zeros((3, len(sample.radius))), empty_hash_grid(sample.grain_set)
    place_first_grain(grid, position)
    count, size = len(sample.radius), float(sample.radius[0])
    done, _ = grow_ballistic(grid, position, sample.grain_set, 1, count, size, rng.positions, TRIES)
    require_all_placed(done, count, f"grain {done}")
    return assign_moments(centred_grains(position.T, sample), moment, moments, magnetic, rng.moments)


@checked
def bcca(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """Ballistic cluster–cluster aggregate: recursively built halves collide in random orientation on straight lines.

    Fractal dimension about 1.9. Parameters and errors as for `bpca`; N need not be a power of 2.
    """
    rng = random_streams(seed)
    sample = population(grain_count(grains, "grains of an aggregate"), radius, material, rng.population)
    position = merge_clusters(sample, halves(0, len(sample.radius)), None, rng.positions, 1)
    return assign_moments(centred_grains(position, sample), moment, moments, magnetic, rng.moments)


def merge_clusters(
    sample: Population, joins: list[tuple[int, int, int]], goals: np.ndarray | None, seed: np.uint64, choices: int
) -> np.ndarray:
    """Positions (N, 3) [m] of grains whose clusters merge in ballistic collisions.

    Parameters
    ----------
    sample : Population
        Radii and materials of the grains.
    joins : list of tuple of int
        Pairs of clusters (first, middle, last), see `halves`.
    goals : ndarray or None
        Target radius of gyration [m] of each merged cluster; None: none.
    seed : int
        Seed of the random numbers.
    choices : int
        Number of collisions from which the one nearest to the target is taken.

    Raises
    ------
    BadInput
        If two clusters found no collision with a single contact.
    """
    position = np.zeros((3, len(sample.radius)))
    plan = np.array(joins, dtype=np.int64).reshape(-1, 3).T.copy()
    aims = np.full(plan.shape[1], np.inf) if goals is None else goals
    table = empty_hash_grid(sample.grain_set, 2.0 * sample.grain_set.largest)
    done = join_ballistic(table, position, np.zeros_like(position), sample.grain_set, plan, aims, seed, TRIES, choices)
    if done < len(joins):
        require_all_placed(done, len(joins), f"a cluster of {joins[done][2] - joins[done][1]} grains")
    return position.T
