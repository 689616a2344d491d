"""Aggregates with a fractal dimension and prefactor of one's choice."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from ..arguments import checked
from ..errors import BadInput
from ..grains import Grains
from ..units import si
from .ballistic import joined
from .growing import halves
from .moments import magnetised
from .population import Population, centred_grains, population, streams, whole

CHOICES = 100
"""Meetings to choose from for each pair of clusters."""
DENSEST = 0.64
"""Filling of a random dense packing; no aggregate is denser."""
LEAST, MOST = 1.3, 2.4
"""Dimensions that clusters which meet in flight can be given."""
SEED_SIZE = 8
"""The clusters that meet in the end have 8 … 63 grains at first."""
WRONG = 0.05
"""Radius of gyration may miss the wanted one by this part."""


@checked
def fractal(
    grains: int, *, dimension: Any = 1.8, prefactor: Any = 1.3, radius: Any, material: Any, moment: Any = None,
    moments: str = "random", magnetic: Any = 1.0, seed: int = 0,
) -> Grains:  # fmt: skip
    """Aggregate of a chosen fractal dimension: N = k_f (r_g/a)^D_f, at every size from 4 on the way to N.

    After Filippov, Zurita & Rosner (2000): small clusters grow grain by grain, then clusters of equal size meet, each
    time at the distance Γ of their centres of mass that gives the new one the wanted radius of gyration:

        Γ² = M²/(M1 M2) (r_g² − (M1 r1² + M2 r2²)/M)

    Of up to 100 meetings in flight, from random directions, the one nearest to Γ is taken; what is missed is made up
    for when the clusters have doubled.  r_g is that of the centres of the grains, a their mean radius.

    Parameters
    ----------
    dimension : optional
        D_f, 1.3 … 2.4.
    prefactor : optional
        k_f > 0; 1.3 is usual for soot and dust with D_f = 1.8.
    grains, radius, …: as for `bpca`.

    Raises
    ------
    BadInput
        a dimension and prefactor that N such grains cannot have, with the reason; or an aggregate whose
        r_g misses what was asked for by more than 5 % (1 %, most of the time).
    """
    count, chance = whole(grains, "grains of an aggregate"), streams(seed)
    power, factor = si(dimension, "1", "dimension"), si(prefactor, "1", "prefactor", above=0.0)
    made = population(count, radius, material, chance.population)
    unit = float(made.radius.mean())
    refuse_impossible(made, power, factor)
    plan = _plan(count)
    sizes = np.array([last - first for first, _, last in plan])
    goals = unit * (np.maximum(sizes, 2) / factor) ** (1.0 / power)
    position = joined(made, plan, goals, chance.places, CHOICES)
    if count > SEED_SIZE:
        _refuse_missed(position, made, goals[-1])
    return magnetised(centred_grains(position, made), moment, moments, magnetic, chance.moments)


def _plan(count: int) -> list[tuple[int, int, int]]:
    """Joins: small clusters grow grain by grain, then they meet as `halves` do, a power of 8 of them.

    Dense fractals are made like cubes, in three steps: a rod of two, a plate of four, a cube of eight.  Only whole
    cubes have the wanted size.
    """
    parts = 1
    while count // (8 * parts) >= SEED_SIZE:
        parts *= 8
    ends = [count * k // parts for k in range(parts + 1)]
    grown = [(a, k, k + 1) for a, b in itertools.pairwise(ends) for k in range(a + 1, b)]
    return grown + [(ends[a], ends[m], ends[b]) for a, m, b in halves(0, parts)]


def refuse_impossible(made: Population, dimension: float, prefactor: float) -> None:
    """Raises BadInput, with the reason, where no aggregate of these grains has this dimension and prefactor."""
    count, unit = len(made.radius), float(made.radius.mean())
    asked = f"{count} grains with dimension {dimension:g} and prefactor {prefactor:g}"
    if dimension > MOST:
        raise BadInput(
            f"dimension = {dimension:g} must not exceed {MOST}: denser clusters would have to pass through each other "
            "to meet; for compact aggregates take bpca, rbd or hexagonal"
        )
    if dimension < LEAST:
        raise BadInput(
            f"dimension = {dimension:g} must be at least {LEAST}: thinner clusters would have to meet tip to tip each "
            "time; take a chain"
        )
    if count < 3:
        return
    size = unit * (count / prefactor) ** (1.0 / dimension)
    chain = unit * math.sqrt((count**2 - 1) / 3.0)
    if size > chain * (float(made.radius.max()) / unit):
        raise BadInput(
            f"{asked} would have a radius of gyration of {size / unit:.4g} mean radii, but even a straight chain has "
            f"only {chain / unit:.4g}; take a larger dimension or prefactor"
        )
    volume = float((made.radius**3).sum())
    ball = math.sqrt(0.6) * (volume / DENSEST) ** (1.0 / 3.0)
    if size < ball * (1.0 - 2.0 / count):
        raise BadInput(
            f"{asked} would have a radius of gyration of {size / unit:.4g} mean radii, but packed as densely as can be "
            f"they have {ball / unit:.4g}; take a smaller dimension or prefactor"
        )


def _refuse_missed(position: np.ndarray, made: Population, goal: float) -> None:
    mass = made.grain_set.mass
    middle = np.average(position, axis=0, weights=mass)
    size = math.sqrt(np.average(((position - middle) ** 2).sum(axis=1), weights=mass))
    if abs(size / goal - 1.0) > WRONG:
        raise BadInput(
            f"the radius of gyration became {size / goal - 1.0:+.1%} of what dimension and prefactor ask for, in "
            f"{CHOICES} choices at each step: these clusters cannot meet {'closer' if size > goal else 'farther out'}; "
            f"take a {'smaller' if size > goal else 'larger'} dimension or prefactor, or another seed"
        )
