"""Aggregates with a prescribed fractal dimension and prefactor."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput
from ..basics.grains import Grains
from ..basics.units import si
from ._kernels.cluster_cluster import CHOICES
from .growing import aggregate, halves, merge_clusters
from .population import Population

DENSEST = 0.64
"""Filling factor of random close packing, an upper limit for aggregates."""
LEAST, MOST = 1.3, 2.4
"""Range of fractal dimensions that ballistic cluster–cluster collisions can produce."""
MIN_CLUSTER = 8
"""Smallest clusters that merge; the initial clusters have 8 … 63 grains."""
TOLERANCE = 0.05
"""Largest relative error of the radius of gyration."""


@checked
def fractal(
    grains: int, *, dimension: Any = 1.8, prefactor: Any = 1.3, radius: Any, material: Any, moment: Any = None,
    moments: str = "random", magnetic: Any = 1.0, seed: int = 0,
) -> Grains:  # fmt: skip
    """Aggregate with a prescribed fractal dimension: N = k_f (r_g/a)^D_f.

    Tunable cluster–cluster aggregation after Filippov, Zurita & Rosner (2000): small clusters are built grain by grain;
    then clusters of equal size merge with their centres of mass at the distance Γ for which the merged cluster has the
    prescribed radius of gyration,

        Γ² = M²/(M1 M2) (r_g² − (M1 r1² + M2 r2²)/M).

    Of up to 100 ballistic collisions from random directions, the one nearest to Γ is used; the targets are absolute, so
    that later collisions compensate the deviations of earlier ones. The relation holds at every size from 4 on. r_g is
    that of the centres of the grains, a their mean radius.

    Parameters
    ----------
    grains, radius, material, moment, moments, magnetic, seed
        As for `bpca`.
    dimension : float, optional
        Fractal dimension D_f, 1.3 … 2.4.
    prefactor : float, optional
        Prefactor k_f > 0; 1.3 is usual for soot and dust with D_f = 1.8.

    Raises
    ------
    BadInput
        If N such grains cannot have this dimension and prefactor, with the reason; or if r_g deviates from the target
        by more than 5 % (usually it is within 1 %).

    References
    ----------
    Filippov, Zurita & Rosner (2000), J. Colloid Interface Sci. 229, 261.
    """
    power, factor = si(dimension, "1", "dimension"), si(prefactor, "1", "prefactor", above=0.0)

    def place(sample: Population, seed: np.uint64) -> np.ndarray:
        check_feasible(sample, power, factor)
        plan = _merge_order(len(sample.radius))
        sizes = np.array([last - first for first, _, last in plan])
        goals = float(sample.radius.mean()) * (np.maximum(sizes, 2) / factor) ** (1.0 / power)
        position = merge_clusters(sample, plan, goals, seed)
        if len(position) > MIN_CLUSTER:
            _check_size(position, sample, goals[-1])
        return position

    return aggregate(place, grains, radius, material, moment, moments, magnetic, seed)


def _merge_order(count: int) -> list[tuple[int, int, int]]:
    """Order of merging: small clusters grow grain by grain; a power of 8 of them then merge as in `halves`.

    Dense fractals are built like cubes in three steps, a rod of two, a plate of four and a cube of eight; only complete
    cubes have the target size.
    """
    parts = 1
    while count // (8 * parts) >= MIN_CLUSTER:
        parts *= 8
    ends = [count * k // parts for k in range(parts + 1)]
    grown = [(a, k, k + 1) for a, b in itertools.pairwise(ends) for k in range(a + 1, b)]
    return grown + [(ends[a], ends[m], ends[b]) for a, m, b in halves(0, parts)]


def check_feasible(sample: Population, dimension: float, prefactor: float) -> None:
    """Raise BadInput, with the reason, if no aggregate of these grains has this dimension and prefactor."""
    count, unit = len(sample.radius), float(sample.radius.mean())
    request = f"{count} grains with dimension {dimension:g} and prefactor {prefactor:g}"
    if dimension > MOST:
        raise BadInput(
            f"dimension = {dimension:g} must not exceed {MOST}: denser clusters would have to interpenetrate to merge; "
            "for compact aggregates use bpca, rbd or hexagonal"
        )
    if dimension < LEAST:
        raise BadInput(
            f"dimension = {dimension:g} must be at least {LEAST}: thinner clusters would have to collide tip to tip in "
            "every collision; use a chain"
        )
    if count < 3:
        return
    size = unit * (count / prefactor) ** (1.0 / dimension)
    chain = unit * math.sqrt((count**2 - 1) / 3.0)
    if size > chain * (float(sample.radius.max()) / unit):
        raise BadInput(
            f"{request} would have a radius of gyration of {size / unit:.4g} mean radii, but a straight chain has only "
            f"{chain / unit:.4g}; use a larger dimension or prefactor"
        )
    volume = float((sample.radius**3).sum())
    ball = math.sqrt(0.6) * (volume / DENSEST) ** (1.0 / 3.0)
    if size < ball * (1.0 - 2.0 / count):
        raise BadInput(
            f"{request} would have a radius of gyration of {size / unit:.4g} mean radii, but random close packing has "
            f"{ball / unit:.4g}; use a smaller dimension or prefactor"
        )


def _check_size(position: np.ndarray, sample: Population, goal: float) -> None:
    """Raise BadInput if the radius of gyration deviates by more than `TOLERANCE` from `goal` [m]."""
    mass = sample.grain_set.mass
    middle = np.average(position, axis=0, weights=mass)
    size = math.sqrt(np.average(((position - middle) ** 2).sum(axis=1), weights=mass))
    if abs(size / goal - 1.0) > TOLERANCE:
        raise BadInput(
            f"the radius of gyration deviates by {size / goal - 1.0:+.1%} from its target, with {CHOICES} collisions "
            f"to choose from at each step: these clusters cannot merge {'closer' if size > goal else 'farther apart'}; "
            f"use a {'smaller' if size > goal else 'larger'} dimension or prefactor, or another seed"
        )
