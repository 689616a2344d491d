"""Contact events: contacts that form, slip or break, each with the exact energy that it dissipates."""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..basics.state import (
    BREAKING,
    BROKEN,
    CONTACTS,
    INNER_COUNT,
    INNER_SKIN,
    LARGEST_OVERLAP,
    MADE,
    PAIRS,
    SLIPPED,
    TIME,
)
from ..compiler.jit import loop, rare
from ..compiler.stage import Stage, stage
from ..numerics.flow import relative_velocity
from ..numerics.quaternion import turned_back
from ..numerics.vec import accrue, dot, load, load4, nearest_image, put, scale, sub
from . import tangential
from .constants_table import column_loops, load_pairing, uniform_contacts
from .damping import NONE, Held, damping_loops
from .gather import sort_contacts_by_grain
from .law import ContactLaw
from .losses import record_slip
from .mechanics import (
    after_slip,
    displacements_of,
    exceeds_limits,
    release_loss,
    scaled_stiffness,
    slip_losses,
    time_since,
)
from .poses import displacements_before, pose_at
from .slip_rules import slipped_pose
from .transitions import BROKEN_FLAG, PENDING_FLAG, Break, Touch, breaking_loop, clear_contact, touch_loop
from .update import single_contact_loop


@loop
def apply_pair_impulse(grains, i, j, n, impulse):
    """Apply the impulse [N s] along n to grain i and the opposite impulse to grain j."""
    accrue(grains.velocity, i, scale(impulse / grains.mass[i], n))
    accrue(grains.velocity, j, scale(-impulse / grains.mass[j], n))


@rare
def mark_separated(pair_list, count, i, j):
    """Mark candidate pair (i, j) as not in contact and invalidate the inner list: the pair may touch again soon."""
    pair_list.skin[INNER_SKIN] = 0.0
    for p in range(count[PAIRS]):
        a, b = pair_list.pair[0, p], pair_list.pair[1, p]
        if (a == i and b == j) or (a == j and b == i):
            pair_list.in_contact[p] = 0
            return


@functools.cache
def slip_and_break_loop(law: ContactLaw, damping: str) -> Callable:
    """The loop that breaks or slips flagged contacts, for one contact law and variant of damping."""
    constants_at, radius_root, contact_radius = column_loops(law).at, law.radius_root, law.contact_radius
    write_loads, dashpots = single_contact_loop(law), damping_loops(damping)
    break_contact, damp = breaking_loop(law, dashpots), dashpots.single

    @rare
    def break_pair(grains, contacts, lost, c, pose, constants, step):
        """Break contact c in a step (`update.PresentStep`)."""
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        overlap = grains.radius[i] + grains.radius[j] - pose.distance
        opening = dot(relative_velocity(grains, i, j, scale(pose.distance, pose.n), step.span), pose.n)
        broken = Break(pose, -constants.break_overlap - overlap, opening, constants)
        apply_pair_impulse(grains, i, j, pose.n, break_contact(grains, contacts, lost, c, broken, step))

    @rare
    def update_flagged_contacts(grains, contacts, pair_list, count, lost, step):
        """Break or slip the flagged contacts, one by one, in a step (`update.PresentStep`).

        Returns
        -------
        bool
            Whether any contact broke.
        """
        broken = False
        for c in range(count[CONTACTS]):
            if contacts.flag[c] != PENDING_FLAG:
                continue
            i, j = contacts.pair[0, c], contacts.pair[1, c]
            r1, r2 = grains.radius[i], grains.radius[j]
            constants = constants_at(contacts, c)
            pose = pose_at(grains, contacts, step.span, c, contacts.twist[c])
            overlap = r1 + r2 - pose.distance
            reached = displacements_of(pose, overlap, r1, r2, constants)
            y = radius_root(overlap, constants)
            if exceeds_limits(reached, pose.n, constants):
                start = displacements_before(grains, contacts, c, pose, constants, step)
                present = scaled_stiffness(constants, y, step.settings.follow)
                if overlap < -constants.break_overlap:
                    lost[BREAKING] += release_loss(start, reached, present)
                    break_pair(grains, contacts, lost, c, pose, constants, step)
                    count[BROKEN] += 1
                    mark_separated(pair_list, count, i, j)
                    broken = True
                    continue
                target = after_slip(reached, pose.n, constants, step.settings.reset)
                new_pose, _ = slipped_pose(target, pose, constants)
                left = displacements_of(new_pose, overlap, r1, r2, constants)
                record_slip(contacts, lost, c, slip_losses(start, reached, left, present))
                put(contacts.pointer1, c, turned_back(load4(grains.orientation, i), new_pose.n1))
                put(contacts.pointer2, c, turned_back(load4(grains.orientation, j), new_pose.n2))
                contacts.twist[c] = left.twist
                count[SLIPPED] += 1
            write_loads(grains, contacts, step.span, step.settings, c)
            damp(grains, contacts, lost, c, Held(pose, contact_radius(overlap, y, constants), constants), step)
        return broken

    return update_flagged_contacts


