"""Equations of motion of two rigid aggregates of magnetic grains, in relative coordinates (compare `two_spheres`).

The state is r, u, then the orientations ϱ and angular momenta L of both bodies in the laboratory frame. Positions and
moments of grains are constant in the principal frame of their body.
"""

import math
from typing import NamedTuple

import numpy as np

from ...compiler.jit import formula, loop
from ...forces.pair.dipole_formulas import pair_load
from ...numerics.quaternion import normalised, turned, turned_back, turning_rate
from ...numerics.random import normal_pair, random_words
from ...numerics.vec import add, axpy, cross, dot, load, norm, put, scale, sub
from .initial_conditions import AXIS1, AXIS2, RANDOM, SPIN_STREAM1, SPIN_STREAM2, R, U, draw_spin, set_vector, vector_at
from .two_spheres import Model, longest_safe_step, relative_motion_error, relative_square

TURN1, TURN2, ANGULAR1, ANGULAR2 = 6, 10, 14, 17
"""Offsets of orientations and angular momenta in the state."""
AGGREGATES = 20
"""Length of the state of two aggregates."""


class Body(NamedTuple):
    """One rigid aggregate."""

    point: np.ndarray  # (3, n) centres of the grains in the principal frame [m]
    moment: np.ndarray  # (3, n) their moments in the principal frame [A m²]
    radius: np.ndarray  # (n,) [m]
    position_now: np.ndarray  # (3, n) work array: centres in the current orientation
    moment_now: np.ndarray  # (3, n) work array: moments in the current orientation
    inertia: tuple  # principal moments of inertia [kg m²]
    pose: tuple  # ϱ of the rotation from the principal frame to the original orientation
    strength: float  # Σ |μ| [A m²]
    extent: float  # outer radius about the centre of mass [m]


class Aggregates(NamedTuple):
    """Parameters of two rigid aggregates."""

    k: float  # μ₀/4π [T m/A]
    reduced: float  # m̄ [kg]
    first: Body
    second: Body
    smallest: float  # smallest radius [m]
    field: tuple  # external flux density [T]


@formula
def quaternion_at(y, first):
    """Four components of a state, from index `first`."""
    return y[first], y[first + 1], y[first + 2], y[first + 3]


@formula
def set_quaternion(y, first, q):
    """Set four components of a state, from index `first`."""
    for n in range(4):
        y[first + n] = q[n]


@formula
def spin_of(q, angular, inertia):
    """Angular velocity ω = R I⁻¹ Rᵀ L."""
    own = turned_back(q, angular)
    return turned(q, (own[0] / inertia[0], own[1] / inertia[1], own[2] / inertia[2]))


@loop
def rotate_body(q, body):
    """Compute positions and moments of the grains in the orientation q."""
    for i in range(body.radius.size):
        put(body.position_now, i, turned(q, load(body.point, i)))
        put(body.moment_now, i, turned(q, load(body.moment, i)))


@loop
def rigid_rates(y, out, parameters):
    """Rates ṙ = u, m̄u̇ = ΣF, ϱ̇ = ½ω∘ϱ, L̇ = Σ x×F + μ×(B + B_ext), x relative to the body's centre of mass."""
    first, second = parameters.first, parameters.second
    r, q1, q2 = vector_at(y, R), normalised(quaternion_at(y, TURN1)), normalised(quaternion_at(y, TURN2))
    rotate_body(q1, first)
    rotate_body(q2, second)
    pull = torque1 = torque2 = (0.0, 0.0, 0.0)
    for j in range(second.radius.size):
        torque2 = add(torque2, cross(load(second.moment_now, j), parameters.field))
    for i in range(first.radius.size):
        x1, moment1 = load(first.position_now, i), load(first.moment_now, i)
        force_i = (0.0, 0.0, 0.0)
        field_i = parameters.field
        for j in range(second.radius.size):
            x2, moment2 = load(second.position_now, j), load(second.moment_now, j)
            force, field1, field2, _ = pair_load(add(r, sub(x1, x2)), moment1, moment2, parameters.k)
            force_i = add(force_i, force)
            field_i = add(field_i, field1)
            torque2 = add(torque2, sub(cross(moment2, field2), cross(x2, force)))
        pull = add(pull, force_i)
        torque1 = add(torque1, add(cross(x1, force_i), cross(moment1, field_i)))
    set_vector(out, R, vector_at(y, U))
    set_vector(out, U, scale(1.0 / parameters.reduced, pull))
    set_quaternion(out, TURN1, turning_rate(q1, spin_of(q1, vector_at(y, ANGULAR1), first.inertia)))
    set_quaternion(out, TURN2, turning_rate(q2, spin_of(q2, vector_at(y, ANGULAR2), second.inertia)))
    set_vector(out, ANGULAR1, torque1)
    set_vector(out, ANGULAR2, torque2)


@loop
def rotation_error(y, error, turn, angular, body, strength):
    """Largest squared error of one body's orientation and angular momentum over its scale."""
    e = quaternion_at(error, turn)
    off = 4.0 * (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3])
    least = min(body.inertia[0], body.inertia[1], body.inertia[2])
    now = vector_at(y, angular)
    return max(off, relative_square(vector_at(error, angular), max(dot(now, now), least * strength)))


