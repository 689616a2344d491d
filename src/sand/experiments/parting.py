"""When bodies in open space cannot touch any more: a bound from their positions, velocities and forces.

Each body is within a sphere of radius R about its centre of mass.  With the separation x and the relative velocity v of
the centres, straight paths stay apart by d = |x + v t|, t = max(−x·v/v², 0): the bodies cannot touch if d > R₁ + R₂.

With forces between the bodies that fall off at least as a power of the distance, the work of the attraction of two of
them from now to infinity is at most W = Σ_ij w_ij(|x| − ρ_i − ρ_j), summed over pairs of grains at distances ρ from
their centres of mass, with w = 2 k μ μ'/r³ for dipoles in any orientation (the work of the largest force 6 k μ μ'/r⁴),
|k q q'|/r for charges and G m m'/r for masses.  Since the tangential motion only adds a centrifugal force, two bodies
that recede at u = x·v/|x| with ½ m̄ u² > W recede for ever.

Of more bodies, each pair has to recede at u > 0.  As long as forces have changed no relative velocity by more than u/2,
the distance of each pair is at least |x| + u t/2, so that the force between them has given at most the momentum
∫ F dt ≤ W/(u/2).  The bodies recede for ever if these momenta, 2W/u, change no relative velocity by more than u/2:

    p_ij (1/M_i + 1/M_j) + Σ_k (p_ik/M_i + p_jk/M_j) ≤ u_ij/2,   p = 2W/u,   k other than i and j.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..basics.constants import COULOMB, GRAVITATION, MAGNETIC
from ..basics.grains import Grains
from ..contact.model import Contact
from ..forces.base import Force
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


def forces_at_distance(simulation: Simulation) -> list[Force]:
    """Forces other than those of contacts."""
    return [force for force in simulation.forces if not isinstance(force, Contact)]


def has_bound(simulation: Simulation) -> bool:
    """Whether the bound holds: with external forces, a gas, forces of the user, walls or a box bodies may come back."""
    items = (each.items for each in simulation._system.given.values())
    known = all(force.name in WORK for force in forces_at_distance(simulation))
    return simulation.box.is_open and not any(items) and known


def cannot_touch(simulation: Simulation, labels: np.ndarray) -> str:
    """Why no two of several bodies can touch any more; "" if they may.

    Parameters
    ----------
    simulation : Simulation
        Simulation of bodies without contacts between them.
    labels : ndarray
        The body of each grain (N,), integers 0…K−1.
    """
    if not has_bound(simulation):
        return ""
    if not labels.any():
        return "one body is left"
    grains, forces = simulation.grains, forces_at_distance(simulation)
    bodies = _Bodies(grains, labels)
    one, other = np.triu_indices(len(bodies.mass), 1)
    x, v = bodies.centre[other] - bodies.centre[one], bodies.velocity[other] - bodies.velocity[one]
    distance, approach = np.linalg.norm(x, axis=1), (x * v).sum(axis=1)
    reach = (1.0 + MARGIN) * (bodies.radius[one] + bodies.radius[other])
    if not forces:
        with np.errstate(invalid="ignore", divide="ignore"):  # at rest, where no time is needed
            later = np.where(approach < 0.0, -approach / (v * v).sum(axis=1), 0.0)
        closest = np.linalg.norm(x + later[:, None] * v, axis=1)
        return "the paths of the bodies are straight and do not meet" if (closest > reach).all() else ""
    if (approach <= 0.0).any() or (distance <= reach).any():
        return ""
    recede = approach / distance
    pairs = zip(one.tolist(), other.tolist(), distance.tolist(), strict=True)
    work = np.array([math.fsum(bodies.work(force, a, b, d) for force in forces) for a, b, d in pairs])
    mass = bodies.mass
    if len(mass) == 2:
        parts = bool((0.5 * mass[0] * mass[1] / mass.sum() * recede**2 > work).all())
    else:
        momentum = 2.0 * work / recede
        given = np.bincount(one, momentum, len(mass)) + np.bincount(other, momentum, len(mass))
        parts = bool((given[one] / mass[one] + given[other] / mass[other] <= 0.5 * recede).all())
    return "the bodies recede too fast for their attraction" if parts else ""


class _Bodies:
    """Masses (K,), centres and velocities (K, 3), radii (K,) of bodies, and distances of grains from the centres."""

    def __init__(self, grains: Grains, labels: np.ndarray):
        mass = np.asarray(grains.mass)
        self.mass = np.bincount(labels, mass)
        self.centre, self.velocity = (
            np.column_stack([np.bincount(labels, mass * each) for each in np.asarray(values).T]) / self.mass[:, None]
            for values in (grains.position, grains.velocity)
        )
        self.distance = np.linalg.norm(grains.position - self.centre[labels], axis=1)
        self.radius = np.zeros(len(self.mass))
        np.maximum.at(self.radius, labels, self.distance + grains.radius)
        self.grains, self.labels = grains, labels

    def work(self, force: Any, one: int, other: int, distance: float) -> float:
        """Largest work [J] of the attraction between two bodies from a distance [m] to infinity."""
        power, strength = WORK[force.name]
        found, first, second = strength(self.grains), self.labels == one, self.labels == other
        product = np.multiply.outer(found[first], found[second])
        nearest = distance - (1.0 + MARGIN) * np.add.outer(self.distance[first], self.distance[second])
        if not product.any():
            return 0.0
        return math.inf if nearest.min() <= 0.0 else float((product / nearest**power).sum())
