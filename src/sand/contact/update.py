"""Contacts: a pass per contact that vectorises."""

import math

import numpy as np

from ..box import nearest_image
from ..compiler.jit import COMPILED, loop, rare
from ..numerics.quaternion import turned
from ..numerics.simd import round_up_to_simd_width
from ..numerics.vec import across, dot, load, load4, put, scale, sub
from ..state.state import CONTACT_STEP, CONTACTS
from . import jkr, tangential
from . import law as contact_law
from .pair_types import kinds

FEW = 4
"""Contacts that are faster done one by one than as a vector."""
PENDING_FLAG, BROKEN_FLAG, SLIPPED_FLAG = 1, 2, 3
"""Flags of a contact that passed a limit: to be settled; broken in this step; moved in the pass over all contacts."""


@loop
def uniform_contacts(contacts):
    """Do all contacts share their constants?  (If there is room for BLOCK of them, what is told does not matter.)"""
    return contacts.bond.shape[1] != contacts.flag.size


@loop
def bond_at(contacts, c):
    """The stored constants of contact c."""
    return bond_in(contacts.bond, 0 if uniform_contacts(contacts) else c)


@loop
def damping_at(contacts, c):
    """The damping force [N] of contact c, along n on grain 1."""
    return contacts.damped[c] if contacts.damped.size > 0 else 0.0


@loop
def bond_in(b, c):
    """Column c of a (K, …) array of constants."""
    return contact_law.Bond(
        b[0, c],
        b[1, c],
        b[2, c],
        b[3, c],
        b[4, c],
        b[5, c],
        b[6, c],
        b[7, c],
        b[8, c],
        b[9, c],
        b[10, c],
        b[11, c],
        b[12, c],
        b[13, c],
        b[14, c],
    )


@loop
def pose_at(grains, contacts, span, c, twist):
    """How the grains of contact c stand to each other now, with a given twist φ [rad]."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    distance = math.sqrt(dot(apart, apart))
    return contact_law.Pose(
        scale(1.0 / distance, apart),
        distance,
        turned(load4(grains.orientation, i), load(contacts.pointer1, c)),
        turned(load4(grains.orientation, j), load(contacts.pointer2, c)),
        twist,
    )


@loop
def twist_gain(grains, contacts, c, pose, dt):
    """Twist gained in the step that led to this pose, from mid-step velocities and spins."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    moving = across(sub(load(grains.velocity, i), load(grains.velocity, j)), pose.n)
    rate = tangential.twisting_rate(pose.n, load(grains.spin, i), load(grains.spin, j), moving, pose.distance, dt)
    return dt * rate


@loop
def pose_after(grains, contacts, span, c, dt):
    """How the grains of contact c stand at the end of a step of dt, with the twist that they gained in it."""
    pose = pose_at(grains, contacts, span, c, 0.0)
    twist = contacts.twist[c] + twist_gain(grains, contacts, c, pose, dt)
    return contact_law.Pose(pose.n, pose.distance, pose.n1, pose.n2, twist)


@loop
def contact_loop(grains, contacts, first, last, used, column, span, law, dt):
    """Twist, loads and flag of the contacts first…last − 1 (uint64); how many passed a limit.  Vectorises.

    Parameters
    ----------
    column
        of the constants of the first; the others' follow.
    used
        number of contacts in use (uint64); columns beyond it may be passed over, to no effect.
    """
    waiting = 0.0
    for k in range(last - first):
        c = first + k
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        bond = bond_in(contacts.bond, column + k)
        r1, r2 = grains.radius[i], grains.radius[j]
        pose = pose_after(grains, contacts, span, c, dt)
        overlap = r1 + r2 - pose.distance
        s = jkr.stretch(overlap, bond.pull_off_overlap)
        y = jkr.root_in_reach(s)
        now = contact_law.stiffened(bond, y, law.follow)
        push, torque1, torque2 = contact_law.contact_load(pose, overlap, y, r1, r2, now)
        strain = contact_law.strain_of(pose, overlap, r1, r2, bond)
        beyond = contact_law.beyond_limits(strain, pose.n, bond) | (s > jkr.STRETCH_OF_POLYNOMIAL)
        contacts.twist[c] = pose.twist
        put(contacts.push, c, push)
        put(contacts.torque1, c, torque1)
        put(contacts.torque2, c, torque2)
        contacts.flag[c] = PENDING_FLAG if beyond else 0
        waiting += 1.0 if beyond & (c < used) else 0.0
    return waiting


@loop
def padded_contact_count(contacts, number):
    """The number of columns to pass over for so many contacts: if many are left over, they are a vector of their own.

    What is beyond the contacts in use is worked out as well, and never read.  Both are uint64.
    """
    whole = round_up_to_simd_width(number, np.uint64(FEW))
    return whole if COMPILED and whole <= np.uint64(contacts.pair.shape[1]) else number


@rare
def write_loads(grains, contacts, span, law, c):
    """Loads of one contact from its stored pointers and twist, at any compression."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    r1, r2 = grains.radius[i], grains.radius[j]
    bond = bond_at(contacts, c)
    pose = pose_at(grains, contacts, span, c, contacts.twist[c])
    overlap = r1 + r2 - pose.distance
    y = jkr.root(jkr.stretch(overlap, bond.pull_off_overlap))
    now = contact_law.stiffened(bond, y, law.follow)
    push, torque1, torque2 = contact_law.contact_load(pose, overlap, y, r1, r2, now)
    put(contacts.push, c, push)
    put(contacts.torque1, c, torque1)
    put(contacts.torque2, c, torque2)


@rare
def contact_step(contacts, pair_list, count, n, clock, per_period):
    """The longest step [s] while there are contacts: fastest period / per_period, less above 6 neighbours.

    Pairs that may touch soon count as well, so that a contact of small grains never begins at the step of large
    ones.  Infinite without contacts: then every closing pair is looked at in every step.
    """
    fastest, most = 0.0, 0
    for c in range(count[CONTACTS]):
        fastest = max(fastest, bond_at(contacts, c).fastest)
    for g in range(n):
        most = max(most, int(contacts.start[g + 1]) - int(contacts.start[g]))
    crowd = max(1.0, most / 6.0)
    clock[CONTACT_STEP] = math.inf
    if fastest > 0.0:
        clock[CONTACT_STEP] = 2.0 * math.pi / math.sqrt(fastest * crowd) / per_period
        for k in range(kinds(pair_list, count)):
            clock[CONTACT_STEP] = min(clock[CONTACT_STEP], pair_list.step[k])
        # few digits, so that sums of steps are exact: cycles of long-range forces then keep momenta to rounding
        clock[CONTACT_STEP] = np.float64(np.float32(clock[CONTACT_STEP]))
