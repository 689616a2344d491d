"""Dashpots of the four modes of a contact, and the thermal noise that belongs to them.

A dashpot acts on the relative motion of the two grains alone, so that momentum and angular momentum are conserved:

    U = v1 − v2 − (a1 ω1 + a2 ω2)×n,  a_i = D r_i/(r1 + r2)      relative velocity of the surfaces at the contact
    f = −c_n (U·n) n − c_s U_t                                   force on grain 1, −f on grain 2
    τ = −C_r Ω_t − C_t (Ω·n) n,  Ω = ω1 − ω2                     torque on grain 1, −τ on grain 2
    M1 = −a1 n×f + τ,  M2 = −a2 n×f − τ

M1 + M2 + (x1 − x2)×f = 0 is exact, and the power f·U + τ·Ω is never positive.  With a bath of temperature T each mode
has a random load of variance 2 k_B T c/dt (fluctuation–dissipation theorem).

The velocities of the second half of a step are those of its middle.  A load at the end of a step depends on the motion
extrapolated from the middles of this step and the one before, U(t) = U(t − dt/2) + ½ [U(t − dt/2) − U(t − 3dt/2)], and
the dissipated energy is its work by the trapezoidal rule, as that of all forces in velocity Verlet: the energy balance
then closes to the order of the integrator.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..compiler.jit import formula, loop
from ..numerics.flow import with_flow
from ..numerics.random import LOW_WORD, WORD_BITS, philox, uniform
from ..numerics.vec import add, axpy, cross, dot, load, put, scale, sub
from .losses import DAMPING_ROW, add_damping_energies

VELOCITY, SPIN, FORCE, TORQUE = 0, 3, 6, 9
"""First rows of U, Ω, f and τ in `ContactArrays.damping`: motion in the middle of the last step, loads at its end."""
STREAM = np.uint64(0x5A4D0001)
"""Keeps the random numbers of contacts distinct from those of the gas: it changes the high word of the key."""
NONE, DASHPOTS, THERMAL = "none", "dashpots", "thermal"
"""Variants of the contact update: undamped, damped, damped with the noise of a bath."""


class Dashpots(NamedTuple):
    """Damping coefficients of the four modes of one contact."""

    normal: float  # c_n [kg/s]
    slide: float  # c_s [kg/s]
    roll: float  # C_r [N m s]
    twist: float  # C_t [N m s]


class Motion(NamedTuple):
    """Relative motion of two grains in contact."""

    velocity: tuple  # U [m/s]
    spin: tuple  # Ω [1/s]


class Surfaces(NamedTuple):
    """The two sides of a contact in the second half of a step; the second one is a grain or a wall.

    A wall is the limit r2 → ∞: W → 0, while W×(x1 − x2) → r1 ω1×n and a1 → r1.
    """

    share: float  # r1/(r1 + r2), so that a1 = |x1 − x2| r1/(r1 + r2); 1 at a wall, where |x1 − x2| is r1
    velocity: tuple  # v1 − v2 [m/s]
    separation: tuple  # x1 − x2 [m]; r1 n at a wall
    rolling: tuple  # W [1/s] of `surface_rotation`; 0 at a wall
    motion: Motion  # U at the end of the step, and Ω
    ids: tuple  # of both sides, for the noise


class DampingLoad(NamedTuple):
    """Loads of the dashpots on grain 1; f and −τ act on grain 2 with the opposite sign."""

    force: tuple  # f [N]
    torque: tuple  # τ [N m]


NO_LOAD = DampingLoad((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@formula
def dashpots_of(contact_radius, constants):
    """Damping coefficients at a contact radius a [m]: c_n = c + (c/a) a, the others are constants of the contact."""
    return Dashpots(
        constants.damping + constants.damping_per_radius * contact_radius,
        constants.slide_damping,
        constants.roll_damping,
        constants.twist_damping,
    )


@formula
def surface_rotation(spin1, spin2, share):
    """Mean spin W = (r1 ω1 + r2 ω2)/(r1 + r2) [1/s], of which W×(x1 − x2) is the part of U due to spins.

    `share` is r1/(r1 + r2).
    """
    return axpy(share, sub(spin1, spin2), spin2)


@formula
def relative_motion(separation, velocity, rolling, spin1, spin2):
    """U = v1 − v2 − W×(x1 − x2) and Ω, for the vector x1 − x2 [m] and the relative velocity v1 − v2 [m/s].

    a_i n = r_i (x1 − x2)/(r1 + r2); W is that of `surface_rotation`.
    """
    return Motion(sub(velocity, cross(rolling, separation)), sub(spin1, spin2))


@formula
def _two_coefficients(along, across, v, n):
    """along (v·n) n + across v_t."""
    return axpy((along - across) * dot(v, n), n, scale(across, v))


@formula
def damping_load(motion, n, dashpots):
    """Loads f and τ of the dashpots."""
    return DampingLoad(
        _two_coefficients(-dashpots.normal, -dashpots.slide, motion.velocity, n),
        _two_coefficients(-dashpots.twist, -dashpots.roll, motion.spin, n),
    )


@formula
def unit_deviates(seed, number, id1, id2):
    """Two vectors of independent uniform deviates with mean 0 and variance 1, for a step and a pair of grains.

    They change sign with the order of the grains, as the loads on grain 1 do: spatial sorting can exchange the grains
    of a contact.  Uniform deviates give the same moments of the motion as normal ones to second order in the step
    (Dünweg & Paul 1991, Int. J. Mod. Phys. C 2, 817), without logarithms.
    """
    seed, number = np.uint64(seed), np.uint64(number)
    id1, id2 = np.uint64(id1), np.uint64(id2)
    counter = (number & LOW_WORD, number >> WORD_BITS, id1 if id1 < id2 else id2, id2 if id1 < id2 else id1)
    low, high = seed & LOW_WORD, (seed >> WORD_BITS) ^ STREAM
    a = philox(counter, (low, high))
    b = philox(counter, (low, high ^ np.uint64(1)))
    width = math.sqrt(12.0) if id1 < id2 else -math.sqrt(12.0)
    u = (width * (uniform(a[0]) - 0.5), width * (uniform(a[1]) - 0.5), width * (uniform(a[2]) - 0.5))
    w = (width * (uniform(b[0]) - 0.5), width * (uniform(b[1]) - 0.5), width * (uniform(b[2]) - 0.5))
    return u, w


@formula
def thermal_load(dashpots, n, deviates, thermal_energy, dt):
    """Random loads of the dashpots in a bath of k_B T [J]: variance 2 k_B T c/dt in each mode; none for dt = 0."""
    strength = math.sqrt(2.0 * thermal_energy / dt) if dt > 0.0 else 0.0
    spread = Dashpots(
        strength * math.sqrt(dashpots.normal),
        strength * math.sqrt(dashpots.slide),
        strength * math.sqrt(dashpots.roll),
        strength * math.sqrt(dashpots.twist),
    )
    return DampingLoad(
        _two_coefficients(spread.normal, spread.slide, deviates[0], n),
        _two_coefficients(spread.twist, spread.roll, deviates[1], n),
    )


@formula
def extrapolated(before, now, dt):
    """Motion half a step after the middle `now` of a step, from the middle of the step before.

    In the step of 0 s at the start of a run, `now` is the present motion.
    """
    weight = 0.5 if dt > 0.0 else 0.0
    return Motion(
        axpy(weight, sub(now.velocity, before.velocity), now.velocity),
        axpy(weight, sub(now.spin, before.spin), now.spin),
    )


@formula
def loads_on_grains(damping, separation, share):
    """Force on grain 1 and torques on both grains, for x1 − x2 [m] and r1/(r1 + r2)."""
    moment = cross(separation, damping.force)
    torque1 = axpy(-share, moment, damping.torque)
    return damping.force, torque1, sub(axpy(share, moment, scale(-1.0, damping.torque)), moment)


@formula
def damping_losses(start, end, n, velocity, motion, rolling, dt):
    """Energies [J] dissipated in a step by the normal, sliding, rolling and twisting dashpots.

    −½ dt [f_start·U_start + f_end·U_end + (τ_start + τ_end)·Ω]: the velocities are those of the middle of the step, and
    U_start = U_end + dt W×(v1 − v2) has the separation at the start.  The sum is exact; the parts of the start that are
    normal and twisting are taken along n at the end.

    Parameters
    ----------
    start, end : DampingLoad
        Loads at the start and at the end of the step.
    n : tuple
        Direction of x1 − x2 at the end of the step.
    velocity : tuple
        v1 − v2 [m/s].
    motion : Motion
        U at the end of the step, and Ω.
    rolling : tuple
        W [1/s] of `surface_rotation`.
    dt : float
        Length of the step [s].
    """
    half, force, torque = -0.5 * dt, add(start.force, end.force), add(start.torque, end.torque)
    normal = half * dot(force, n) * dot(velocity, n)  # W×(x1 − x2) is perpendicular to n
    twist = half * dot(torque, n) * dot(motion.spin, n)
    both = half * (dot(force, motion.velocity) + dt * dot(start.force, cross(rolling, velocity)))
    return normal, both - normal, half * dot(torque, motion.spin) - twist, twist


@loop
def load_rows(array, first, c):
    """Rows first … first + 2 of column c, as a vector."""
    return array[first, c], array[first + 1, c], array[first + 2, c]


@loop
def store_rows(array, first, c, v):
    """Set the rows first … first + 2 of column c."""
    array[first, c] = v[0]
    array[first + 1, c] = v[1]
    array[first + 2, c] = v[2]


@loop
def stored_load(contacts, c):
    """Loads of the dashpots of contact c at the end of the last step."""
    return DampingLoad(load_rows(contacts.damping, FORCE, c), load_rows(contacts.damping, TORQUE, c))


@loop
def store_loads(contacts, c, loads):
    """Store force on grain 1 [N] and torques on both sides [N m] of contact c."""
    put(contacts.force, c, loads[0])
    put(contacts.torque1, c, loads[1])
    put(contacts.torque2, c, loads[2])


@loop
def stored_loads(contacts, c):
    """Force on grain 1 [N] and torques on both sides [N m] of contact c, as stored."""
    return load(contacts.force, c), load(contacts.torque1, c), load(contacts.torque2, c)


@loop
def measured_load(contacts, c):
    """Loads of the dashpots of contact c; 0 in simulations without damping."""
    if contacts.damping.shape[1] == 0:
        return NO_LOAD
    return stored_load(contacts, c)


@loop
def surfaces_of_pair(grains, contacts, c, held, span):
    """The two sides of contact c between grains; `held` has its pose and constants, `span` is the box."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    share, pose = held.constants.derived.radius1 * held.constants.derived.inverse_sum, held.pose
    velocity = sub(load(grains.velocity, i), load(grains.velocity, j))  # before the spins: the order changes last bits
    w1, w2 = load(grains.spin, i), load(grains.spin, j)
    separation = scale(pose.distance, pose.n)
    velocity = with_flow(velocity, separation, span)
    rolling = surface_rotation(w1, w2, share)
    motion = relative_motion(separation, velocity, rolling, w1, w2)
    return Surfaces(share, velocity, separation, rolling, motion, (grains.id[i], grains.id[j]))


