"""Contact forces, first pass: one update of all contacts, in loops that vectorise, which stores loads per contact.

Contacts are updated in two passes.  The pass over contacts computes pose, displacements, force and torques of each
contact from its two grains and stores them per contact; no two iterations write to the same memory, so the loop
vectorises.  The gather pass over grains (`gather`) then sums the stored forces and torques of the contacts of each
grain in a fixed order.

The update (`contact_loop`) exists in two variants that give the same results.  `_flag_contact` only flags contacts
beyond a limit, which `events.slip_and_break_loop` then handles one by one.  In strongly excited aggregates most
contacts slip in every step: blocks in which more than 10 % of the contacts were flagged in the last step use
`_slip_contact`, which computes slip for every contact and selects the result where a limit is exceeded.  Both are free
of branches.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..basics.arrays import CONTACTS_PER_BLOCK
from ..basics.state import (
    CONTACT_STEP,
    CONTACTS,
    SLIPPED,
)
from ..compiler.jit import COMPILED, formula, loop, rare
from ..numerics.quaternion import turned, turned_back, turned_by
from ..numerics.simd import float_bits, float_from_bits, round_up_to_simd_width
from ..numerics.vec import axpy, load, load4, nearest_image, put, scale, sub
from . import tangential
from .constants_table import FASTEST_MODE, column_loops, uniform_contacts
from .damping import NONE, Held, damping_loops, store_loads
from .law import ContactLaw
from .losses import add_damping_energies, add_slip_energies, add_slip_losses
from .mechanics import (
    Pose,
    after_slip,
    contact_load,
    displacements_of,
    exceeds_limits,
    pose_of,
    scaled_stiffness,
    slip_losses,
)
from .pair_types import pair_type_count
from .transitions import PENDING_FLAG, SLIPPED_FLAG

BLOCK_SIZE = np.uint64(CONTACTS_PER_BLOCK)
"""Contacts per block."""
SLIP_FRACTION = 0.1
"""Fraction of a block's contacts flagged in the last step, above which the block uses `_slip_contact`."""
MIN_REMAINDER = 4
"""Remaining contacts from which a padded SIMD vector is faster than a scalar loop."""


class PassVariant(NamedTuple):
    """What the pass over contacts computes; loops are compiled without what a simulation does not need."""

    damping: str = NONE  # of `damping`: NONE, DASHPOTS or THERMAL
    periodic: bool = True  # nearest images; False for open boxes
    follow: bool = False  # stiffnesses that follow the contact radius
    adhesive: bool = False  # whether all contacts adhere


class ContactStep(NamedTuple):
    """What is the same for all contacts in a step."""

    span: Any  # box.Span, the box
    settings: Any  # ContactParameters, settings of the contact model
    number: int  # of the step, for the noise of damping
    dt: float  # length of the step [s]


class ContactRange(NamedTuple):
    """A range of contacts, all uint64."""

    first: Any  # contacts first … last − 1
    last: Any
    used: Any  # contacts in use; columns beyond it may be computed as padding, and are never read
    column: Any  # column of the constants of the first contact; those of the others follow


class Reached(NamedTuple):
    """A contact at the end of a step, before slip."""

    pose: Any  # mechanics.Pose
    displacements: Any  # mechanics.Displacements
    constants: Any  # law.ContactConstants
    present: Any  # these with the present stiffnesses
    valid: bool  # whether the contact radius is


class ContactSums(NamedTuple):
    """Counts, energy losses and the largest overlap of a pass over contacts."""

    pending: float  # contacts to be handled one by one
    slipped: float  # contacts that slipped
    slid: float  # energies [J] dissipated by sliding, rolling and twisting
    rolled: float
    twisted: float
    damped_normal: float  # energies [J] dissipated by the dashpots of the four modes
    damped_sliding: float
    damped_rolling: float
    damped_twisting: float
    deepest: float  # largest overlap, in radii of the smaller grain; 0 if no grains overlap


@loop
def _separation(grains, contacts, span, c):
    """x1 − x2 [m] of the grains of contact c in an open box."""
    return sub(load(grains.position, contacts.pair[0, c]), load(grains.position, contacts.pair[1, c]))


@loop
def _nearest_separation(grains, contacts, span, c):
    """x1 − x2 [m] of the grains of contact c in any box."""
    return nearest_image(_separation(grains, contacts, span, c), span)


@loop
def pose_at(grains, contacts, span, c, twist):
    """Relative pose of the grains of contact c now, with the given twist φ [rad]."""
    return _pose_apart(grains, contacts, _nearest_separation(grains, contacts, span, c), c, twist)


