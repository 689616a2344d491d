"""Two rigid aggregates of magnetic grains: the second kind of pair (experiments/scattering/two_spheres.py has the first).

The state is r, u, then orientations ϱ and angular momenta L of both, in the laboratory frame; grains are at rest in a
body's principal frame.
"""

import math
from typing import NamedTuple

import numpy as np

from ...compiler.jit import formula, loop
from ...forces.pair.dipole_formulas import pair_load
from ...numerics.quaternion import normalised, turned, turned_back, turning_rate
from ...numerics.random import normal_pair, random_words
from ...numerics.vec import add, axpy, cross, dot, load, norm, put, scale, sub
from .initial_conditions import AXIS1, AXIS2, RANDOM, WHIRL1, WHIRL2, R, U, at, drawn_spin, write
from .two_spheres import CLOSE, Model, over

TURN1, TURN2, ANGULAR1, ANGULAR2 = 6, 10, 14, 17
"""Where orientations and angular momenta begin."""
AGGREGATES = 20
"""Numbers in the state of two aggregates."""


class Body(NamedTuple):
    """One rigid aggregate."""

    point: np.ndarray  # (3, n) centres of the grains in the principal frame [m]
    moment: np.ndarray  # (3, n) their moments there [A m²]
    radius: np.ndarray  # (n,) [m]
    here: np.ndarray  # (3, n) room for the centres as they lie now
    now: np.ndarray  # (3, n) room for the moments as they lie now
    inertia: tuple  # principal moments of inertia [kg m²]
    pose: tuple  # ϱ that turns the principal frame to how the body was given
    strength: float  # Σ |μ| [A m²]
    extent: float  # outermost surface from the centre of mass [m]


class Aggregates(NamedTuple):
    """Numbers of two rigid aggregates."""

    k: float  # μ₀/4π [T m/A]
    reduced: float  # m̄ [kg]
    first: Body
    second: Body
    smallest: float  # smallest radius [m]
    field: tuple  # external flux density [T]


@formula
def at4(y, first):
    """Four numbers of a state."""
    return y[first], y[first + 1], y[first + 2], y[first + 3]


@formula
def write4(y, first, q):
    """Put four numbers into a state."""
    for n in range(4):
        y[first + n] = q[n]


@formula
def spin_of(q, angular, inertia):
    """ω = R I⁻¹ Rᵀ L"""
    own = turned_back(q, angular)
    return turned(q, (own[0] / inertia[0], own[1] / inertia[1], own[2] / inertia[2]))


@loop
def lay_out(q, body):
    """Where the grains and their moments are, for this orientation."""
    for i in range(body.radius.size):
        put(body.here, i, turned(q, load(body.point, i)))
        put(body.now, i, turned(q, load(body.moment, i)))


@loop
def rigid_rates(y, out, rules):
    """ṙ = u, m̄u̇ = ΣF, ϱ̇ = ½ω∘ϱ, L̇ = Σ x×F + μ×(B + B_ext), x from the body's own centre of mass."""
    first, second = rules.first, rules.second
    r, q1, q2 = at(y, R), normalised(at4(y, TURN1)), normalised(at4(y, TURN2))
    lay_out(q1, first)
    lay_out(q2, second)
    pull = torque1 = torque2 = (0.0, 0.0, 0.0)
    for j in range(second.radius.size):
        torque2 = add(torque2, cross(load(second.now, j), rules.field))
    for i in range(first.radius.size):
        x1, moment1 = load(first.here, i), load(first.now, i)
        force_i = (0.0, 0.0, 0.0)
        field_i = rules.field
        for j in range(second.radius.size):
            x2, moment2 = load(second.here, j), load(second.now, j)
            force, field1, field2, _ = pair_load(add(r, sub(x1, x2)), moment1, moment2, rules.k)
            force_i = add(force_i, force)
            field_i = add(field_i, field1)
            torque2 = add(torque2, sub(cross(moment2, field2), cross(x2, force)))
        pull = add(pull, force_i)
        torque1 = add(torque1, add(cross(x1, force_i), cross(moment1, field_i)))
    write(out, R, at(y, U))
    write(out, U, scale(1.0 / rules.reduced, pull))
    write4(out, TURN1, turning_rate(q1, spin_of(q1, at(y, ANGULAR1), first.inertia)))
    write4(out, TURN2, turning_rate(q2, spin_of(q2, at(y, ANGULAR2), second.inertia)))
    write(out, ANGULAR1, torque1)
    write(out, ANGULAR2, torque2)


@loop
def turning_error(y, error, turn, angular, body, strength):
    """Largest squared error of one body's orientation and angular momentum over its scale."""
    e = at4(error, turn)
    off = 4.0 * (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3])
    least = min(body.inertia[0], body.inertia[1], body.inertia[2])
    now = at(y, angular)
    return max(off, over(at(error, angular), max(dot(now, now), least * strength)))


