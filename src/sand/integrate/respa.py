"""Multiple time stepping of the long-range loads by r-RESPA (Tuckerman et al. 1992).

The long-range force F of a grain is summed at both ends of a cycle of length T and split:
1. forces between grains in contact are evaluated in every step (`contact_pair_loops`);
2. a constant part F̄, updated rarely (`update_constant_loads`), acts in every step;
3. the remainder F − F̄ acts as an impulse ½T (F − F̄) at each end of the cycle.
Loads are forces and torques; both are treated in the same way.  See docs/physics/long-range.md.
"""

import functools
import math
from collections.abc import Callable

import numpy as np

from ..basics.state import CONTACTS
from ..compiler.jit import loop
from ..contact.transitions import BROKEN_FLAG
from ..contact.update import padded_contact_count
from ..numerics.vec import accrue, axpy, cross, dot, load, nearest_image, put, scale, sub

CONSTANT_PART_CHANGE = 0.5
"""Relative change of a grain's long-range load at which its constant part is set to the present load.

Tested on a chain of 20 grains, at rest and vibrating, in cycles of 70 steps with 0.2, 0.5 and 1 (no constant part):
with 0.2 the energy of the vibrating chain drifts, with 1 the impulses excite the chain at rest; see
docs/physics/long-range.md.
"""


@loop
def clear_long_range_loads(long_range):
    """Set all long-range forces and torques, and the virial, to 0."""
    for i in range(long_range.force.shape[1]):
        put(long_range.force, i, (0.0, 0.0, 0.0))
        put(long_range.torque, i, (0.0, 0.0, 0.0))
    for i in range(long_range.virial.shape[1]):
        put(long_range.virial, i, (0.0, 0.0, 0.0))


@loop
def add_long_range_loads(grains, long_range):
    """Add the last sums of the long-range loads to the loads of the grains."""
    for i in range(grains.mass.size):
        accrue(grains.force, i, load(long_range.force, i))
        accrue(grains.torque, i, load(long_range.torque, i))


@loop
def add_constant_loads(grains, long_range, since):
    """Add the constant part of the long-range loads, which acts in every step.

    A constant load can be split off without error, and impulses of the remainder excite a cluster at rest much less.
    """
    for i in range(grains.mass.size):
        accrue(grains.force, i, load(long_range.constant_force, i))
        accrue(grains.torque, i, load(long_range.constant_torque, i))


@loop
def update_constant_loads(grains, long_range):
    """At the start of a cycle: update constant loads that differ too much from present ones, reset ∫(x − x_n) dt."""
    for i in range(grains.mass.size):
        force, torque = load(long_range.force, i), load(long_range.torque, i)
        change = sub(force, load(long_range.constant_force, i))
        if dot(change, change) > CONSTANT_PART_CHANGE**2 * dot(force, force):
            put(long_range.constant_force, i, force)
        change = sub(torque, load(long_range.constant_torque, i))
        if dot(change, change) > CONSTANT_PART_CHANGE**2 * dot(torque, torque):
            put(long_range.constant_torque, i, torque)
        put(long_range.past_position, i, load(grains.position, i))
        put(long_range.path, i, (0.0, 0.0, 0.0))


@loop
def integrate_displacement(grains, long_range, span, weight):
    """Accumulate ∫(x − x_n) dt, x_n at the start of the cycle, where the constant force acts for `weight` seconds."""
    for i in range(grains.mass.size):
        moved = nearest_image(sub(load(grains.position, i), load(long_range.past_position, i)), span)
        accrue(long_range.path, i, scale(weight, moved))