class Held(NamedTuple):
    """A contact at the end of a step, as far as its dashpots depend on it."""

    pose: Any  # mechanics.Pose, or that of a grain at a wall
    radius: float  # of the contact [m]
    constants: Any  # law.ContactConstants


class DampingVariant(NamedTuple):
    """Functions of the dashpots in one variant of the contact update; `bodies` is what `surfaces_of` takes."""

    update: (
        Callable  # of one contact: returns `loads` with damping, and the energies [J] that the four modes dissipated
    )
    single: Callable  # of one contact that the pass has not updated: adds to its loads, and logs its losses
    at_touch: Callable  # of a new contact, likewise; returns the normal impulse [N s] since first touch
    at_break: Callable  # of a broken contact: logs its losses; returns the normal force [N] at the start of the step


@functools.cache
def damping_loops(damping: str, surfaces_of: Callable = surfaces_of_pair) -> DampingVariant:
    """The dashpots of contacts with `surfaces_of(bodies, contacts, c, held, span)`, in one variant of the update."""
    if damping == NONE:
        return NO_DAMPING
    thermal = damping == THERMAL

    @loop
    def update(bodies, contacts, c, held, loads, active, step):
        """Update and store the dashpots of contact c at the end of a step, and log its losses.

        If it is not `active`, the stored loads stay those of the start of the step, and nothing is lost.
        """
        share, velocity, separation, rolling, motion, ids = surfaces_of(bodies, contacts, c, held, step.span)
        n = held.pose.n
        before = Motion(load_rows(contacts.damping, VELOCITY, c), load_rows(contacts.damping, SPIN, c))
        start = stored_load(contacts, c)
        dashpots = dashpots_of(held.radius, held.constants)
        end = damping_load(extrapolated(before, motion, step.dt), n, dashpots)
        if thermal:
            deviates = unit_deviates(step.settings.seed, step.number, ids[0], ids[1])
            noise = thermal_load(dashpots, n, deviates, step.settings.bath, step.dt)
            end = DampingLoad(add(end.force, noise.force), add(end.torque, noise.torque))
        lost = damping_losses(start, end, n, velocity, motion, rolling, step.dt)
        first, others = _chosen(active, lost[:3], NO_LOAD.force), lost[3] if active else 0.0
        lost = (first[0], first[1], first[2], others)
        contacts.lost[DAMPING_ROW, c] += lost[0] + lost[1] + lost[2] + lost[3]
        store_rows(contacts.damping, VELOCITY, c, _chosen(active, motion.velocity, before.velocity))
        store_rows(contacts.damping, SPIN, c, _chosen(active, motion.spin, before.spin))
        store_rows(contacts.damping, FORCE, c, _chosen(active, end.force, start.force))
        store_rows(contacts.damping, TORQUE, c, _chosen(active, end.torque, start.torque))
        force, torque1, torque2 = loads_on_grains(end, separation, share)
        return (add(loads[0], force), add(loads[1], torque1), add(loads[2], torque2)), lost

    @loop
    def single(bodies, contacts, lost, c, held, step):
        loads, dissipated = update(bodies, contacts, c, held, stored_loads(contacts, c), True, step)
        store_loads(contacts, c, loads)
        add_damping_energies(lost, dissipated)

    @loop
    def at_touch(bodies, contacts, lost, c, held, closing, elapsed, step):
        motion = surfaces_of(bodies, contacts, c, held, step.span).motion
        store_rows(contacts.damping, VELOCITY, c, motion.velocity)
        store_rows(contacts.damping, SPIN, c, motion.spin)
        store_rows(contacts.damping, FORCE, c, NO_LOAD.force)
        store_rows(contacts.damping, TORQUE, c, NO_LOAD.torque)
        loads, dissipated = update(bodies, contacts, c, held, stored_loads(contacts, c), True, step)
        impulse = dot(sub(loads[0], load(contacts.force, c)), held.pose.n) * elapsed
        store_loads(contacts, c, loads)
        # along n the force acts since first touch, otherwise for half a step in the velocity Verlet kick
        contacts.lost[DAMPING_ROW, c] += impulse * closing - dissipated[0]
        add_damping_energies(lost, (impulse * closing, dissipated[1], dissipated[2], dissipated[3]))
        return impulse

    @loop
    def at_break(bodies, contacts, lost, c, broken, elapsed, step):
        # the loads of the start of the step acted for half a step in the velocity Verlet kick; along n, the impulse of
        # the break extends this to the time until the break, dt − elapsed
        _, velocity, _, rolling, motion, _ = surfaces_of(bodies, contacts, c, broken, step.span)
        start = stored_load(contacts, c)
        losses = damping_losses(start, NO_LOAD, broken.pose.n, velocity, motion, rolling, step.dt)
        normal = dot(start.force, broken.pose.n)
        add_damping_energies(lost, (-normal * broken.opening * (step.dt - elapsed), losses[1], losses[2], losses[3]))
        return normal

    return DampingVariant(update, single, at_touch, at_break)


@formula
def _chosen(condition, u, v):
    """Vector u where the condition holds, else v."""
    return u[0] if condition else v[0], u[1] if condition else v[1], u[2] if condition else v[2]


@loop
def _no_update(bodies, contacts, c, held, loads, active, step):
    return loads, (0.0, 0.0, 0.0, 0.0)


@loop
def _no_single(bodies, contacts, lost, c, held, step):
    return


@loop
def _no_touch(bodies, contacts, lost, c, held, closing, elapsed, step):
    return 0.0


@loop
def _no_break(bodies, contacts, lost, c, broken, elapsed, step):
    return 0.0


NO_DAMPING = DampingVariant(_no_update, _no_single, _no_touch, _no_break)
