"""Contact events: contacts that form, slip or break, and damping, each with the exact energy it dissipates."""

import math

from ..box import nearest_image
from ..compiler.jit import kernel, loop, rare
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
from .gather import sort_contacts_by_grain
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
from .pair_types import pair_constants
from .slip import displacements_before, loss_row
from .update import (
    BROKEN_FLAG,
    PENDING_FLAG,
    constants_at,
    pose_at,
    stored_damping_force,
    uniform_contacts,
    write_loads,
)


@loop
def log_loss(contact_losses, lost, c, channel, energy):
    """Add an energy [J] dissipated by contact c to the energy table and to the losses (L, C) of the contact.

    Breaking has no row in `contact_losses`; neither have damping and stiffness changes where the contact law has none.
    """
    lost[channel] += energy
    row = loss_row(channel)
    if channel != BREAKING and row < contact_losses.shape[0]:
        contact_losses[row, c] += energy


@loop
def log_slip_losses(contact_losses, lost, c, energies):
    """Log the energies [J] dissipated by sliding, rolling and twisting of contact c."""
    log_loss(contact_losses, lost, c, SLIDING, energies[0])
    log_loss(contact_losses, lost, c, ROLLING, energies[1])
    log_loss(contact_losses, lost, c, TWISTING, energies[2])


@loop
def store_damping_force(contacts, c, force):
    """Store the damping force [N] of contact c, if the contact law has an array for it (`ContactArrays.damped`)."""
    if contacts.damped.size > 0:
        contacts.damped[c] = force


@rare
def add_damping_force(grains, contacts, span, c, dt):
    """Add the damping force to the loads of contact c.

    The force depends on the closing speed at the end of the step, extrapolated with the accelerations at its start.
    The dissipated energy follows from the trapezoidal rule, as the work of all forces in velocity Verlet, with the
    stored force of the previous step.

    Returns
    -------
    float
        Energy [J] dissipated in the step.
    """
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    constants = constants_at(contacts, c)
    separation = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    distance = math.sqrt(dot(separation, separation))
    n = scale(1.0 / distance, separation)
    relative_velocity = sub(load(grains.velocity, i), load(grains.velocity, j))
    acceleration1 = scale(1.0 / grains.mass[i], load(grains.force, i))
    acceleration2 = scale(1.0 / grains.mass[j], load(grains.force, j))
    closing = -dot(axpy(0.5 * dt, sub(acceleration1, acceleration2), relative_velocity), n)
    overlap = grains.radius[i] + grains.radius[j] - distance
    y = jkr.root(jkr.stretch(overlap, constants.pull_off_overlap))
    force = damping_force(overlap, y, closing, constants)
    accrue(contacts.force, c, scale(force, n))
    start_separation = axpy(-dt, relative_velocity, separation)
    start_force = stored_damping_force(contacts, c) / math.sqrt(dot(start_separation, start_separation))
    store_damping_force(contacts, c, force)
    return -0.5 * dt * (start_force * dot(start_separation, relative_velocity) + force * dot(n, relative_velocity))


@rare
def damp_contacts(grains, contacts, count, lost, span, dt):
    """Damp all contacts and log the dissipated energies."""
    for c in range(count[CONTACTS]):
        if contacts.flag[c] != BROKEN_FLAG:
            log_loss(contacts.lost, lost, c, DAMPING, add_damping_force(grains, contacts, span, c, dt))


@rare
def log_stiffness_work(grains, contacts, count, lost, span, dt):
    """Log the energy that stiffnesses following a(δ) removed from the springs of all contacts in this step."""
    for c in range(count[CONTACTS]):
        constants = constants_at(contacts, c)
        pose = pose_at(grains, contacts, span, c, contacts.twist[c])
        r1, r2 = grains.radius[contacts.pair[0, c]], grains.radius[contacts.pair[1, c]]
        start = displacements_before(grains, contacts, c, pose, constants, dt)
        displacements = displacements_of(pose, r1 + r2 - pose.distance, r1, r2, constants)
        at_start = scaled_to_overlap(start.overlap, constants)
        now = scaled_to_overlap(displacements.overlap, constants)
        log_loss(contacts.lost, lost, c, STIFFNESS, stiffness_loss(start, displacements, at_start, now))


