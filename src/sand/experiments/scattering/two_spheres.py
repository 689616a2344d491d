"""Equations of motion of two free magnetic spheres, in relative coordinates.

The state is one array: r = x1 − x2 and u = v1 − v2 of the projectile (1) relative to the target (2), then their
orientations and spins. `Model` is the interface to the driver of flights (`flight_driver`); rigid aggregates are
defined in `two_aggregates`.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from ...compiler.jit import formula, loop
from ...forces.pair.dipole_formulas import pair_load
from ...numerics.vec import add, cross, dot, scale
from .initial_conditions import (
    AXIS1,
    AXIS2,
    SPIN_STREAM1,
    SPIN_STREAM2,
    R,
    U,
    draw_axis,
    draw_spin,
    set_vector,
    unit,
    vector_at,
)

DIRECTION1, DIRECTION2, SPIN1, SPIN2 = 6, 9, 12, 15
"""Offsets of the unit vectors of the moments and of the spins in the state of two spheres."""
SPHERES = 18
"""Length of the state of two spheres."""
CLOSE = 0.02
"""Longest path per step near contact, in units of the smallest radius; undetected grazing contacts are 5e-5 deep."""


class Model(NamedTuple):
    """Functions of one type of pair; all take the state first and the parameters of the pair last."""

    size: int  # length of the state
    rates: Callable  # (y, out, parameters): dy/dt
    error: Callable  # (y, error, parameters): largest error over its scale
    gap: Callable  # (y, parameters): smallest gap [m], longest step [s] that cannot miss a contact
    energy: Callable  # (y, parameters) [J]
    normalise: Callable  # (y): restores unit vectors and quaternions
    draw_pose: Callable  # (y, flight_id, start, parameters): draws orientations and spins; r and u are set before


class Spheres(NamedTuple):
    """Parameters of two magnetic spheres."""

    k: float  # μ₀/4π [T m/A]
    reduced: float  # m̄ [kg]
    moment1: float  # [A m²]
    moment2: float
    inertia1: float  # [kg m²]
    inertia2: float
    touch: float  # r1 + r2 [m]
    smallest: float  # smaller radius [m]
    field: tuple  # external flux density [T]


@loop
def sphere_rates(y, out, parameters):
    """Rates ṙ = u, u̇ = F/m̄, ê̇ = ω×ê, ω̇ = μ×(B + B_ext)/I.

    Eqs. 29, 33 (with the factors 1/m and 1/I), 39 and 40 of Dominik & Nübold (2002).
    """
    e1, e2 = vector_at(y, DIRECTION1), vector_at(y, DIRECTION2)
    moment1, moment2 = scale(parameters.moment1, e1), scale(parameters.moment2, e2)
    force, field1, field2, _ = pair_load(vector_at(y, R), moment1, moment2, parameters.k)
    set_vector(out, R, vector_at(y, U))
    set_vector(out, U, scale(1.0 / parameters.reduced, force))
    set_vector(out, DIRECTION1, cross(vector_at(y, SPIN1), e1))
    set_vector(out, DIRECTION2, cross(vector_at(y, SPIN2), e2))
    set_vector(out, SPIN1, scale(1.0 / parameters.inertia1, cross(moment1, add(field1, parameters.field))))
    set_vector(out, SPIN2, scale(1.0 / parameters.inertia2, cross(moment2, add(field2, parameters.field))))


@formula
def relative_square(error, square):
    """Relative squared error |e|²/scale², 0 for e = 0."""
    e = dot(error, error)
    return e / square if e > 0.0 else 0.0


@loop
def relative_motion_error(y, error, reduced, strength):
    """Largest squared error of r and u over its scale; `strength` is the magnetic energy at this separation [J]."""
    r, u = vector_at(y, R), vector_at(y, U)
    return max(
        relative_square(vector_at(error, R), dot(r, r)),
        relative_square(vector_at(error, U), max(dot(u, u), strength / reduced)),
    )


@loop
def longest_safe_step(gap, speed, smallest):
    """Longest step [s] that cannot miss a contact: half the gap, or `CLOSE` of the smallest radius near contact."""
    way = max(0.5 * gap, CLOSE * smallest)
    return way / speed if speed > 0.0 else math.inf


@loop
def sphere_error(y, error, parameters):
    """Largest error over its scale; the scales are |r|, |u|, 1 and |ω|.

    Speeds and spins may vanish; √(α/(m̄ r³)) and √((α/r³ + μB)/I), from the fields at this separation, are lower
    bounds of their scales.
    """
    r = vector_at(y, R)
    square = dot(r, r)
    strength = 2.0 * parameters.k * parameters.moment1 * parameters.moment2 / (square * math.sqrt(square))
    outer = math.sqrt(dot(parameters.field, parameters.field))
    w1, w2 = vector_at(y, SPIN1), vector_at(y, SPIN2)
    worst = relative_motion_error(y, error, parameters.reduced, strength)
    worst = max(
        worst, relative_square(vector_at(error, DIRECTION1), 1.0), relative_square(vector_at(error, DIRECTION2), 1.0)
    )
    swing1 = (strength + parameters.moment1 * outer) / parameters.inertia1
    swing2 = (strength + parameters.moment2 * outer) / parameters.inertia2
    worst = max(worst, relative_square(vector_at(error, SPIN1), max(dot(w1, w1), swing1)))
    return math.sqrt(max(worst, relative_square(vector_at(error, SPIN2), max(dot(w2, w2), swing2))))


@loop
def sphere_gap(y, parameters):
    """Gap [m], and the longest step [s] that cannot miss a contact."""
    r, u = vector_at(y, R), vector_at(y, U)
    gap = math.sqrt(dot(r, r)) - parameters.touch
    return gap, longest_safe_step(gap, math.sqrt(dot(u, u)), parameters.smallest)


@loop
def sphere_energy(y, parameters):
    """Energy ½m̄u² + ½I1ω1² + ½I2ω2² + U − (μ1 + μ2)·B_ext [J] (Dominik & Nübold 2002, Eqs. 6, 41)."""
    u, w1, w2 = vector_at(y, U), vector_at(y, SPIN1), vector_at(y, SPIN2)
    moment1, moment2 = (
        scale(parameters.moment1, vector_at(y, DIRECTION1)),
        scale(parameters.moment2, vector_at(y, DIRECTION2)),
    )
    _, _, _, energy = pair_load(vector_at(y, R), moment1, moment2, parameters.k)
    moving = parameters.reduced * dot(u, u) + parameters.inertia1 * dot(w1, w1) + parameters.inertia2 * dot(w2, w2)
    return 0.5 * moving + energy - dot(add(moment1, moment2), parameters.field)


@loop
def normalise_spheres(y):
    """Restore |ê| = 1 against rounding."""
    set_vector(y, DIRECTION1, unit(vector_at(y, DIRECTION1)))
    set_vector(y, DIRECTION2, unit(vector_at(y, DIRECTION2)))


@loop
def draw_sphere_pose(y, flight_id, start, parameters):
    """Draw moments and spins as `InitialConditions` prescribes."""
    line = unit(vector_at(y, R))
    set_vector(y, DIRECTION1, draw_axis(flight_id, AXIS1, start.axes, start.axis[0], line))
    set_vector(y, DIRECTION2, draw_axis(flight_id, AXIS2, start.axes, start.axis[1], line))
    spread1 = math.sqrt(2.0 / 3.0 * start.spin_energy[0] / parameters.inertia1)
    spread2 = math.sqrt(2.0 / 3.0 * start.spin_energy[1] / parameters.inertia2)
    set_vector(y, SPIN1, draw_spin(flight_id, SPIN_STREAM1, start.spin[0], spread1))
    set_vector(y, SPIN2, draw_spin(flight_id, SPIN_STREAM2, start.spin[1], spread2))


TWO_SPHERES = Model(SPHERES, sphere_rates, sphere_error, sphere_gap, sphere_energy, normalise_spheres, draw_sphere_pose)