@loop
def _pose_apart(grains, contacts, separation, c, twist):
    """As `pose_at`, for given x1 − x2 [m]."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    n1 = turned(load4(grains.orientation, i), load(contacts.pointer1, c))
    n2 = turned(load4(grains.orientation, j), load(contacts.pointer2, c))
    return pose_of(separation, n1, n2, twist)


@loop
def twist_increment(grains, contacts, c, pose, dt):
    """Increase of the twist [rad] in the step that led to this pose, from mid-step velocities and spins."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    turn = sub(load(grains.spin, i), load(grains.spin, j))
    speed = sub(load(grains.velocity, i), load(grains.velocity, j))
    return dt * tangential.twisting_rate(pose.n, turn, speed, pose.inverse_distance, dt)


@loop
def _pose_at_step_end(grains, contacts, separation, c, dt):
    """Relative pose at the end of a step of dt [s], with the twist accumulated in the step."""
    pose = _pose_apart(grains, contacts, separation, c, 0.0)
    twist = contacts.twist[c] + twist_increment(grains, contacts, c, pose, dt)
    return Pose(pose.n, pose.distance, pose.inverse_distance, pose.n1, pose.n2, twist)


@loop
def _displacements_at_step_start(grains, contacts, c, pose, twist, constants, dt):
    """Displacements at the start of the step that led to this pose; `twist` is the twist at that time."""
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    relative_velocity = sub(load(grains.velocity, i), load(grains.velocity, j))
    separation = axpy(-dt, relative_velocity, scale(pose.distance, pose.n))
    n1 = turned_by(scale(-dt, load(grains.spin, i)), pose.n1)
    n2 = turned_by(scale(-dt, load(grains.spin, j)), pose.n2)
    start, r1, r2 = pose_of(separation, n1, n2, twist), grains.radius[i], grains.radius[j]
    return displacements_of(start, r1 + r2 - start.distance, r1, r2, constants)


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
def slipped_pose(displacements, pose, r1, r2, constants, reset):
    """Pose after slip: the pointers and the twist represent the displacements of `mechanics.after_slip`."""
    target = after_slip(displacements, pose.n, constants, reset)
    n1, n2 = tangential.pointers_for(target.slide, target.roll, pose.n, r1, r2)
    return Pose(pose.n, pose.distance, pose.inverse_distance, n1, n2, target.twist)


@loop
def _flag_contact(grains, contacts, c, reached, step):
    """Only flag a contact beyond a limit; returns its pose, the energies [J] dissipated by slip, and its flag."""
    exceeded = exceeds_limits(reached.displacements, reached.pose.n, reached.constants) | (not reached.valid)
    return reached.pose, (0.0, 0.0, 0.0), PENDING_FLAG if exceeded else 0


@loop
def _slip_contact(grains, contacts, c, reached, step):
    """As `_flag_contact`, but let a contact beyond a limit slip.

    Contacts that break, or whose contact radius is not valid, are only flagged.
    """
    pose, displacements, constants, present, valid = reached
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    r1, r2 = grains.radius[i], grains.radius[j]
    pointer1, pointer2 = load(contacts.pointer1, c), load(contacts.pointer2, c)
    needs_event = (displacements.overlap < -constants.break_overlap) | (not valid)
    slips = exceeds_limits(displacements, pose.n, constants) & (not needs_event)
    # both cases are computed and selected from at the end: branches and conditional stores prevent vectorisation
    start = _displacements_at_step_start(grains, contacts, c, pose, contacts.twist[c], constants, step.dt)
    slipped = slipped_pose(displacements, pose, r1, r2, constants, step.settings.reset)
    body1 = turned_back(load4(grains.orientation, i), slipped.n1)
    body2 = turned_back(load4(grains.orientation, j), slipped.n2)
    n1, n2 = _select(slips, slipped.n1, pose.n1), _select(slips, slipped.n2, pose.n2)
    twist = slipped.twist if slips else pose.twist
    new_pose = Pose(pose.n, pose.distance, pose.inverse_distance, n1, n2, twist)
    left = displacements_of(new_pose, displacements.overlap, r1, r2, constants)
    lost = slip_losses(start, displacements, left, present)
    lost = _select(slips, lost, (0.0, 0.0, 0.0))
    put(contacts.pointer1, c, _select(slips, body1, pointer1))
    put(contacts.pointer2, c, _select(slips, body2, pointer2))
    add_slip_losses(contacts.lost, c, lost)
    return new_pose, lost, PENDING_FLAG if needs_event else SLIPPED_FLAG if slips else 0


