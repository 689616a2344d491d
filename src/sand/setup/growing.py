"""Aggregates that grow by collisions, ballistic (BPCA, BCCA) or diffusion-limited (DLA, DLCA)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput
from ..basics.grains import Grains
from ._kernels.aggregation import grow_ballistic, grow_diffusing
from ._kernels.cluster_cluster import join_ballistic, join_diffusing
from ._kernels.hash_grid import EMPTY, TRIES, GrainSet, HashGrid, table_size
from .moments import assign_moments
from .population import Population, centred_grains, grain_count, population, random_streams

CELL = 3.0
"""Width of the lowest-level cells in radii of the largest grain, so that a grain reaches at most two per axis."""


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
    return aggregate(partial(_one_by_one, grow_ballistic), grains, radius, material, moment, moments, magnetic, seed)


@checked
def dla(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """Diffusion-limited particle–cluster aggregate: grains arrive by Brownian motion and stay at first contact.

    Off-lattice walks on spheres whose radius is the gap to the nearest grain, accurate to 1e-3 of the largest radius. A
    grain that leaves the enclosing sphere returns with the probability and at the position of Brownian motion. Fractal
    dimension about 2.5. Parameters and errors as for `bpca`.

    References
    ----------
    Witten & Sander (1981), Phys. Rev. Lett. 47, 1400.
    """
    place = partial(_one_by_one, grow_diffusing, work=1)
    return aggregate(place, grains, radius, material, moment, moments, magnetic, seed)


@checked
def bcca(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """Ballistic cluster–cluster aggregate: recursively built halves collide in random orientation on straight lines.

    Fractal dimension about 1.9. Parameters and errors as for `bpca`; N need not be a power of 2.
    """

    def place(sample: Population, seed: np.uint64) -> np.ndarray:
        joins = halves(0, len(sample.radius))
        return merge_clusters(sample, joins, np.full(len(joins), np.inf), seed)

    return aggregate(place, grains, radius, material, moment, moments, magnetic, seed)


@checked
def dlca(
    grains: int, *, radius: Any, material: Any, moment: Any = None, moments: str = "random", magnetic: Any = 1.0,
    seed: int = 0,
) -> Grains:  # fmt: skip
    """Diffusion-limited cluster–cluster aggregate: recursively built halves diffuse until they touch.

    Clusters have random orientations and do not rotate while they diffuse. Fractal dimension about 1.8. Parameters and
    errors as for `bpca`.
    """

    def place(sample: Population, seed: np.uint64) -> np.ndarray:
        joins = _joins_array(halves(0, len(sample.radius)))
        position, bound = np.zeros((3, len(sample.radius))), np.zeros(len(sample.radius))
        table = empty_hash_grid(sample.grain_set)
        done = join_diffusing(table, position, np.zeros_like(position), bound, sample.grain_set, joins, seed)
        require_all_placed(done, joins.shape[1], "a cluster")
        return position.T

    return aggregate(place, grains, radius, material, moment, moments, magnetic, seed)


def aggregate(
    place: Callable[[Population, np.uint64], np.ndarray],
    grains: Any,
    radius: Any,
    material: Any,
    moment: Any,
    moments: str,
    magnetic: Any,
    seed: Any,
) -> Grains:
    """Aggregate of randomly drawn grains at the positions (N, 3) [m] that `place` returns for them and a seed.

    Other parameters and errors as for `bpca`.
    """
    rng = random_streams(seed)
    sample = population(grain_count(grains, "grains of an aggregate"), radius, material, rng.population)
    body = centred_grains(place(sample, rng.positions), sample)
    return assign_moments(body, moment, moments, magnetic, rng.moments)


def _one_by_one(grow: Callable[..., int], sample: Population, seed: np.uint64, work: int = 0) -> np.ndarray:
    """Positions (N, 3) [m] of grains that `grow`, which takes `work` work arrays (N,), adds one by one to an aggregate.

    Raises BadInput if a grain cannot be placed.
    """
    position = np.zeros((3, len(sample.radius)))
    arrays = np.zeros((work, len(sample.radius)))
    done = grow(empty_hash_grid(sample.grain_set), position, sample.grain_set, seed, *arrays)
    require_all_placed(done, len(sample.radius), f"grain {done}")
    return position.T


def merge_clusters(
    sample: Population, joins: list[tuple[int, int, int]], goals: np.ndarray, seed: np.uint64
) -> np.ndarray:
    """Positions (N, 3) [m] of grains whose clusters merge in ballistic collisions.

    Parameters
    ----------
    sample : Population
        Radii and materials of the grains.
    joins : list of tuple of int
        Pairs of clusters (first, middle, last), see `halves`.
    goals : ndarray
        Target radius of gyration [m] of each merged cluster; infinite: none.
    seed : int
        Seed of the random numbers.

    Raises
    ------
    BadInput
        If two clusters found no collision with a single contact.
    """
    position = np.zeros((3, len(sample.radius)))
    table = empty_hash_grid(sample.grain_set, 2.0 * sample.grain_set.largest)
    done = join_ballistic(table, position, np.zeros_like(position), sample.grain_set, _joins_array(joins), goals, seed)
    if done < len(joins):
        require_all_placed(done, len(joins), f"a cluster of {joins[done][2] - joins[done][1]} grains")
    return position.T


def _joins_array(joins: list[tuple[int, int, int]]) -> np.ndarray:
    """Pairs of clusters as the kernels take them, (3, K)."""
    return np.array(joins, dtype=np.int64).reshape(-1, 3).T.copy()


def halves(first: int, last: int) -> list[tuple[int, int, int]]:
    """Order in which grains first … last − 1 merge into one cluster by repeated halving, small clusters first.

    Each cluster is merged from two halves whose sizes differ by at most one grain.

    Returns
    -------
    list of tuple of int
        (first, middle, last) of each pair of clusters.
    """
    layers, layer = [], [(first, last)]
    while layer:
        split = [(a, (a + b) // 2, b) for a, b in layer if b - a > 1]
        layers.append(split)
        layer = [part for a, middle, b in split for part in ((a, middle), (middle, b))]
    return [join for split in reversed(layers) for join in split]


def empty_hash_grid(grain_set: GrainSet, width: float | None = None) -> HashGrid:
    """Allocate an empty hash grid for all grains.

    Parameters
    ----------
    grain_set : GrainSet
        Properties of the grains.
    width : float, optional
        Width of the lowest-level cells [m]; `CELL` radii of the largest grain by default.
    """
    count = len(grain_set.radius)
    slots = table_size(count, 1 << 40)
    return HashGrid(
        np.full(slots, EMPTY, dtype=np.int64),
        np.full(slots, EMPTY, dtype=np.int32),
        np.full(count, EMPTY, dtype=np.int32),
        slots - 1,
        CELL * grain_set.largest if width is None else width,
    )


def require_all_placed(done: int, count: int, subject: str) -> None:
    """Raise BadInput if a kernel placed only `done` of `count` grains or clusters; `subject` names the failed one."""
    if done < count:
        raise BadInput(
            f"no position where {subject} has exactly one contact was found in {TRIES} attempts: equilibrium overlaps "
            "or differences of the radii are too large; use larger or stiffer grains, or a narrower distribution"
        )
