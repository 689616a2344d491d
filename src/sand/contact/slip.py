"""First pass over contacts: per block, a loop that only flags contacts beyond a limit, or one that lets them slip.

The first loop (`update.contact_loop`) only flags contacts beyond a limit, and `events.update_flagged_contacts` handles
them one by one.  In strongly excited aggregates most contacts slip in every step.  Blocks in which more than 10 % of
the contacts were flagged in the last step therefore use `_loop_with_slip`, which computes slip for every contact and
selects the result where a limit is exceeded.  Both loops are free of branches, so that they vectorise, and give the
same results.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler.jit import formula, loop
from ..numerics.quaternion import turned_back, turned_by
from ..numerics.vec import axpy, dot, load, load4, put, scale, sub
from ..state.arrays import BLOCK as CONTACTS_PER_BLOCK
from ..state.state import BREAKING, ROLLING, SLIDING, SLIPPED, TWISTING
from . import jkr, tangential
from .law import Pose, after_slip, contact_load, displacements_of, exceeds_limits, scaled_stiffness, slip_losses
from .update import (
    PENDING_FLAG,
    SLIPPED_FLAG,
    contact_loop,
    load_constants,
    padded_contact_count,
    pose_at_step_end,
    twist_increment,
    uniform_contacts,
)

BLOCK = np.uint64(CONTACTS_PER_BLOCK)
"""Contacts per block."""
SLIP_FRACTION = 0.1
"""Fraction of a block's contacts flagged in the last step, above which the block uses `_loop_with_slip`."""


class SlipSums(NamedTuple):
    """Counts and energy losses of a pass over contacts."""

    pending: float  # contacts to be handled one by one
    slipped: float  # contacts that slipped
    slid: float  # energies [J] dissipated by sliding, rolling and twisting
    rolled: float
    twisted: float


