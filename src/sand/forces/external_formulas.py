"""Formulas of external forces on single grains: force, torque and energy.

All have the signature `formula(time, grain, parameters)`.
"""

import math
from typing import NamedTuple

from ..compiler.jit import formula
from ..numerics.vec import add, axpy, cross, dot, scale


class GrainState(NamedTuple):
    """The quantities of one grain that a formula may use."""

    position: tuple  # [m]
    velocity: tuple  # [m/s]
    spin: tuple  # [rad/s]
    moment: tuple  # μ [A m²], laboratory frame
    radius: float  # [m]
    mass: float  # [kg]
    charge: float  # [C]


class UniformVector(NamedTuple):
    """A uniform, constant flux density B [T], acceleration g [m/s²] or electric field E [V/m]."""

    x: float
    y: float
    z: float


@formula
def uniform_field(time, grain, parameters):
    """No force, torque μ×B [N m], energy −μ·B [J] (Eqs. 40, 41)."""
    b = (parameters.x, parameters.y, parameters.z)
    return (0.0, 0.0, 0.0), cross(grain.moment, b), -dot(grain.moment, b)


class FieldInTime(NamedTuple):
    """A uniform flux density B(t) [T]; terms that a shape does not use are 0."""

    constant: tuple  # B0 [T]
    cosine: tuple  # C [T]
    sine: tuple  # S [T]
    ramp: tuple  # R [T]
    frequency: float  # ω = 2πf [rad/s]
    phase: float  # φ [rad]
    start: float  # t0 [s], start of the ramp
    inverse_duration: float  # 1/(t1 − t0) [1/s]


@formula
def flux_density_at(time, field):
    """B(t) [T] of a `FieldInTime`.

        B = B0 + C cos(ωt + φ) + S sin(ωt + φ) + R p,  p = (t − t0)/(t1 − t0) clipped to 0 … 1

    The sum is independent of the grain, so the compiler evaluates it once per step.
    """
    angle = field.frequency * time + field.phase
    ramp = min(max((time - field.start) * field.inverse_duration, 0.0), 1.0)
    periodic = axpy(math.cos(angle), field.cosine, scale(math.sin(angle), field.sine))
    return add(periodic, axpy(ramp, field.ramp, field.constant))


@formula
def field_in_time(time, grain, parameters):
    """No force, torque μ×B(t) [N m], energy −μ·B(t) [J] (Eqs. 40, 41 at the time t).

    The energy changes explicitly at the rate −μ·dB/dt, which is work of the source of the field.
    """
    b = flux_density_at(time, parameters)
    return (0.0, 0.0, 0.0), cross(grain.moment, b), -dot(grain.moment, b)


@formula
def uniform_gravity(time, grain, parameters):
    """Force m g [N], no torque, energy −m g·x [J], 0 at the origin."""
    force = scale(grain.mass, (parameters.x, parameters.y, parameters.z))
    return force, (0.0, 0.0, 0.0), -dot(force, grain.position)


@formula
def uniform_electric(time, grain, parameters):
    """Force q E [N], no torque, energy −q E·x [J], 0 at the origin."""
    force = scale(grain.charge, (parameters.x, parameters.y, parameters.z))
    return force, (0.0, 0.0, 0.0), -dot(force, grain.position)


@formula
def stiffness_of_field(moment, b, inertia):
    """ω² = μB/I [1/s²], squared frequency of the oscillation of a moment about a field."""
    return (dot(moment, moment) * dot(b, b)) ** 0.5 / inertia
