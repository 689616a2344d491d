"""Forces that act on one grain at a time: each formula gives force, torque and energy.

All have the same form, `formula(time, grain, parameters)`, so that a list of them is one formula.
"""

from typing import NamedTuple

from ..core.jit import formula
from ..core.vec import add, cross, dot


class One(NamedTuple):
    """One grain, as a per-grain force sees it."""

    position: tuple  # [m]
    velocity: tuple  # [m/s]
    spin: tuple  # [rad/s]
    moment: tuple  # μ [A m²], laboratory frame
    radius: float  # [m]
    mass: float  # [kg]
    charge: float  # [C]


class UniformField(NamedTuple):
    """A magnetic flux density [T] that is the same everywhere and always."""

    x: float
    y: float
    z: float


@formula
def uniform_field(time, grain, parameters):
    """No force, torque μ×B [N m], energy −μ·B [J] (Eqs. 40, 41)."""
    b = (parameters.x, parameters.y, parameters.z)
    return (0.0, 0.0, 0.0), cross(grain.moment, b), -dot(grain.moment, b)


@formula
def nothing(time, grain, parameters):
    """No force at all: the end of every list."""
    return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0


def together(first, rest):
    """One formula for two; `parameters` is the pair of theirs."""

    @formula
    def both(time, grain, parameters):
        force1, torque1, energy1 = first(time, grain, parameters[0])
        force2, torque2, energy2 = rest(time, grain, parameters[1])
        return add(force1, force2), add(torque1, torque2), energy1 + energy2

    return both


@formula
def stiffness_of_field(moment, b, inertia):
    """ω² = μB/I [1/s²], the square of the frequency at which a moment turns about a field."""
    return (dot(moment, moment) * dot(b, b)) ** 0.5 / inertia
