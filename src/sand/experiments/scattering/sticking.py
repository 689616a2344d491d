"""From a touch to its outcome: the real contact of two bodies that have just met."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from ...contact import jkr
from ...contact.model import Contact
from ...forces.external.magnetic_field import Field
from ...forces.pair.dipoles import Dipoles
from ...grains import Grains
from ...simulation.simulation import Simulation
from .encounters import Flight, body_of
from .initial_conditions import R, U
from .two_aggregates import ANGULAR1, ANGULAR2, TURN1, TURN2
from .two_spheres import DIRECTION1, DIRECTION2, SPIN1, SPIN2

PERIODS = 40
"""A pair that has been in contact for so many normal periods without a break sticks."""
LOOKS = 2000
"""Looks after which a pair that is neither stuck nor free counts as stuck: it was caught and keeps coming back."""


def sticks(setup: Flight, state: np.ndarray) -> bool:
    """True if the contact that begins with this state holds.

    The grains go on with all their contacts and dipoles (`Contact`, `Dipoles` without a cut-off, `Field`), deformable,
    until they have stayed in contact, or have come apart and fly away.

    Parameters
    ----------
    state : ndarray
        of the pair at the touch, (18,) or (20,), as experiments/scattering/two_spheres.py and
        experiments/scattering/two_aggregates.py lay it out.
    """
    grains, first = grains_at(setup, state)
    forces: list[Any] = [Contact(), Dipoles(cutoff=None)]
    if any(setup.field):
        forces.append(Field(setup.field))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the user has been told of them
        sim = Simulation(grains, forces)
    period, joined_for = slowest_period(setup), 0
    for _ in range(LOOKS):
        _, moving = _relative(sim.grains, first)
        away = float(np.linalg.norm(moving))
        # apart, the next thing can only happen after a way of the size of the grains
        free_flight = 0.05 * float(grains.radius.min()) / away if away > 0.0 else period
        sim.run(until=sim.time + (period if joined_for or not sim.time else max(period, free_flight)))
        pairs = sim.contacts["pair"]
        joined = bool(len(pairs)) and bool(((pairs < first).sum(axis=1) == 1).any())
        joined_for = joined_for + 1 if joined else 0
        if joined_for >= PERIODS:
            return True
        if not joined and _escapes(sim.grains, first, setup):
            return False
    return True


def slowest_period(setup: Flight) -> float:
    """2π √(m̄/k_n) [s] of the bodies' reduced mass on the softest contact that they can make, k_n = (6/5) E* a0.

    Without adhesion: the time of a Hertzian impact at the speed of the flight, 2.87 (m̄²/(R E*² v))^(1/5).
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
    """Both bodies as one set of grains, the projectile first, in the frame of their centre of mass."""
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
    position, velocity, whirl, moments = (np.concatenate(column) for column in zip(*parts, strict=True))
    grains = Grains(
        position,
        np.concatenate([one.radius, two.radius]),
        [b.materials[m] for b in (one, two) for m in b.material],
        velocity=velocity,
        spin=whirl,
        moment=moments,
    )
    return grains, len(one)


def _relative(grains: Grains, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Separation and relative velocity of the two centres of mass, projectile from target."""
    mass = grains.mass
    parts = (slice(first), slice(first, None))
    centres, speeds = (
        [np.average(v[part], axis=0, weights=mass[part]) for part in parts] for v in (grains.position, grains.velocity)
    )
    return centres[0] - centres[1], speeds[0] - speeds[1]


def _escapes(grains: Grains, first: int, setup: Flight) -> bool:
    """On the way out, and faster than all moments could hold, were they as close as the two closest grains are."""
    apart, moving = _relative(grains, first)
    kinetic = 0.5 * setup.scales.reduced * float(moving @ moving)
    closest = float(cdist(grains.position[:first], grains.position[first:]).min())
    return float(apart @ moving) > 0.0 and kinetic > setup.scales.alpha / closest**3