@loop
def rigid_error(y, error, parameters):
    """Largest error over its scale, as `two_spheres.sphere_error`; the scales are |r|, |u|, 1 and |L|.

    Their lower bounds use Σ|μ| of both bodies.
    """
    r = vector_at(y, R)
    square = dot(r, r)
    first, second = parameters.first, parameters.second
    outer = math.sqrt(dot(parameters.field, parameters.field))
    strength = 2.0 * parameters.k * first.strength * second.strength / (square * math.sqrt(square))
    worst = relative_motion_error(y, error, parameters.reduced, strength)
    worst = max(worst, rotation_error(y, error, TURN1, ANGULAR1, first, strength + first.strength * outer))
    worst = max(worst, rotation_error(y, error, TURN2, ANGULAR2, second, strength + second.strength * outer))
    return math.sqrt(worst)


@loop
def rigid_gap(y, parameters):
    """Smallest gap [m] of all pairs of grains, and the longest step [s] that cannot miss a contact.

    As long as the bounding spheres of the bodies are separate, their gap is used.
    """
    first, second = parameters.first, parameters.second
    r, u, q1, q2 = vector_at(y, R), vector_at(y, U), quaternion_at(y, TURN1), quaternion_at(y, TURN2)
    gap = norm(r) - first.extent - second.extent
    if gap < parameters.smallest:
        rotate_body(q1, first)
        rotate_body(q2, second)
        gap = math.inf
        for i in range(first.radius.size):
            for j in range(second.radius.size):
                apart = norm(add(r, sub(load(first.position_now, i), load(second.position_now, j))))
                gap = min(gap, apart - first.radius[i] - second.radius[j])
    speed = norm(u) + norm(spin_of(q1, vector_at(y, ANGULAR1), first.inertia)) * first.extent
    speed += norm(spin_of(q2, vector_at(y, ANGULAR2), second.inertia)) * second.extent
    return gap, longest_safe_step(gap, speed, parameters.smallest)


@loop
def rigid_energy(y, parameters):
    """Energy ½m̄u² + ½L1·ω1 + ½L2·ω2 + ΣU − Σμ·B_ext [J], without the constant energy within each body."""
    first, second = parameters.first, parameters.second
    r, u, q1, q2 = vector_at(y, R), vector_at(y, U), quaternion_at(y, TURN1), quaternion_at(y, TURN2)
    angular1, angular2 = vector_at(y, ANGULAR1), vector_at(y, ANGULAR2)
    rotate_body(q1, first)
    rotate_body(q2, second)
    total = 0.5 * parameters.reduced * dot(u, u)
    total += 0.5 * dot(angular1, spin_of(q1, angular1, first.inertia))
    total += 0.5 * dot(angular2, spin_of(q2, angular2, second.inertia))
    for j in range(second.radius.size):
        total -= dot(load(second.moment_now, j), parameters.field)
    for i in range(first.radius.size):
        x1, moment1 = load(first.position_now, i), load(first.moment_now, i)
        total -= dot(moment1, parameters.field)
        for j in range(second.radius.size):
            apart = add(r, sub(x1, load(second.position_now, j)))
            total += pair_load(apart, moment1, load(second.moment_now, j), parameters.k)[3]
    return total


@loop
def normalise_rigid(y):
    """Restore |ϱ| = 1 against rounding."""
    set_quaternion(y, TURN1, normalised(quaternion_at(y, TURN1)))
    set_quaternion(y, TURN2, normalised(quaternion_at(y, TURN2)))


@loop
def draw_orientation(flight_id, stream, mode, given):
    """Quaternion of a uniformly random rotation (Shoemake 1992), or the original orientation."""
    seed, stratum, number = flight_id
    a, b, c, d = random_words(seed, number, stratum, stream)
    x, y = normal_pair(a, b)
    z, w = normal_pair(c, d)
    return normalised((x, y, z, w)) if mode == RANDOM else given


@loop
def draw_angular_momentum(flight_id, stream, spin, energy, q, inertia):
    """Angular momentum L = I ω of the given spin plus a thermal part of mean energy `energy` [J].

    A third of the energy belongs to each principal axis.
    """
    xi = draw_spin(flight_id, stream, (0.0, 0.0, 0.0), math.sqrt(2.0 * energy / 3.0))
    own = turned_back(q, spin)
    mean = (inertia[0] * own[0], inertia[1] * own[1], inertia[2] * own[2])
    spread = (math.sqrt(inertia[0]) * xi[0], math.sqrt(inertia[1]) * xi[1], math.sqrt(inertia[2]) * xi[2])
    return turned(q, axpy(1.0, spread, mean))


@loop
def draw_rigid_pose(y, flight_id, start, parameters):
    """Draw orientations and angular momenta as `InitialConditions` prescribes."""
    first, second = parameters.first, parameters.second
    q1 = draw_orientation(flight_id, AXIS1, start.axes, first.pose)
    q2 = draw_orientation(flight_id, AXIS2, start.axes, second.pose)
    set_quaternion(y, TURN1, q1)
    set_quaternion(y, TURN2, q2)
    energy1, energy2 = start.spin_energy
    angular1 = draw_angular_momentum(flight_id, SPIN_STREAM1, start.spin[0], energy1, q1, first.inertia)
    angular2 = draw_angular_momentum(flight_id, SPIN_STREAM2, start.spin[1], energy2, q2, second.inertia)
    set_vector(y, ANGULAR1, angular1)
    set_vector(y, ANGULAR2, angular2)


TWO_AGGREGATES = Model(AGGREGATES, rigid_rates, rigid_error, rigid_gap, rigid_energy, normalise_rigid, draw_rigid_pose)
