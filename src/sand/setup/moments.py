"""Magnetic moments of the grains of an aggregate: random, aligned, or relaxed in each other's field."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.constants import MAGNETIC
from ..basics.errors import BadInput, did_you_mean, warn
from ..basics.grains import Grains, moment_size, vector_for_all
from ..basics.units import si
from ._kernels.moment_relaxation import alignment_energy, relax

MOMENT_MODES = ("random", "aligned", "relaxed")
MOST_RELAXED = 3000
"""Largest number of moments to relax: a sweep costs O(N²) and more sweeps are needed; this many take half a minute."""
TOLERANCE = 1e-6
"""Approximate largest angle between a relaxed moment and the local field [rad]."""
SWEEPS = 20_000
"""Largest number of sweeps."""


def directions(count: int, rng: np.random.Generator) -> np.ndarray:
    """Isotropic unit vectors (count, 3)."""
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1)[:, None]


def magnetic_fraction(moment: Any, mode: str, magnetic: Any) -> float:
    """Check the arguments of `assign_moments` and return the fraction of grains with a moment. Raises BadInput."""
    if mode not in MOMENT_MODES:
        raise BadInput(f"moments = {mode!r}; {did_you_mean(str(mode), list(MOMENT_MODES))}")
    fraction = si(magnetic, "1", "magnetic", least=0.0)
    if fraction > 1.0:
        raise BadInput(f"magnetic = {magnetic!r} is the fraction of grains with a moment; it must not exceed 1")
    if moment is None and (mode == "relaxed" or fraction < 1.0):
        given = f"moments = {mode!r}" if mode == "relaxed" else f"magnetic = {magnetic!r}"
        raise BadInput(f"{given} needs a moment; give one, such as moment = '200 A m^2/kg' or 'material'")
    return fraction


def assign_moments(
    body: Grains, moment: Any, mode: str, magnetic: Any, rng: np.random.Generator, axis: int = 2
) -> Grains:
    """Assign magnetic moments to the grains of a body, in place.

    Parameters
    ----------
    body : Grains
        The body, without moments.
    moment : float or str or array_like or None
        Magnitude of each moment, as for `sand.Grains`, or one vector (3,) [A m²] for all; None: no moments.
    mode : str
        "random": isotropic; "aligned": along `axis`; "relaxed": random, then see `relaxed`.
    magnetic : float
        Fraction of randomly chosen grains that have a moment, 0 … 1.
    rng : Generator
        Source of random numbers.
    axis : int, optional
        Axis of aligned moments.

    Returns
    -------
    Grains
        The body.

    Raises
    ------
    BadInput
        If the mode is unknown, the fraction is outside 0 … 1, or there are too many moments to relax.
    """
    fraction = magnetic_fraction(moment, mode, magnetic)
    if moment is None:
        return body
    count = len(body)
    specific = np.array([m.specific_moment for m in body.materials])[body.material]
    vector = vector_for_all(moment)
    magnitude = moment if vector is None else float(np.linalg.norm(vector))
    size = np.array(moment_size(magnitude, body.mass, specific), dtype=float)
    size[rng.permutation(count)[: count - int(np.rint(fraction * count))]] = 0.0
    # drawn for every mode, so that the mode does not change later random numbers
    direction = directions(count, rng)
    if mode == "aligned":
        direction = np.tile(np.eye(3)[axis], (count, 1))
    if vector is not None:
        direction = np.tile(vector / (np.linalg.norm(vector) or 1.0), (count, 1))
    body.arrays.body_moment[...] = (direction * size[:, None]).T
    body.arrays.moment[...] = body.arrays.body_moment
    return relaxed(body) if mode == "relaxed" else body


@checked
def relaxed(body: Grains) -> Grains:
    """Rotate the moments of a body, in place, until each is parallel to the field of the others.

    Gauss–Seidel iteration: each moment in turn is aligned with the flux density of all others (open boundaries), which
    minimises its term of U = −½ Σ μ·B, until no moment rotates by more than 1e-6 rad in a sweep. The result is a local
    minimum of the energy near the initial state; magnitudes do not change. The orientations of the grains must be those
    of the start, with body frames parallel to the laboratory frame.

    Parameters
    ----------
    body : Grains
        At most 3000 grains with a moment.

    Returns
    -------
    Grains
        The body.

    Raises
    ------
    BadInput
        If there are more than 3000 moments.
    """
    chosen = np.flatnonzero((body.moment**2).sum(axis=1) > 0.0)
    if len(chosen) > MOST_RELAXED:
        raise BadInput(
            f"{len(chosen)} moments cannot be relaxed, at most {MOST_RELAXED}: each sweep computes all pairs; "
            "use fewer magnetic grains, or moments = 'random'"
        )
    if len(chosen) < 2:
        return body
    position = np.ascontiguousarray(body.arrays.position[:, chosen])
    moment = np.ascontiguousarray(body.arrays.body_moment[:, chosen])
    sweeps, worst = relax(position, moment, MAGNETIC, TOLERANCE, SWEEPS)
    if worst > TOLERANCE:
        warn(f"moments are not fully relaxed: after {sweeps} sweeps they still rotate by {worst:.1e} rad per sweep")
    body.arrays.body_moment[:, chosen] = moment
    body.arrays.moment[...] = body.arrays.body_moment
    return body


@checked
def magnetic_energy(body: Grains) -> float:
    """Magnetic interaction energy of all moments with open boundaries [J]: U = −½ Σ μ·B."""
    return float(alignment_energy(body.arrays.position, body.arrays.moment, MAGNETIC))
