"""Contact forces, first pass: one update of all contacts, in loops that vectorise, which stores loads per contact.

Contacts are updated in two passes.  The pass over contacts computes pose, displacements, force and torques of each
contact from its two grains and stores them per contact; no two iterations write to the same memory, so the loop
vectorises.  The gather pass over grains (`gather`) then sums the stored forces and torques of the contacts of each
grain in a fixed order.

The update (`contact_loop`) exists with three rules for limits (`slip_rules`) that give the same results.  Contacts that
a rule only flags are handled one by one by `events.slip_and_break_loop`.  In strongly excited aggregates most contacts
slip in every step: blocks in which more than 10 % of the contacts were beyond a limit in the last step use a loop in
which contacts slip in rolling, and if more than 5 % of them slid, twisted, broke or were left to the events, one in
which they slip in any mode.  All are free of branches.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..basics.arrays import CONTACTS_AT_ONCE
from ..basics.state import CONTACT_LIMIT, CONTACTS, SLIPPED
from ..compiler.jit import COMPILED, loop, rare
from ..numerics.simd import float_bits, float_from_bits, round_up_to_simd_width
from . import tangential
from .constants_table import FASTEST_MODE, column_loops, uniform_contacts
from .damping import NONE, Held, damping_loops, store_loads
from .law import ContactLaw
from .losses import add_damping_energies, add_slip_energies
from .mechanics import contact_load, displacements_of, load_of_springs, scaled_stiffness
from .pair_types import pair_type_count
from .poses import nearest_separation, pose_at, pose_at_step_end, separation_of
from .slip_rules import Reached, flag_contact, kept_loop, roll_contact, slip_contact
from .transitions import PENDING_FLAG, SLIPPED_FLAG

BLOCK_SIZE = np.uint64(CONTACTS_AT_ONCE)
"""Contacts per block."""
SLIP_FRACTION = 0.1
"""Fraction of a block's contacts beyond a limit in the last step, above which contacts slip in the loop."""
OTHER_FRACTION = 0.05
"""Fraction of them that did not only slip in rolling, above which contacts slip in any mode."""
MIN_REMAINDER = 4
"""Remaining contacts from which a padded SIMD vector is faster than a scalar loop."""


class PassVariant(NamedTuple):
    """What the pass over contacts computes; loops are compiled without what a simulation does not need."""

    damping: str = NONE  # of `damping`: NONE, DASHPOTS or THERMAL
    periodic: bool = True  # nearest images; False for open boxes
    follow: bool = False  # stiffnesses that follow the contact radius
    adhesive: bool = False  # whether all contacts adhere


class PresentStep(NamedTuple):
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


