"""Damping of contacts, and the work of stiffnesses that follow the contact radius."""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

from ..box import nearest_image
from ..compiler.jit import loop, rare
from ..numerics.vec import accrue, axpy, dot, load, scale, sub
from ..state.state import BREAKING, CONTACTS, DAMPING, STIFFNESS
from .columns import column_loops
from .law import ContactLaw
from .mechanics import damping_force, displacements_of, scaled_stiffness, stiffness_loss
from .update import BROKEN_FLAG, displacements_before, loss_row, pose_at, stored_damping_force


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
def store_damping_force(contacts, c, force):
    """Store the damping force [N] of contact c, if the contact law has an array for it (`ContactArrays.damped`)."""
    if contacts.damped.size > 0:
        contacts.damped[c] = force


class DampingLoops(NamedTuple):
    """Loops of damping and of changing stiffnesses, for one contact law."""

    add_force: Callable  # (grains, contacts, span, c, dt): damping force of one contact; returns the energy [J]
    damp: Callable  # (grains, contacts, count, lost, span, dt): all contacts
    log_stiffness_work: Callable  # likewise


@functools.cache
def damping_loops(law: ContactLaw) -> DampingLoops:
    """The loops of damping for one contact law."""
    constants_at, radius_root, contact_radius = column_loops(law).at, law.radius_root, law.contact_radius

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
        radius = contact_radius(overlap, radius_root(overlap, constants), constants)
        force = damping_force(radius, closing, constants)
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
            at_start = scaled_stiffness(constants, radius_root(start.overlap, constants), True)
            now = scaled_stiffness(constants, radius_root(displacements.overlap, constants), True)
            log_loss(contacts.lost, lost, c, STIFFNESS, stiffness_loss(start, displacements, at_start, now))

    return DampingLoops(add_damping_force, damp_contacts, log_stiffness_work)
