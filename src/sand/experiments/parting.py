"""When bodies in open space cannot touch any more: a bound from their positions, velocities and forces.

Each body is within a sphere of radius R about its centre of mass.  With the separation x and the relative velocity v of
the centres, straight paths stay apart by d = |x + v t|, t = max(−x·v/v², 0): the bodies cannot touch if d > R₁ + R₂.

With forces between the bodies that fall off at least as a power of the distance, the work of the attraction of two of
them from now to infinity is at most W = Σ_ij w_ij(|x| − ρ_i − ρ_j), summed over pairs of grains at distances ρ from
their centres of mass, with w = 2 k μ μ'/r³ for dipoles in any orientation (the work of the largest force 6 k μ μ'/r⁴),
|k q q'|/r for charges and G m m'/r for masses; cut-offs make it smaller.  Since the tangential motion only adds a
centrifugal force, two bodies that recede at u = x·v/|x| with ½ m̄ u² > W recede for ever.

Of more bodies, each pair has to recede at u > 0.  As long as forces have changed no relative velocity v by more than
u/2, all its later values, and so the way that they make, are within 30° of v.  The separation is that of now plus this
way, and its unit vector n has n·v ≥ u cos 30°: the distance grows at s = (cos 30° − ½) u or faster, and the force
between the two has given at most the momentum ∫ F dt ≤ ∫ F dr/s ≤ W/s.  The bodies recede for ever if these momenta
change no relative velocity by more than u/2:

    p_ij (1/M_i + 1/M_j) + Σ_k (p_ik/M_i + p_jk/M_j) ≤ u_ij/2,   p = W/s,   k other than i and j.

R₁ + R₂ and ρ_i + ρ_j are taken 1 % larger, for vibrations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..basics.constants import COULOMB, GRAVITATION, MAGNETIC
from ..basics.grains import Grains
from ..contact.model import Contact
from ..forces.base import Force
from ..simulation.simulation import Simulation
from .scattering.free_bodies import FreeBodies, recede_for_ever, stay_apart

MARGIN = 0.01
"""Allowance for vibrations of the bodies, in units of R₁ + R₂, and of ρ_i + ρ_j."""
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
    bodies = bodies_of(simulation.grains, labels, forces_at_distance(simulation))
    if not bodies.strength.any():
        return "the paths of the bodies are straight and do not meet" if stay_apart(bodies, MARGIN) else ""
    recede = recede_for_ever(bodies, np.zeros(len(bodies.mass)), MARGIN)
    return "the bodies recede too fast for their attraction" if recede else ""


def bodies_of(grains: Grains, labels: np.ndarray, forces: Sequence[Any]) -> FreeBodies:
    """The bodies with these labels of grains (N,), for the loops over their pairs."""
    mass = np.asarray(grains.mass)
    total = np.bincount(labels, mass)
    centre, velocity = (
        np.array([np.bincount(labels, mass * each) for each in np.asarray(values).T]) / total
        for values in (grains.position, grains.velocity)
    )
    distance = np.linalg.norm(grains.position - centre.T[labels], axis=1)
    radius = np.zeros(len(total))
    np.maximum.at(radius, labels, distance + grains.radius)
    order, first = np.argsort(labels, kind="stable"), np.concatenate([[0], np.cumsum(np.bincount(labels))])
    strengths = np.array([WORK[force.name][1](grains)[order] for force in forces]).reshape(len(forces), len(order))
    powers = np.array([WORK[force.name][0] for force in forces], float)
    return FreeBodies(total, centre, velocity, radius, first, distance[order], strengths, powers)
