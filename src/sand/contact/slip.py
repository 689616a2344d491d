"""The pass over all contacts, quiet ones and those that slide, roll or twist beyond a limit.

In shaken aggregates most contacts move in every step.  Blocks of which many moved in the step before get a pass that
moves them at once, without a branch; elsewhere `events.settle_flagged` moves the few that must.  Both do the same.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler.jit import formula, loop
from ..numerics.quaternion import turned_back, turned_by
from ..numerics.vec import axpy, dot, load, load4, put, scale, sub
from ..state.arrays import BLOCK as JUDGED_TOGETHER
from ..state.state import BREAKING, MOVED, ROLLING, SLIDING, TWISTING
from . import jkr, tangential
from . import law as law_of
from .update import WAITS, YIELDED, alike, bond_in, pose_after, quiet_pass, twist_gain, whole_vectors

BLOCK = np.uint64(JUDGED_TOGETHER)
"""Contacts that are judged together."""
BUSY = 0.1
"""Share of a block's contacts that passed a limit in the step before, from which it gets the longer pass."""


class Passed(NamedTuple):
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
    earlier = law_of.Pose(
        scale(1.0 / distance, apart),
        distance,
        turned_by(scale(-dt, load(grains.spin, i)), pose.n1),
        turned_by(scale(-dt, load(grains.spin, j)), pose.n2),
        twist,
    )
    r1, r2 = grains.radius[i], grains.radius[j]
    return law_of.strain_of(earlier, r1 + r2 - distance, r1, r2, bond)


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
def _busy_pass(grains, contacts, first, last, column, span, law, dt):
    """What `quiet_pass` does, but contacts beyond a limit are moved at once unless they break or are pressed hard."""
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
        now = law_of.stiffened(bond, y, law.follow)
        strain = law_of.strain_of(pose, overlap, r1, r2, bond)
        odd = (overlap < -bond.break_overlap) | (s > jkr.STRETCH_OF_POLYNOMIAL)
        moves = law_of.beyond_limits(strain, pose.n, bond) & (not odd)
        # all is worked out for all and chosen from at the end: a branch, or a store under a condition, stops SIMD
        before = _strain_at_start(grains, contacts, c, pose, contacts.twist[c], bond, dt)
        wish = law_of.yielded(strain, pose.n, bond, law.release)
        n1, n2 = tangential.pointers_for(wish.slide, wish.roll, pose.n, r1, r2)
        back1 = turned_back(load4(grains.orientation, i), n1)
        back2 = turned_back(load4(grains.orientation, j), n2)
        n1, n2 = _chosen(moves, n1, pose.n1), _chosen(moves, n2, pose.n2)
        there = law_of.Pose(pose.n, pose.distance, n1, n2, wish.twist if moves else pose.twist)
        left = law_of.strain_of(there, overlap, r1, r2, bond)
        lost = law_of.lost_by_yielding(before, strain, left, now)
        lost = _chosen(moves, lost, (0.0, 0.0, 0.0))
        push, torque1, torque2 = law_of.contact_load(there, overlap, y, r1, r2, now)
        put(contacts.pointer1, c, _chosen(moves, back1, pointer1))
        put(contacts.pointer2, c, _chosen(moves, back2, pointer2))
        contacts.twist[c] = there.twist
        put(contacts.push, c, push)
        put(contacts.torque1, c, torque1)
        put(contacts.torque2, c, torque2)
        contacts.flag[c] = WAITS if odd else YIELDED if moves else 0
        _keep_record(contacts.lost, c, lost[0], lost[1], lost[2])
        waiting += 1.0 if odd else 0.0
        moved += 1.0 if moves else 0.0
        slid += lost[0]
        rolled += lost[1]
        twisted += lost[2]
    return Passed(waiting, moved, slid, rolled, twisted)


@loop
def contact_pass(grains, contacts, first, last, span, law, dt):
    """Twist, loads and flag of the contacts first…last − 1 (uint64); most of those beyond a limit move.

    Stiffnesses that follow a(δ) are booked between pass and moving: then all wait.
    """
    waiting = moved = slid = rolled = twisted = 0.0
    for b in range((last - first + BLOCK - np.uint64(1)) // BLOCK):
        begin = first + b * BLOCK
        end = begin + BLOCK if begin + BLOCK < last else last
        column = np.uint64(0) if alike(contacts) else begin
        busy = 0.0
        for k in range(end - begin):
            busy += 1.0 if contacts.flag[begin + k] > 0 else 0.0
        if busy > BUSY * (end - begin) and not law.follow:
            part = _busy_pass(grains, contacts, begin, end, column, span, law, dt)
            waiting += part.waiting
            moved += part.moved
            slid += part.slid
            rolled += part.rolled
            twisted += part.twisted
        else:
            whole = whole_vectors(contacts, end)
            waiting += quiet_pass(grains, contacts, begin, whole, end, column, span, law, dt)
    return Passed(waiting, moved, slid, rolled, twisted)


@loop
def book_passed(count, lost, passed):
    """Add what a pass moved and lost to the books."""
    count[MOVED] += int(passed.moved)
    lost[SLIDING] += passed.slid
    lost[ROLLING] += passed.rolled
    lost[TWISTING] += passed.twisted


@loop
def keep_passed(rows, b, passed):
    """Leave what a pass found in row b of a (B, 5 or more) array."""
    rows[b, 0] = passed.waiting
    rows[b, 1] = passed.moved
    rows[b, 2] = passed.slid
    rows[b, 3] = passed.rolled
    rows[b, 4] = passed.twisted


@loop
def kept_passed(rows, b):
    """What `keep_passed` left there."""
    return Passed(rows[b, 0], rows[b, 1], rows[b, 2], rows[b, 3], rows[b, 4])