@loop
def scaled_to_overlap(overlap, constants):
    """Constants with the tangential stiffnesses at this overlap ("dt97")."""
    return scaled_stiffness(constants, jkr.root(jkr.stretch(overlap, constants.pull_off_overlap)), True)


@loop
def apply_pair_impulse(grains, i, j, n, impulse):
    """Apply the impulse [N s] along n to grain i and the opposite impulse to grain j."""
    accrue(grains.velocity, i, scale(impulse / grains.mass[i], n))
    accrue(grains.velocity, j, scale(-impulse / grains.mass[j], n))


@rare
def break_contact(grains, contacts, pair_list, count, lost, c, pose, constants, dt):
    """Log the energy of a contact that broke within the step, and flag it as broken.

    The contact force, −(5/9) F_c just before the break, ended a time τ before the end of the step, but velocity Verlet
    applied it for half a step: the difference is applied as an impulse.
    """
    i, j = contacts.pair[0, c], contacts.pair[1, c]
    overlap = grains.radius[i] + grains.radius[j] - pose.distance
    opening = dot(sub(load(grains.velocity, i), load(grains.velocity, j)), pose.n)
    stretched = -constants.break_overlap - overlap
    elapsed = min(stretched / opening, dt) if opening > 0.0 else 0.0
    energy, force = breaking_loss(constants)
    apply_pair_impulse(grains, i, j, pose.n, (force + stored_damping_force(contacts, c)) * (0.5 * dt - elapsed))
    log_loss(contacts.lost, lost, c, BREAKING, energy)
    # the damping force acted until the break: half a step in the velocity Verlet kick, the rest in the impulse
    log_loss(contacts.lost, lost, c, DAMPING, -stored_damping_force(contacts, c) * opening * (dt - elapsed))
    count[BROKEN] += 1
    contacts.flag[c] = BROKEN_FLAG
    put(contacts.force, c, (0.0, 0.0, 0.0))
    put(contacts.torque1, c, (0.0, 0.0, 0.0))
    put(contacts.torque2, c, (0.0, 0.0, 0.0))
    store_damping_force(contacts, c, 0.0)
    mark_separated(pair_list, count, i, j)


@rare
def update_flagged_contacts(grains, contacts, pair_list, count, lost, span, law, dt):
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
            y = jkr.root(jkr.stretch(displacements.overlap, constants.pull_off_overlap))
            constants_now = scaled_stiffness(constants, y, law.follow)
            if displacements.overlap < -constants.break_overlap:
                zero = (0.0, 0.0, 0.0)
                unloaded = Displacements(displacements.overlap, zero, zero, 0.0)
                slid, rolled, twisted = slip_losses(start, displacements, unloaded, constants_now)
                log_loss(contacts.lost, lost, c, BREAKING, slid + rolled + twisted)
                break_contact(grains, contacts, pair_list, count, lost, c, pose, constants, dt)
                broken = True
                continue
            target = after_slip(displacements, pose.n, constants, law.reset)
            n1, n2 = tangential.pointers_for(target.slide, target.roll, pose.n, r1, r2)
            new_pose = Pose(pose.n, pose.distance, n1, n2, target.twist)
            left = displacements_of(new_pose, displacements.overlap, r1, r2, constants)
            log_slip_losses(contacts.lost, lost, c, slip_losses(start, displacements, left, constants_now))
            put(contacts.pointer1, c, turned_back(load4(grains.orientation, i), n1))
            put(contacts.pointer2, c, turned_back(load4(grains.orientation, j), n2))
            contacts.twist[c] = left.twist
            count[SLIPPED] += 1
        write_loads(grains, contacts, span, law, c)
    return broken


@rare
def compact_contacts(contacts, count):
    """Remove broken contacts from the arrays; the order of the others is kept."""
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
                contacts.force[row, kept] = contacts.force[row, c]
                contacts.torque1[row, kept] = contacts.torque1[row, c]
                contacts.torque2[row, kept] = contacts.torque2[row, c]
            if not uniform_contacts(contacts):
                for row in range(contacts.constants.shape[0]):
                    contacts.constants[row, kept] = contacts.constants[row, c]
            for row in range(contacts.lost.shape[0]):
                contacts.lost[row, kept] = contacts.lost[row, c]
            store_damping_force(contacts, kept, stored_damping_force(contacts, c))
            contacts.twist[kept] = contacts.twist[c]
            contacts.formed[kept] = contacts.formed[c]
            contacts.flag[kept] = contacts.flag[c]
            contacts.every_step[kept] = contacts.every_step[c]
        kept += 1
    count[CONTACTS] = kept


