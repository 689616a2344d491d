"""Magnetic moments of the grains of an aggregate: by chance, aligned, or at rest in each other's field."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arguments import checked
from ..constants import MAGNETIC
from ..errors import BadInput, did_you_mean, warn
from ..grains import Grains, moment_size, vector_for_all
from ..units import si
from ._kernels.moment_relaxation import alignment_energy, relax
from .gas import directions

WAYS = ("random", "aligned", "relaxed")
MOST_RELAXED = 3000
"""Magnetic grains that can be relaxed: sweeps look at all pairs and grow in number; these take half a minute."""
TOLERANCE = 1e-6
"""Relaxed moments make at most this angle with the field at their place [rad], about."""
SWEEPS = 20_000


def part_given(moment: Any, ways: str, magnetic: Any) -> float:
    """The part of the grains that have a moment; the arguments are those of `magnetised`.  Raises BadInput."""
    if ways not in WAYS:
        raise BadInput(f"moments = {ways!r}; {did_you_mean(str(ways), list(WAYS))}")
    part = si(magnetic, "1", "magnetic", least=0.0)
    if part > 1.0:
        raise BadInput(f"magnetic = {magnetic!r} is the part of grains with a moment; it must not exceed 1")
    if moment is None and (ways == "relaxed" or part < 1.0):
        given = f"moments = {ways!r}" if ways == "relaxed" else f"magnetic = {magnetic!r}"
        raise BadInput(f"{given} needs a moment; give one, such as moment = '200 A m^2/kg' or 'material'")
    return part


def magnetised(body: Grains, moment: Any, ways: str, magnetic: Any, rng: np.random.Generator, axis: int = 2) -> Grains:
    """The same grains with magnetic moments, in place.

    Parameters
    ----------
    moment
        size of each, as for `sand.Grains`, or one vector (3,) [A m²], the same for all; None: no moments.
    ways : str
        "random": isotropic; "aligned": along `axis`; "relaxed": from random ones, see `relaxed`.
    magnetic
        part of the grains that have a moment, 0 … 1; which ones is drawn by chance.

    Raises
    ------
    BadInput
        an unknown way, a part outside 0 … 1, or too many moments to be relaxed.
    """
    part = part_given(moment, ways, magnetic)
    if moment is None:
        return body
    count = len(body)
    specific = np.array([m.specific_moment for m in body.materials])[body.material]
    vector = vector_for_all(moment)
    told = moment if vector is None else float(np.linalg.norm(vector))
    size = np.array(moment_size(told, body.mass, specific), dtype=float)
    size[rng.permutation(count)[: count - int(np.rint(part * count))]] = 0.0
    # drawn in any case: other ways leave the rest of what is drawn as it is
    way = directions(count, rng)
    if ways == "aligned":
        way = np.tile(np.eye(3)[axis], (count, 1))
    if vector is not None:
        way = np.tile(vector / (np.linalg.norm(vector) or 1.0), (count, 1))
    body.arrays.body_moment[...] = (way * size[:, None]).T
    body.arrays.moment[...] = body.arrays.body_moment
    return relaxed(body) if ways == "relaxed" else body


@checked
def relaxed(body: Grains) -> Grains:
    """Turn the moments until each lies along the field of the others, in place.

    Gauss–Seidel: one after the other, each moment is laid along the flux density at its place from all others in open
    space, which lowers U = ½ Σ −μ·B by what it can; sweeps go on until no moment turns by more than 1e-6.  That is a
    minimum of the energy near the start, not always the deepest; sizes do not change.  The grains must not have turned
    yet: moments in their own frames are taken for those in the laboratory.

    Raises
    ------
    BadInput
        more than 3000 moments.
    """
    chosen = np.flatnonzero((body.moment**2).sum(axis=1) > 0.0)
    if len(chosen) > MOST_RELAXED:
        raise BadInput(
            f"{len(chosen)} moments cannot be relaxed, at most {MOST_RELAXED}: each sweep looks at all pairs; "
            "take fewer magnetic grains, or moments = 'random'"
        )
    if len(chosen) < 2:
        return body
    position = np.ascontiguousarray(body.arrays.position[:, chosen])
    moment = np.ascontiguousarray(body.arrays.body_moment[:, chosen])
    sweeps, worst = relax(position, moment, MAGNETIC, TOLERANCE, SWEEPS)
    if worst > TOLERANCE:
        told = f"moments still turn by {worst:.1e} rad a sweep after {sweeps} sweeps: nearly at rest, no more"
        warn(told)
    body.arrays.body_moment[:, chosen] = moment
    body.arrays.moment[...] = body.arrays.body_moment
    return body


@checked
def magnetic_energy(body: Grains) -> float:
    """Energy of all moments in each other's field [J], open space: U = ½ Σ −μ·B."""
    return float(alignment_energy(body.arrays.position, body.arrays.moment, MAGNETIC))
