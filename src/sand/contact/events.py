"""The rare contacts that form, move or break, with their energy booked exactly."""

import math

from ..box import nearest_image
from ..compiler.jit import loop, rare
from ..numerics.quaternion import turned_back
from ..numerics.vec import accrue, axpy, dot, load, load4, put, scale, sub
from ..state.state import (
    BREAKING,
    BROKEN,
    CONTACTS,
    DAMPING,
    FORMING,
    INNER_COUNT,
    INNER_SKIN,
    MADE,
    PAIRS,
    ROLLING,
    SLIDING,
    SLIPPED,
    STIFFNESS,
    TIME,
    TWISTING,
)
from . import jkr, tangential
from .law import (
    Displacements,
    Pose,
    after_slip,
    breaking_loss,
    contact_speed_gain,
    damping_force,
    displacements_of,
    exceeds_limits,
    forming_loss,
    scaled_stiffness,
    slip_losses,
    stiffness_loss,
)
from .pair_types import bond_of
from .slip import displacements_before, loss_row
from .update import BROKEN_FLAG, PENDING_FLAG, bond_at, pose_at, stored_damping_force, uniform_contacts, write_loads


@loop
def log_loss(own, lost, c, channel, energy):
    """Add an energy [J] lost by contact c to the books and to its own record, `own` (L, C), if that has room."""
    lost[channel] += energy
    row = loss_row(channel)
    if channel != BREAKING and row < own.shape[0]:
        own[row, c] += energy


@loop
def log_slip_losses(own, lost, c, energies):
    """The same for the three tangential modes."""
    log_loss(own, lost, c, SLIDING, energies[0])
    log_loss(own, lost, c, ROLLING, energies[1])
    log_loss(own, lost, c, TWISTING, energies[2])


@loop
def store_damping_force(contacts, c, force):
    """Remember the damping force [N] of contact c, where there is any."""
    if contacts.damped.size > 0:
        contacts.damped[c] = force


@rare
def add_damping_force(grains, contacts, span, c, dt):
    """Add the damping force to the loads of contact c; returns the energy [J] it took in the step.

    It acts on the closing speed at the end of the step, foretold with the loads of its start.  Its work is
    that of the trapezoid rule, as velocity Verlet does it, with the force kept from the step before.
    """
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    bond = bond_at(contacts, c)
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    distance = math.sqrt(dot(apart, apart))
    n = scale(1.0 / distance, apart)
    moving = sub(load(grains.velocity, i), load(grains.velocity, j))
    pull = sub(scale(1.0 / grains.mass[i], load(grains.force, i)), scale(1.0 / grains.mass[j], load(grains.force, j)))
    closing = -dot(axpy(0.5 * dt, pull, moving), n)
    overlap = grains.radius[i] + grains.radius[j] - distance
    y = jkr.root(jkr.stretch(overlap, bond.pull_off_overlap))
    force = damping_force(overlap, y, closing, bond)
    accrue(contacts.push, c, scale(force, n))
    earlier = axpy(-dt, moving, apart)
    before = stored_damping_force(contacts, c) / math.sqrt(dot(earlier, earlier))
    store_damping_force(contacts, c, force)
    return -0.5 * dt * (before * dot(earlier, moving) + force * dot(n, moving))


@rare
def damp_contacts(grains, contacts, count, lost, span, dt):
    """Damping of all contacts."""
    for c in range(count[CONTACTS]):
        if contacts.flag[c] != BROKEN_FLAG:
            log_loss(contacts.lost, lost, c, DAMPING, add_damping_force(grains, contacts, span, c, dt))


@rare
def log_stiffness_work(grains, contacts, count, lost, span, dt):
    """What stiffnesses that follow a(δ) took out of the springs of all contacts in this step."""
    for c in range(count[CONTACTS]):
        bond = bond_at(contacts, c)
        pose = pose_at(grains, contacts, span, c, contacts.twist[c])
        r1, r2 = grains.radius[contacts.pair[0, c]], grains.radius[contacts.pair[1, c]]
        before = displacements_before(grains, contacts, c, pose, bond, dt)
        displacements = displacements_of(pose, r1 + r2 - pose.distance, r1, r2, bond)
        earlier, now = scaled_to_overlap(before.overlap, bond), scaled_to_overlap(displacements.overlap, bond)
        log_loss(contacts.lost, lost, c, STIFFNESS, stiffness_loss(before, displacements, earlier, now))


@loop
def scaled_to_overlap(overlap, bond):
    """The bond with the stiffnesses that follow this overlap."""
    return scaled_stiffness(bond, jkr.root(jkr.stretch(overlap, bond.pull_off_overlap)), True)


@loop
def apply_pair_impulse(grains, i, j, n, impulse):
    """Give grain i the impulse [N s] along n and grain j the opposite."""
    accrue(grains.velocity, i, scale(impulse / grains.mass[i], n))
    accrue(grains.velocity, j, scale(-impulse / grains.mass[j], n))


