"""Initial conditions of a collision of two bodies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, shown
from ..basics.grains import Grains
from ..basics.own_quantities import joined
from ..basics.units import MOST, in_unit, si

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

GAP = 0.5
"""Smallest initial gap between the bodies, in radii of the smallest grain."""


class Encounter(NamedTuple):
    """Target and projectile in one set of grains."""

    grains: Grains
    target: int  # grains 0 … target − 1 are the target's
    flight: float  # approximate time of the earliest possible contact [s]


@checked
def turned_at_random(body: Grains, rng: np.random.Generator) -> Grains:
    """Rotate a body by a random rotation about its centre of mass, with velocities, spins and moments."""
    from scipy.spatial.transform import Rotation  # slow to import

    return turned(body, Rotation.random(random_state=rng))


@checked
def turned(body: Grains, rotation: Rotation) -> Grains:
    """Rotate a body about its centre of mass, with velocities, spins and moments.  Raises BadInput for no rotation."""
    if isinstance(rotation, type) or not hasattr(rotation, "apply"):
        raise BadInput(f"rotation = {shown(rotation)}; give a scipy.spatial.transform.Rotation")
    middle = np.average(body.position, axis=0, weights=body.mass)
    # SciPy does not accept read-only views
    velocity, spin, moment = (rotation.apply(v.copy()) for v in (body.velocity, body.spin, body.moment))
    return Grains(
        middle + rotation.apply(body.position - middle),
        body.radius,
        [body.materials[k] for k in body.material],
        velocity=velocity,
        spin=spin,
        moment=moment,
        charge=body.charge,
        own=body.own,
        mass=body.mass,
    )


@checked
def encounter(
    target: Grains, projectile: Grains, *, speed: Any, impact_parameter: Any = 0.0, along: Any = "x"
) -> Encounter:
    """Place two bodies on a collision course, in the frame of their centre of mass.

    Parameters
    ----------
    target, projectile : Grains
        The bodies. Their own velocities and spins are kept; the relative motion is added.
    speed : float or str
        Relative speed of the centres of mass [m/s] > 0.
    impact_parameter : float or str, optional
        Distance of the lines of flight of the two centres of mass [m]; or as text a fraction of the sum of the bodies'
        outer radii, "0.5 b", or of their characteristic radii √(5/3) r_g, "0.5 c", as in the literature on aggregates.
    along : str or array_like, optional
        Direction of flight of the projectile, "x", "y", "z" or a vector. The offset is perpendicular to it, along the
        next axis.

    Returns
    -------
    Encounter
        `grains`, both bodies in one `sand.Grains`, those of the target first: what `sand.Simulation` takes; `target`,
        the number of grains of the target; `flight`, about the time of the earliest possible contact [s].

    Raises
    ------
    BadInput
        If an argument is invalid.
    """
    v = si(speed, "m/s", "speed", above=0.0)
    direction = _direction(along)
    side = np.cross(np.array([0.0, 0.0, 1.0]) if abs(direction[2]) < 0.9 else np.array([1.0, 0.0, 0.0]), direction)
    side /= np.linalg.norm(side)
    centres = [np.average(b.position, axis=0, weights=b.mass) for b in (target, projectile)]
    outer, characteristic = outer_radius(target) + outer_radius(projectile), 0.0
    for body, centre in zip((target, projectile), centres, strict=True):
        distance = np.linalg.norm(body.position - centre, axis=1)
        characteristic += float(np.sqrt(np.average(5.0 / 3.0 * distance**2 + body.radius**2, weights=body.mass)))
    offset = offset_of(impact_parameter, outer, characteristic)
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
    velocities = [-(1 - share) * v * direction, share * v * direction]
    grains = combined([target, projectile], [np.zeros(3), shift], velocities)
    return Encounter(grains, len(target), float(gap / v))


def outer_radius(body: Grains) -> float:
    """Radius [m] of the smallest sphere about the centre of mass that holds all grains."""
    centre = np.average(body.position, axis=0, weights=body.mass)
    return float((np.linalg.norm(body.position - centre, axis=1) + body.radius).max())


def combined(bodies: Sequence[Grains], shifts: Sequence[np.ndarray], velocities: Sequence[np.ndarray]) -> Grains:
    """Combine bodies into one set of grains, each shifted [m] and with a velocity [m/s] added."""
    pair = ("target: it has", "projectile: it has")
    called = pair if len(bodies) == 2 else [f"body {k}: it has" for k in range(len(bodies))]

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
        own=joined([body.own for body in bodies], called),
        mass=all_of("mass"),
    )


def _direction(along: Any) -> np.ndarray:
    named = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    found = in_unit(named.get(along, along) if isinstance(along, str) else along, "1")
    vector = np.zeros(0) if found is None else np.asarray(found)
    if vector.shape != (3,) or not np.linalg.norm(vector) > 0.0 or not np.isfinite(vector).all():
        raise BadInput(f"along = {shown(along)} must be 'x', 'y', 'z' or three numbers, not all 0")
    return vector / np.linalg.norm(vector)


def offset_of(given: Any, outer: float, characteristic: float) -> float:
    """Convert an impact parameter to a length [m].

    Parameters
    ----------
    given : float or str
        A length, or a fraction of `outer`, "0.5 b", or of `characteristic`, "0.5 c".
    outer, characteristic : float
        Sums of the outer radii, and of the characteristic radii √(5/3) r_g, of both bodies [m].

    Raises
    ------
    BadInput
        If it is neither, or negative.
    """
    if isinstance(given, str) and given.strip()[-1:] in ("b", "c"):
        fraction = in_unit(given.strip()[:-1], "1")
        offset = None if fraction is None else fraction * (outer if given.strip().endswith("b") else characteristic)
    else:
        offset = in_unit(given, "m")
    if offset is None or np.ndim(offset) != 0 or not 0.0 <= offset < MOST:
        raise BadInput(
            f"impact_parameter = {shown(given)} must be a length ≥ 0 such as '10 nm', or a fraction of the sum of the "
            "outer radii, such as '0.5 b', or of the characteristic radii, such as '0.5 c'"
        )
    return float(offset)


def _clearance(
    target: np.ndarray, r1: np.ndarray, projectile: np.ndarray, r2: np.ndarray, direction: np.ndarray
) -> float:
    """Distance [m] by which the projectile must be moved back to keep all gaps above `GAP`."""
    gap = GAP * min(float(r1.min()), float(r2.min()))
    apart = projectile[:, None] - target[None]
    along = apart @ direction
    miss = (apart**2).sum(axis=2) - along**2
    reach = (r2[:, None] + r1[None] + gap) ** 2
    meets = miss < reach
    if not meets.any():  # a miss: start behind all grains of the target
        return float(along.max() + r1.max() + r2.max() + gap)
    return float((along[meets] + np.sqrt(reach[meets] - miss[meets])).max())
