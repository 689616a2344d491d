"""Motion in a box that is deformed, where velocities are those relative to the flow v = A x of the box.

Two grains then part with u1 − u2 + A l, where l is the nearest image of x1 − x2.  In a box that keeps its shape, whose
`Span` has no rates, nothing of the flow is part of the compiled code.  Simple shear has one more rate, A_xz, in a
`TiltedSpan`; A and the matrix H of the box, dH/dt = A H, are then upper triangular.
"""

import math

from ..basics.box import MovingSpan, TiltedSpan
from ..compiler.jit import formula, loop
from .kinds_of_box import unless_still, unless_straight
from .vec import axpy, load, sub


@unless_straight(lambda span: 0.0)
def tilt_of(span):
    """Tilt of the box [m]."""
    return span.tilt


@unless_straight(lambda span: 0.0)
def shear_rate(span):
    """Rate of shear A_xz [1/s]."""
    return span.rate_xz


@unless_straight(lambda z, span: 0.0)
def sheared(z, span):
    """Velocity A_xz z [m/s] of simple shear; no code, rather than a product with 0, in other boxes."""
    return span.rate_xz * z


@unless_straight(lambda z, built, span: 0.0)
def slid(z, built, span):
    """Distance [m] along x by which shear has displaced a point at z [m] since the box was `built`, see `carried`."""
    return z * ((span.tilt - span.x / built[0] * built[3]) / built[2])


@unless_still(lambda velocity, separation, span: velocity)
def with_flow(velocity, separation, span):
    """u + A l [m/s] of a relative velocity u [m/s] and a separation l [m]."""
    return (
        velocity[0] + span.rate_x * separation[0] + sheared(separation[2], span),
        velocity[1] + span.rate_y * separation[1],
        velocity[2] + span.rate_z * separation[2],
    )


@unless_still(lambda span: 0.0)
def rate_of_strain(span):
    """Σ |A_ab| [1/s], the largest rate at which two points may part or approach, over their distance."""
    return abs(span.rate_x) + abs(span.rate_y) + abs(span.rate_z) + abs(shear_rate(span))


@unless_still(lambda squared_speed, reach, span: 4.0 * squared_speed)
def squared_approach(squared_speed, reach, span):
    """Square of the largest speed [m/s] at which two grains within reach [m] approach, of that of a grain."""
    return (2.0 * math.sqrt(squared_speed) + reach * rate_of_strain(span)) ** 2


@unless_still(lambda length, span: 1.0)
def shrinkage(length, span):
    """Factor by which the box is shorter along x than a length [m]."""
    return length * span.inverse_x


@unless_still(lambda built, span: 0.0)
def strain_since(built, span):
    """Σ |F_ab − δ_ab| of the deformation F of the box since its lengths and its tilt were `built` (4,) [m]."""
    strain = abs(span.x / built[0] - 1.0) if span.x > 0.0 else 0.0
    strain += abs(span.y / built[1] - 1.0) if span.y > 0.0 else 0.0
    return strain + (abs(span.z / built[2] - 1.0) if span.z > 0.0 else 0.0) + abs(slid(1.0, built, span))


@unless_still(lambda x, built, span: x)
def carried(x, built, span):
    """Where the flow has carried a point x [m] since the lengths and the tilt of the box were `built` (4,) [m]."""
    return (
        (x[0] * (span.x / built[0]) if span.x > 0.0 else x[0]) + slid(x[2], built, span),
        x[1] * (span.y / built[1]) if span.y > 0.0 else x[1],
        x[2] * (span.z / built[2]) if span.z > 0.0 else x[2],
    )


@loop
def relative_velocity(grains, i, j, separation, span):
    """Velocity [m/s] of grain i relative to grain j, whose separation x_i − x_j [m] is that of nearest images."""
    return with_flow(sub(load(grains.velocity, i), load(grains.velocity, j)), separation, span)


@loop
def store_box(built, span):
    """Set an array (4,) to the lengths of the box and its tilt [m]."""
    built[0], built[1], built[2], built[3] = span.x, span.y, span.z, tilt_of(span)


@formula
def sides_after_step(dt, span):
    """The deformed box a step of dt [s] later, without shear: L grows by L A dt, and A is that of the same dL/dt."""
    x, y, z = 1.0 + dt * span.rate_x, 1.0 + dt * span.rate_y, 1.0 + dt * span.rate_z
    return MovingSpan(
        span.x * x, span.y * y, span.z * z, span.inverse_x / x, span.inverse_y / y, span.inverse_z / z,
        span.rate_x / x, span.rate_y / y, span.rate_z / z,
    )  # fmt: skip


@unless_straight(sides_after_step)
def after_step(dt, span):
    """The deformed box a step of dt [s] later: H grows by A H dt, and A is that of the same dH/dt."""
    x, y, z = 1.0 + dt * span.rate_x, 1.0 + dt * span.rate_y, 1.0 + dt * span.rate_z
    return TiltedSpan(
        span.x * x, span.y * y, span.z * z, span.inverse_x / x, span.inverse_y / y, span.inverse_z / z,
        span.rate_x / x, span.rate_y / y, span.rate_z / z,
        x * span.tilt + dt * span.rate_xz * span.z, span.rate_xz / (x * z),
    )  # fmt: skip


@formula
def drifted_with_flow(x, v, span, dt):
    """Where a grain at x [m] with the velocity v [m/s] relative to the flow is after dt [s]: x + dt (v + A x)."""
    return axpy(dt, with_flow(v, x, span), x)


@formula
def slowed(v, span, dt):
    """That velocity after dt [s], in which the velocity in the laboratory is constant."""
    upwards = v[2] / (1.0 + dt * span.rate_z)
    along = v[0] - dt * sheared(upwards, span)
    return along / (1.0 + dt * span.rate_x), v[1] / (1.0 + dt * span.rate_y), upwards