@rare
def break_contact(grains, contacts, pair_list, count, lost, c, pose, bond, dt):
    """Book the energy of a neck that snapped inside the step, and mark the contact as dead.

    The force −(5/9)F_c ended τ ago; velocity Verlet let it act until half the step: the difference is
    given as an impulse.
    """
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    overlap = grains.radius[i] + grains.radius[j] - pose.distance
    opening = dot(sub(load(grains.velocity, i), load(grains.velocity, j)), pose.n)
    late = -bond.break_overlap - overlap
    since = min(late / opening, dt) if opening > 0.0 else 0.0
    energy, force = breaking_loss(bond)
    apply_pair_impulse(grains, i, j, pose.n, (force + stored_damping_force(contacts, c)) * (0.5 * dt - since))
    log_loss(contacts.lost, lost, c, BREAKING, energy)
    # the damping force acted until the break: half a step by Verlet, the rest by the impulse
    log_loss(contacts.lost, lost, c, DAMPING, -stored_damping_force(contacts, c) * opening * (dt - since))
    count[BROKEN] += 1
    contacts.flag[c] = BROKEN_FLAG
    put(contacts.push, c, (0.0, 0.0, 0.0))
    put(contacts.torque1, c, (0.0, 0.0, 0.0))
    put(contacts.torque2, c, (0.0, 0.0, 0.0))
    store_damping_force(contacts, c, 0.0)
    mark_separated(pair_list, count, i, j)


@rare
def update_flagged_contacts(grains, contacts, pair_list, count, lost, span, law, dt):
    """Break or move the contacts that wait for it; returns True if any broke."""
    parted = False
    for c in range(count[CONTACTS]):
        if contacts.flag[c] != PENDING_FLAG:
            continue
        i, j = contacts.pair[0, c], contacts.pair[1, c]
        r1, r2 = grains.radius[i], grains.radius[j]
        bond = bond_at(contacts, c)
        pose = pose_at(grains, contacts, span, c, contacts.twist[c])
        displacements = displacements_of(pose, r1 + r2 - pose.distance, r1, r2, bond)
        if exceeds_limits(displacements, pose.n, bond):
            before = displacements_before(grains, contacts, c, pose, bond, dt)
            y = jkr.root(jkr.stretch(displacements.overlap, bond.pull_off_overlap))
            now = scaled_stiffness(bond, y, law.follow)
            if displacements.overlap < -bond.break_overlap:
                zero = (0.0, 0.0, 0.0)
                gone = Displacements(displacements.overlap, zero, zero, 0.0)
                slid, rolled, twisted = slip_losses(before, displacements, gone, now)
                log_loss(contacts.lost, lost, c, BREAKING, slid + rolled + twisted)
                break_contact(grains, contacts, pair_list, count, lost, c, pose, bond, dt)
                parted = True
                continue
            wish = after_slip(displacements, pose.n, bond, law.release)
            n1, n2 = tangential.pointers_for(wish.slide, wish.roll, pose.n, r1, r2)
            moved = Pose(pose.n, pose.distance, n1, n2, wish.twist)
            left = displacements_of(moved, displacements.overlap, r1, r2, bond)
            log_slip_losses(contacts.lost, lost, c, slip_losses(before, displacements, left, now))
            put(contacts.pointer1, c, turned_back(load4(grains.orientation, i), n1))
            put(contacts.pointer2, c, turned_back(load4(grains.orientation, j), n2))
            contacts.twist[c] = left.twist
            count[SLIPPED] += 1
        write_loads(grains, contacts, span, law, c)
    return parted


@rare
def compact_contacts(contacts, count):
    """Close the gaps that broken contacts leave; the order of the others stays."""
    kept = 0
    for c in range(count[CONTACTS]):
        if contacts.flag[c] == BROKEN_FLAG:
            continue
        if kept != c:
            for row in range(2):
                contacts.pair[row, kept] = contacts.pair[row, c]
            for row in range(3):
                contacts.pointer1[row, kept] = contacts.pointer1[row, c]
                contacts.pointer2[row, kept] = contacts.pointer2[row, c]
                contacts.push[row, kept] = contacts.push[row, c]
                contacts.torque1[row, kept] = contacts.torque1[row, c]
                contacts.torque2[row, kept] = contacts.torque2[row, c]
            if not uniform_contacts(contacts):
                for row in range(contacts.bond.shape[0]):
                    contacts.bond[row, kept] = contacts.bond[row, c]
            for row in range(contacts.lost.shape[0]):
                contacts.lost[row, kept] = contacts.lost[row, c]
            store_damping_force(contacts, kept, stored_damping_force(contacts, c))
            contacts.twist[kept] = contacts.twist[c]
            contacts.formed[kept] = contacts.formed[c]
            contacts.flag[kept] = contacts.flag[c]
            contacts.bonded[kept] = contacts.bonded[c]
        kept += 1
    count[CONTACTS] = kept


