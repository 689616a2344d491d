"""Kinds of outcomes of a collision by stated definitions, growth efficiency, and numbers of fragments."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, shown

__all__ = ["KINDS", "collision_kind", "fragment_numbers", "growth_efficiency"]

UNDECIDED = "undecided"
"""Kind, and outcome, of a collision that ended before the bodies touched, or could not touch any more."""
KINDS = {
    UNDECIDED: "no contact formed until the end, but one still may",
    "miss": "no contact formed",
    "bouncing": "two bodies with the same masses as before",
    "sticking": "one body, few of whose contacts changed",
    "restructuring": "one body, many of whose contacts changed",
    "mass transfer": "the heavier body lost no mass, the lighter one left fragments",
    "erosion": "the heavier body lost mass, and kept more than half of all",
    "fragmentation": "no body has more than half of all mass",
}
"""Kinds, from the gentlest to the most violent."""
NEGLIGIBLE = 0.05
"""Mass that is neglected, in units of the mass of the lighter body."""
ROUNDING = 1e-9
"""Allowance for rounding of a growth efficiency."""
CHANGED = 0.1
"""Share of contacts that formed or broke beyond which a body that sticks is restructured."""


@checked
def growth_efficiency(first: float, second: float, largest: float) -> float:
    """Growth efficiency f = (M_largest − M_target)/M_projectile; the target is the heavier body (Wada et al. 2013).

    1 if the bodies stick, 0 if they bounce or miss, negative if the target loses mass.

    Parameters
    ----------
    first, second : float
        Masses of both bodies, or their numbers of equal grains, above 0.
    largest : float
        Mass of the largest fragment, in the same unit.
    """
    if not (first > 0.0 and second > 0.0):
        raise BadInput(f"masses {shown(first)} and {shown(second)} must be above 0")
    return (largest - max(first, second)) / min(first, second)


@checked
def collision_kind(
    first: float, second: float, fragments: Sequence[float], changed: float, *, touched: bool | None = True
) -> str:
    """Kind of an outcome, one of `KINDS`.

    With the masses M_t ≥ M_p of target and projectile, M = M_t + M_p, M_1 ≥ M_2 of the two largest fragments, and
    ε = 0.05 M_p, a mass that is neglected, it is the first of these whose definition holds:

        undecided      no contact formed until the end, but one still may
        miss           no contact formed
        sticking       M_1 ≥ M − ε, and at most a tenth of the contacts changed
        restructuring  M_1 ≥ M − ε, and more changed
        bouncing       |M_1 − M_t| ≤ ε and |M_2 − M_p| ≤ ε
        fragmentation  M_1 ≤ M/2
        mass transfer  f ≥ 0, that is M_1 ≥ M_t
        erosion        otherwise

    Parameters
    ----------
    first, second : float
        Masses of both bodies, or their numbers of equal grains.
    fragments : sequence of float
        Masses of all fragments, in any order and the same unit.
    changed : float
        Number of contacts that formed or broke, without the first one, over that before; 0 if there were none.
    touched : bool or None, optional
        Whether any contact formed; None: not until the end, but one still may.
    """
    target, projectile = max(first, second), min(first, second)
    few, total = NEGLIGIBLE * projectile, target + projectile
    largest, other = sorted([*fragments, 0.0], reverse=True)[:2]
    if not touched:
        return UNDECIDED if touched is None else "miss"
    if largest >= total - few:
        return "sticking" if changed <= CHANGED else "restructuring"
    if abs(largest - target) <= few and abs(other - projectile) <= few:
        return "bouncing"
    if largest <= 0.5 * total:
        return "fragmentation"
    return "mass transfer" if growth_efficiency(first, second, largest) >= -ROUNDING else "erosion"


@checked
def fragment_numbers(collisions: Sequence[Sequence[int]], without: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Mean number of fragments of a collision with at least n grains, without the largest ones.

    Parameters
    ----------
    collisions : sequence of sequences of int
        Numbers of grains of all fragments of each collision.
    without : int, optional
        Number of largest fragments of each collision that are left out; 1 by default, 0 for all.

    Returns
    -------
    grains : ndarray
        Sizes n that occur (K,), ascending.
    number : ndarray
        Fragments with at least n grains per collision (K,).
    """
    if not len(collisions):
        raise BadInput("collisions = [] has no collision; give the fragments of at least one")
    sizes = np.concatenate([np.sort(np.asarray(each, np.int64))[::-1][without:] for each in collisions])
    grains, counts = np.unique(sizes, return_counts=True)
    return grains, counts[::-1].cumsum()[::-1] / len(collisions)
