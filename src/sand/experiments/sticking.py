"""From a touch to its outcome: the real contact of two bodies that have just met."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..core.grains import Grains
from ..forces.contact import Contact
from ..forces.dipoles import Dipoles
from ..forces.field import Field
from ..kernels.pairs import DIRECTION1, DIRECTION2, SPIN1, SPIN2
from ..kernels.rigid import ANGULAR1, ANGULAR2, TURN1, TURN2
from ..kernels.starts import R, U
from ..run.simulation import Simulation
from .encounters import Flight, body_of

PERIODS = 40
"""A pair that has been in contact for so many of its normal periods sticks."""
APART = 3.0
"""Distance of the centres, in sums of the radii, at which two that fly apart have bounced off."""
LOOKS = 400
"""Looks, one each `PERIODS`, after which a pair that is still in between counts as stuck: it cannot get away."""


def sticks(flying: Flight, state: np.ndarray) -> bool:
    """True if the contact that begins with this state holds.

    The grains go on with all their contacts and dipoles (`Contact`, `Dipoles` without a cut-off, `Field`), deformable,
    until they have stayed in contact, or have come apart and fly away.

    Args:
        state: of the pair at the touch, (18,) or (20,), as kernels/pairs.py and kernels/rigid.py lay it out.
    """
    grains, first = grains_at(flying, state)
    forces: list[Any] = [Contact(), Dipoles(cutoff=None)]
    if any(flying.field):
        forces.append(Field(flying.field))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the user has been told of them
        sim = Simulation(grains, forces)
    smallest = min((m.density / m.young_modulus) ** 0.5 for m in grains.materials) * float(grains.radius.min())
    burst, calm = 2.0 * math.pi * 10.0 * smallest, 0
    for _ in range(LOOKS):
        sim.run(until=sim.time + burst)
        pairs = sim.contacts["pair"]
        joined = bool(((pairs < first).sum(axis=1) == 1).any()) if len(pairs) else False
        calm = calm + 1 if joined else 0
        if calm >= PERIODS // 10:
            return True
        if not joined and _flies_apart(sim.grains, first, flying):
            return False
    return True


def grains_at(flying: Flight, state: np.ndarray) -> tuple[Grains, int]:
    """Both bodies as one set of grains, the projectile first, in the frame of their centre of mass."""
    one, two = flying.projectile, flying.target
    m1, m2 = float(one.mass.sum()), float(two.mass.sum())
    parts = []
    for body, share, k in ((one, m2 / (m1 + m2), 0), (two, -m1 / (m1 + m2), 1)):
        middle, moving = share * state[R : R + 3], share * state[U : U + 3]
        if flying.spheres:
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


def _flies_apart(grains: Grains, first: int, flying: Flight) -> bool:
    """Well apart and still going."""
    mass = grains.mass
    centres, speeds = (
        [np.average(v[part], axis=0, weights=mass[part]) for part in (slice(first), slice(first, None))]
        for v in (grains.position, grains.velocity)
    )
    apart, moving = centres[0] - centres[1], speeds[0] - speeds[1]
    reduced, distance = flying.scales.reduced, float(np.linalg.norm(apart))
    free = 0.5 * reduced * float(moving @ moving) > flying.scales.alpha / distance**3
    return free and distance > APART * flying.scales.touch and float(apart @ moving) > 0.0