@loop
def correct_angular_momentum(grains, long_range, span, weight):
    """Correct the spins so that the constant forces leave the total angular momentum unchanged.

    The long-range loads conserve L at the positions x_n and x_{n+1}, where they are summed.  The constant force F̄ of a
    grain also acts at the positions in between, and the impulse of weight w that compensates it at the end of the
    cycle acts at x_{n+1}.  The excess angular momentum is

        (∫(x − x_n) dt − w (x_{n+1} − x_n)) × F̄

    Returns
    -------
    float
        Sum of the magnitudes of the corrections of all grains [J s].
    """
    corrected = 0.0
    for i in range(grains.mass.size):
        moved = nearest_image(sub(load(grains.position, i), load(long_range.past_position, i)), span)
        excess = cross(axpy(-weight, moved, load(long_range.path, i)), load(long_range.constant_force, i))
        accrue(grains.spin, i, scale(-1.0 / grains.inertia[i], excess))
        corrected += math.sqrt(dot(excess, excess))
    return corrected


@loop
def apply_impulse(grains, long_range, dt):
    """v += ΔF dt/m, ω += ΔM dt/I, with the difference of the long-range loads from their constant part."""
    for i in range(grains.mass.size):
        force = sub(load(long_range.force, i), load(long_range.constant_force, i))
        torque = sub(load(long_range.torque, i), load(long_range.constant_torque, i))
        accrue(grains.velocity, i, scale(dt / grains.mass[i], force))
        accrue(grains.spin, i, scale(dt / grains.inertia[i], torque))


@loop
def mark_every_step(contacts, count):
    """Record that the pair forces of all contacts act in every step."""
    for c in range(count[CONTACTS]):
        contacts.every_step[c] = 1


@functools.cache
def contact_pair_loops(pair: Callable) -> tuple[Callable, Callable, Callable]:
    """Loops that treat the long-range loads of grains in contact apart from those of all other pairs.

    Pairs in contact oscillate at contact frequencies, other pairs hardly at all.  Therefore the loads of contact pairs
    are evaluated in every step, and the cycle covers the other pairs.

    Parameters
    ----------
    pair : Callable
        `LongRangeSums.pair` of a long-range force.

    Returns
    -------
    add_contact_pairs : Callable
        Adds them to the contact loads before these are gathered; vectorises.
    subtract_contact_pairs : Callable
        Subtracts them from the long-range loads just summed.
    reassign_contact_pairs : Callable
        Between two cycles: new contacts (`every_step` 0) leave the long-range loads, broken ones (BROKEN_FLAG) return;
        `mark_every_step` follows when this is done for all pair forces.
    """

    @loop
    def add_contact_pairs(grains, contacts, count, span, parameters):
        for c in range(padded_contact_count(contacts, np.uint64(count[CONTACTS]))):
            force, torque1, torque2 = pair(grains, span, parameters, contacts.pair[0, c], contacts.pair[1, c])
            part = 1.0 if contacts.every_step[c] == 1 else 0.0
            accrue(contacts.force, c, scale(part, force))
            accrue(contacts.torque1, c, scale(part, torque1))
            accrue(contacts.torque2, c, scale(part, torque2))

    @loop
    def subtract_contact_pairs(grains, contacts, count, long_range, span, parameters):
        for c in range(count[CONTACTS]):
            if contacts.every_step[c] == 1:
                i, j = contacts.pair[0, c], contacts.pair[1, c]
                force, torque1, torque2 = pair(grains, span, parameters, i, j)
                accrue(long_range.force, i, scale(-1.0, force))
                accrue(long_range.force, j, force)
                accrue(long_range.torque, i, scale(-1.0, torque1))
                accrue(long_range.torque, j, scale(-1.0, torque2))

    @loop
    def reassign_contact_pairs(grains, contacts, count, long_range, span, parameters):
        for c in range(count[CONTACTS]):
            broken = contacts.flag[c] == BROKEN_FLAG
            if broken or contacts.every_step[c] == 0:
                i, j = contacts.pair[0, c], contacts.pair[1, c]
                force, torque1, torque2 = pair(grains, span, parameters, i, j)
                sign = 1.0 if broken else -1.0
                if not (broken and contacts.every_step[c] == 0):
                    accrue(long_range.force, i, scale(sign, force))
                    accrue(long_range.force, j, scale(-sign, force))
                    accrue(long_range.torque, i, scale(sign, torque1))
                    accrue(long_range.torque, j, scale(sign, torque2))

    return add_contact_pairs, subtract_contact_pairs, reassign_contact_pairs
