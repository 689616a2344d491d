"""Bodies of dilute dust: a grain, or an aggregate in the frame of its principal axes, with its contacts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from ..basics.grains import GrainArrays, net_charge
from ..basics.initial_pairs import StrainedContacts
from .dilute_charges import Multipoles, multipoles_of
from .scattering.encounters import principal_frame
from .scattering.groups import charge_groups_of, groups_of
from .scattering.initial_conditions import R, U
from .scattering.rigid_flight import FlyingBody
from .scattering.two_aggregates import ANGULAR1, ANGULAR2, TURN1, TURN2

NO_CONTACTS = StrainedContacts(np.zeros((0, 2), np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
VECTORS = ("position", "velocity", "spin", "moment", "body_moment")
"""Quantities of grains that turn with their body."""

MOST_GAPS = 10**6
"""Gaps between grains of two bodies that are in memory at a time."""


class Motion(NamedTuple):
    """How a body moves between encounters."""

    velocity: np.ndarray  # (3,) V of its centre of mass [m/s]
    angular: np.ndarray  # (3,) L about it [J s]
    own: np.ndarray  # (3,) L along the principal axes of the body when its last encounter ended


@dataclass(frozen=True)
class Body:
    """A rigid body at rest in its principal frame, about its centre of mass.

    Attributes
    ----------
    grains : GrainArrays
        Its grains; orientations are those of the principal frame.
    contacts : StrainedContacts
        Their contacts, with displacements in the principal frame.
    flying : FlyingBody
        What flights need: groups of grains, moments of inertia, extent.
    mass, moment_sum : float
        M [kg], Σ|μ| [A m²].
    charges : Multipoles
        Its charges; the net one is 0 where they cancel but for rounding.
    radii : tuple of float
        Smallest and largest radius of its grains [m].
    number : int
        Number of the body, in the order in which bodies formed; equal for copies.
    born : int
        Number of draws when it formed; 0 for those of the start.
    copy : int
        0, or the number of the doubling in which it was copied.
    motion : Motion or None
        Its motion, if it keeps one between encounters.
    """

    grains: GrainArrays
    contacts: StrainedContacts
    flying: FlyingBody
    mass: float
    moment_sum: float
    charges: Multipoles
    radii: tuple[float, float]
    number: int = 0
    born: int = 0
    copy: int = 0
    motion: Motion | None = None

    def __len__(self) -> int:
        return self.grains.mass.size

    @property
    def charge(self) -> float:
        """Net charge [C]."""
        return self.charges.charge

    @property
    def extent(self) -> float:
        """Outer radius e = max(|x| + r) about the centre of mass [m]."""
        return self.flying.extent

    @property
    def rotation(self) -> float:
        """Energy of rotation ½ Σ L_k²/I_k [J]; 0 without a motion."""
        return 0.0 if self.motion is None else float(0.5 * (self.motion.own**2 / self.flying.inertia).sum())


def body_of(grains: GrainArrays, contacts: StrainedContacts, number: int = 0, born: int = 0) -> tuple[Body, np.ndarray]:
    """The body that grains in any frame are, without their motion; and its principal axes (3, 3) as columns."""
    mass = grains.mass
    offset = grains.position - ((grains.position @ mass) / mass.sum())[:, None]
    inertia, axes = principal_frame(mass, grains.inertia, offset)
    turned = contacts._replace(slide=contacts.slide @ axes, roll=contacts.roll @ axes)
    own = grains._replace(position=axes.T @ offset, moment=axes.T @ grains.moment)
    return body_at_rest(own, turned, inertia, (number, born, 0)), axes


def body_at_rest(
    grains: GrainArrays, contacts: StrainedContacts, inertia: np.ndarray, identity: tuple[int, int, int]
) -> Body:
    """A body of grains in their principal frame, with its moments of inertia, and (number, born, copy)."""
    zeros, pose = np.zeros_like(grains.position), np.zeros((4, grains.mass.size))
    pose[3] = 1.0
    own = grains._replace(
        velocity=zeros, spin=zeros, body_moment=grains.moment, orientation=pose, force=zeros, torque=zeros, field=zeros
    )
    x, moment, magnitude = own.position, own.moment, np.linalg.norm(own.moment, axis=0)
    flying = FlyingBody(
        groups_of(x.T, moment.T),
        charge_groups_of(x.T, own.charge),
        own.radius,
        (float(inertia[0]), float(inertia[1]), float(inertia[2])),
        (0.0, 0.0, 0.0, 1.0),
        float((np.linalg.norm(x, axis=0) + own.radius).max()),
    )
    charges = multipoles_of(x, own.charge, net_charge(own.charge))
    total = float(own.mass.sum()), float(magnitude.sum()), charges
    radii = float(own.radius.min()), float(own.radius.max())
    return Body(own, contacts, flying, *total, radii, *identity)


def in_space(a: Body, b: Body, y: np.ndarray) -> tuple[GrainArrays, StrainedContacts]:
    """Grains of both bodies with their contacts in the frame of the centre of mass, from the state of a pair (20,)."""
    parts, contacts = [], []
    for body, other, sign, turn, angular in ((a, b, 1.0, TURN1, ANGULAR1), (b, a, -1.0, TURN2, ANGULAR2)):
        share, rotation = sign * other.mass / (a.mass + b.mass), Rotation.from_quat(y[turn : turn + 4]).as_matrix()
        spin = rotation @ ((rotation.T @ y[angular : angular + 3]) / body.flying.inertia)
        x, moment = rotation @ body.grains.position, rotation @ body.grains.moment
        velocity = share * y[U : U + 3, None] + np.cross(spin, x, axisb=0, axisc=0)
        parts.append(
            body.grains._replace(
                position=share * y[R : R + 3, None] + x, velocity=velocity, moment=moment, body_moment=moment,
                spin=np.repeat(spin[:, None], len(body), axis=1),
            )
        )  # fmt: skip
        own = body.contacts
        contacts.append(own._replace(slide=own.slide @ rotation.T, roll=own.roll @ rotation.T))
    contacts[1] = contacts[1]._replace(pair=contacts[1].pair + len(a))
    grains = GrainArrays(*(np.concatenate(both, axis=-1) for both in zip(*parts, strict=True)))
    return grains, StrainedContacts(*map(np.concatenate, zip(*contacts, strict=True)))


def part_of(grains: GrainArrays, contacts: StrainedContacts, own: np.ndarray) -> tuple[GrainArrays, StrainedContacts]:
    """Some grains (n,), ascending, with the contacts between them."""
    number = np.full(grains.mass.size, -1)
    number[own] = np.arange(len(own))
    inside = number[contacts.pair[:, 0]] >= 0
    chosen = StrainedContacts(*(array[inside] for array in contacts))
    return GrainArrays(*(np.ascontiguousarray(array[..., own]) for array in grains)), chosen._replace(
        pair=number[chosen.pair]
    )


def momenta_of(grains: GrainArrays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centre of mass [m], its velocity [m/s], and the angular momentum about it [J s] of grains, each (3,)."""
    share = grains.mass / grains.mass.sum()
    centre, velocity = grains.position @ share, grains.velocity @ share
    arm, moving = grains.position - centre[:, None], grains.velocity - velocity[:, None]
    spin = (grains.inertia * grains.spin).sum(axis=1)
    return centre, velocity, (grains.mass * np.cross(arm, moving, axis=0)).sum(axis=1) + spin


def closest_pair(a: int, grains: GrainArrays) -> tuple[int, int, float]:
    """The two grains of the first `a` and of the others with the smallest gap, and this gap [m]."""
    x, radius = grains.position.T, grains.radius
    found, rows = (0, a, math.inf), 1 + MOST_GAPS // (len(radius) - a)
    for first in range(0, a, rows):
        part = slice(first, min(first + rows, a))
        gaps = cdist(x[part], x[a:]) - radius[part, None] - radius[None, a:]
        i, j = np.unravel_index(np.argmin(gaps), gaps.shape)
        if gaps[i, j] < found[2]:
            found = first + int(i), a + int(j), float(gaps[i, j])
    return found
