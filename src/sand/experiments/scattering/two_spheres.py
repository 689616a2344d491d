"""Two free magnetic bodies in the frame of one of them: rates of change, errors, gap and energy.

The state is one row of numbers: r = x1 − x2 and u = v1 − v2 of the projectile (1) from the target (2), then their
orientations and spins.  `Model` is what a flight (experiments/scattering/flight_driver.py) needs to know of a kind of body; there are
spheres here, rigid aggregates in experiments/scattering/two_aggregates.py.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from ...compiler.jit import formula, loop
from ...forces.pair.dipole_formulas import pair_load
from ...numerics.vec import add, cross, dot, scale
from .initial_conditions import AXIS1, AXIS2, WHIRL1, WHIRL2, R, U, at, drawn_axis, drawn_spin, unit, write

DIRECTION1, DIRECTION2, SPIN1, SPIN2 = 6, 9, 12, 15
"""Where the unit vectors of the moments and the spins of two spheres begin."""
SPHERES = 18
"""Numbers in the state of two spheres."""
CLOSE = 0.02
"""In reach of a touch no step is longer than this part of the smallest radius: a graze that is missed is 5e-5 deep."""


class Model(NamedTuple):
    """The loops of one kind of pair; all take the state first and the kind's own numbers last."""

    size: int  # numbers in the state
    rates: Callable  # (y, out, rules): dy/dt
    error: Callable  # (y, error, rules): largest error over its scale
    gap: Callable  # (y, rules): least distance of two surfaces [m], longest step [s] for which a touch is seen
    energy: Callable  # (y, rules) [J]
    tidy: Callable  # (y): unit vectors of unit length
    pose: Callable  # (y, address, start, rules): draws orientations and spins; r and u are there


class Spheres(NamedTuple):
    """Numbers of two magnetic spheres."""

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
def sphere_rates(y, out, rules):
    """ṙ = u, u̇ = F/m̄, ê̇ = ω×ê, ω̇ = μ×(B + B_ext)/I (Eqs. 29, 33 with their 1/m and 1/I; 39, 40)."""
    e1, e2 = at(y, DIRECTION1), at(y, DIRECTION2)
    moment1, moment2 = scale(rules.moment1, e1), scale(rules.moment2, e2)
    force, field1, field2, _ = pair_load(at(y, R), moment1, moment2, rules.k)
    write(out, R, at(y, U))
    write(out, U, scale(1.0 / rules.reduced, force))
    write(out, DIRECTION1, cross(at(y, SPIN1), e1))
    write(out, DIRECTION2, cross(at(y, SPIN2), e2))
    write(out, SPIN1, scale(1.0 / rules.inertia1, cross(moment1, add(field1, rules.field))))
    write(out, SPIN2, scale(1.0 / rules.inertia2, cross(moment2, add(field2, rules.field))))


@formula
def over(error, square):
    """|e|²/scale², 0 where there is no error."""
    e = dot(error, error)
    return e / square if e > 0.0 else 0.0


@loop
def sphere_error(y, error, rules):
    """The largest error over its scale: |r|, |u|, 1 and |ω|, or what the fields make of a pair at rest here.

    Speeds and spins may pass through 0; √(α/(m̄ r³)) and √((α/r³ + μB)/I) stand in for them then.
    """
    r = at(y, R)
    square = dot(r, r)
    strength = 2.0 * rules.k * rules.moment1 * rules.moment2 / (square * math.sqrt(square))
    outer = math.sqrt(dot(rules.field, rules.field))
    u, w1, w2 = at(y, U), at(y, SPIN1), at(y, SPIN2)
    worst = max(over(at(error, R), square), over(at(error, U), max(dot(u, u), strength / rules.reduced)))
    worst = max(worst, over(at(error, DIRECTION1), 1.0), over(at(error, DIRECTION2), 1.0))
    swing1 = (strength + rules.moment1 * outer) / rules.inertia1
    swing2 = (strength + rules.moment2 * outer) / rules.inertia2
    worst = max(worst, over(at(error, SPIN1), max(dot(w1, w1), swing1)))
    return math.sqrt(max(worst, over(at(error, SPIN2), max(dot(w2, w2), swing2))))


@loop
def sphere_gap(y, rules):
    """Distance of the surfaces [m], and the longest step [s] that no touch can be jumped over in."""
    r, u = at(y, R), at(y, U)
    gap = math.sqrt(dot(r, r)) - rules.touch
    speed = math.sqrt(dot(u, u))
    way = max(0.5 * gap, CLOSE * rules.smallest)
    return gap, way / speed if speed > 0.0 else math.inf


@loop
def sphere_energy(y, rules):
    """½m̄u² + ½I1ω1² + ½I2ω2² + U − (μ1 + μ2)·B_ext [J] (Eqs. 6, 41)."""
    u, w1, w2 = at(y, U), at(y, SPIN1), at(y, SPIN2)
    moment1, moment2 = scale(rules.moment1, at(y, DIRECTION1)), scale(rules.moment2, at(y, DIRECTION2))
    _, _, _, energy = pair_load(at(y, R), moment1, moment2, rules.k)
    moving = rules.reduced * dot(u, u) + rules.inertia1 * dot(w1, w1) + rules.inertia2 * dot(w2, w2)
    return 0.5 * moving + energy - dot(add(moment1, moment2), rules.field)


@loop
def sphere_tidy(y):
    """|ê| = 1, to rounding."""
    write(y, DIRECTION1, unit(at(y, DIRECTION1)))
    write(y, DIRECTION2, unit(at(y, DIRECTION2)))


@loop
def sphere_pose(y, address, start, rules):
    """Moments and spins by chance or as asked for (experiments/scattering/initial_conditions.py)."""
    line = unit(at(y, R))
    write(y, DIRECTION1, drawn_axis(address, AXIS1, start.axes, start.axis1, line))
    write(y, DIRECTION2, drawn_axis(address, AXIS2, start.axes, start.axis2, line))
    spread1 = math.sqrt(2.0 / 3.0 * start.spin_energy1 / rules.inertia1)
    spread2 = math.sqrt(2.0 / 3.0 * start.spin_energy2 / rules.inertia2)
    write(y, SPIN1, drawn_spin(address, WHIRL1, start.spin1, spread1))
    write(y, SPIN2, drawn_spin(address, WHIRL2, start.spin2, spread2))


TWO_SPHERES = Model(SPHERES, sphere_rates, sphere_error, sphere_gap, sphere_energy, sphere_tidy, sphere_pose)
