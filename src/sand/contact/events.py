"""Contact events: contacts that form, slip or break, each with the exact energy that it dissipates."""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

from ..basics.box import nearest_image
from ..basics.state import (
    BREAKING,
    BROKEN,
    CONTACTS,
    FORMING,
    INNER_COUNT,
    INNER_SKIN,
    LARGEST_OVERLAP,
    MADE,
    PAIRS,
    SLIPPED,
    STEPS,
    TIME,
)
from ..compiler.jit import loop, rare
from ..compiler.stage import Stage, stage
from ..numerics.quaternion import turned_back
from ..numerics.vec import accrue, dot, load, load4, put, scale, sub
from . import tangential
from .constants_table import column_loops, load_pairing, uniform_contacts
from .damping import NONE, VARIANTS
from .gather import sort_contacts_by_grain
from .impact import note_impact
from .law import ContactLaw
from .losses import FORMING_ROW, add_slip_energies, add_slip_losses
from .mechanics import (
    Displacements,
    contact_speed_gain,
    displacements_of,
    exceeds_limits,
    scaled_stiffness,
    slip_losses,
)
from .update import (
    BROKEN_FLAG,
    PENDING_FLAG,
    displacements_before,
    overlap_share,
    pose_at,
    single_contact_loop,
    slipped_pose,
)


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
def settle_loop(law: ContactLaw, damping: str) -> Callable:
    """The loop that breaks or slips flagged contacts, for one contact law and variant of damping."""
    constants_at, radius_root, at_break = column_loops(law).at, law.radius_root, law.at_break
    contact_radius, write_loads, damping_loops = law.contact_radius, single_contact_loop(law), VARIANTS[damping]
    damping_of_break, damp = damping_loops.at_break, damping_loops.single

    @rare
    def break_contact(grains, contacts, pair_list, count, lost, c, pose, constants, dt):
        """Log the energy of a contact that broke within the step, and flag it as broken.

        The contact force just before the break ended a time τ before the end of the step, but velocity Verlet
        applied it for half a step: the difference is applied as an impulse.
        """
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        overlap = grains.radius[i] + grains.radius[j] - pose.distance
        opening = dot(sub(load(grains.velocity, i), load(grains.velocity, j)), pose.n)
        stretched = -constants.break_overlap - overlap
        elapsed = min(stretched / opening, dt) if opening > 0.0 else 0.0
        energy, force = at_break(constants)
        lost[BREAKING] += energy
        force += damping_of_break(grains, contacts, lost, c, pose, opening, elapsed, dt)
        apply_pair_impulse(grains, i, j, pose.n, force * (0.5 * dt - elapsed))
        count[BROKEN] += 1
        contacts.flag[c] = BROKEN_FLAG
        put(contacts.force, c, (0.0, 0.0, 0.0))
        put(contacts.torque1, c, (0.0, 0.0, 0.0))
        put(contacts.torque2, c, (0.0, 0.0, 0.0))
        mark_separated(pair_list, count, i, j)

    @rare
    def update_flagged_contacts(grains, contacts, pair_list, count, lost, span, settings, dt):
        """Break or slip the flagged contacts, one by one.

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
            pose = pose_at(grains, contacts, span, c, contacts.twist[c])
            displacements = displacements_of(pose, r1 + r2 - pose.distance, r1, r2, constants)
            if exceeds_limits(displacements, pose.n, constants):
                start = displacements_before(grains, contacts, c, pose, constants, dt)
                present = scaled_stiffness(constants, radius_root(displacements.overlap, constants), settings.follow)
                if displacements.overlap < -constants.break_overlap:
                    zero = (0.0, 0.0, 0.0)
                    unloaded = Displacements(displacements.overlap, zero, zero, 0.0)
                    slid, rolled, twisted = slip_losses(start, displacements, unloaded, present)
                    lost[BREAKING] += slid + rolled + twisted
                    break_contact(grains, contacts, pair_list, count, lost, c, pose, constants, dt)
                    broken = True
                    continue
                new_pose = slipped_pose(displacements, pose, r1, r2, constants, settings.reset)
                left = displacements_of(new_pose, displacements.overlap, r1, r2, constants)
                slipped = slip_losses(start, displacements, left, present)
                add_slip_losses(contacts.lost, c, slipped)
                add_slip_energies(lost, slipped)
                put(contacts.pointer1, c, turned_back(load4(grains.orientation, i), new_pose.n1))
                put(contacts.pointer2, c, turned_back(load4(grains.orientation, j), new_pose.n2))
                contacts.twist[c] = left.twist
                count[SLIPPED] += 1
            write_loads(grains, contacts, span, settings, c)
            overlap = r1 + r2 - pose.distance
            radius = contact_radius(overlap, radius_root(overlap, constants), constants)
            damp(grains, contacts, lost, c, pose, radius, constants, settings, count[STEPS], dt)
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


class FormingLoops(NamedTuple):
    """Loops that form contacts, for one contact law."""

    form: Callable  # contacts of pairs that began to touch within the step
    add_initial: Stage  # contacts with given displacements, before the first step


@functools.cache
def forming_loops(law: ContactLaw, damping: str = NONE) -> FormingLoops:
    """The loops that form contacts, for one contact law and variant of damping."""
    columns, write_loads = column_loops(law), single_contact_loop(law)
    contact_radius, damping_of_touch = law.contact_radius, VARIANTS[damping].at_touch
    constants_at, constants_of_pair, store_constants = columns.at, columns.of_pair, columns.store
    radius_root, at_touch = law.radius_root, law.at_touch
    normal_force, normal_energy, normal_stiffness = law.force, law.energy, law.stiffness

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
        contacts.twist[c] = 0.0
        contacts.formed[c] = formed
        contacts.flag[c] = 0
        contacts.every_step[c] = 0
        for row in range(contacts.lost.shape[0]):
            contacts.lost[row, c] = 0.0
        constants = constants_of_pair(grains, settings.pairings, i, j)
        first, last = (0, contacts.constants.shape[1]) if settings.uniform_contacts else (c, c + 1)
        if c == 0 or not settings.uniform_contacts:
            for k in range(first, last):
                store_constants(contacts.constants, k, constants)
        write_loads(grains, contacts, span, settings, c)
        return c

    @loop
    def speed_gain(overlap, closing, reduced, constants, dt):
        """Increase of the closing speed [m/s] since first touch, see `mechanics.contact_speed_gain`."""
        y = radius_root(overlap, constants)
        energy_drop = at_touch(constants) - normal_energy(overlap, y, constants)
        force, stiffness = normal_force(overlap, y, constants), normal_stiffness(overlap, y, constants)
        return contact_speed_gain(energy_drop, force, stiffness, closing, reduced, dt)

    @rare
    def form_contacts(grains, contacts, pair_list, count, lost, clock, span, settings, dt):
        """Form the contacts of pairs that began to touch within the step, and log the energy −U(0).

        The grains have moved freely for a time τ = overlap / closing speed w since first touch.  An impulse along n
        gives them the speed w′ that the contact force would have given them, less the contribution that velocity
        Verlet still adds; to first order the impulse is F (τ − dt/2).  Without the second order, (F τ)²/2m̄, there
        would be an energy error of the same sign in every contact formed.
        """
        for p in range(count[PAIRS]):
            i, j = pair_list.pair[0, p], pair_list.pair[1, p]
            separation = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
            radii = grains.radius[i] + grains.radius[j]
            squared_distance = dot(separation, separation)
            if pair_list.in_contact[p] == 1 or squared_distance > radii * radii:
                continue
            distance = math.sqrt(squared_distance)
            n = scale(1.0 / distance, separation)
            closing = -dot(sub(load(grains.velocity, i), load(grains.velocity, j)), n)
            elapsed = min((radii - distance) / closing, dt) if closing > 0.0 else 0.0
            c = add_contact(grains, contacts, count, span, settings, i, j, clock[TIME] + dt - elapsed)
            pose, constants = pose_at(grains, contacts, span, c, 0.0), constants_at(contacts, c)
            radius = contact_radius(radii - distance, radius_root(radii - distance, constants), constants)
            impulse = damping_of_touch(
                grains, contacts, lost, c, pose, radius, constants, closing, elapsed, settings, count[STEPS], dt
            )
            share = overlap_share(radii - distance, grains.radius[i], grains.radius[j])
            clock[LARGEST_OVERLAP] = max(clock[LARGEST_OVERLAP], share)
            reduced = grains.mass[i] * grains.mass[j] / (grains.mass[i] + grains.mass[j])
            # the step of 0 s at the start of a run finds grains that overlap already
            gain = speed_gain(radii - distance, closing, reduced, constants, dt) if dt > 0.0 else 0.0
            if dt > 0.0:
                pairing = load_pairing(settings.pairings, grains.material[i], grains.material[j])
                note_impact(clock, closing, reduced, constants.reduced_radius, pairing.modulus)
            impulse -= reduced * gain + 0.5 * dt * dot(load(contacts.force, c), n)
            apply_pair_impulse(grains, i, j, n, impulse)
            lost[FORMING] -= at_touch(constants)
            contacts.lost[FORMING_ROW, c] -= at_touch(constants)
            pair_list.in_contact[p] = 1
            count[MADE] += 1

    @stage("the first contacts")
    def add_initial_contacts(grains, contacts, count, span, settings, pair, slide, roll, twist):
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
        pair : ndarray
            (2, C) grain indices.
        slide, roll : ndarray
            (3, C) ζ and ξ [m] in the laboratory frame; their components along n are ignored.
        twist : ndarray
            (C,) φ [rad].

        Returns
        -------
        int
            First contact that is stretched beyond breaking, or −1.
        """
        broken = -1
        for k in range(twist.size):
            i, j = pair[0, k], pair[1, k]
            c = add_contact(grains, contacts, count, span, settings, i, j, 0.0)
            separation = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
            distance = math.sqrt(dot(separation, separation))
            n = scale(1.0 / distance, separation)
            r1, r2 = grains.radius[i], grains.radius[j]
            zeta, xi = load(slide, k), load(roll, k)
            zeta, xi = sub(zeta, scale(dot(zeta, n), n)), sub(xi, scale(dot(xi, n), n))
            n1, n2 = tangential.pointers_for(zeta, xi, n, r1, r2)
            put(contacts.pointer1, c, turned_back(load4(grains.orientation, i), n1))
            put(contacts.pointer2, c, turned_back(load4(grains.orientation, j), n2))
            contacts.twist[c] = twist[k]
            write_loads(grains, contacts, span, settings, c)
            if broken < 0 and r1 + r2 - distance < -constants_at(contacts, c).break_overlap:
                broken = k
        sort_contacts_by_grain(contacts, count, grains.mass.size)
        return broken

    return FormingLoops(form_contacts, add_initial_contacts)
