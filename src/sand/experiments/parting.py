"""When two bodies that have not touched cannot touch any more: a bound from their positions, velocities and forces.

Each body is within a sphere of radius R about its centre of mass.  With the separation x and the relative velocity v of
the centres, straight paths stay apart by d = |x + v t|, t = max(−x·v/v², 0): the bodies cannot touch if d > R₁ + R₂.

With forces between the bodies that fall off at least as a power of the distance, the work of their attraction from now
to infinity is at most W = Σ_ij w_ij(|x| − ρ_i − ρ_j), summed over pairs of grains at distances ρ from their centres of
mass, with w = 2 k μ μ'/r³ for dipoles in any orientation (the work of the largest force 6 k μ μ'/r⁴), |k q q'|/r for
charges and G m m'/r for masses.  Since the tangential motion only adds a centrifugal force, bodies that recede with
½ m̄ (x·v/|x|)² > W recede for ever.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..basics.constants import COULOMB, GRAVITATION, MAGNETIC
from ..basics.grains import Grains
from ..contact.model import Contact
from ..simulation.simulation import Simulation

MARGIN = 0.01
"""Allowance for vibrations of the bodies, in units of R₁ + R₂."""
WORK = {
    "dipoles": (3, lambda grains: math.sqrt(2.0 * MAGNETIC) * np.linalg.norm(grains.moment, axis=1)),
    "charges": (1, lambda grains: math.sqrt(COULOMB) * np.abs(grains.charge)),
    "screened_charges": (1, lambda grains: math.sqrt(COULOMB) * np.abs(grains.charge)),
    "attraction": (1, lambda grains: math.sqrt(GRAVITATION) * np.asarray(grains.mass)),
}
"""Forces with such a bound: power of the distance, and a strength s of each grain, with w = s s'/r^power."""


def cannot_touch(simulation: Simulation, target: int) -> str:
    """Why two bodies that have not touched cannot touch any more; "" if they may.

    Parameters
    ----------
    simulation : Simulation
        Simulation of two bodies in open space, without contacts between them.
    target : int
        Number of grains of the first body.
    """
    grains, forces = simulation.grains, [force for force in simulation.forces if not isinstance(force, Contact)]
    if not simulation.box.is_open or any(each.items for each in simulation._system.given.values()):
        return ""
    if any(force.name not in WORK for force in forces):
        return ""  # external forces, a gas and forces of the user may bring bodies back
    bodies = [_Body(grains, part) for part in (slice(target), slice(target, None))]
    one, other = bodies
    x, v = other.centre - one.centre, other.velocity - one.velocity
    distance, speed = float(np.linalg.norm(x)), float(np.linalg.norm(v))
    reach = (1.0 + MARGIN) * (one.radius + other.radius)
    approach = float(x @ v)
    if not forces:
        closest = distance if approach >= 0.0 else float(np.linalg.norm(x - approach / speed**2 * v))
        return "the paths of the bodies are straight and do not meet" if closest > reach else ""
    if approach <= 0.0 or distance <= reach:
        return ""
    reduced = one.mass * other.mass / (one.mass + other.mass)
    work = math.fsum(_work(force, one, other, distance) for force in forces)
    parts = 0.5 * reduced * (approach / distance) ** 2 > work
    return "the bodies recede too fast for their attraction" if parts else ""


class _Body:
    """Mass, centre, velocity and radius of a body, and the distances of its grains from its centre."""

    def __init__(self, grains: Grains, part: slice):
        mass, position = np.asarray(grains.mass[part]), np.asarray(grains.position[part])
        self.mass = float(mass.sum())
        self.centre = mass @ position / self.mass
        self.velocity = mass @ np.asarray(grains.velocity[part]) / self.mass
        self.distance = np.linalg.norm(position - self.centre, axis=1)
        self.radius = float((self.distance + grains.radius[part]).max())
        self.grains, self.part = grains, part


def _work(force: Any, one: _Body, other: _Body, distance: float) -> float:
    """Largest work [J] of the attraction between two bodies from a distance [m] to infinity."""
    power, strength = WORK[force.name]
    found = strength(one.grains)
    product = np.multiply.outer(found[one.part], found[other.part])
    nearest = distance - (1.0 + MARGIN) * np.add.outer(one.distance, other.distance)
    if not product.any():
        return 0.0
    return math.inf if nearest.min() <= 0.0 else float((product / nearest**power).sum())
