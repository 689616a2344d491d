"""The stages of walls: what the driver calls in each step, and what the ledger needs."""

from __future__ import annotations

import math

import numpy as np

from ..basics.state import GRAIN1, LATE, STEP
from ..compiler.recipes import factory
from ..compiler.stage import Stage, stage
from ..contact.bath_work import accelerations, half_kick_weight, record_half_kick
from ..contact.constants_table import FASTEST_MODE, column_loops
from ..contact.damping import THERMAL, relative_motion
from ..contact.law import ContactLaw
from ..contact.measure import ENERGIES, put_row
from ..contact.mechanics import scaled_stiffness, stored_energies
from ..contact.transitions import ZERO
from ..integrate.hooks import Hook, HookStages
from ..integrate.parts import DT, LIMIT, Stop
from ..integrate.rigid.body_touches import NEAR, TOUCHING, reach_of_plane
from ..integrate.stages import NO_STEP
from ..integrate.step_control import CLOSING_FRACTION, quantise_step
from ..numerics.vec import accrue, across, dot, load, scale, sub
from .wall_formulas import wall_displacements
from .wall_loops import (
    FULL,
    WALL_PARTS,
    WallNumbers,
    constants_loop,
    move_walls_alone,
    relative_velocity,
    wall_height,
    wall_loop,
    wall_pose,
)


@factory
def contacts_stage(law: ContactLaw, damping: str) -> Stage:
    """Contacts with walls at the end of a step, for one contact law and variant of damping."""
    update = wall_loop(law, damping)

    @stage("the contacts with walls", seconds=4.0, parts=WALL_PARTS)
    def update_walls(s, parameters):
        """Move the walls, and form, slip and break their contacts; returns a `Stop`."""
        return Stop.TABLES_FULL.value if update(s, parameters) == FULL else Stop.NONE.value

    return update_walls


@factory
def step_stage(law: ContactLaw) -> Stage:
    """The longest step that walls allow, for one contact law."""
    constants_of, constants_at = constants_loop(law), column_loops(law).at

    @stage("the time step of walls", parts=(*WALL_PARTS, "criteria", "scratch"))
    def wall_step(s, parameters):
        """Lower `scratch[LIMIT]` to what contacts with walls, and grains approaching a wall, allow.

        The rules are those of pairs of grains (`integrate.step_control.pair_step`): the fastest mode is resolved by
        `settings.per_period` steps, an impact by steps of at most `criteria.impact` δ_c, and in one step a grain closes
        at most CLOSING_FRACTION of its gap; this step of approach is rounded down to a power of two of a second.

        Returns
        -------
        int
            `Stop.OVERCOMPRESSED`, with GRAIN1, if the centre of a grain is behind a wall that it touches.
        """
        grains, walls, contacts, numbers = s.grains, s.walls, s.wall_contacts, parameters
        impact, per_period = s.criteria.impact, s.settings.per_period
        bound = approach = s.criteria.longest
        stop = Stop.NONE.value
        for w in range(walls.work.size):
            walls.contacts[w] = 0.0
        for c in range(contacts.used[0]):
            walls.contacts[contacts.pair[1, c]] += 1.0
        for c in range(contacts.used[0]):
            g, w = contacts.pair[0, c], contacts.pair[1, c]
            speed = abs(dot(relative_velocity(grains, walls, g, w), load(walls.normal, w)))
            # all contacts of a wall with a mass M share it, z m/M times
            shared = 1.0 + walls.contacts[w] * grains.mass[g] / numbers.mass[w]
            required = 2.0 * math.pi / math.sqrt(contacts.constants[FASTEST_MODE, c] * shared) / per_period
            bound = min(bound, required)
            overlap = constants_at(contacts, c).break_overlap
            if overlap > 0.0 and speed * required > impact * overlap:
                approach = min(approach, impact * overlap / speed)
            if wall_height(grains, walls, g, w) < 0.0:
                stop, s.count[GRAIN1] = Stop.OVERCOMPRESSED.value, g
        for w in range(walls.work.size):
            n = load(walls.normal, w)
            for g in range(grains.mass.size):
                gap = wall_height(grains, walls, g, w) - grains.radius[g]
                closing = -dot(relative_velocity(grains, walls, g, w), n)
                if gap > 0.0 and closing * approach > CLOSING_FRACTION * gap:
                    constants = constants_of(grains, numbers, g, w)
                    required = 2.0 * math.pi / math.sqrt(constants.max_squared_frequency) / per_period
                    if constants.break_overlap > 0.0 and closing * required > impact * constants.break_overlap:
                        required = impact * constants.break_overlap / closing
                    approach = min(approach, max(required, CLOSING_FRACTION * gap / closing))
        step = s.criteria.longest
        if bound < step:
            step = np.float64(np.float32(bound))  # as in contact.update.contact_limit
        if approach < step:
            step = quantise_step(1.0, approach, True)
        s.scratch[LIMIT] = min(s.scratch[LIMIT], step)
        return stop

    return wall_step


@factory
def energies_stage(law: ContactLaw) -> Stage:
    """The energies of contacts with walls, for one contact law."""
    constants_at, radius_root, normal_energy = column_loops(law).at, law.radius_root, law.energy

    @stage("the energies of contacts with walls", parts=WALL_PARTS)
    def measure_wall_energies(s, parameters):
        """Add the energies [J] listed in ENERGIES to the array parameters[0]."""
        contacts = s.wall_contacts
        for c in range(s.wall_contacts.used[0]):
            constants, radius = constants_at(contacts, c), s.grains.radius[contacts.pair[0, c]]
            found = wall_displacements(wall_pose(s, c, contacts.twist[c]), radius)
            y = radius_root(found.overlap, constants)
            present = scaled_stiffness(constants, y, s.settings.follow)
            stored = stored_energies(found, normal_energy(found.overlap, y, constants), present)
            for mode in range(4):
                parameters[0][mode] += stored[mode]
        return 0

    return measure_wall_energies


