"""What becomes of the summed long-range loads, and what multiple time steps need."""

import functools
from collections.abc import Callable

import numpy as np

from ..box import nearest_image
from ..compiler.jit import loop
from ..contact.update import BROKEN_FLAG, padded_contact_count
from ..numerics.vec import accrue, axpy, cross, dot, load, put, scale, sub
from ..state.state import CONTACTS

SLOW_FORCE_CHANGE = 0.5
"""Change of a grain's far load, in parts of it, at which its held part follows.

A chain of 20 at rest and one that rings were tried in cycles of 70 steps with 0.2, 0.5 and 1 (no held part): 0.2 lets
the energy of the ringing one drift, 1 makes the impulses shake the calm one; see docs/physics/long-range.md.
"""


@loop
def clear_long_range_loads(long_range):
    """No far loads."""
    for i in range(long_range.force.shape[1]):
        put(long_range.force, i, (0.0, 0.0, 0.0))
        put(long_range.torque, i, (0.0, 0.0, 0.0))


@loop
def add_long_range_loads(grains, long_range):
    """The far loads as last summed, on top of what the grains carry."""
    for i in range(grains.mass.size):
        accrue(grains.force, i, load(long_range.force, i))
        accrue(grains.torque, i, load(long_range.torque, i))


@loop
def add_slow_loads(grains, long_range, since):
    """The held part of the far loads, which acts in every step.

    A load that does not change can be split off without any error, and impulses of what is left shake a cluster
    at rest much less.
    """
    for i in range(grains.mass.size):
        accrue(grains.force, i, load(long_range.slow_force, i))
        accrue(grains.torque, i, load(long_range.slow_torque, i))


@loop
def update_slow_loads(grains, long_range):
    """At the begin of a cycle: let the held part of a grain's far loads follow where they have become too different."""
    for i in range(grains.mass.size):
        force, torque = load(long_range.force, i), load(long_range.torque, i)
        change = sub(force, load(long_range.slow_force, i))
        if dot(change, change) > SLOW_FORCE_CHANGE**2 * dot(force, force):
            put(long_range.slow_force, i, force)
        change = sub(torque, load(long_range.slow_torque, i))
        if dot(change, change) > SLOW_FORCE_CHANGE**2 * dot(torque, torque):
            put(long_range.slow_torque, i, torque)
        put(long_range.past_position, i, load(grains.position, i))
        put(long_range.path, i, (0.0, 0.0, 0.0))


@loop
def follow_path(grains, long_range, span, weight):
    """Sum up the displacement since the begin of the cycle where the held force acts for `weight` seconds."""
    for i in range(grains.mass.size):
        moved = nearest_image(sub(load(grains.position, i), load(long_range.past_position, i)), span)
        accrue(long_range.path, i, scale(weight, moved))


@loop
def keep_angular_momentum(grains, long_range, span, weight):
    """Give each grain the spin that its held force F̄ took from the sum of all angular momenta.

    Far loads leave L alone where they are summed, at x_n and x_{n+1}.  The held force acts at the places between as
    well, and the impulse of `weight` w that takes its place at the end acts at x_{n+1}: what is left over is
    (∫(x − x_n) dt − w (x_{n+1} − x_n)) × F̄.
    """
    for i in range(grains.mass.size):
        moved = nearest_image(sub(load(grains.position, i), load(long_range.past_position, i)), span)
        excess = cross(axpy(-weight, moved, load(long_range.path, i)), load(long_range.slow_force, i))
        accrue(grains.spin, i, scale(-1.0 / grains.inertia[i], excess))


@loop
def add_extrapolated_loads(grains, long_range, since):
    """F + Ḟ t and M + Ṁ t (Eq. 51), t the time [s] since the last summation."""
    for i in range(grains.mass.size):
        accrue(grains.force, i, axpy(since, load(long_range.force_rate, i), load(long_range.force, i)))
        accrue(grains.torque, i, axpy(since, load(long_range.torque_rate, i), load(long_range.torque, i)))


