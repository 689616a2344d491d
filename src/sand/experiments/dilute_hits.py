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
from .dilute_flight import START, FlightResult, RigidFlights, start_distance
from .dilute_majorant import Majorant
from .dilute_own import OWN_START, repulsion_of, velocity_far_away
from .dilute_population import sizes_of
from .scattering.flight_driver import HIT, MISS
from .scattering.initial_conditions import R, U

MOST_RETURNS = 100
"""Contact phases of one encounter after which bodies that part again and again are an error."""


class Hit(NamedTuple):
    """What became of two bodies that touched."""

    pieces: list[tuple[GrainArrays, StrainedContacts]]  # in the frame of the pair
    made: int  # contacts that formed, slipped and broke
    slipped: int
    broken: int
    time: float  # of contact phases, and of flights between them [s]
    steps: int  # contact steps
    energies: dict[str, float]  # changes [J] by channel: `simulation.contact_phase.CHANGES`
    # of the pieces: velocity in the frame of the pair, of parted charges at an infinite distance, and L
    motions: list[tuple[np.ndarray, np.ndarray]]

    @property
    def is_miss(self) -> bool:
        """Whether the grains have not touched after all."""
        return not self.made

    @property
    def relative(self) -> tuple[np.ndarray, np.ndarray]:
        """r × u (3,) [m²/s] of two pieces, and their relative velocity u (3,)."""
        (one, own, _), (two, other, _) = (momenta_of(grains) for grains, _ in self.pieces)
        return np.cross(one - two, own - other), own - other


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
    majorant : Majorant
        Its b̂ is the unit of the distance to which pieces fly.
    """

    def __init__(self, phase: ContactPhase, rigid_flights: RigidFlights, majorant: Majorant):
        self.phase, self.rigid_flights, self.majorant = phase, rigid_flights, majorant

    def __call__(self, a: Body, b: Body, state: np.ndarray) -> Hit:
        """Compute a hit in the state of a pair.  Raises BadInput if the contact steps fail."""
        grains, contacts = in_space(a, b, state)
        counts, time, steps, energies = np.zeros(3, int), 0.0, 0, dict.fromkeys(CHANGES, 0.0)
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
            flight = self.flight_apart(one, two, y, START if a.motion is None else OWN_START)
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

    def flight_apart(self, a: Body, b: Body, state: np.ndarray, start: float) -> FlightResult:
        """Flight from a state (20,) to a touch, or until the bodies are where a flight of their speed would begin.

        That grows while the bodies lose speed on their way (`dilute_flight.start_distance`).  Charges are taken to an
        infinite distance from there; bodies that they bring back fly on.
        """
        first = flight = self.rigid_flights.onward(a, b, state, self._distance_apart(a, b, state, start))
        time = flight.time
        while flight.end == MISS:
            far = self._distance_apart(a, b, flight.state, start)
            if far <= np.linalg.norm(flight.state[R : R + 3]):
                break
            flight = self.rigid_flights.onward(a, b, flight.state, far)
            time += flight.time
        whole = flight._replace(time=time, potential_start=first.potential_start, energy_start=first.energy_start)
        r, u, repulsion = flight.state[R : R + 3], flight.state[U : U + 3], repulsion_of(a, b)
        velocity = velocity_far_away(r, u, repulsion)
        if flight.end != MISS or repulsion == 0.0 or velocity is None:
            return whole
        square, orbit = float(velocity @ velocity), np.cross(r, u)
        gained = 0.5 * a.mass * b.mass / (a.mass + b.mass) * (square - float(u @ u))
        # on the line that their orbit comes to, with the same r × u
        flight.state[R : R + 3] = np.linalg.norm(r) / np.sqrt(square) * velocity + np.cross(velocity, orbit) / square
        flight.state[U : U + 3] = velocity
        return whole._replace(kinetic=whole.kinetic + gained, potential=whole.potential - gained)

    def _distance_apart(self, a: Body, b: Body, state: np.ndarray, start: float) -> float:
        """Distance [m] at which a flight of the present energy begins; that of charges is |½m̄u² + qq′/4πε₀r|."""
        r, u, repulsion = state[R : R + 3], state[U : U + 3], repulsion_of(a, b)
        speed = np.linalg.norm(u)
        if repulsion != 0.0:
            speed = np.sqrt(abs(u @ u + 2.0 * repulsion / np.linalg.norm(r)))
        return start_distance(a, b, float(speed), float(self.majorant.bound(sizes_of(a), sizes_of(b), speed)), start)


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