@factory
def table_stage(law: ContactLaw) -> Stage:
    """The stage that measures contacts with walls, for one contact law."""
    constants_at, radius_root, contact_radius = column_loops(law).at, law.radius_root, law.contact_radius
    normal_energy = law.energy

    @stage("the table of contacts with walls", parts=WALL_PARTS)
    def measure_wall_contacts(s, parameters):
        """Fill `parameters[0]` (rows, C) with CONTACT_ROWS and CONTACT_VECTORS of `contact.measure`."""
        contacts = s.wall_contacts
        for c in range(contacts.used[0]):
            constants, radius = constants_at(contacts, c), s.grains.radius[contacts.pair[0, c]]
            pose = wall_pose(s, c, contacts.twist[c])
            found = wall_displacements(pose, radius)
            y = radius_root(found.overlap, constants)
            present = scaled_stiffness(constants, y, s.settings.follow)
            stored = stored_energies(found, normal_energy(found.overlap, y, constants), present)
            forces = contact_radius(found.overlap, y, constants), dot(load(contacts.force, c), pose.n)
            put_row(parameters[0], c, found, across(found.roll, pose.n), stored, forces, present)
        return 0

    return measure_wall_contacts


@stage("the forces of walls")
def wall_loads(grains, wall_contacts):
    """Add the loads of contacts with walls to the loads of the grains."""
    for c in range(wall_contacts.used[0]):
        g = wall_contacts.pair[0, c]
        accrue(grains.force, g, load(wall_contacts.force, c))
        accrue(grains.torque, g, load(wall_contacts.torque1, c))
    return 0


@stage("the work of the noise of contacts with walls", parts=(*WALL_PARTS, "scratch"))
def bath_wall_work(s, parameters, block):
    """As `integrate.stages.bath_work`, of contacts with walls; a wall with a mass is accelerated along its normal."""
    weight = half_kick_weight(s.clock[STEP], 0.0 if block == NO_STEP else s.scratch[DT])
    for c in range(s.wall_contacts.used[0]):
        g, w = s.wall_contacts.pair[0, c], s.wall_contacts.pair[1, c]
        n = load(s.walls.normal, w)
        of_grain, turn = accelerations(s.grains, g)
        of_wall = (dot(load(s.walls.force, w), n) + s.walls.push[w]) / parameters.mass[w]
        arm = scale(s.grains.radius[g], n)
        change = relative_motion(arm, sub(of_grain, scale(of_wall, n)), turn, turn, ZERO)
        record_half_kick(s.wall_contacts, s.lost, c, n, change, weight)
    return 0


OF_BODIES = Hook.NEAR_BODIES, Hook.NONE_AWAKE


@stage("the walls that bodies may touch", parts=(*WALL_PARTS, "bodies", "gas", "flight_limits"))
def bodies_at_walls(s, parameters, block):
    """Mark bodies near walls (`BodyArrays.near`) for the present step; at NONE_AWAKE, move walls without contacts."""
    grains, bodies, walls, h = s.grains, s.bodies, s.walls, s.clock[STEP]
    if block == Hook.NONE_AWAKE.value:
        move_walls_alone(walls, s.wall_contacts, parameters, h)
        return 0
    for c in range(s.wall_contacts.used[0]):
        first = bodies.first[s.wall_contacts.pair[0, c]]
        bodies.near[first] = max(bodies.near[first], NEAR)
    for w in range(walls.work.size):
        n = load(walls.normal, w)
        # as of a grain, twice the distance by its present acceleration
        moved = abs(dot(load(walls.force, w), n) + walls.push[w]) / parameters.mass[w] * h * h
        for g in range(grains.mass.size):
            gap, first = wall_height(grains, walls, g, w) - grains.radius[g], bodies.first[g]
            closing = -dot(relative_velocity(grains, walls, g, w), n)
            reach = moved + reach_of_plane(grains, bodies, g, closing, s.gas, s.flight_limits.friction_rate, h)
            if not gap > reach and bodies.asleep[g] == 1:  # also if the reach is not a number
                bodies.near[first] = TOUCHING
                s.count[LATE] += 1 if gap < 0.0 else 0
            elif not gap > 2.0 * reach:
                bodies.near[first] = max(bodies.near[first], NEAR)
    return 0


def wall_stages(law: ContactLaw, damping: str, numbers: WallNumbers, *, moves_bodies: bool) -> HookStages:
    """The stages of walls at each place of a step, with their parameters."""
    return {
        Hook.LIMIT_STEP: [(step_stage(law), numbers)],
        Hook.BATH_WORK: [(bath_wall_work, numbers)] if damping == THERMAL else [],
        Hook.CONTACTS: [(contacts_stage(law, damping), numbers)],
        Hook.LOADS: [(wall_loads, ())],
        # called by the engine for rows of the ledger, with an array of its own; here it is compiled with the others
        Hook.ENERGIES: [(energies_stage(law), (np.zeros(len(ENERGIES)),))],
        **{hook: [(bodies_at_walls, numbers)] for hook in (OF_BODIES if moves_bodies else ())},
    }