@loop
def apply_impulse(grains, long_range, dt):
    """v += ΔF dt/m, ω += ΔM dt/I with what the far loads differ from their held part."""
    for i in range(grains.mass.size):
        force = sub(load(long_range.force, i), load(long_range.slow_force, i))
        torque = sub(load(long_range.torque, i), load(long_range.slow_torque, i))
        accrue(grains.velocity, i, scale(dt / grains.mass[i], force))
        accrue(grains.spin, i, scale(dt / grains.inertia[i], torque))


@functools.cache
def bonded_loops(pair: Callable) -> tuple[Callable, Callable, Callable]:
    """Far loads of pairs in contact apart from all others: they ring with their contact, the others hardly.

    The first loop adds them to the loads of the contacts, before these are gathered, and vectorises; the second takes
    them out of the far loads just summed.  The third lets contacts change sides between two cycles: new ones
    (`bonded` 0) come out of the far loads, dead ones (flag 2) go back to them.
    """

    @loop
    def add_bonded(grains, contacts, count, span, numbers):
        for c in range(padded_contact_count(contacts, np.uint64(count[CONTACTS]))):
            force, torque1, torque2 = pair(grains, span, numbers, contacts.pair[0, c], contacts.pair[1, c])
            part = 1.0 if contacts.bonded[c] == 1 else 0.0
            accrue(contacts.push, c, scale(part, force))
            accrue(contacts.torque1, c, scale(part, torque1))
            accrue(contacts.torque2, c, scale(part, torque2))

    @loop
    def take_out_bonded(grains, contacts, count, long_range, span, numbers):
        for c in range(count[CONTACTS]):
            if contacts.bonded[c] == 1:
                i, j = contacts.pair[0, c], contacts.pair[1, c]
                force, torque1, torque2 = pair(grains, span, numbers, i, j)
                accrue(long_range.force, i, scale(-1.0, force))
                accrue(long_range.force, j, force)
                accrue(long_range.torque, i, scale(-1.0, torque1))
                accrue(long_range.torque, j, scale(-1.0, torque2))

    @loop
    def swap_slow_parts(grains, contacts, count, long_range, span, numbers):
        for c in range(count[CONTACTS]):
            dead = contacts.flag[c] == BROKEN_FLAG
            if dead or contacts.bonded[c] == 0:
                i, j = contacts.pair[0, c], contacts.pair[1, c]
                force, torque1, torque2 = pair(grains, span, numbers, i, j)
                sign = 1.0 if dead else -1.0
                if not (dead and contacts.bonded[c] == 0):
                    accrue(long_range.force, i, scale(sign, force))
                    accrue(long_range.force, j, scale(-sign, force))
                    accrue(long_range.torque, i, scale(sign, torque1))
                    accrue(long_range.torque, j, scale(sign, torque2))
                contacts.bonded[c] = 1

    return add_bonded, take_out_bonded, swap_slow_parts


@loop
def store_positions(grains, long_range):
    """Keep positions and moments of this summation for the mean rates of the next."""
    for i in range(grains.mass.size):
        put(long_range.past_position, i, load(grains.position, i))
        put(long_range.past_moment, i, load(grains.moment, i))


@loop
def set_mean_velocities(grains, long_range, start, span, cycle, literal):
    """Turn `past_position` and `past_moment` into ṙ and μ̇.

    Grains in contact ring within the time that is to be foretold: their mean rates since the summation before the
    last, `cycle` [s] ago, stand for the drift.  Free grains, and all of them if `literal`, take v and ω×μ.
    """
    for i in range(grains.mass.size):
        if literal or start[i + 1] == start[i]:
            put(long_range.past_position, i, load(grains.velocity, i))
            put(long_range.past_moment, i, cross(load(grains.spin, i), load(grains.moment, i)))
        else:
            rate = 1.0 / cycle if cycle > 0.0 else 0.0
            moved = nearest_image(sub(load(grains.position, i), load(long_range.past_position, i)), span)
            turned = sub(load(grains.moment, i), load(long_range.past_moment, i))
            put(long_range.past_position, i, scale(rate, moved))
            put(long_range.past_moment, i, scale(rate, turned))


@loop
def clear_rates(long_range):
    """No rates."""
    for i in range(long_range.force.shape[1]):
        put(long_range.force_rate, i, (0.0, 0.0, 0.0))
        put(long_range.torque_rate, i, (0.0, 0.0, 0.0))