@loop
def _displacements_at_step_start(grains, contacts, c, pose, twist, constants, dt):
    """Displacements at the start of the step that led to this pose; `twist` is the twist at that time."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    relative_velocity = sub(load(grains.velocity, i), load(grains.velocity, j))
    separation = axpy(-dt, relative_velocity, scale(pose.distance, pose.n))
    distance = math.sqrt(dot(separation, separation))
    start_pose = Pose(
        scale(1.0 / distance, separation),
        distance,
        turned_by(scale(-dt, load(grains.spin, i)), pose.n1),
        turned_by(scale(-dt, load(grains.spin, j)), pose.n2),
        twist,
    )
    r1, r2 = grains.radius[i], grains.radius[j]
    return displacements_of(start_pose, r1 + r2 - distance, r1, r2, constants)


@loop
def displacements_before(grains, contacts, c, pose, constants, dt):
    """Displacements at the start of the step, for a contact whose stored twist is that at the end."""
    twist = pose.twist - twist_increment(grains, contacts, c, pose, dt)
    return _displacements_at_step_start(grains, contacts, c, pose, twist, constants, dt)


@formula
def _select(condition, u, v):
    """Vector u where the condition holds, else v."""
    return u[0] if condition else v[0], u[1] if condition else v[1], u[2] if condition else v[2]


@formula
def loss_row(channel):
    """Row of `ContactArrays.lost` for a loss channel other than breaking, which has no row."""
    return channel - 1 if channel > BREAKING else channel


@loop
def _add_to_contact_losses(losses, c, slid, rolled, twisted):
    """Add energies [J] dissipated by contact c to its losses."""
    losses[loss_row(SLIDING), c] += slid
    losses[loss_row(ROLLING), c] += rolled
    losses[loss_row(TWISTING), c] += twisted


@loop
def _loop_with_slip(grains, contacts, first, last, column, span, law, dt):
    """Version of `contact_loop` in which contacts beyond a limit slip.

    Contacts that break, or are compressed beyond the range of the JKR polynomial, are only flagged.
    """
    pending = slipped = slid = rolled = twisted = 0.0
    for k in range(last - first):
        c = first + k
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        constants = load_constants(contacts.constants, column + k)
        r1, r2 = grains.radius[i], grains.radius[j]
        pointer1, pointer2 = load(contacts.pointer1, c), load(contacts.pointer2, c)
        pose = pose_at_step_end(grains, contacts, span, c, dt)
        overlap = r1 + r2 - pose.distance
        s = jkr.stretch(overlap, constants.pull_off_overlap)
        y = jkr.polynomial_root(s)
        constants_now = scaled_stiffness(constants, y, law.follow)
        displacements = displacements_of(pose, overlap, r1, r2, constants)
        needs_event = (overlap < -constants.break_overlap) | (s > jkr.POLYNOMIAL_RANGE)
        slips = exceeds_limits(displacements, pose.n, constants) & (not needs_event)
        # both cases are computed and selected from at the end: branches and conditional stores prevent vectorisation
        start = _displacements_at_step_start(grains, contacts, c, pose, contacts.twist[c], constants, dt)
        target = after_slip(displacements, pose.n, constants, law.reset)
        n1, n2 = tangential.pointers_for(target.slide, target.roll, pose.n, r1, r2)
        body1 = turned_back(load4(grains.orientation, i), n1)
        body2 = turned_back(load4(grains.orientation, j), n2)
        n1, n2 = _select(slips, n1, pose.n1), _select(slips, n2, pose.n2)
        new_pose = Pose(pose.n, pose.distance, n1, n2, target.twist if slips else pose.twist)
        left = displacements_of(new_pose, overlap, r1, r2, constants)
        lost = slip_losses(start, displacements, left, constants_now)
        lost = _select(slips, lost, (0.0, 0.0, 0.0))
        force, torque1, torque2 = contact_load(new_pose, overlap, y, r1, r2, constants_now)
        put(contacts.pointer1, c, _select(slips, body1, pointer1))
        put(contacts.pointer2, c, _select(slips, body2, pointer2))
        contacts.twist[c] = new_pose.twist
        put(contacts.force, c, force)
        put(contacts.torque1, c, torque1)
        put(contacts.torque2, c, torque2)
        contacts.flag[c] = PENDING_FLAG if needs_event else SLIPPED_FLAG if slips else 0
        _add_to_contact_losses(contacts.lost, c, lost[0], lost[1], lost[2])
        pending += 1.0 if needs_event else 0.0
        slipped += 1.0 if slips else 0.0
        slid += lost[0]
        rolled += lost[1]
        twisted += lost[2]
    return SlipSums(pending, slipped, slid, rolled, twisted)


@loop
def contact_pass(grains, contacts, first, last, span, law, dt):
    """Update twist, loads and flag of the contacts first … last − 1 (uint64), block by block.

    With stiffnesses that follow a(δ) all contacts beyond a limit stay flagged: the work of the stiffness change must be
    logged before they slip.

    Returns
    -------
    SlipSums
        Contacts that remain flagged, and contacts that slipped with their losses.
    """
    pending = slipped = slid = rolled = twisted = 0.0
    for b in range((last - first + BLOCK - np.uint64(1)) // BLOCK):
        begin = first + b * BLOCK
        end = begin + BLOCK if begin + BLOCK < last else last
        column = np.uint64(0) if uniform_contacts(contacts) else begin
        slipped_before = 0.0
        for k in range(end - begin):
            slipped_before += 1.0 if contacts.flag[begin + k] > 0 else 0.0
        if slipped_before > SLIP_FRACTION * (end - begin) and not law.follow:
            part = _loop_with_slip(grains, contacts, begin, end, column, span, law, dt)
            pending += part.pending
            slipped += part.slipped
            slid += part.slid
            rolled += part.rolled
            twisted += part.twisted
        else:
            padded = padded_contact_count(contacts, end)
            pending += contact_loop(grains, contacts, begin, padded, end, column, span, law, dt)
    return SlipSums(pending, slipped, slid, rolled, twisted)


@loop
def log_slip_sums(count, lost, sums):
    """Add slip events and losses of a pass to the counters and to the energy table."""
    count[SLIPPED] += int(sums.slipped)
    lost[SLIDING] += sums.slid
    lost[ROLLING] += sums.rolled
    lost[TWISTING] += sums.twisted


@loop
def store_slip_sums(rows, b, sums):
    """Store the sums of a pass in row b of a (B, ≥ 5) array."""
    rows[b, 0] = sums.pending
    rows[b, 1] = sums.slipped
    rows[b, 2] = sums.slid
    rows[b, 3] = sums.rolled
    rows[b, 4] = sums.twisted


@loop
def load_slip_sums(rows, b):
    """Sums stored in row b by `store_slip_sums`."""
    return SlipSums(rows[b, 0], rows[b, 1], rows[b, 2], rows[b, 3], rows[b, 4])