@rare
def compact_contacts(contacts, number):
    """Remove broken contacts from the first `number` columns, in order; returns how many contacts are left."""
    kept = 0
    for c in range(number):
        if contacts.flag[c] == BROKEN_FLAG:
            continue
        if kept != c:
            for row in range(2):
                contacts.pair[row, kept] = contacts.pair[row, c]
            for row in range(3):
                contacts.pointer1[row, kept] = contacts.pointer1[row, c]
                contacts.pointer2[row, kept] = contacts.pointer2[row, c]
                contacts.force[row, kept] = contacts.force[row, c]
                contacts.torque1[row, kept] = contacts.torque1[row, c]
                contacts.torque2[row, kept] = contacts.torque2[row, c]
            if not uniform_contacts(contacts):
                for row in range(contacts.constants.shape[0]):
                    contacts.constants[row, kept] = contacts.constants[row, c]
            for row in range(contacts.lost.shape[0]):
                contacts.lost[row, kept] = contacts.lost[row, c]
            for row in range(contacts.kept.shape[0]):
                contacts.kept[row, kept] = contacts.kept[row, c]
            if contacts.damping.shape[1] > 0:
                for row in range(contacts.damping.shape[0]):
                    contacts.damping[row, kept] = contacts.damping[row, c]
            contacts.twist[kept] = contacts.twist[c]
            contacts.formed[kept] = contacts.formed[c]
            contacts.flag[kept] = contacts.flag[c]
            contacts.every_step[kept] = contacts.every_step[c]
        kept += 1
    return kept


@loop
def _is_new_contact(grains, pair_list, span, p):
    """1 if the grains of candidate pair p are not in contact but touch (D ≤ r1 + r2), else 0."""
    i, j = pair_list.pair[0, p], pair_list.pair[1, p]
    separation = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    radii = grains.radius[i] + grains.radius[j]
    return 1 if (pair_list.in_contact[p] == 0) & (dot(separation, separation) <= radii * radii) else 0


@loop
def inner_list_overflowed(pair_list, count):
    """Whether all candidate pairs must be searched because the inner list was too short."""
    return pair_list.skin[INNER_COUNT] == count[PAIRS]


@loop
def count_new_contacts(grains, pair_list, count, span):
    """Number of pairs that began to touch, searched in the inner list."""
    new_contacts = 0
    if inner_list_overflowed(pair_list, count):
        for p in range(count[PAIRS]):
            new_contacts += _is_new_contact(grains, pair_list, span, p)
    else:
        for k in range(int(pair_list.skin[INNER_COUNT])):
            new_contacts += _is_new_contact(grains, pair_list, span, pair_list.inner[k])
    return new_contacts


class InitialContacts(NamedTuple):
    """Contacts with given displacements."""

    pair: np.ndarray  # (2, C) grain indices
    slide: np.ndarray  # (3, C) ζ and ξ [m] in the laboratory frame; their components along n are ignored
    roll: np.ndarray
    twist: np.ndarray  # (C,) φ [rad]


class FormingLoops(NamedTuple):
    """Loops that form contacts, for one contact law."""

    form: Callable  # contacts of pairs that began to touch within the step
    add_initial: Stage  # contacts with given displacements, before the first step


