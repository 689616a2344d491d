"""Simulation of the contact after a hit, to decide whether two bodies stick."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ...basics.grains import Grains
from ...contact import jkr
from ...contact.model import Contact
from ...forces.magnetic_field import Field
from ...forces.pair.dipoles import Dipoles
from ...simulation.simulation import Simulation
from .encounters import Flight, body_of
from .initial_conditions import R, U
from .two_aggregates import ANGULAR1, ANGULAR2, TURN1, TURN2
from .two_spheres import DIRECTION1, DIRECTION2, SPIN1, SPIN2

PERIODS = 40
"""Number of normal oscillation periods in uninterrupted contact after which bodies stick."""
MOST_CHECKS = 2000
"""Number of checks after which bodies that collide repeatedly without escaping count as sticking."""


def sticks(setup: Flight, state: np.ndarray) -> bool:
    """Whether the bodies stick after a hit with this state.

    The grains are simulated with all contacts and dipole forces (`Contact`, `Dipoles` without a cut-off, `Field`) until
    they have stayed in contact, or have separated and escape.

    Parameters
    ----------
    setup : Flight
        Bodies and initial conditions.
    state : ndarray
        State of the pair at contact, (18,) of `two_spheres` or (20,) of `two_aggregates`.
    """
    grains, first = grains_at(setup, state)
    forces: list[Any] = [Contact(), Dipoles(cutoff=None)]
    if any(setup.field):
        forces.append(Field(setup.field))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the warnings were issued when the flight was set up
        sim = Simulation(grains, forces)
    period, periods_in_contact = slowest_period(setup), 0
    for _ in range(MOST_CHECKS):
        speed = float(np.linalg.norm(_relative(sim.grains, first)[1]))
        # separated bodies are checked after 0.05 radii of free flight
        free_flight = 0.05 * float(grains.radius.min()) / speed if speed > 0.0 else period
        sim.run(until=sim.time + (period if periods_in_contact or not sim.time else max(period, free_flight)))
        pairs = sim.contacts["pair"]
        in_contact = bool(len(pairs)) and bool(((pairs < first).sum(axis=1) == 1).any())
        periods_in_contact = periods_in_contact + 1 if in_contact else 0
        if periods_in_contact >= PERIODS:
            return True
        if not in_contact and _escapes(sim.grains, first, setup):
            return False
    return True


def slowest_period(setup: Flight) -> float:
    """Longest normal oscillation period 2π √(m̄/k_n) [s] of any contact of the bodies, with k_n = (6/5) E* a0.

    m̄ is the reduced mass of the bodies. Without adhesion: the duration of a Hertzian impact at the speed of the
    flight, 2.87 (m̄²/(R E*² v))^(1/5).
    """
    contact, reduced, longest = Contact(), setup.scales.reduced, 0.0
    for one in {(m, r) for m, r in zip(setup.projectile.material.tolist(), setup.projectile.radius, strict=True)}:
        for two in {(m, r) for m, r in zip(setup.target.material.tolist(), setup.target.radius, strict=True)}:
            pairing = contact.pairing(setup.projectile.materials[one[0]], setup.target.materials[two[0]])
            radius = one[1] * two[1] / (one[1] + two[1])
            hertz = 2.87 * (reduced**2 / (radius * pairing.modulus**2 * setup.relative_speed)) ** 0.2
            longest = max(longest, hertz)
            if pairing.surface_energy > 0.0:
                a0 = jkr.rest_radius(pairing.surface_energy, radius, pairing.modulus)
                stiffness = jkr.normal_stiffness(a0, pairing.modulus)
                longest = max(longest, 2.0 * math.pi * math.sqrt(reduced / stiffness))
    return longest


def grains_at(setup: Flight, state: np.ndarray) -> tuple[Grains, int]:
    """Grains of both bodies, projectile first, in the centre-of-mass frame; and the projectile's number of grains."""
    one, two = setup.projectile, setup.target
    m1, m2 = float(one.mass.sum()), float(two.mass.sum())
    parts = []
    for body, share, k in ((one, m2 / (m1 + m2), 0), (two, -m1 / (m1 + m2), 1)):
        middle, moving = share * state[R : R + 3], share * state[U : U + 3]
        if setup.spheres:
            axis = (DIRECTION1, DIRECTION2)[k]
            spin = state[(SPIN1, SPIN2)[k] :][:3]
            arm = np.zeros((1, 3))
            moment = float(np.linalg.norm(body.moment[0])) * state[axis : axis + 3][None]
        else:
            rigid, turn = body_of(body), Rotation.from_quat(state[(TURN1, TURN2)[k] :][:4])
            own = turn.inv().apply(state[(ANGULAR1, ANGULAR2)[k] :][:3]) / np.array(rigid.inertia)
            spin = turn.apply(own)
            arm, moment = turn.apply(rigid.point.T), turn.apply(rigid.moment.T)
        parts.append((middle + arm, moving + np.cross(spin, arm), np.tile(spin, (len(body), 1)), moment))
    position, velocity, spins, moments = (np.concatenate(column) for column in zip(*parts, strict=True))
    grains = Grains(
        position,
        np.concatenate([one.radius, two.radius]),
        [b.materials[m] for b in (one, two) for m in b.material],
        velocity=velocity,
        spin=spins,
        moment=moments,
    )
    return grains, len(one)


def _relative(grains: Grains, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Separation and relative velocity of the centres of mass, projectile minus target."""
    mass = grains.mass
    parts = (slice(first), slice(first, None))
    centres, speeds = (
        [np.average(v[part], axis=0, weights=mass[part]) for part in parts] for v in (grains.position, grains.velocity)
    )
    return centres[0] - centres[1], speeds[0] - speeds[1]


def _escapes(grains: Grains, first: int, setup: Flight) -> bool:
    """Whether the bodies recede with a kinetic energy above the largest possible magnetic energy at their distance."""
    separation, velocity = _relative(grains, first)
    kinetic = 0.5 * setup.scales.reduced * float(velocity @ velocity)
    closest = float(cKDTree(grains.position[:first]).query(grains.position[first:])[0].min())
    return float(separation @ velocity) > 0.0 and kinetic > setup.scales.alpha / closest**3