@functools.cache
def contact_loop(law: ContactLaw, handle_limits: Callable, variant: PassVariant) -> Callable:
    """The loop that updates a range of contacts, for a contact law and a rule for limits.

    The rule is `_flag_contact` or `_slip_contact`.
    """
    load_constants, radius_root = column_loops(law).load, law.fast_radius_root
    normal_force = (law.adhesive_force if variant.adhesive else None) or law.force
    contact_radius = (law.adhesive_radius if variant.adhesive else None) or law.contact_radius
    damp, follow = damping_loops(variant.damping).update, variant.follow
    apart = _nearest_separation if variant.periodic else _separation

    @loop
    def update_contacts(grains, contacts, part, step):
        """Update twist, loads and flag of a range of contacts.  The loop has no branches, so it vectorises.

        Parameters
        ----------
        grains, contacts : GrainArrays, ContactArrays
            Arrays of grains and contacts.
        part : ContactRange
            The range.
        step : ContactStep
            The step.

        Returns
        -------
        ContactSums
            Contacts that remain flagged, and contacts that slipped with their losses.
        """
        pending = slipped = 0
        slid = rolled = twisted = 0.0
        damped1 = damped2 = damped3 = damped4 = 0.0
        deepest = float_bits(0.0)  # the bits of a negative number are below 0
        for k in range(part.last - part.first):
            c = part.first + k
            i, j = contacts.pair[0, c], contacts.pair[1, c]
            constants = load_constants(contacts.constants, part.column + k)
            r1, r2 = grains.radius[i], grains.radius[j]
            separation = apart(grains, contacts, step.span, c)
            pose = _pose_at_step_end(grains, contacts, separation, c, step.dt)
            overlap = r1 + r2 - pose.distance
            y, valid = radius_root(overlap, constants)
            present = scaled_stiffness(constants, y, True) if follow else constants
            displacements = displacements_of(pose, overlap, r1, r2, constants)
            reached = Reached(pose, displacements, constants, present, valid)
            pose, lost, flag = handle_limits(grains, contacts, c, reached, step)
            normal = normal_force(overlap, y, constants)
            # a flagged contact is damped by events.slip_and_break_loop; padding columns hold no grains
            active = (flag != PENDING_FLAG) & (c < part.used)
            radius, springs = contact_radius(overlap, y, constants), contact_load(pose, normal, r1, r2, present)
            loads, dissipated = damp(grains, contacts, c, Held(pose, radius, constants), springs, active, step)
            damped1 += dissipated[0]
            damped2 += dissipated[1]
            damped3 += dissipated[2]
            damped4 += dissipated[3]
            contacts.twist[c] = pose.twist
            store_loads(contacts, c, loads)
            contacts.flag[c] = flag
            pending += 1 if (flag == PENDING_FLAG) & (c < part.used) else 0
            slipped += 1 if flag == SLIPPED_FLAG else 0
            deepest = max(deepest, float_bits(overlap * constants.derived.inverse_radius if c < part.used else 0.0))
            slid += lost[0]
            rolled += lost[1]
            twisted += lost[2]
        return ContactSums(
            float(pending), float(slipped), slid, rolled, twisted, damped1, damped2, damped3, damped4,
            float_from_bits(deepest),
        )  # fmt: skip

    return update_contacts


@loop
def padded_contact_count(contacts, number):
    """Number of columns (uint64) to compute for `number` contacts: padded to whole SIMD vectors where faster.

    Padding columns are computed and never read.
    """
    padded = round_up_to_simd_width(number, np.uint64(MIN_REMAINDER))
    return padded if COMPILED and padded <= np.uint64(contacts.pair.shape[1]) else number


