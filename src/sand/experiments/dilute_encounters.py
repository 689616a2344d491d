"""Encounters of dilute dust, one after the other: pairs by thinning of a bound, flights, and what becomes of hits."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..basics.errors import BadInput
from ..simulation.contact_phase import CHANGES
from .dilute_body import Body, Motion, body_of
from .dilute_flight import FlightResult, RigidFlights, kepler_start, start_distance
from .dilute_hits import Hit, HitRule
from .dilute_majorant import Approach
from .dilute_own import OWN_START, centre_velocity, deflected, has_reverse, own_start, parted, turned_copy
from .dilute_population import Population, sizes_of
from .scattering.event_draws import event_uniforms
from .scattering.flight_driver import BOUND, FLIGHT_FAILED, HIT, MISS

ENDS = {HIT: "hit", MISS: "miss", BOUND: "bound", FLIGHT_FAILED: "failed"}
REPELLED = "repelled"
"""End of an encounter of like net charges that turn around before the start of a flight."""
HIT_CHANGES = tuple(name for name in CHANGES if name not in ("lost_gas", "lost_outside", "lost_cutoff_changed"))
"""Changes of energies [J] over a hit that can occur."""


RECENT = 100
"""Memory, in hits, of the exponential mean `Encounters.recent_others`."""


class Encounter(NamedTuple):
    """One draw; a row of encounters.csv."""

    event: int
    time: float  # [s]
    end: str  # "hit", "miss", "bound", "repelled"
    grains1: int
    grains2: int
    body1: int  # numbers of the bodies
    body2: int
    copy1: int  # 0, or the doubling in which the body was copied
    copy2: int
    mass1: float  # [kg]
    mass2: float
    moment1: float  # net moments [A m²]
    moment2: float
    speed: float  # relative speed at a large distance [m/s]
    impact_parameter: float  # [m]
    bound: float  # b̂ [m]
    kernel: float  # K̂ of the pair [m³/s]
    flight_time: float  # [s]
    flight_steps: int
    energy_start: float  # of relative motion, rotation and interaction at the start [J]
    flight_error: float  # change of this energy in the flight [J]
    touch_kinetic: float  # ½m̄u² at the touch [J]
    touch_rotation: float  # [J]
    touch_potential: float  # interaction of the two bodies at the touch [J]
    made: int
    slipped: int
    broken: int
    pieces: int
    rest_time: float  # time of the contact phase [s]
    contact_steps: int
    others: float  # expected encounters of the two with others during the flight, without the contact phase
    energies: dict[str, float]  # of a hit, by channel [J]; empty if not computed

    def row(self) -> dict[str, Any]:
        """Columns of encounters.csv."""
        return self._asdict() | {"energies": None} | {name: self.energies.get(name, 0.0) for name in HIT_CHANGES}


WITHOUT_FLIGHT: dict[str, Any] = dict.fromkeys(
    ("flight_time", "energy_start", "flight_error", "touch_kinetic", "touch_rotation", "touch_potential", "others"), 0.0
) | {"flight_steps": 0}
NO_HIT: dict[str, Any] = dict.fromkeys(("made", "slipped", "broken", "pieces", "contact_steps"), 0) | {
    "rest_time": 0.0,
    "energies": {},
}


class Drawn(NamedTuple):
    """A pair, and its flight."""

    i: int
    j: int
    kernel: float  # K̂ [m³/s]
    approach: Approach
    flight: FlightResult | None  # None: bodies with charges do not come as near as its start
    others: float  # expected encounters of the two with others during the flight


def draw_flight(
    population: Population, rigid_flights: RigidFlights, event: tuple[int, int], uniforms: tuple[float, ...]
) -> Drawn:
    """Draw a pair and its approach, from five of the uniform deviates of an event (seed, number), and fly it."""
    i, j, kernel = population.draw(*uniforms[1:3])
    a, b = population.bodies[i], population.bodies[j]
    approach = population.majorant.draw(sizes_of(a), sizes_of(b), uniforms[3:6])
    flight = _fly(a, b, approach, rigid_flights, event)
    if flight is None:
        return Drawn(i, j, kernel, approach, None, 0.0)
    rate = float(population.sums[i] + population.sums[j] - 2.0 * kernel) / population.volume
    return Drawn(i, j, kernel, approach, flight, rate * flight.time)


def _fly(
    a: Body, b: Body, approach: Approach, rigid_flights: RigidFlights, event: tuple[int, int]
) -> FlightResult | None:
    """The flight of two bodies, thermal or with their own motion; None if they do not come as near as its start."""
    speed, impact, bound = approach
    if a.motion is None:
        start = kepler_start(a, b, (speed, impact), start_distance(a, b, speed, bound))
        return start and rigid_flights.thermal(a, b, *start, event)
    state = own_start(a, b, approach, start_distance(a, b, speed, bound, OWN_START), event)
    if state is None:
        return None
    # until they are as far from each other again: their motion afterwards is kept
    return rigid_flights.onward(a, b, state, float(np.linalg.norm(state[:3])))


class Encounters:
    """Growth of a population; bodies are thermal at each encounter, or keep their motion if they have one.

    Parameters
    ----------
    population : Population
        The bodies.
    rigid_flights : RigidFlights
        Computes flights.
    hits : HitRule
        What becomes of two bodies that touch.
    seed : int
        All random numbers are functions of it and the number of the event.

    Attributes
    ----------
    time : float
        [s]
    event, flights, hits_seen, bound : int
        Draws, flights, hits, and flights that ended without a hit or an escape so far.
    others, recent_others : float
        Sum of `Encounter.others` over hits, and its exponential mean with the memory `RECENT`, that of all for fewer.
    numbers : int
        Number of the next body that forms.
    """

    def __init__(self, population: Population, rigid_flights: RigidFlights, hits: HitRule, seed: int):
        self.population, self.rigid_flights, self.rule, self.seed = population, rigid_flights, hits, seed
        self.time, self.event, self.flights, self.hits_seen, self.others = 0.0, 0, 0, 0, 0.0
        self.recent_others, self.bound = 0.0, 0
        self.numbers = 1 + max(body.number for body in population.bodies)

    def step(self) -> Encounter:
        """Draw one encounter, and compute it.

        Raises
        ------
        BadInput
            If a flight or a contact phase fails.
        """
        population, uniforms = self.population, event_uniforms(self.seed, self.event)
        self.time -= math.log(uniforms[0]) / population.rate
        i, j, kernel, approach, flight, met = draw_flight(
            population, self.rigid_flights, (self.seed, self.event), uniforms
        )
        a, b = population.bodies[i], population.bodies[j]
        drawn = _drawn(self.event, self.time, a, b) | approach._asdict() | {"kernel": kernel}
        self.event += 1
        if flight is None:
            if a.motion is not None:
                population.replace(i, j, deflected(a, b, approach, (self.seed, self.event - 1)))
            end = REPELLED if a.charge * b.charge > 0.0 else ENDS[MISS]
            return Encounter(**drawn, **WITHOUT_FLIGHT, **NO_HIT, end=end)
        self.flights += 1
        self.bound += flight.end == BOUND
        own = _of_flight(flight) | {"others": met}
        if flight.end == FLIGHT_FAILED:
            raise BadInput(f"the flight of event {self.event - 1} failed: its state is not finite")
        if flight.end != HIT:
            if flight.end == MISS and a.motion is not None:
                population.replace(i, j, parted(a, b, flight.state, population.majorant))
            return Encounter(**drawn, **own, **NO_HIT, end=ENDS[flight.end])
        hit = self.rule(a, b, flight.state)
        if hit.is_miss:
            if a.motion is not None and len(hit.pieces) == 2 and has_reverse(a, b, *hit.relative, population.majorant):
                population.replace(i, j, pieces_of(a, b, hit, [(each.number, each.born, each.copy) for each in (a, b)]))
            return Encounter(**drawn, **own, **NO_HIT, end=ENDS[MISS])
        self._replace(i, j, hit)
        self.hits_seen, self.others = self.hits_seen + 1, self.others + met
        self.recent_others += (met - self.recent_others) / min(self.hits_seen, RECENT)
        return Encounter(**drawn, **own, **_hit(hit), end=ENDS[HIT])

    def _replace(self, i: int, j: int, hit: Hit) -> None:
        """The bodies of a hit; all are copied when half of their number at the start is left."""
        population, numbers = self.population, range(self.numbers, self.numbers + len(hit.pieces))
        a, b = population.bodies[i], population.bodies[j]
        population.replace(i, j, pieces_of(a, b, hit, [(number, self.event, 0) for number in numbers]))
        self.numbers += len(hit.pieces)
        if 2 * len(population.bodies) <= population.start:
            turn = None if a.motion is None else lambda body, place: turned_copy(body, self.seed, place)
            population.double(turn)


def pieces_of(a: Body, b: Body, hit: Hit, identities: Sequence[tuple[int, int, int]]) -> list[Body]:
    """The bodies of a hit of a and b, with (number, born, copy) of each; they move if a and b did.

    Each has the momentum and the angular momentum of its grains; of two bodies that join it is that of both.
    """
    found = []
    for (grains, contacts), (velocity, angular), identity in zip(hit.pieces, hit.motions, identities, strict=True):
        (body, axes), (number, born, copy), motion = body_of(grains, contacts), identity, None
        if a.motion is not None:
            motion = Motion(centre_velocity(a, b) + velocity, angular, axes.T @ angular)
        found.append(dataclasses.replace(body, number=number, born=born, copy=copy, motion=motion))
    return found


def net_moment(body: Body) -> float:
    """|Σμ| [A m²]."""
    return float(np.linalg.norm(body.grains.moment.sum(axis=1)))


def _drawn(event: int, time: float, a: Body, b: Body) -> dict[str, Any]:
    found: dict[str, Any] = {"event": event, "time": time}
    for k, body in ((1, a), (2, b)):
        found |= {f"grains{k}": len(body), f"body{k}": body.number, f"copy{k}": body.copy}
        found |= {f"mass{k}": body.mass, f"moment{k}": net_moment(body)}
    return found


def _of_flight(flight: FlightResult) -> dict[str, Any]:
    rotation = flight.energy - flight.kinetic - flight.potential
    return {
        "flight_time": flight.time, "flight_steps": flight.steps, "energy_start": flight.energy_start,
        "flight_error": flight.drift, "touch_kinetic": flight.kinetic, "touch_rotation": rotation,
        "touch_potential": flight.potential,
    }  # fmt: skip


def _hit(hit: Hit) -> dict[str, Any]:
    return {
        "made": hit.made, "slipped": hit.slipped, "broken": hit.broken, "pieces": len(hit.pieces),
        "rest_time": hit.time, "contact_steps": hit.steps, "energies": hit.energies,
    }  # fmt: skip