@functools.cache
def contact_loop(law: ContactLaw, handle_limits: Callable, variant: PassVariant) -> Callable:
    """The loop that updates a range of contacts, for a contact law and a rule of `slip_rules`."""
    load_constants, radius_root = column_loops(law).load, law.fast_radius_root
    normal_force = (law.adhesive_force if variant.adhesive else None) or law.force
    contact_radius = (law.adhesive_radius if variant.adhesive else None) or law.contact_radius
    damp, follow = damping_loops(variant.damping).update, variant.follow
    apart = nearest_separation if variant.periodic else separation_of

    @loop
    def update_contacts(grains, contacts, part, step):
        """Update twist, loads and flag of a range of contacts.  The loop has no branches, so it vectorises.

        Parameters
        ----------
        grains, contacts : GrainArrays, ContactArrays
            Arrays of grains and contacts.
        part : ContactRange
            The range.
        step : PresentStep
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
            constants = load_constants(contacts.constants, part.column + k)
            r1, r2 = constants.derived.radius1, constants.derived.radius2
            pose = pose_at_step_end(grains, contacts, apart(grains, contacts, step.span, c), c, step)
            overlap = r1 + r2 - pose.distance
            y, valid = radius_root(overlap, constants)
            present = scaled_stiffness(constants, y, True) if follow else constants
            _, along = tangential.sliding(pose.n1, pose.n2, pose.n, r1, r2)
            reached = Reached(pose, displacements_of(pose, overlap, r1, r2, constants), along, constants, valid)
            pose, sliding, lost, flag = handle_limits(grains, contacts, c, reached, step)
            normal = normal_force(overlap, y, constants)
            # a flagged contact is damped by events.slip_and_break_loop; padding columns hold no grains
            used = c < part.used
            active = (flag != PENDING_FLAG) & used
            held = Held(pose, contact_radius(overlap, y, constants), constants)
            springs = load_of_springs(pose, sliding, normal, r1, r2, present)
            loads, dissipated = damp(grains, contacts, c, held, springs, active, step)
            damped1 += dissipated[0]
            damped2 += dissipated[1]
            damped3 += dissipated[2]
            damped4 += dissipated[3]
            contacts.twist[c] = pose.twist
            store_loads(contacts, c, loads)
            contacts.flag[c] = flag
            pending += 1 if (flag == PENDING_FLAG) & used else 0
            slipped += 1 if (flag >= SLIPPED_FLAG) & used else 0
            deepest = max(deepest, float_bits(overlap * constants.derived.inverse_smaller_radius if used else 0.0))
            slid += lost[0] if used else 0.0
            rolled += lost[1] if used else 0.0
            twisted += lost[2] if used else 0.0
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
    update_flagging, complete_kept = contact_loop(law, flag_contact, variant), kept_loop(law)
    update_rolling = update_flagging if variant.follow else contact_loop(law, roll_contact, variant)
    update_slipping = update_flagging if variant.follow else contact_loop(law, slip_contact, variant)
    fraction = math.inf if variant.follow else SLIP_FRACTION

    @loop
    def contact_pass(grains, contacts, first, last, step):
        """Update the contacts first … last − 1 (uint64) in a step (`PresentStep`); result as for `contact_loop`.

        With stiffnesses that follow a(δ) all contacts beyond a limit stay flagged: the work of the stiffness change
        must be logged before they slip.
        """
        pending = slipped = slid = rolled = twisted = deepest = 0.0
        damped1 = damped2 = damped3 = damped4 = 0.0
        for b in range((last - first + BLOCK_SIZE - np.uint64(1)) // BLOCK_SIZE):
            begin = first + b * BLOCK_SIZE
            end = begin + BLOCK_SIZE if begin + BLOCK_SIZE < last else last
            column = np.uint64(0) if uniform_contacts(contacts) else begin
            beyond = 0.0
            for k in range(end - begin):
                beyond += 1.0 if contacts.flag[begin + k] > 0 else 0.0
            block = ContactRange(begin, padded_contact_count(contacts, end), end, column)
            if beyond <= fraction * (end - begin):
                part = update_flagging(grains, contacts, block, step)
            else:
                complete_kept(grains, contacts, ContactRange(begin, end, end, column), step)
                others = beyond
                for k in range(end - begin):
                    others -= 1.0 if contacts.flag[begin + k] == SLIPPED_FLAG else 0.0
                if others <= OTHER_FRACTION * (end - begin):
                    part = update_rolling(grains, contacts, block, step)
                else:
                    part = update_slipping(grains, contacts, block, step)
            pending += part.pending
            slipped += part.slipped
            slid += part.slid
            rolled += part.rolled
            twisted += part.twisted
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
    for k in range(len(sums)):
        rows[b, k] = sums[k]


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
def contact_limit(contacts, pair_list, count, n, clock, per_period):
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
    clock[CONTACT_LIMIT] = math.inf
    if squared_frequency > 0.0:
        clock[CONTACT_LIMIT] = 2.0 * math.pi / math.sqrt(squared_frequency * coordination) / per_period
        for k in range(pair_type_count(pair_list, count)):
            clock[CONTACT_LIMIT] = min(clock[CONTACT_LIMIT], pair_list.step[k])
        # 24 significant bits, so that sums of steps are exact and r-RESPA cycles conserve momenta to rounding
        clock[CONTACT_LIMIT] = np.float64(np.float32(clock[CONTACT_LIMIT]))
