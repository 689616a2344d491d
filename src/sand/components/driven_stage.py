"""Grains whose velocity and spin are prescribed.

Their loads are computed as those of all grains, but in the parts of a step that change velocities they have another
mass and moment of inertia: infinite in kicks, which then change nothing, and so large in contact events and in the
settling of clusters that impulses between two grains act with the mass of the other one; the rigid motion of a cluster,
to which settling leads, is then that of its driven grains.  The work of the drive is minus that of the loads on
driven grains, ½ Δt (F·v + M·ω) with the loads at either end of a step, and minus J·v for an impulse J.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from ..basics.state import OUTSIDE
from ..compiler.jit import loop
from ..compiler.stage import stage
from ..integrate.hooks import Hook
from ..integrate.parts import DT, HEAVY
from ..numerics.vec import add, dot, load, put, sub


class DrivenArrays(NamedTuple):
    """Driven grains."""

    grain: np.ndarray  # (K,) int64, indices
    velocity: np.ndarray  # (3, K) [m/s]
    spin: np.ndarray  # (3, K) [rad/s]
    mass: np.ndarray  # (K,) [kg], as of other grains
    inertia: np.ndarray  # (K,) [kg m²]

    def for_part(self, heavy: np.ndarray, grains: int) -> Self:
        """The same for a part in which the driven grains have other numbers."""
        return self._replace(grain=heavy)


@loop
def set_masses(grains, driven, factor):
    """Set masses and moments of inertia of driven grains to a multiple of theirs."""
    for k in range(driven.grain.size):
        grains.mass[driven.grain[k]] = factor * driven.mass[k]
        grains.inertia[driven.grain[k]] = factor * driven.inertia[k]


@loop
def work_of_loads(grains, driven):
    """Power F·v + M·ω [W] of the loads on driven grains."""
    power = 0.0
    for k in range(driven.grain.size):
        i = driven.grain[k]
        power += dot(load(grains.force, i), load(driven.velocity, k))
        power += dot(load(grains.torque, i), load(driven.spin, k))
    return power


@loop
def restore_velocities(grains, driven):
    """Set velocities and spins to the prescribed ones; returns the work [J] of the impulses that changed them.

    m Δv·v + I Δω·ω, which leaves out the energy m Δv²/2 of a finite mass.
    """
    work = 0.0
    for k in range(driven.grain.size):
        i, v, w = driven.grain[k], load(driven.velocity, k), load(driven.spin, k)
        work += grains.mass[i] * dot(sub(load(grains.velocity, i), v), v)
        work += grains.inertia[i] * dot(sub(load(grains.spin, i), w), w)
        put(grains.velocity, i, v)
        put(grains.spin, i, w)
    return work


@loop
def kinetic_energy(grains, driven):
    """Kinetic energy [J] of the driven grains beyond that of the prescribed motion."""
    energy = 0.0
    for k in range(driven.grain.size):
        i, v, w = driven.grain[k], load(driven.velocity, k), load(driven.spin, k)
        present, spin = load(grains.velocity, i), load(grains.spin, i)
        energy += 0.5 * grains.mass[i] * dot(sub(present, v), add(present, v))
        energy += 0.5 * grains.inertia[i] * dot(sub(spin, w), add(spin, w))
    return energy


@stage("the drive of grains")
def drive(grains, lost, scratch, parameters, block):
    """Hold or release the driven grains (`parameters`, DrivenArrays) at a hook, and log the work of the drive."""
    if block == Hook.BEFORE_DRIFT.value or block == Hook.BEFORE_KICK.value:
        set_masses(grains, parameters, math.inf)
    elif block == Hook.AFTER_DRIFT.value or block == Hook.AFTER_KICK.value:
        set_masses(grains, parameters, 1.0)
        lost[OUTSIDE] += 0.5 * scratch[DT] * work_of_loads(grains, parameters)
    elif block == Hook.BEFORE_CONTACTS.value:
        set_masses(grains, parameters, HEAVY)
    elif block == Hook.AFTER_CONTACTS.value or block == Hook.AFTER_CHANGES.value:
        lost[OUTSIDE] += restore_velocities(grains, parameters)
        set_masses(grains, parameters, 1.0)
    else:  # after drag and random kicks; BETWEEN_CYCLES, the settling of clusters follows
        lost[OUTSIDE] += kinetic_energy(grains, parameters)
        restore_velocities(grains, parameters)
        set_masses(grains, parameters, HEAVY if block == Hook.BETWEEN_CYCLES.value else 1.0)
    return 0


KICKS = Hook.BEFORE_DRIFT, Hook.AFTER_DRIFT, Hook.BEFORE_KICK, Hook.AFTER_KICK
CONTACTS = Hook.BEFORE_CONTACTS, Hook.AFTER_CONTACTS
CHANGES = Hook.BETWEEN_CYCLES, Hook.AFTER_CHANGES, Hook.END_OF_BODIES
"""Where driven grains are held and released; in CHANGES if a gas or settling changes velocities."""
