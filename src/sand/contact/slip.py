"""The pass over all contacts, quiet ones and those that slide, roll or twist beyond a limit.

In shaken aggregates most contacts move in every step.  Blocks of which many moved in the step before get a pass that
moves them at once, without a branch; elsewhere `events.update_flagged_contacts` moves the few that must.  Both do the same.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler.jit import formula, loop
from ..numerics.quaternion import turned_back, turned_by
from ..numerics.vec import axpy, dot, load, load4, put, scale, sub
from ..state.arrays import BLOCK as JUDGED_TOGETHER
from ..state.state import BREAKING, ROLLING, SLIDING, SLIPPED, TWISTING
from . import jkr, tangential
from . import law as contact_law
from .update import (
    PENDING_FLAG,
    SLIPPED_FLAG,
    bond_in,
    contact_loop,
    padded_contact_count,
    pose_after,
    twist_gain,
    uniform_contacts,
)

BLOCK = np.uint64(JUDGED_TOGETHER)
"""Contacts that are judged together."""
SLIP_FRACTION = 0.1
"""Share of a block's contacts that passed a limit in the step before, from which it gets the longer pass."""


class SlipSums(NamedTuple):
    """What a pass over contacts found and lost."""

    waiting: float  # contacts that wait to be settled one by one
    moved: float  # those that have moved
    slid: float  # energies [J] that they lost
    rolled: float
    twisted: float


@loop
def _strain_at_start(grains, contacts, c, pose, twist, bond, dt):
    """Displacements at the start of the step that led to this pose, when the twist was `twist`."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    moving = sub(load(grains.velocity, i), load(grains.velocity, j))
    apart = axpy(-dt, moving, scale(pose.distance, pose.n))
    distance = math.sqrt(dot(apart, apart))
    earlier = contact_law.Pose(
        scale(1.0 / distance, apart),
        distance,
        turned_by(scale(-dt, load(grains.spin, i)), pose.n1),
        turned_by(scale(-dt, load(grains.spin, j)), pose.n2),
        twist,
    )
    r1, r2 = grains.radius[i], grains.radius[j]
    return contact_law.strain_of(earlier, r1 + r2 - distance, r1, r2, bond)


@loop
def strain_before(grains, contacts, c, pose, bond, dt):
    """The same for a contact whose twist is that of the pose."""
    twist = pose.twist - twist_gain(grains, contacts, c, pose, dt)
    return _strain_at_start(grains, contacts, c, pose, twist, bond, dt)


@formula
def _chosen(first, u, v):
    """u if `first`, else v: vectors."""
    return u[0] if first else v[0], u[1] if first else v[1], u[2] if first else v[2]


@formula
def record_of(channel):
    """The row of a contact's own record for a channel of losses, but for breaking, which has none."""
    return channel - 1 if channel > BREAKING else channel


@loop
def _keep_record(own, c, slid, rolled, twisted):
    """Add what contact c lost [J] to its own record."""
    own[record_of(SLIDING), c] += slid
    own[record_of(ROLLING), c] += rolled
    own[record_of(TWISTING), c] += twisted


