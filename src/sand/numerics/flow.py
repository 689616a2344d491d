"""Motion in a box that is deformed, where velocities are those relative to the flow v = A x of the box.

Two grains then part with u1 − u2 + A l, where l is the nearest image of x1 − x2.  In a box that keeps its shape, whose
`Span` has no rates, nothing of the flow is part of the compiled code.  Simple shear has one more rate, A_xz, in a
`TiltedSpan`; A and the matrix H of the box, dH/dt = A H, are then upper triangular.
"""

import math

from ..basics.box import MovingSpan, TiltedSpan
from ..compiler.jit import formula, loop
from .kinds_of_box import unless_still, unless_straight
from .vec import accrue, axpy, dot, load, sub


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


@unless_still(lambda volume, span: 1.0)
def compression(volume, span):
    """A volume [m³] over that of the box."""
    return volume * span.inverse_x * span.inverse_y * span.inverse_z


@unless_still(lambda virial, separation, force, span: virial)
def with_pair(virial, separation, force, span):
    """Sums (3,) of r_a F_a [J], with those of one more pair; 0 in a box that keeps its shape, as nothing needs them."""
    return axpy(1.0, (separation[0] * force[0], separation[1] * force[1], separation[2] * force[2]), virial)


@unless_still(lambda virial, energy, q, quarter, span: virial)
def with_wave(virial, energy, q, quarter, span):
    """As `with_pair`, with U_q [1 − 2 q_a² (1/q² + 1/4α²)] of one more wave q [1/m]; `quarter` is 1/4α² [m²]."""
    slope = 2.0 * energy * (1.0 / dot(q, q) + quarter) if energy > 0.0 else 0.0
    return (
        virial[0] + energy - slope * q[0] * q[0],
        virial[1] + energy - slope * q[1] * q[1],
        virial[2] + energy - slope * q[2] * q[2],
    )


@unless_still(lambda sums, column, virial, span: None)
def add_virial(sums, column, virial, span):
    """Add W_aa (3,) [J] to a column of an array (3, …) of sums."""
    accrue(sums, column, virial)


@unless_still(lambda sums, column, moment, field, span: None)
def add_virial_of_moment(sums, column, moment, field, span):
    """Add −μ_a B_a [J] to a column of an array (3, …) of sums."""
    accrue(sums, column, (-moment[0] * field[0], -moment[1] * field[1], -moment[2] * field[2]))


@formula
def extends_over_half(low, high, span):
    """Whether a cuboid between two corners [m] extends over half of the box along an axis."""
    x, y, z = (
        (high[0] - low[0]) * span.inverse_x,
        (high[1] - low[1]) * span.inverse_y,
        (high[2] - low[2]) * span.inverse_z,
    )
    return max(x, max(y, z)) >= 0.5


@unless_still(lambda offset, member, first, end, span: False)
def spans_half(offset, member, first, end, span):
    """Whether grains member[first … end − 1], at vectors (3, N) [m], extend over half of the box along an axis."""
    low = high = load(offset, member[first])
    for k in range(first, end):
        x = load(offset, member[k])
        low = min(low[0], x[0]), min(low[1], x[1]), min(low[2], x[2])
        high = max(high[0], x[0]), max(high[1], x[1]), max(high[2], x[2])
    return extends_over_half(low, high, span)


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


@unless_still(lambda dt, span: span)
def box_after(dt, span):
    """`after_step`; a box that keeps its shape is the same."""
    return after_step(dt, span)


@unless_still(lambda velocity, separation, span: velocity)
def less_flow(velocity, separation, span):
    """v − A s [m/s], the velocity relative to the flow of a point at s [m] from one at which it is given by v."""
    return (
        velocity[0] - span.rate_x * separation[0] - sheared(separation[2], span),
        velocity[1] - span.rate_y * separation[1],
        velocity[2] - span.rate_z * separation[2],
    )


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