@functools.cache
def contact_pass_loop(law: ContactLaw, variant: PassVariant) -> Callable:
    """The pass over a range of contacts, block by block, for one contact law."""
    flag_contacts = contact_loop(law, _flag_contact, variant)
    slip_contacts = contact_loop(law, _slip_contact, variant)
    follow = variant.follow

    @loop
    def contact_pass(grains, contacts, first, last, step):
        """Update the contacts first … last − 1 (uint64) in a step (`ContactStep`); result as for `contact_loop`.

        With stiffnesses that follow a(δ) all contacts beyond a limit stay flagged: the work of the stiffness change
        must be logged before they slip.
        """
        pending = slipped = slid = rolled = twisted = deepest = 0.0
        damped1 = damped2 = damped3 = damped4 = 0.0
        for b in range((last - first + BLOCK_SIZE - np.uint64(1)) // BLOCK_SIZE):
            begin = first + b * BLOCK_SIZE
            end = begin + BLOCK_SIZE if begin + BLOCK_SIZE < last else last
            column = np.uint64(0) if uniform_contacts(contacts) else begin
            slipped_before = 0.0
            for k in range(end - begin):
                slipped_before += 1.0 if contacts.flag[begin + k] > 0 else 0.0
            if not follow and slipped_before > SLIP_FRACTION * (end - begin):
                part = slip_contacts(grains, contacts, ContactRange(begin, end, end, column), step)
                slipped += part.slipped
                slid += part.slid
                rolled += part.rolled
                twisted += part.twisted
            else:
                padded = padded_contact_count(contacts, end)
                part = flag_contacts(grains, contacts, ContactRange(begin, padded, end, column), step)
            pending += part.pending
            damped1 += part.damped_normal
            damped2 += part.damped_sliding
            damped3 += part.damped_rolling
            damped4 += part.damped_twisting
            deepest = max(deepest, part.deepest)
        return ContactSums(pending, slipped, slid, rolled, twisted, damped1, damped2, damped3, damped4, deepest)

    return contact_pass


@loop
def log_contact_sums(count, lost, sums):
    """Add slip events and losses of a pass to the counters and to the energy table."""
    count[SLIPPED] += int(sums.slipped)
    add_slip_energies(lost, (sums.slid, sums.rolled, sums.twisted))
    add_damping_energies(lost, (sums.damped_normal, sums.damped_sliding, sums.damped_rolling, sums.damped_twisting))


@loop
def store_contact_sums(rows, b, sums):
    """Store the sums of a pass in row b of a (B, ≥ 10) array."""
    rows[b, 0] = sums.pending
    rows[b, 1] = sums.slipped
    rows[b, 2] = sums.slid
    rows[b, 3] = sums.rolled
    rows[b, 4] = sums.twisted
    rows[b, 5] = sums.damped_normal
    rows[b, 6] = sums.damped_sliding
    rows[b, 7] = sums.damped_rolling
    rows[b, 8] = sums.damped_twisting
    rows[b, 9] = sums.deepest


@loop
def load_contact_sums(rows, b):
    """Sums stored in row b by `store_contact_sums`."""
    return ContactSums(
        rows[b, 0], rows[b, 1], rows[b, 2], rows[b, 3], rows[b, 4], rows[b, 5], rows[b, 6], rows[b, 7], rows[b, 8],
        rows[b, 9],
    )  # fmt: skip


@functools.cache
def single_contact_loop(law: ContactLaw) -> Callable:
    """The function that computes the loads of one contact, for one contact law."""
    constants_at, radius_root, normal_force = column_loops(law).at, law.radius_root, law.force

    @rare
    def write_loads(grains, contacts, span, settings, c):
        """Compute the loads of contact c from its stored pointers and twist, at any compression."""
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        r1, r2 = grains.radius[i], grains.radius[j]
        constants = constants_at(contacts, c)
        pose = pose_at(grains, contacts, span, c, contacts.twist[c])
        overlap = r1 + r2 - pose.distance
        y = radius_root(overlap, constants)
        present = scaled_stiffness(constants, y, settings.follow)
        store_loads(contacts, c, contact_load(pose, normal_force(overlap, y, constants), r1, r2, present))

    return write_loads


@rare
def contact_step(contacts, pair_list, count, n, clock, per_period):
    """Set the longest step [s] allowed by contacts: shortest period / per_period, times √(6/z) for z > 6 contacts.

    Contact candidates are included, so that the step is short enough before two small grains touch.  The step is
    infinite without contacts: then the closing speeds of pairs are examined in every step.
    """
    squared_frequency, most_contacts = 0.0, 0
    for c in range(count[CONTACTS]):
        column = 0 if uniform_contacts(contacts) else c
        squared_frequency = max(squared_frequency, contacts.constants[FASTEST_MODE, column])
    for g in range(n):
        most_contacts = max(most_contacts, int(contacts.start[g + 1]) - int(contacts.start[g]))
    coordination = max(1.0, most_contacts / 6.0)
    clock[CONTACT_STEP] = math.inf
    if squared_frequency > 0.0:
        clock[CONTACT_STEP] = 2.0 * math.pi / math.sqrt(squared_frequency * coordination) / per_period
        for k in range(pair_type_count(pair_list, count)):
            clock[CONTACT_STEP] = min(clock[CONTACT_STEP], pair_list.step[k])
        # 24 significant bits, so that sums of steps are exact and r-RESPA cycles conserve momenta to rounding
        clock[CONTACT_STEP] = np.float64(np.float32(clock[CONTACT_STEP]))