@loop
def _slip_loop(grains, contacts, first, last, column, span, law, dt):
    """What `contact_loop` does, but contacts beyond a limit are moved at once unless they break or are pressed hard."""
    waiting = moved = slid = rolled = twisted = 0.0
    for k in range(last - first):
        c = first + k
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        bond = bond_in(contacts.bond, column + k)
        r1, r2 = grains.radius[i], grains.radius[j]
        pointer1, pointer2 = load(contacts.pointer1, c), load(contacts.pointer2, c)
        pose = pose_after(grains, contacts, span, c, dt)
        overlap = r1 + r2 - pose.distance
        s = jkr.stretch(overlap, bond.pull_off_overlap)
        y = jkr.root_in_reach(s)
        now = contact_law.stiffened(bond, y, law.follow)
        strain = contact_law.strain_of(pose, overlap, r1, r2, bond)
        odd = (overlap < -bond.break_overlap) | (s > jkr.STRETCH_OF_POLYNOMIAL)
        moves = contact_law.beyond_limits(strain, pose.n, bond) & (not odd)
        # all is worked out for all and chosen from at the end: a branch, or a store under a condition, stops SIMD
        before = _strain_at_start(grains, contacts, c, pose, contacts.twist[c], bond, dt)
        wish = contact_law.yielded(strain, pose.n, bond, law.release)
        n1, n2 = tangential.pointers_for(wish.slide, wish.roll, pose.n, r1, r2)
        back1 = turned_back(load4(grains.orientation, i), n1)
        back2 = turned_back(load4(grains.orientation, j), n2)
        n1, n2 = _chosen(moves, n1, pose.n1), _chosen(moves, n2, pose.n2)
        there = contact_law.Pose(pose.n, pose.distance, n1, n2, wish.twist if moves else pose.twist)
        left = contact_law.strain_of(there, overlap, r1, r2, bond)
        lost = contact_law.lost_by_yielding(before, strain, left, now)
        lost = _chosen(moves, lost, (0.0, 0.0, 0.0))
        push, torque1, torque2 = contact_law.contact_load(there, overlap, y, r1, r2, now)
        put(contacts.pointer1, c, _chosen(moves, back1, pointer1))
        put(contacts.pointer2, c, _chosen(moves, back2, pointer2))
        contacts.twist[c] = there.twist
        put(contacts.push, c, push)
        put(contacts.torque1, c, torque1)
        put(contacts.torque2, c, torque2)
        contacts.flag[c] = PENDING_FLAG if odd else SLIPPED_FLAG if moves else 0
        _keep_record(contacts.lost, c, lost[0], lost[1], lost[2])
        waiting += 1.0 if odd else 0.0
        moved += 1.0 if moves else 0.0
        slid += lost[0]
        rolled += lost[1]
        twisted += lost[2]
    return SlipSums(waiting, moved, slid, rolled, twisted)


@loop
def contact_pass(grains, contacts, first, last, span, law, dt):
    """Twist, loads and flag of the contacts first…last − 1 (uint64); most of those beyond a limit move.

    Stiffnesses that follow a(δ) are booked between pass and moving: then all wait.
    """
    waiting = moved = slid = rolled = twisted = 0.0
    for b in range((last - first + BLOCK - np.uint64(1)) // BLOCK):
        begin = first + b * BLOCK
        end = begin + BLOCK if begin + BLOCK < last else last
        column = np.uint64(0) if uniform_contacts(contacts) else begin
        busy = 0.0
        for k in range(end - begin):
            busy += 1.0 if contacts.flag[begin + k] > 0 else 0.0
        if busy > SLIP_FRACTION * (end - begin) and not law.follow:
            part = _slip_loop(grains, contacts, begin, end, column, span, law, dt)
            waiting += part.waiting
            moved += part.moved
            slid += part.slid
            rolled += part.rolled
            twisted += part.twisted
        else:
            whole = padded_contact_count(contacts, end)
            waiting += contact_loop(grains, contacts, begin, whole, end, column, span, law, dt)
    return SlipSums(waiting, moved, slid, rolled, twisted)


@loop
def log_slip_sums(count, lost, passed):
    """Add what a pass moved and lost to the books."""
    count[SLIPPED] += int(passed.moved)
    lost[SLIDING] += passed.slid
    lost[ROLLING] += passed.rolled
    lost[TWISTING] += passed.twisted


@loop
def store_slip_sums(rows, b, passed):
    """Leave what a pass found in row b of a (B, 5 or more) array."""
    rows[b, 0] = passed.waiting
    rows[b, 1] = passed.moved
    rows[b, 2] = passed.slid
    rows[b, 3] = passed.rolled
    rows[b, 4] = passed.twisted


@loop
def load_slip_sums(rows, b):
    """What `store_slip_sums` left there."""
    return SlipSums(rows[b, 0], rows[b, 1], rows[b, 2], rows[b, 3], rows[b, 4])
