"""Bodies after a hit: joined at the touch, or with contact steps of their grains until these are at rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..basics.grains import GrainArrays
from ..basics.initial_pairs import StrainedContacts
from ..basics.material import Material
from ..contact.model import Contact
from ..simulation.contact_phase import CHANGES, ContactPhase
from .dilute_body import Body, body_of, closest_pair, in_space, momenta_of, part_of
from .dilute_flight import RigidFlights
from .scattering.flight_driver import HIT

MOST_RETURNS = 100
"""Contact phases of one encounter after which bodies that part again and again are an error."""


class Hit(NamedTuple):
    """What became of two bodies that touched."""

    pieces: list[tuple[GrainArrays, StrainedContacts]]  # in any frame
    made: int  # contacts that formed, slipped and broke
    slipped: int
    broken: int
    time: float  # of contact phases, and of flights between them [s]
    steps: int  # contact steps
    energies: dict[str, float]  # changes [J] by channel: `simulation.contact_phase.CHANGES`
    motions: list[tuple[np.ndarray, np.ndarray]]  # of the pieces: velocity in the frame of the pair, and L

    @property
    def is_miss(self) -> bool:
        """Whether the grains have not touched after all."""
        return not self.made


class Stick:
    """Bodies join at the touch, at the overlap of a contact at rest; energies of the hit are not known.

    Parameters
    ----------
    contact : Contact
        The contact model.
    materials : sequence of Material
        Those of the grains.
    """

    def __init__(self, contact: Contact, materials: Sequence[Material]):
        self.contact, self.materials = contact, materials

    def rest_overlap(self, grains: GrainArrays, i: int, j: int) -> float:
        """Overlap [m] of two grains in contact at rest."""
        materials = (self.materials[int(grains.material[k])] for k in (i, j))
        pairing, (r1, r2) = self.contact.pairing(*materials), grains.radius[[i, j]].tolist()
        law = self.contact.contact_law
        return float(law.normal_mode(pairing.surface_energy, pairing.modulus, r1 * r2 / (r1 + r2)).rest_overlap)

    def __call__(self, a: Body, b: Body, state: np.ndarray) -> Hit:
        """Join two bodies in the state of a pair: b is shifted along the line of the two closest grains."""
        grains, contacts = in_space(a, b, state)
        count = len(a)
        i, j, gap = closest_pair(count, grains)
        position = grains.position.copy()
        apart = position[:, i] - position[:, j]
        position[:, count:] += (apart * ((gap + self.rest_overlap(grains, i, j)) / np.linalg.norm(apart)))[:, None]
        none = np.zeros((1, 3))
        more = StrainedContacts(np.array([[i, j]]), none, none, np.zeros(1))
        joined = StrainedContacts(*(np.concatenate(both) for both in zip(contacts, more, strict=True)))
        # the shift changes no momentum: L is that of the touch
        return Hit([(grains._replace(position=position), joined)], 1, 0, 0, 0.0, 0, {}, [momenta_of(grains)[1:]])


class Resolve:
    """Contact steps until everything is at rest; two pieces that part fly on, and may touch again.

    Parameters
    ----------
    phase : ContactPhase
        Contact steps with the forces of the grains.
    rigid_flights : RigidFlights
        Computes flights.
    """

    def __init__(self, phase: ContactPhase, rigid_flights: RigidFlights):
        self.phase, self.rigid_flights = phase, rigid_flights

    def __call__(self, a: Body, b: Body, state: np.ndarray) -> Hit:
        """Compute a hit in the state of a pair.  Raises BadInput if the contact steps fail."""
        grains, contacts = in_space(a, b, state)
        counts, time, steps, energies = np.zeros(3, int), 0.0, 0, dict.fromkeys(CHANGES, 0.0)
        escape = float(np.linalg.norm(state[:3])) + a.extent + b.extent
        for _ in range(MOST_RETURNS):
            end = self.phase.run(grains, contacts)
            counts += (end.made, end.slipped, end.broken)
            time, steps = time + end.time, steps + end.steps
            for name in CHANGES:
                energies[name] += end.energies[name]
            pieces = [
                part_of(end.grains, end.contacts, np.flatnonzero(end.label == k)) for k in range(end.label.max() + 1)
            ]
            if len(pieces) != 2:
                break
            one, two, y = moving_pair(pieces)
            flight = self.rigid_flights.onward(one, two, y, escape)
            time += flight.time
            energies["kinetic"] += flight.energy - flight.potential - (flight.energy_start - flight.potential_start)
            energies["distant"] += flight.potential - flight.potential_start
            grains, contacts = in_space(one, two, flight.state)
            if flight.end != HIT:
                count = len(one)
                own = np.arange(count), np.arange(count, grains.mass.size)
                pieces = [part_of(grains, contacts, part) for part in own]
                break
        made, slipped, broken = counts.tolist()
        motions = [momenta_of(part)[1:] for part, _ in pieces]
        return Hit(pieces, made, slipped, broken, time, steps, energies, motions)


def moving_pair(pieces: Sequence[tuple[GrainArrays, StrainedContacts]]) -> tuple[Body, Body, np.ndarray]:
    """Two pieces as rigid bodies with their P and L, and the state of this pair (20,)."""
    bodies, centres, velocities, turns, momenta = [], [], [], [], []
    for grains, contacts in pieces:
        body, axes = body_of(grains, contacts)
        centre, velocity, angular = momenta_of(grains)
        bodies.append(body)
        centres.append(centre)
        velocities.append(velocity)
        turns.append(Rotation.from_matrix(axes).as_quat())
        momenta.append(angular)
    apart = centres[0] - centres[1], velocities[0] - velocities[1]
    return bodies[0], bodies[1], np.concatenate([*apart, *turns, *momenta])


HitRule = Callable[[Body, Body, np.ndarray], Hit]
"""`Stick` or `Resolve`."""