@loop
def _is_new_contact(grains, pair_list, span, p):
    """1 if the grains of candidate pair p are not in contact but touch (D ≤ r1 + r2), else 0."""
    i, j = pair_list.pair[0, p], pair_list.pair[1, p]
    separation = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
    radii = grains.radius[i] + grains.radius[j]
    return 1 if (pair_list.in_contact[p] == 0) & (dot(separation, separation) <= radii * radii) else 0


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


@rare
def add_contact(grains, contacts, count, span, law, i, j, formed):
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
    store_damping_force(contacts, c, 0.0)
    for row in range(contacts.lost.shape[0]):
        contacts.lost[row, c] = 0.0
    constants = pair_constants(grains, law.pairings, i, j)
    first, last = (0, contacts.constants.shape[1]) if law.uniform_contacts else (c, c + 1)
    if c == 0 or not law.uniform_contacts:
        for row in range(contacts.constants.shape[0]):
            for k in range(first, last):
                contacts.constants[row, k] = constants[row]
    write_loads(grains, contacts, span, law, c)
    return c


@rare
def form_contacts(grains, contacts, pair_list, count, lost, clock, span, law, dt):
    """Form the contacts of pairs that began to touch within the step, and log the energy −U(0).

    The grains have moved freely for a time τ = overlap / closing speed w since first touch.  An impulse along n gives
    them the speed w′ that the contact force would have given them, less the contribution that velocity Verlet still
    adds; to first order the impulse is F (τ − dt/2).  Without the second order, (F τ)²/2m̄, there would be an energy
    error of the same sign in every contact formed.
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
        c = add_contact(grains, contacts, count, span, law, i, j, clock[TIME] + dt - elapsed)
        if law.damped:
            add_damping_force(grains, contacts, span, c, 0.0)
            log_loss(contacts.lost, lost, c, DAMPING, stored_damping_force(contacts, c) * closing * elapsed)
        reduced = grains.mass[i] * grains.mass[j] / (grains.mass[i] + grains.mass[j])
        # the step of 0 s at the start of a run finds grains that overlap already
        gain = (
            contact_speed_gain(radii - distance, closing, reduced, constants_at(contacts, c), dt) if dt > 0.0 else 0.0
        )
        impulse = stored_damping_force(contacts, c) * elapsed - reduced * gain
        apply_pair_impulse(grains, i, j, n, impulse - 0.5 * dt * dot(load(contacts.force, c), n))
        log_loss(contacts.lost, lost, c, FORMING, forming_loss(constants_at(contacts, c)))
        pair_list.in_contact[p] = 1
        count[MADE] += 1


@loop
def inner_list_overflowed(pair_list, count):
    """Whether all candidate pairs must be searched because the inner list was too short."""
    return pair_list.skin[INNER_COUNT] == count[PAIRS]


@rare
def mark_separated(pair_list, count, i, j):
    """Mark candidate pair (i, j) as not in contact and invalidate the inner list: the pair may touch again soon."""
    pair_list.skin[INNER_SKIN] = 0.0
    for p in range(count[PAIRS]):
        a, b = pair_list.pair[0, p], pair_list.pair[1, p]
        if (a == i and b == j) or (a == j and b == i):
            pair_list.in_contact[p] = 0
            return


@kernel
def add_initial_contacts(grains, contacts, count, span, law, pair, slide, roll, twist):
    """Append contacts with given displacements, before the first step.

    Parameters
    ----------
    grains, contacts : GrainArrays, ContactArrays
        Arrays of grains and contacts; the latter must have enough columns.
    count : ndarray
        Counters of the state.
    span : Span
        The box.
    law : ContactParameters
        Settings of the contact law.
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
        c = add_contact(grains, contacts, count, span, law, i, j, 0.0)
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
        write_loads(grains, contacts, span, law, c)
        if broken < 0 and r1 + r2 - distance < -constants_at(contacts, c).break_overlap:
            broken = k
    sort_contacts_by_grain(contacts, count, grains.mass.size)
    return broken
