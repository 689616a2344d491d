"""Loops over the contacts of grains with walls: form, slip, break, loads, and the motion of walls.

These contacts are few, and kept in a table of their own (`wall_arrays.WallContactArrays`).  Forming, slip, breaking,
dashpots and losses are those of contacts of grains (`transitions`, `mechanics`, `damping`): these loops load what they
take, and apply the impulses.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..basics.state import BREAKING, LARGEST_OVERLAP, STEP, STEPS, TIME
from ..compiler.jit import caller, loop, rare
from ..contact.constants_table import column_loops, load_pairing
from ..contact.damping import Held, Surfaces, damping_loops, relative_motion, store_loads
from ..contact.events import compact_contacts
from ..contact.law import ContactLaw
from ..contact.losses import record_slip, record_stiffness_loss
from ..contact.mechanics import (
    after_slip,
    exceeds_limits,
    release_loss,
    scaled_stiffness,
    slip_losses,
    stiffness_loss,
    time_since,
)
from ..contact.transitions import ZERO, Break, Touch, breaking_loop, clear_contact, touch_loop
from ..contact.update import PresentStep
from ..numerics.quaternion import turned, turned_back, turned_by
from ..numerics.vec import accrue, across, add, axpy, dot, load, load4, nearest_image, put, scale, sub
from .wall_formulas import WallPose, wall_constants, wall_displacements, wall_load, wall_pointers

FULL = -1
"""Value of the loop of `wall_loop` if the table of contacts is too small; nothing has changed then."""
LAST_ID = np.uint32(0xFFFFFFFF)
"""The walls count down from this number in the keys of random numbers, which grains use from 0 up."""


WALL_PARTS = ("grains", "walls", "wall_contacts", "clock", "count", "lost", "span", "settings")
"""Parts that the loops over contacts with walls use, as attributes of `s`."""


class WallNumbers(NamedTuple):
    """Constant numbers of the walls, parameters of their stages."""

    pairings: Any  # (11, M, W) contact.law.Pairing of each material of grains with each wall
    mass: Any  # (W,) [kg]; infinite if the motion of the wall is given


@loop
def wall_height(grains, walls, g, w):
    """Distance [m] of the centre of grain g from the plane of wall w; negative behind the wall."""
    return dot(sub(load(grains.position, g), load(walls.position, w)), load(walls.normal, w))


@caller
def wall_pose(s, c, twist):
    """Pose of contact c at the present positions, with the given twist [rad]."""
    g, w = s.wall_contacts.pair[0, c], s.wall_contacts.pair[1, c]
    n = load(s.walls.normal, w)
    from_anchor = sub(sub(load(s.grains.position, g), load(s.walls.position, w)), load(s.wall_contacts.pointer2, c))
    offset = across(nearest_image(from_anchor, s.span), n)
    n1 = turned(load4(s.grains.orientation, g), load(s.wall_contacts.pointer1, c))
    return WallPose(n, wall_height(s.grains, s.walls, g, w), offset, n1, twist)


@loop
def relative_velocity(grains, walls, g, w):
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
def surfaces_at_wall(bodies, contacts, c, held, span):
    """The two sides of contact c, for `bodies` = (grains, walls): `damping.surfaces_of_pair` for r2 → ∞."""
    grains, walls = bodies
    g, w = contacts.pair[0, c], contacts.pair[1, c]
    velocity, spin = relative_velocity(grains, walls, g, w), load(grains.spin, g)
    arm = scale(grains.radius[g], held.pose.n)
    motion = relative_motion(arm, velocity, spin, spin, ZERO)
    ids = grains.id[g], LAST_ID - np.uint32(w)
    return Surfaces(1.0, velocity, arm, ZERO, motion, ids)


@caller
def _push_apart(s, numbers, c, impulse):
    """Apply an impulse [N s] along the normal to the grain of contact c, and the opposite one to the wall."""
    g, w = s.wall_contacts.pair[0, c], s.wall_contacts.pair[1, c]
    n = load(s.walls.normal, w)
    accrue(s.grains.velocity, g, scale(impulse / s.grains.mass[g], n))
    accrue(s.walls.velocity, w, scale(-impulse / numbers.mass[w], n))
    accrue(s.walls.impulse, w, scale(-impulse, n))


@loop
def _start_walls(walls, numbers, dt):
    """First half kick of walls with a mass, and the drift of all walls."""
    for w in range(walls.work.size):
        put(walls.velocity_before, w, load(walls.velocity, w))
        put(walls.impulse_before, w, load(walls.impulse, w))
        along = dot(load(walls.force, w), load(walls.normal, w)) + walls.push[w]
        accrue(walls.velocity, w, scale(0.5 * dt * along / numbers.mass[w], load(walls.normal, w)))
        accrue(walls.position, w, scale(dt, load(walls.velocity, w)))


@loop
def _finish_walls(walls, contacts, numbers, dt):
    """Force on each wall, the second half kick of walls with a mass, impulse and work in this step.

    The work is −V·J with the impulse J of the grains.  Along n, a wall with a mass does ∫ push V dt less its gain of
    kinetic energy.
    """
    for w in range(walls.work.size):
        n, start = load(walls.normal, w), load(walls.force, w)
        force = ZERO
        for c in range(contacts.used[0]):
            if contacts.pair[1, c] == w:
                force = sub(force, load(contacts.force, c))
        put(walls.force, w, force)
        accrue(walls.impulse, w, scale(0.5 * dt, add(start, force)))
        impulse = sub(load(walls.impulse, w), load(walls.impulse_before, w))
        middle = load(walls.velocity, w)  # with the impulses of contacts that formed or broke in this step
        speed = dot(load(walls.velocity_before, w), n)
        drift_speed = speed + 0.5 * dt * (dot(start, n) + walls.push[w]) / numbers.mass[w]
        along = dot(force, n) + walls.push[w]
        accrue(walls.velocity, w, scale(0.5 * dt * along / numbers.mass[w], n))
        if numbers.mass[w] < math.inf:
            # kinetic energy of the motion along n; the other components of the velocity are constant
            before, after = dot(load(walls.velocity_before, w), n), dot(load(walls.velocity, w), n)
            gained = 0.5 * numbers.mass[w] * (after * after - before * before)
            walls.work[w] += walls.push[w] * dt * drift_speed - gained - dot(across(middle, n), impulse)
        else:
            walls.work[w] -= dot(middle, impulse)


@loop
def move_walls_alone(walls, contacts, numbers, dt):
    """Move walls for a step of dt [s] in which no grain is in contact with them."""
    _start_walls(walls, numbers, dt)
    _finish_walls(walls, contacts, numbers, dt)


@rare
def count_new_wall_contacts(grains, walls, contacts, numbers, dt):
    """Mark grains in contact in `walls.touching`; number of grains that touch a wall after it has moved for dt [s]."""
    for w in range(walls.work.size):
        for g in range(grains.mass.size):
            walls.touching[w, g] = 0
    for c in range(contacts.used[0]):
        walls.touching[contacts.pair[1, c], contacts.pair[0, c]] = 1
    found = 0
    for w in range(walls.work.size):
        n, at = load(walls.normal, w), load(walls.position, w)
        along = dot(load(walls.force, w), n) + walls.push[w]
        at = axpy(dt, axpy(0.5 * dt * along / numbers.mass[w], n, load(walls.velocity, w)), at)
        for g in range(grains.mass.size):
            near = dot(sub(load(grains.position, g), at), n) <= grains.radius[g]
            found += 1 if near and walls.touching[w, g] == 0 else 0
    return found


@loop
def _note_overlaps(grains, walls, contacts, clock):
    """Keep the largest overlap with a wall, in radii of the grain, in `State.clock` if it is the largest so far."""
    for c in range(contacts.used[0]):
        g = contacts.pair[0, c]
        overlap = grains.radius[g] - wall_height(grains, walls, g, contacts.pair[1, c])
        clock[LARGEST_OVERLAP] = max(clock[LARGEST_OVERLAP], overlap / grains.radius[g])


@functools.cache
def constants_loop(law: ContactLaw) -> Callable:
    """The function (grains, numbers, g, w) → `ContactConstants` of a grain and a wall, for one contact law."""
    of_materials = wall_constants(law)

    @loop
    def constants_of(grains, numbers, g, w):
        pairing = load_pairing(numbers.pairings, grains.material[g], w)
        return of_materials(pairing, grains.radius[g], grains.mass[g], numbers.mass[w])

    return constants_of


@functools.cache
def wall_loop(law: ContactLaw, damping: str) -> Callable:
    """The function (s, numbers) that moves walls and updates their contacts, for a law and a variant of damping."""
    constants_at, store_constants, constants_of = column_loops(law).at, column_loops(law).store, constants_loop(law)
    radius_root, normal_force, contact_radius = law.radius_root, law.force, law.contact_radius
    dashpots = damping_loops(damping, surfaces_at_wall)
    break_contact, touch, damp = breaking_loop(law, dashpots), touch_loop(law, dashpots), dashpots.single

    @rare
    def update_contact(s, numbers, c, step):
        """Update contact c at the end of a step: slip or break it, and store its loads.  Returns 1 if it broke."""
        contacts, bodies, dt = s.wall_contacts, (s.grains, s.walls), step.dt
        g, w = contacts.pair[0, c], contacts.pair[1, c]
        constants, twist = constants_at(contacts, c), contacts.twist[c]
        radius, spin, velocity = s.grains.radius[g], load(s.grains.spin, g), relative_velocity(s.grains, s.walls, g, w)
        pose = wall_pose(s, c, twist + dt * dot(spin, load(s.walls.normal, w)))
        reached = wall_displacements(pose, radius)
        start = wall_displacements(_at_step_start(pose, velocity, spin, twist, dt), radius)
        overlap = reached.overlap
        y = radius_root(overlap, constants)
        present = scaled_stiffness(constants, y, step.settings.follow)
        if step.settings.follow:
            earlier = scaled_stiffness(constants, radius_root(start.overlap, constants), True)
            record_stiffness_loss(contacts, s.lost, c, stiffness_loss(start, reached, earlier, present))
        if overlap < -constants.break_overlap:
            s.lost[BREAKING] += release_loss(start, reached, present)
            broken = Break(pose, -constants.break_overlap - overlap, dot(velocity, pose.n), constants)
            _push_apart(s, numbers, c, break_contact(bodies, contacts, s.lost, c, broken, step))
            return 1
        if exceeds_limits(reached, pose.n, constants):
            target = after_slip(reached, pose.n, constants, step.settings.reset)
            n1, offset = wall_pointers(target.slide, target.roll, pose.n, radius)
            put(contacts.pointer1, c, turned_back(load4(s.grains.orientation, g), n1))
            accrue(contacts.pointer2, c, sub(pose.offset, offset))
            pose = WallPose(pose.n, pose.height, offset, n1, target.twist)
            left = wall_displacements(pose, radius)
            record_slip(contacts, s.lost, c, slip_losses(start, reached, left, present))
            reached = left
        contacts.twist[c] = pose.twist
        normal = normal_force(overlap, y, constants)
        store_loads(contacts, c, wall_load(pose, reached.slide, normal, radius, present))
        damp(bodies, contacts, s.lost, c, Held(pose, contact_radius(overlap, y, constants), constants), step)
        return 0

    @rare
    def form_contact(s, numbers, g, w, step):
        """Form the contact of a grain and a wall that began to touch within the step."""
        contacts, c = s.wall_contacts, s.wall_contacts.used[0]
        contacts.used[0] = c + 1
        contacts.pair[0, c], contacts.pair[1, c] = g, w
        n, constants = load(s.walls.normal, w), constants_of(s.grains, numbers, g, w)
        from_point = sub(load(s.grains.position, g), load(s.walls.position, w))
        overlap = s.grains.radius[g] - dot(from_point, n)
        closing = -dot(relative_velocity(s.grains, s.walls, g, w), n)
        clear_contact(contacts, c, s.clock[TIME] + step.dt - time_since(overlap, closing, step.dt))
        put(contacts.pointer1, c, turned_back(load4(s.grains.orientation, g), scale(-1.0, n)))
        put(contacts.pointer2, c, across(from_point, n))
        store_constants(contacts.constants, c, constants)
        y = radius_root(overlap, constants)
        store_loads(contacts, c, (scale(normal_force(overlap, y, constants), n), ZERO, ZERO))
        pose = WallPose(n, s.grains.radius[g] - overlap, ZERO, scale(-1.0, n), 0.0)
        held = Held(pose, contact_radius(overlap, y, constants), constants)
        pairing = load_pairing(numbers.pairings, s.grains.material[g], w)
        reduced = 1.0 / (1.0 / s.grains.mass[g] + 1.0 / numbers.mass[w])
        touched = Touch(n, held, overlap, closing, reduced, pairing.modulus)
        _push_apart(s, numbers, c, touch((s.grains, s.walls), contacts, s.lost, s.clock, c, touched, step))

    @rare
    def update(s, numbers):
        """Move the walls, and update their contacts at the end of a step; returns FULL or the number of contacts."""
        grains, walls, contacts, used = s.grains, s.walls, s.wall_contacts, s.wall_contacts.used
        step = PresentStep(s.span, s.settings, s.count[STEPS], s.clock[STEP])
        formed = count_new_wall_contacts(grains, walls, contacts, numbers, step.dt)
        if used[0] + formed > contacts.pair.shape[1]:
            return FULL
        _start_walls(walls, numbers, step.dt)
        broken = 0
        for c in range(used[0]):
            broken += update_contact(s, numbers, c, step)
        for w in range(walls.work.size):
            for g in range(grains.mass.size if formed > 0 else 0):
                touches = walls.touching[w, g] == 0 and wall_height(grains, walls, g, w) <= grains.radius[g]
                if touches and used[0] < contacts.pair.shape[1]:
                    form_contact(s, numbers, g, w, step)
        _finish_walls(walls, contacts, numbers, step.dt)
        _note_overlaps(grains, walls, contacts, s.clock)
        if broken > 0:
            used[0] = compact_contacts(contacts, used[0])
        return used[0]

    return update