@functools.cache
def forming_loops(law: ContactLaw, damping: str = NONE) -> FormingLoops:
    """The loops that form contacts, for one contact law and variant of damping."""
    columns, write_loads, touch = column_loops(law), single_contact_loop(law), touch_loop(law, damping_loops(damping))
    radius_root, contact_radius = law.radius_root, law.contact_radius
    constants_at, constants_of_pair, store_constants = columns.at, columns.of_pair, columns.store

    @rare
    def add_contact(grains, contacts, count, span, settings, i, j, formed):
        """Append a contact between grains i and j, unstrained but for its overlap; returns its index."""
        c = count[CONTACTS]
        count[CONTACTS] = c + 1
        contacts.pair[0, c] = i
        contacts.pair[1, c] = j
        separation = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        n = scale(1.0 / math.sqrt(dot(separation, separation)), separation)
        put(contacts.pointer1, c, turned_back(load4(grains.orientation, i), scale(-1.0, n)))
        put(contacts.pointer2, c, turned_back(load4(grains.orientation, j), n))
        clear_contact(contacts, c, formed)
        contacts.kept[:, c] = 0.0  # the column may hold those of a broken contact
        constants = constants_of_pair(grains, settings.pairings, i, j)
        first, last = (0, contacts.constants.shape[1]) if settings.uniform_contacts else (c, c + 1)
        if c == 0 or not settings.uniform_contacts:
            for k in range(first, last):
                store_constants(contacts.constants, k, constants)
        write_loads(grains, contacts, span, settings, c)
        return c

    @rare
    def form_contacts(grains, contacts, pair_list, count, lost, clock, step):
        """Form the contacts of pairs that began to touch within the step (`update.PresentStep`)."""
        for p in range(count[PAIRS]):
            i, j = pair_list.pair[0, p], pair_list.pair[1, p]
            separation = nearest_image(sub(load(grains.position, i), load(grains.position, j)), step.span)
            radii = grains.radius[i] + grains.radius[j]
            squared_distance = dot(separation, separation)
            if pair_list.in_contact[p] == 1 or squared_distance > radii * radii:
                continue
            distance = math.sqrt(squared_distance)
            n, overlap = scale(1.0 / distance, separation), radii - distance
            closing = -dot(relative_velocity(grains, i, j, separation, step.span), n)
            formed = clock[TIME] + step.dt - time_since(overlap, closing, step.dt)
            c = add_contact(grains, contacts, count, step.span, step.settings, i, j, formed)
            pairing = load_pairing(step.settings.pairings, grains.material[i], grains.material[j])
            reduced = grains.mass[i] * grains.mass[j] / (grains.mass[i] + grains.mass[j])
            pose, constants = pose_at(grains, contacts, step.span, c, 0.0), constants_at(contacts, c)
            clock[LARGEST_OVERLAP] = max(clock[LARGEST_OVERLAP], overlap * constants.derived.inverse_smaller_radius)
            radius = contact_radius(overlap, radius_root(overlap, constants), constants)
            touched = Touch(n, Held(pose, radius, constants), overlap, closing, reduced, pairing.modulus)
            apply_pair_impulse(grains, i, j, n, touch(grains, contacts, lost, clock, c, touched, step))
            pair_list.in_contact[p] = 1
            count[MADE] += 1

    @stage("the first contacts")
    def add_initial_contacts(grains, contacts, count, span, settings, initial):
        """Append contacts with given displacements, before the first step.

        Parameters
        ----------
        grains, contacts : GrainArrays, ContactArrays
            Arrays of grains and contacts; the latter must have enough columns.
        count : ndarray
            Counters of the state.
        span : Span
            The box.
        settings : ContactParameters
            Settings of the contact model.
        initial : InitialContacts
            The contacts.

        Returns
        -------
        int
            First contact that is stretched beyond breaking, or −1.
        """
        broken = -1
        for k in range(initial.twist.size):
            i, j = initial.pair[0, k], initial.pair[1, k]
            c = add_contact(grains, contacts, count, span, settings, i, j, 0.0)
            separation = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
            distance = math.sqrt(dot(separation, separation))
            n = scale(1.0 / distance, separation)
            r1, r2 = grains.radius[i], grains.radius[j]
            zeta, xi = load(initial.slide, k), load(initial.roll, k)
            zeta, xi = sub(zeta, scale(dot(zeta, n), n)), sub(xi, scale(dot(xi, n), n))
            n1, n2 = tangential.pointers_for(zeta, xi, n, r1, r2)
            put(contacts.pointer1, c, turned_back(load4(grains.orientation, i), n1))
            put(contacts.pointer2, c, turned_back(load4(grains.orientation, j), n2))
            contacts.twist[c] = initial.twist[k]
            write_loads(grains, contacts, span, settings, c)
            if broken < 0 and r1 + r2 - distance < -constants_at(contacts, c).break_overlap:
                broken = k
        sort_contacts_by_grain(contacts, count, grains.mass.size)
        return broken

    return FormingLoops(form_contacts, add_initial_contacts)