@loop
def _is_new_contact(grains, pair_list, span, p):
    """1 if pair p has come to touch (D ≤ r1 + r2), else 0."""
    i, j = pair_list.pair[0, p], pair_list.pair[1, p]
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    reach = grains.radius[i] + grains.radius[j]
    return 1 if (pair_list.touching[p] == 0) & (dot(apart, apart) <= reach * reach) else 0


@loop
def count_new_contacts(grains, pair_list, count, span):
    """How many pairs have come to touch, out of those that may."""
    found = 0
    if inner_list_overflowed(pair_list, count):
        for p in range(count[PAIRS]):
            found += _is_new_contact(grains, pair_list, span, p)
    else:
        for k in range(int(pair_list.skin[INNER_COUNT])):
            found += _is_new_contact(grains, pair_list, span, pair_list.inner[k])
    return found


@rare
def add_contact(grains, contacts, count, span, law, i, j, formed):
    """Append an unstrained contact (but for its overlap) between grains i and j; returns its number."""
    c = count[CONTACTS]
    count[CONTACTS] = c + 1
    contacts.pair[0, c] = i
    contacts.pair[1, c] = j
    apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    n = scale(1.0 / math.sqrt(dot(apart, apart)), apart)
    put(contacts.pointer1, c, turned_back(load4(grains.orientation, i), scale(-1.0, n)))
    put(contacts.pointer2, c, turned_back(load4(grains.orientation, j), n))
    contacts.twist[c] = 0.0
    contacts.formed[c] = formed
    contacts.flag[c] = 0
    contacts.bonded[c] = 0
    store_damping_force(contacts, c, 0.0)
    for row in range(contacts.lost.shape[0]):
        contacts.lost[row, c] = 0.0
    bond = bond_of(grains, law.pairings, i, j)
    first, last = (0, contacts.bond.shape[1]) if law.uniform_contacts else (c, c + 1)
    if c == 0 or not law.uniform_contacts:
        for row in range(contacts.bond.shape[0]):
            for k in range(first, last):
                contacts.bond[row, k] = bond[row]
    write_loads(grains, contacts, span, law, c)
    return c


@rare
def form_contacts(grains, contacts, pair_list, count, lost, clock, span, law, dt):
    """Form the contacts of pairs that came to touch inside the step, and log_loss −U(0).

    The grains flew freely to where they are, a time τ = overlap / closing speed w beyond the touch.  An impulse along
    n gives them the speed w' of their contact, less what velocity Verlet still adds: to first order F (τ − dt/2).
    The second order, (F τ)²/2m̄, would be an error of the same sign in every touch.
    """
    for p in range(count[PAIRS]):
        i, j = pair_list.pair[0, p], pair_list.pair[1, p]
        apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        reach = grains.radius[i] + grains.radius[j]
        square = dot(apart, apart)
        if pair_list.touching[p] == 1 or square > reach * reach:
            continue
        distance = math.sqrt(square)
        n = scale(1.0 / distance, apart)
        closing = -dot(sub(load(grains.velocity, i), load(grains.velocity, j)), n)
        since = min((reach - distance) / closing, dt) if closing > 0.0 else 0.0
        c = add_contact(grains, contacts, count, span, law, i, j, clock[TIME] + dt - since)
        if law.damped:
            add_damping_force(grains, contacts, span, c, 0.0)
            log_loss(contacts.lost, lost, c, DAMPING, stored_damping_force(contacts, c) * closing * since)
        reduced = grains.mass[i] * grains.mass[j] / (grains.mass[i] + grains.mass[j])
        # a step of 0 s finds what touches already
        gain = contact_speed_gain(reach - distance, closing, reduced, bond_at(contacts, c), dt) if dt > 0.0 else 0.0
        owed = stored_damping_force(contacts, c) * since - reduced * gain
        apply_pair_impulse(grains, i, j, n, owed - 0.5 * dt * dot(load(contacts.push, c), n))
        log_loss(contacts.lost, lost, c, FORMING, forming_loss(bond_at(contacts, c)))
        pair_list.touching[p] = 1
        count[MADE] += 1


@loop
def inner_list_overflowed(pair_list, count):
    """Are all near pairs to be looked at, instead of the first watch[INNER_COUNT] of `soon`?"""
    return pair_list.skin[INNER_COUNT] == count[PAIRS]


@rare
def mark_separated(pair_list, count, i, j):
    """Mark the pair (i, j) of the list as no longer in contact; it may touch again soon."""
    pair_list.skin[INNER_SKIN] = 0.0
    for p in range(count[PAIRS]):
        a, b = pair_list.pair[0, p], pair_list.pair[1, p]
        if (a == i and b == j) or (a == j and b == i):
            pair_list.touching[p] = 0
            return