@loop
def rigid_error(y, error, rules):
    """As `pairs.sphere_error`: |r|, |u|, 1 and |L|, or what Σ|μ| of both would make of a pair at rest here."""
    r, u = at(y, R), at(y, U)
    square = dot(r, r)
    first, second = rules.first, rules.second
    outer = math.sqrt(dot(rules.field, rules.field))
    strength = 2.0 * rules.k * first.strength * second.strength / (square * math.sqrt(square))
    worst = max(over(at(error, R), square), over(at(error, U), max(dot(u, u), strength / rules.reduced)))
    worst = max(worst, turning_error(y, error, TURN1, ANGULAR1, first, strength + first.strength * outer))
    worst = max(worst, turning_error(y, error, TURN2, ANGULAR2, second, strength + second.strength * outer))
    return math.sqrt(worst)


@loop
def rigid_gap(y, rules):
    """As `pairs.sphere_gap`, over all pairs of grains; while the bodies' outer spheres are apart, that of these."""
    first, second = rules.first, rules.second
    r, u, q1, q2 = at(y, R), at(y, U), at4(y, TURN1), at4(y, TURN2)
    gap = norm(r) - first.extent - second.extent
    if gap < rules.smallest:
        lay_out(q1, first)
        lay_out(q2, second)
        gap = math.inf
        for i in range(first.radius.size):
            for j in range(second.radius.size):
                apart = norm(add(r, sub(load(first.here, i), load(second.here, j))))
                gap = min(gap, apart - first.radius[i] - second.radius[j])
    speed = norm(u) + norm(spin_of(q1, at(y, ANGULAR1), first.inertia)) * first.extent
    speed += norm(spin_of(q2, at(y, ANGULAR2), second.inertia)) * second.extent
    way = max(0.5 * gap, CLOSE * rules.smallest)
    return gap, way / speed if speed > 0.0 else math.inf


@loop
def rigid_energy(y, rules):
    """½m̄u² + ½L1·ω1 + ½L2·ω2 + ΣU − Σμ·B_ext [J]; energies inside a body never change."""
    first, second = rules.first, rules.second
    r, u, q1, q2 = at(y, R), at(y, U), at4(y, TURN1), at4(y, TURN2)
    angular1, angular2 = at(y, ANGULAR1), at(y, ANGULAR2)
    lay_out(q1, first)
    lay_out(q2, second)
    total = 0.5 * rules.reduced * dot(u, u)
    total += 0.5 * dot(angular1, spin_of(q1, angular1, first.inertia))
    total += 0.5 * dot(angular2, spin_of(q2, angular2, second.inertia))
    for j in range(second.radius.size):
        total -= dot(load(second.now, j), rules.field)
    for i in range(first.radius.size):
        x1, moment1 = load(first.here, i), load(first.now, i)
        total -= dot(moment1, rules.field)
        for j in range(second.radius.size):
            apart = add(r, sub(x1, load(second.here, j)))
            total += pair_load(apart, moment1, load(second.now, j), rules.k)[3]
    return total


@loop
def rigid_tidy(y):
    """|ϱ| = 1, to rounding."""
    write4(y, TURN1, normalised(at4(y, TURN1)))
    write4(y, TURN2, normalised(at4(y, TURN2)))


@loop
def drawn_turn(address, stream, mode, given):
    """ϱ of a rotation by chance, evenly over all (Shoemake 1992), or as the body was given."""
    seed, stratum, number = address
    a, b, c, d = random_words(seed, number, stratum, stream)
    x, y = normal_pair(a, b)
    z, w = normal_pair(c, d)
    return normalised((x, y, z, w)) if mode == RANDOM else given


@loop
def drawn_angular(address, stream, spin, energy, q, inertia):
    """L = I ω for the spin given, and a thermal part of mean energy `energy` [J], a third about each principal axis."""
    xi = drawn_spin(address, stream, (0.0, 0.0, 0.0), math.sqrt(2.0 * energy / 3.0))
    own = turned_back(q, spin)
    mean = (inertia[0] * own[0], inertia[1] * own[1], inertia[2] * own[2])
    spread = (math.sqrt(inertia[0]) * xi[0], math.sqrt(inertia[1]) * xi[1], math.sqrt(inertia[2]) * xi[2])
    return turned(q, axpy(1.0, spread, mean))


@loop
def rigid_pose(y, address, start, rules):
    """Orientations and spins by chance or as asked for; without chance the bodies lie as they were given."""
    first, second = rules.first, rules.second
    q1 = drawn_turn(address, AXIS1, start.axes, first.pose)
    q2 = drawn_turn(address, AXIS2, start.axes, second.pose)
    write4(y, TURN1, q1)
    write4(y, TURN2, q2)
    write(y, ANGULAR1, drawn_angular(address, WHIRL1, start.spin1, start.spin_energy1, q1, first.inertia))
    write(y, ANGULAR2, drawn_angular(address, WHIRL2, start.spin2, start.spin_energy2, q2, second.inertia))


TWO_AGGREGATES = Model(AGGREGATES, rigid_rates, rigid_error, rigid_gap, rigid_energy, rigid_tidy, rigid_pose)
