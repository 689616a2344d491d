"""What happens to one contact of a grain with another grain or with a wall: it forms, slips and breaks.

The loops over pairs (`events`) and over walls (`components.wall_loops`) load what these functions take from grains and
walls, and apply the impulses that they return.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from ..basics.state import BREAKING, FORMING
from ..compiler.jit import loop
from ..numerics.vec import dot, load
from .damping import DampingVariant, store_loads
from .impact import note_impact
from .law import ContactLaw
from .losses import FORMING_ROW
from .mechanics import contact_speed_gain, time_since

PENDING_FLAG, BROKEN_FLAG, SLIPPED_FLAG, SLID_FLAG = 1, 2, 3, 4
"""Flags of contacts beyond a limit: to be handled by `events.slip_and_break_loop`; broken in this step; slipped in this
step in the pass over contacts, in rolling only; also, or only, in sliding or twisting.
"""
ZERO = (0.0, 0.0, 0.0)


class Touch(NamedTuple):
    """A contact that formed within a step."""

    n: tuple  # towards grain 1
    held: Any  # damping.Held, at the end of the step
    overlap: float  # δ at the end of the step [m]
    closing: float  # closing speed w [m/s]
    mass: float  # m̄, reduced mass [kg]
    modulus: float  # E* [Pa]


class Break(NamedTuple):
    """A contact that broke within a step."""

    pose: Any  # mechanics.Pose, or that of a grain at a wall, at the end of the step
    stretched: float  # −δ − δ_c at the end of the step [m]
    opening: float  # opening speed [m/s]
    constants: Any  # law.ContactConstants


@loop
def clear_contact(contacts, c, formed):
    """Begin contact c, which formed at a time [s], without twist and losses."""
    contacts.twist[c] = 0.0
    contacts.formed[c] = formed
    contacts.flag[c] = 0
    contacts.every_step[c] = 0
    for row in range(contacts.lost.shape[0]):
        contacts.lost[row, c] = 0.0


@functools.cache
def breaking_loop(law: ContactLaw, dashpots: DampingVariant) -> Callable:
    """The function that breaks one contact, for one contact law and the dashpots of its sides."""
    at_break, damping_of_break = law.at_break, dashpots.at_break

    @loop
    def break_contact(bodies, contacts, lost, c, broken, step):
        """Log the energy of contact c, which broke within a step (`update.PresentStep`), and flag it as broken.

        The contact force just before the break ended a time τ before the end of the step, but velocity Verlet
        applied it for half a step: the difference is applied as an impulse.

        Returns
        -------
        float
            Impulse on grain 1 along n [N s].
        """
        elapsed = time_since(broken.stretched, broken.opening, step.dt)
        energy, force = at_break(broken.constants)
        lost[BREAKING] += energy
        force += damping_of_break(bodies, contacts, lost, c, broken, elapsed, step)
        contacts.flag[c] = BROKEN_FLAG
        store_loads(contacts, c, (ZERO, ZERO, ZERO))
        return force * (0.5 * step.dt - elapsed)

    return break_contact


@functools.cache
def touch_loop(law: ContactLaw, dashpots: DampingVariant) -> Callable:
    """The function that logs the forming of one contact, for one contact law and the dashpots of its sides."""
    radius_root, at_touch = law.radius_root, law.at_touch
    normal_force, normal_energy, normal_stiffness = law.force, law.energy, law.stiffness
    damping_of_touch = dashpots.at_touch

    @loop
    def touch(bodies, contacts, lost, clock, c, touched, step):
        """Log the energy −U(0) of contact c, which formed within the step, and add the loads of its dashpots.

        The surfaces have moved freely for a time τ = overlap / closing speed w since first touch.  An impulse along n
        gives them the speed w′ that the contact force would have given them (`mechanics.contact_speed_gain`), less the
        contribution that velocity Verlet still adds; to first order the impulse is F (τ − dt/2).  Without the second
        order, (F τ)²/2m̄, there would be an energy error of the same sign in every contact formed.

        Parameters
        ----------
        touched : Touch
            The contact, with its loads without dashpots.
        step : update.PresentStep
            The step; that of 0 s at the start of a run finds grains that overlap already.

        Returns
        -------
        float
            Impulse on grain 1 along n [N s].
        """
        (n, held, overlap, closing, mass, modulus), constants, dt = touched, touched.held.constants, step.dt
        elapsed = time_since(overlap, closing, dt)
        impulse = damping_of_touch(bodies, contacts, lost, c, held, closing, elapsed, step)
        if dt > 0.0:
            note_impact(clock, closing, mass, constants.reduced_radius, modulus)
            y = radius_root(overlap, constants)
            drop = at_touch(constants) - normal_energy(overlap, y, constants)
            force, stiffness = normal_force(overlap, y, constants), normal_stiffness(overlap, y, constants)
            gain = contact_speed_gain(drop, force, stiffness, closing, mass, dt)
            impulse -= mass * gain + 0.5 * dt * dot(load(contacts.force, c), n)
        lost[FORMING] -= at_touch(constants)
        contacts.lost[FORMING_ROW, c] -= at_touch(constants)
        return impulse

    return touch
