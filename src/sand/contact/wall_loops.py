"""Loops over the contacts of grains with walls: form, slip, break, loads, energies, and the step that they need.

These contacts are few.  They are kept in a table of their own, `ContactArrays` with the grain in pair[0], the wall in
pair[1], and in `pointer2` the anchor relative to the point of the wall [m], laboratory frame; `torque2` and the lists
per grain are not used.  One loop does what `update`, `events` and `damping` do for contacts of grains, with the same
formulas and the same energies.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..basics.box import nearest_image
from ..basics.state import BREAKING, FORMING, LARGEST_OVERLAP, STEP, STEPS, STIFFNESS, TIME, WALL_CONTACTS
from ..compiler.jit import loop, rare
from ..numerics.quaternion import turned, turned_back, turned_by
from ..numerics.vec import accrue, across, add, axpy, dot, load, load4, put, scale, sub
from .constants_table import FASTEST_MODE, column_loops, load_pairing
from .damping import (
    FORCE,
    NO_LOAD,
    NONE,
    SPIN,
    THERMAL,
    TORQUE,
    VELOCITY,
    DampingLoad,
    Motion,
    damping_load,
    damping_losses,
    dashpots_of,
    extrapolated,
    load_rows,
    loads_on_grains,
    relative_motion,
    store_rows,
    stored_load,
    thermal_load,
    unit_deviates,
)
from .events import compact_contacts
from .impact import note_impact
from .law import ContactLaw, wall_constants
from .losses import DAMPING_ROW, FORMING_ROW, STIFFNESS_ROW, add_damping_energies, add_slip_energies, add_slip_losses
from .mechanics import (
    Displacements,
    after_slip,
    contact_speed_gain,
    exceeds_limits,
    scaled_stiffness,
    slip_losses,
    stiffness_loss,
    stored_energies,
)
from .update import BROKEN_FLAG
from .wall_mechanics import WallPose, wall_displacements, wall_load, wall_pointers

FULL = -1
"""Value of `WallLoops.update` if the table of contacts is too small; nothing has changed then."""
ZERO = (0.0, 0.0, 0.0)
LAST_ID = np.uint32(0xFFFFFFFF)
"""The walls count down from this number in the keys of random numbers, which grains use from 0 up."""


class WallNumbers(NamedTuple):
    """Constant numbers of the walls, parameters of their stages."""

    pairings: Any  # (11, M, W) contact.law.Pairing of each material of grains with each wall
    mass: Any  # (W,) [kg]; infinite if the motion of the wall is given
    push: Any  # (W,) force on the wall along its normal [N], for a wall with a mass


class WallLoops(NamedTuple):
    """Loops over contacts with walls, for one contact law and variant of damping."""

    update: Callable  # walls and contacts at the end of a step: returns FULL or the number of contacts
    energies: Callable  # adds the energies [J] of the four modes to an array
    constants_of: Callable  # ContactConstants of a grain and a wall


@loop
def wall_height(grains, walls, g, w):
    """Distance [m] of the centre of grain g from the plane of wall w; negative behind the wall."""
    return dot(sub(load(grains.position, g), load(walls.position, w)), load(walls.normal, w))


@loop
def _wall_pose(grains, walls, contacts, span, c, twist):
    """Pose of contact c at the present positions, with the given twist [rad]."""
    g, w = contacts.pair[0, c], contacts.pair[1, c]
    n = load(walls.normal, w)
    from_anchor = sub(sub(load(grains.position, g), load(walls.position, w)), load(contacts.pointer2, c))
    offset = across(nearest_image(from_anchor, span), n)
    n1 = turned(load4(grains.orientation, g), load(contacts.pointer1, c))
    return WallPose(n, wall_height(grains, walls, g, w), offset, n1, twist)


@loop
def _relative_velocity(grains, walls, g, w):
    """Velocity [m/s] of the centre of grain g relative to wall w."""
    return sub(load(grains.velocity, g), load(walls.velocity, w))


@loop
def _at_step_start(pose, velocity, spin, twist, dt):
    """Pose at the start of the step of dt [s], from the velocities in its middle."""
    return WallPose(
        pose.n,
        pose.height - dt * dot(velocity, pose.n),
        axpy(-dt, across(velocity, pose.n), pose.offset),
        turned_by(scale(-dt, spin), pose.n1),
        twist,
    )


@loop
def _push_apart(grains, walls, numbers, g, w, impulse):
    """Apply an impulse [N s] along the normal to grain g, and the opposite one to wall w."""
    n = load(walls.normal, w)
    accrue(grains.velocity, g, scale(impulse / grains.mass[g], n))
    accrue(walls.velocity, w, scale(-impulse / numbers.mass[w], n))
    accrue(walls.impulse, w, scale(-impulse, n))


@loop
def _relative_motion(radius, n, velocity, spin):
    """U = v − v_wall − r1 ω×n and Ω = ω: `damping.relative_motion` for r2 → ∞."""
    return relative_motion(scale(radius, n), velocity, spin, spin, ZERO)


@loop
def _start_walls(walls, numbers, dt):
    """First half kick of walls with a mass, and the drift of all walls."""
    for w in range(walls.work.size):
        put(walls.velocity_before, w, load(walls.velocity, w))
        put(walls.impulse_before, w, load(walls.impulse, w))
        along = dot(load(walls.force, w), load(walls.normal, w)) + numbers.push[w]
        accrue(walls.velocity, w, scale(0.5 * dt * along / numbers.mass[w], load(walls.normal, w)))
        accrue(walls.position, w, scale(dt, load(walls.velocity, w)))


@loop
def _finish_walls(walls, contacts, count, numbers, dt):
    """Force on each wall, the second half kick of walls with a mass, impulse and work in this step."""
    for w in range(walls.work.size):
        n, start = load(walls.normal, w), load(walls.force, w)
        force = ZERO
        for c in range(count[WALL_CONTACTS]):
            if contacts.pair[1, c] == w:
                force = sub(force, load(contacts.force, c))
        put(walls.force, w, force)
        accrue(walls.impulse, w, scale(0.5 * dt, add(start, force)))
        impulse = sub(load(walls.impulse, w), load(walls.impulse_before, w))
        middle = load(walls.velocity, w)  # with the impulses of contacts that formed or broke in this step
        drift = dot(load(walls.velocity_before, w), n) + 0.5 * dt * (dot(start, n) + numbers.push[w]) / numbers.mass[w]
        along = dot(force, n) + numbers.push[w]
        accrue(walls.velocity, w, scale(0.5 * dt * along / numbers.mass[w], n))
        if numbers.mass[w] < math.inf:
            # kinetic energy of the motion along n; the other components of the velocity are constant
            before, after = dot(load(walls.velocity_before, w), n), dot(load(walls.velocity, w), n)
            gained = 0.5 * numbers.mass[w] * (after * after - before * before)
            walls.work[w] += numbers.push[w] * dt * drift - gained - dot(across(middle, n), impulse)
        else:
            walls.work[w] -= dot(middle, impulse)


@rare
def count_new_wall_contacts(grains, walls, contacts, count, numbers, dt):
    """Mark grains in contact in `walls.touching`; number of grains that touch a wall after it has moved for dt [s]."""
    for w in range(walls.work.size):
        for g in range(grains.mass.size):
            walls.touching[w, g] = 0
    for c in range(count[WALL_CONTACTS]):
        walls.touching[contacts.pair[1, c], contacts.pair[0, c]] = 1
    found = 0
    for w in range(walls.work.size):
        n, at = load(walls.normal, w), load(walls.position, w)
        along = dot(load(walls.force, w), n) + numbers.push[w]
        at = axpy(dt, axpy(0.5 * dt * along / numbers.mass[w], n, load(walls.velocity, w)), at)
        for g in range(grains.mass.size):
            near = dot(sub(load(grains.position, g), at), n) <= grains.radius[g]
            found += 1 if near and walls.touching[w, g] == 0 else 0
    return found


@loop
def _note_overlaps(grains, walls, contacts, clock, count):
    """Keep the largest overlap with a wall, in radii of the grain, in `State.clock` if it is the largest so far."""
    for c in range(count[WALL_CONTACTS]):
        g = contacts.pair[0, c]
        overlap = grains.radius[g] - wall_height(grains, walls, g, contacts.pair[1, c])
        clock[LARGEST_OVERLAP] = max(clock[LARGEST_OVERLAP], overlap / grains.radius[g])


@functools.cache
def wall_loops(law: ContactLaw, damping: str = NONE) -> WallLoops:
    """The loops over contacts with walls, for one contact law and variant of damping."""
    columns, of_materials = column_loops(law), wall_constants(law)
    constants_at, store_constants = columns.at, columns.store
    radius_root, normal_force, normal_energy = law.radius_root, law.force, law.energy
    stiffness, contact_radius, at_touch, at_break = law.stiffness, law.contact_radius, law.at_touch, law.at_break
    damped, thermal = damping != NONE, damping == THERMAL

    @loop
    def constants_of(grains, numbers, g, w):
        pairing = load_pairing(numbers.pairings, grains.material[g], w)
        return of_materials(pairing, grains.radius[g], grains.mass[g], numbers.mass[w])

    @loop
    def dashpot_load(grains, walls, contacts, c, pose, constants, settings, number, dt):
        """Update and store the dashpots of contact c; their loads, and the energies [J] dissipated by the modes."""
        g, w = contacts.pair[0, c], contacts.pair[1, c]
        radius, spin = grains.radius[g], load(grains.spin, g)
        velocity = _relative_velocity(grains, walls, g, w)
        motion = _relative_motion(radius, pose.n, velocity, spin)
        before = Motion(load_rows(contacts.damping, VELOCITY, c), load_rows(contacts.damping, SPIN, c))
        start, overlap = stored_load(contacts, c), radius - pose.height
        dashpots = dashpots_of(contact_radius(overlap, radius_root(overlap, constants), constants), constants)
        end = damping_load(extrapolated(before, motion, dt), pose.n, dashpots)
        if thermal:
            deviates = unit_deviates(settings.seed, number, grains.id[g], LAST_ID - np.uint32(w))
            noise = thermal_load(dashpots, pose.n, deviates, settings.bath, dt)
            end = DampingLoad(add(end.force, noise.force), add(end.torque, noise.torque))
        store_rows(contacts.damping, VELOCITY, c, motion.velocity)
        store_rows(contacts.damping, SPIN, c, motion.spin)
        store_rows(contacts.damping, FORCE, c, end.force)
        store_rows(contacts.damping, TORQUE, c, end.torque)
        return end, damping_losses(start, end, pose.n, velocity, motion, ZERO, dt)

    @loop
    def write_loads(grains, contacts, c, pose, slide, normal, end, present):
        """Store the loads of contact c with those of its dashpots."""
        radius = grains.radius[contacts.pair[0, c]]
        force, torque = wall_load(pose, slide, normal, radius, present)
        more, more_torque, _ = loads_on_grains(end, scale(radius, pose.n), 1.0, 0.0)
        put(contacts.force, c, add(force, more))
        put(contacts.torque1, c, add(torque, more_torque))

    @rare
    def break_contact(grains, walls, contacts, lost, numbers, c, pose, velocity, constants, dt):
        """As `events.settle_loop`: the energy of a contact that broke within the step, and the impulse since then."""
        g, w = contacts.pair[0, c], contacts.pair[1, c]
        opening, radius = dot(velocity, pose.n), grains.radius[g]
        stretched = pose.height - radius - constants.break_overlap
        elapsed = min(stretched / opening, dt) if opening > 0.0 else 0.0
        energy, force = at_break(constants)
        lost[BREAKING] += energy
        if damped:
            start, motion = stored_load(contacts, c), _relative_motion(radius, pose.n, velocity, load(grains.spin, g))
            losses = damping_losses(start, NO_LOAD, pose.n, velocity, motion, ZERO, dt)
            normal = dot(start.force, pose.n)
            add_damping_energies(lost, (-normal * opening * (dt - elapsed), losses[1], losses[2], losses[3]))
            force += normal
        _push_apart(grains, walls, numbers, g, w, force * (0.5 * dt - elapsed))
        contacts.flag[c] = BROKEN_FLAG
        put(contacts.force, c, ZERO)
        put(contacts.torque1, c, ZERO)

    @rare
    def update_contact(grains, walls, contacts, count, lost, span, settings, numbers, c, dt):
        """Update contact c at the end of a step: slip or break it, and store its loads.  Returns 1 if it broke."""
        g, w = contacts.pair[0, c], contacts.pair[1, c]
        radius, spin, constants = grains.radius[g], load(grains.spin, g), constants_at(contacts, c)
        velocity = _relative_velocity(grains, walls, g, w)
        twist = contacts.twist[c]
        pose = _wall_pose(grains, walls, contacts, span, c, twist + dt * dot(spin, load(walls.normal, w)))
        found = wall_displacements(pose, radius)
        start = wall_displacements(_at_step_start(pose, velocity, spin, twist, dt), radius)
        y = radius_root(found.overlap, constants)
        present = scaled_stiffness(constants, y, settings.follow)
        if settings.follow:
            earlier = scaled_stiffness(constants, radius_root(start.overlap, constants), True)
            energy = stiffness_loss(start, found, earlier, present)
            lost[STIFFNESS] += energy
            contacts.lost[STIFFNESS_ROW, c] += energy
        if found.overlap < -constants.break_overlap:
            slid, rolled, twisted = slip_losses(start, found, Displacements(found.overlap, ZERO, ZERO, 0.0), present)
            lost[BREAKING] += slid + rolled + twisted
            break_contact(grains, walls, contacts, lost, numbers, c, pose, velocity, constants, dt)
            return 1
        if exceeds_limits(found, pose.n, constants):
            target = after_slip(found, pose.n, constants, settings.reset)
            n1, offset = wall_pointers(target.slide, target.roll, pose.n, radius)
            put(contacts.pointer1, c, turned_back(load4(grains.orientation, g), n1))
            accrue(contacts.pointer2, c, sub(pose.offset, offset))
            pose = WallPose(pose.n, pose.height, offset, n1, target.twist)
            left = wall_displacements(pose, radius)
            slipped = slip_losses(start, found, left, present)
            add_slip_losses(contacts.lost, c, slipped)
            add_slip_energies(lost, slipped)
            found = left
        contacts.twist[c] = pose.twist
        end = NO_LOAD
        if damped:
            end, losses = dashpot_load(grains, walls, contacts, c, pose, constants, settings, count[STEPS], dt)
            contacts.lost[DAMPING_ROW, c] += losses[0] + losses[1] + losses[2] + losses[3]
            add_damping_energies(lost, losses)
        write_loads(grains, contacts, c, pose, found.slide, normal_force(found.overlap, y, constants), end, present)
        return 0

    @rare
    def form_contact(grains, walls, contacts, clock, count, lost, settings, numbers, g, w, dt):
        """As `events.forming_loops`: a contact that formed within the step, its energy −U(0), and the impulse."""
        c = count[WALL_CONTACTS]
        count[WALL_CONTACTS] = c + 1
        n, radius, constants = load(walls.normal, w), grains.radius[g], constants_of(grains, numbers, g, w)
        from_point = sub(load(grains.position, g), load(walls.position, w))
        overlap, velocity = radius - dot(from_point, n), _relative_velocity(grains, walls, g, w)
        closing = -dot(velocity, n)
        elapsed = min(overlap / closing, dt) if closing > 0.0 else 0.0
        contacts.pair[0, c], contacts.pair[1, c] = g, w
        put(contacts.pointer1, c, turned_back(load4(grains.orientation, g), scale(-1.0, n)))
        put(contacts.pointer2, c, across(from_point, n))
        contacts.twist[c] = 0.0
        contacts.formed[c] = clock[TIME] + dt - elapsed
        contacts.flag[c] = contacts.every_step[c] = 0
        for row in range(contacts.lost.shape[0]):
            contacts.lost[row, c] = 0.0
        store_constants(contacts.constants, c, constants)
        y = radius_root(overlap, constants)
        force = normal_force(overlap, y, constants)
        pose, end, impulse = WallPose(n, radius - overlap, ZERO, scale(-1.0, n), 0.0), NO_LOAD, 0.0
        if damped:
            motion = _relative_motion(radius, n, velocity, load(grains.spin, g))
            store_rows(contacts.damping, VELOCITY, c, motion.velocity)
            store_rows(contacts.damping, SPIN, c, motion.spin)
            store_rows(contacts.damping, FORCE, c, ZERO)
            store_rows(contacts.damping, TORQUE, c, ZERO)
            end, losses = dashpot_load(grains, walls, contacts, c, pose, constants, settings, count[STEPS], dt)
            # along n the force acts since first touch, otherwise for half a step in the velocity Verlet kick
            impulse = dot(end.force, n) * elapsed
            contacts.lost[DAMPING_ROW, c] += impulse * closing + losses[1] + losses[2] + losses[3]
            add_damping_energies(lost, (impulse * closing, losses[1], losses[2], losses[3]))
        write_loads(grains, contacts, c, pose, ZERO, force, end, scaled_stiffness(constants, y, settings.follow))
        if dt > 0.0:
            reduced = 1.0 / (1.0 / grains.mass[g] + 1.0 / numbers.mass[w])
            pairing = load_pairing(numbers.pairings, grains.material[g], w)
            note_impact(clock, closing, reduced, constants.reduced_radius, pairing.modulus)
            drop = at_touch(constants) - normal_energy(overlap, y, constants)
            gain = contact_speed_gain(drop, force, stiffness(overlap, y, constants), closing, reduced, dt)
            impulse -= reduced * gain + 0.5 * dt * dot(load(contacts.force, c), n)
        _push_apart(grains, walls, numbers, g, w, impulse)
        lost[FORMING] -= at_touch(constants)
        contacts.lost[FORMING_ROW, c] -= at_touch(constants)

    @rare
    def update(grains, walls, contacts, clock, count, lost, span, settings, numbers):
        """Move the walls, and update their contacts at the end of a step; returns FULL or the number of contacts."""
        dt = clock[STEP]
        formed = count_new_wall_contacts(grains, walls, contacts, count, numbers, dt)
        if count[WALL_CONTACTS] + formed > contacts.pair.shape[1]:
            return FULL
        _start_walls(walls, numbers, dt)
        broken = 0
        for c in range(count[WALL_CONTACTS]):
            broken += update_contact(grains, walls, contacts, count, lost, span, settings, numbers, c, dt)
        for w in range(walls.work.size):
            for g in range(grains.mass.size if formed > 0 else 0):
                touches = walls.touching[w, g] == 0 and wall_height(grains, walls, g, w) <= grains.radius[g]
                if touches and count[WALL_CONTACTS] < contacts.pair.shape[1]:
                    form_contact(grains, walls, contacts, clock, count, lost, settings, numbers, g, w, dt)
        _finish_walls(walls, contacts, count, numbers, dt)
        _note_overlaps(grains, walls, contacts, clock, count)
        if broken > 0:
            count[WALL_CONTACTS] = compact_contacts(contacts, count[WALL_CONTACTS])
        return count[WALL_CONTACTS]

    @loop
    def add_energies(grains, walls, contacts, count, span, settings, out):
        """Add the energies [J] of the four modes of all contacts with walls to `out`."""
        for c in range(count[WALL_CONTACTS]):
            constants, radius = constants_at(contacts, c), grains.radius[contacts.pair[0, c]]
            found = wall_displacements(_wall_pose(grains, walls, contacts, span, c, contacts.twist[c]), radius)
            y = radius_root(found.overlap, constants)
            present = scaled_stiffness(constants, y, settings.follow)
            stored = stored_energies(found, normal_energy(found.overlap, y, constants), present)
            for mode in range(4):
                out[mode] += stored[mode]

    return WallLoops(update, add_energies, constants_of)


@loop
def add_wall_loads(grains, contacts, count):
    """Add the loads of contacts with walls to the loads of the grains."""
    for c in range(count[WALL_CONTACTS]):
        g = contacts.pair[0, c]
        accrue(grains.force, g, load(contacts.force, c))
        accrue(grains.torque, g, load(contacts.torque1, c))


@loop
def _fastest(walls, contacts, count, numbers, grains, c):
    """Largest squared frequency [1/s²] of contact c: all contacts of a wall with a mass M share it, z m/M times."""
    g, w = contacts.pair[0, c], contacts.pair[1, c]
    return contacts.constants[FASTEST_MODE, c] * (1.0 + walls.contacts[w] * grains.mass[g] / numbers.mass[w])


@functools.cache
def wall_step_loop(law: ContactLaw) -> Callable:
    """The loop that finds the longest step that walls allow, for one contact law."""
    constants_of, constants_at = wall_loops(law).constants_of, column_loops(law).at

    @rare
    def wall_step(grains, walls, contacts, count, per_period, numbers, longest, impact, closing_fraction):
        """Longest step [s] that contacts with walls allow, and that grains approaching a wall allow.

        The rules are those of pairs of grains (`integrate.step_control.pair_step`): the fastest mode is resolved by
        `per_period` steps, an impact by steps of at most `impact` δ_c, and in one step a grain closes at most
        `closing_fraction` of its gap.

        Returns
        -------
        tuple
            Step of contacts and step of approach [s], at most `longest`, and a grain whose centre is behind a wall
            that it touches, or −1.
        """
        bound = approach = longest
        behind = -1
        for w in range(walls.work.size):
            walls.contacts[w] = 0.0
        for c in range(count[WALL_CONTACTS]):
            walls.contacts[contacts.pair[1, c]] += 1.0
        for c in range(count[WALL_CONTACTS]):
            g, w = contacts.pair[0, c], contacts.pair[1, c]
            speed = abs(dot(_relative_velocity(grains, walls, g, w), load(walls.normal, w)))
            required = 2.0 * math.pi / math.sqrt(_fastest(walls, contacts, count, numbers, grains, c)) / per_period
            bound = min(bound, required)
            overlap = constants_at(contacts, c).break_overlap
            if overlap > 0.0 and speed * required > impact * overlap:
                approach = min(approach, impact * overlap / speed)
            if wall_height(grains, walls, g, w) < 0.0:
                behind = g
        for w in range(walls.work.size):
            n = load(walls.normal, w)
            for g in range(grains.mass.size):
                gap = wall_height(grains, walls, g, w) - grains.radius[g]
                closing = -dot(_relative_velocity(grains, walls, g, w), n)
                if gap > 0.0 and closing * approach > closing_fraction * gap:
                    constants = constants_of(grains, numbers, g, w)
                    required = 2.0 * math.pi / math.sqrt(constants.max_squared_frequency) / per_period
                    if constants.break_overlap > 0.0 and closing * required > impact * constants.break_overlap:
                        required = impact * constants.break_overlap / closing
                    approach = min(approach, max(required, closing_fraction * gap / closing))
        return bound, approach, behind

    return wall_step
