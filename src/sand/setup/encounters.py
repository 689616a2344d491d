"""Two bodies aimed at each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..arguments import checked
from ..errors import BadInput, shown
from ..grains import Grains
from ..units import MOST, in_unit, si

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

GAP = 0.5
"""Least distance between the bodies' surfaces at the start, in radii of the smallest grain."""


class Encounter(NamedTuple):
    """Target and projectile as one set of grains, and how many belong to the target."""

    grains: Grains
    target: int  # grains 0 … target − 1 are the target's
    flight: float  # time until the bodies can touch first [s], about


@checked
def turned_at_random(body: Grains, rng: np.random.Generator) -> Grains:
    """The body turned as a whole by a random rotation about its centre of mass; moments turn with it."""
    from scipy.spatial.transform import Rotation  # slow to load

    return turned(body, Rotation.random(random_state=rng))


@checked
def turned(body: Grains, rotation: Rotation) -> Grains:
    """The body turned as a whole about its centre of mass, velocities, spins and moments too."""
    middle = np.average(body.position, axis=0, weights=body.mass)
    # SciPy does not take the read-only views
    velocity, spin, moment = (rotation.apply(v.copy()) for v in (body.velocity, body.spin, body.moment))
    return Grains(
        middle + rotation.apply(body.position - middle),
        body.radius,
        [body.materials[k] for k in body.material],
        velocity=velocity,
        spin=spin,
        moment=moment,
        charge=body.charge,
        mass=body.mass,
    )


@checked
def encounter(
    target: Grains, projectile: Grains, *, speed: Any, impact_parameter: Any = 0.0, along: Any = "x"
) -> Encounter:
    """Put the projectile before the target, on a straight line towards it, in the frame of their centre of mass.

    Parameters
    ----------
    target, projectile : Grains
        bodies; their own velocities and spins are kept and the relative motion added.
    speed
        relative speed of the centres of mass [m/s] > 0.
    impact_parameter : optional
        distance of the two lines of flight [m], or a fraction of the sum of the bodies' outer
        radii as text, "0.5 b" (b is that sum).
    along : optional
        direction the projectile flies in, "x", "y", "z" or a vector; the offset is along the next axis.

    Raises
    ------
    BadInput
        wrong numbers, or grains of a body that overlap those of the other.
    """
    v = si(speed, "m/s", "speed", above=0.0)
    direction = _direction(along)
    side = np.cross(np.array([0.0, 0.0, 1.0]) if abs(direction[2]) < 0.9 else np.array([1.0, 0.0, 0.0]), direction)
    side /= np.linalg.norm(side)
    centres = [np.average(b.position, axis=0, weights=b.mass) for b in (target, projectile)]
    reach = [
        float((np.linalg.norm(b.position - c, axis=1) + b.radius).max())
        for b, c in zip((target, projectile), centres, strict=True)
    ]
    offset = offset_of(impact_parameter, sum(reach))
    back = _clearance(
        target.position - centres[0],
        target.radius,
        projectile.position - centres[1] + offset * side,
        projectile.radius,
        direction,
    )
    shift = centres[0] - centres[1] + offset * side - back * direction
    masses = target.mass.sum(), projectile.mass.sum()
    share = masses[0] / sum(masses)
    gap = GAP * min(target.radius.min(), projectile.radius.min())
    away = [np.zeros(3), shift]
    thrown = [-(1 - share) * v * direction, share * v * direction]
    return Encounter(joined([target, projectile], away, thrown), len(target), float(gap / v))


def joined(bodies: Sequence[Grains], shifts: Sequence[np.ndarray], velocities: Sequence[np.ndarray]) -> Grains:
    """All bodies as one set of grains, each moved by its shift [m], with its velocity [m/s] added."""

    def all_of(name: str) -> np.ndarray:
        return np.concatenate([getattr(body, name) for body in bodies])

    return Grains(
        np.concatenate([b.position + shift for b, shift in zip(bodies, shifts, strict=True)]),
        all_of("radius"),
        [body.materials[k] for body in bodies for k in body.material],
        velocity=np.concatenate([b.velocity + more for b, more in zip(bodies, velocities, strict=True)]),
        spin=all_of("spin"),
        moment=all_of("moment"),
        charge=all_of("charge"),
        mass=all_of("mass"),
    )


def _direction(along: Any) -> np.ndarray:
    named = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    vector = np.asarray(named.get(along, along) if isinstance(along, str) else along, dtype=object)
    try:
        vector = vector.astype(np.float64)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.linalg.norm(vector) > 0.0 or not np.isfinite(vector).all():
        raise BadInput(f"along = {along!r} must be 'x', 'y', 'z' or three numbers, not all 0")
    return vector / np.linalg.norm(vector)


def offset_of(given: Any, whole: float) -> float:
    """The impact parameter [m] as `encounter` takes it.

    Parameters
    ----------
    given
        a length, or a part of `whole` as text, "0.5 b".
    whole : float
        sum of the outer radii [m].

    Raises
    ------
    BadInput
        neither, or below 0.
    """
    if isinstance(given, str) and given.strip().endswith("b"):
        part = in_unit(given.strip()[:-1], "1")
        offset = None if part is None else part * whole
    else:
        offset = in_unit(given, "m")
    if offset is None or np.ndim(offset) != 0 or not 0.0 <= offset < MOST:
        raise BadInput(
            f"impact_parameter = {shown(given)} must be a length ≥ 0 such as '10 nm', or a part of the reach, '0.5 b'"
        )
    return float(offset)


def _clearance(
    target: np.ndarray, r1: np.ndarray, projectile: np.ndarray, r2: np.ndarray, direction: np.ndarray
) -> float:
    """How far to move the projectile back so that its grains clear the target's by GAP, seen along its flight."""
    gap = GAP * min(float(r1.min()), float(r2.min()))
    apart = projectile[:, None] - target[None]
    along = apart @ direction
    miss = (apart**2).sum(axis=2) - along**2
    reach = (r2[:, None] + r1[None] + gap) ** 2
    meets = miss < reach
    if not meets.any():  # it flies past: start beside the target's far side
        return float(along.max() + r1.max() + r2.max() + gap)
    return float((along[meets] + np.sqrt(reach[meets] - miss[meets])).max())
