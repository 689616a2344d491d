"""Flights of two bodies of dilute dust, to a touch or until they part for good."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..basics.constants import COULOMB, MAGNETIC
from .dilute_body import Body
from .dilute_charges import attraction_of
from .dilute_population import sizes_of
from .dilute_start import start_in_field
from .scattering.encounters import MOST_FLIGHT_STEPS
from .scattering.flight_driver import Flights
from .scattering.initial_conditions import RANDOM, InitialConditions
from .scattering.rigid_flight import (
    CHARGE_GROUP_SIZE,
    GROUP_SIZE,
    RESULTS,
    STEP_FRACTION,
    FlyingPair,
    Now,
    contact_energy,
    flights_of,
)
from .scattering.two_aggregates import AGGREGATES

START = 2.0
"""Distance at which flights start, in units of b̂, of charges in units of their own, see `start_distance`."""
STREAMS = 0
"""The stratum of flights; their number is that of the event."""


class FlightResult(NamedTuple):
    """Result of a flight, see `scattering.rigid_flight.RESULTS`, and the state at its end."""

    end: int
    impact_parameter: float
    time: float
    steps: int
    gap: float
    kinetic: float
    potential: float
    energy: float
    potential_start: float
    energy_start: float
    revolutions: float
    state: np.ndarray  # (20,)

    @property
    def drift(self) -> float:
        """Error of the energy [J]."""
        return self.energy - self.energy_start


class RigidFlights:
    """Computes flights with the same settings; its work arrays grow with the bodies.

    Parameters
    ----------
    heat : float
        k_BT of the thermal rotation [J].
    spin : float, optional
        Mean energy of rotation in k_BT: 3/2 in equilibrium.
    field : tuple, optional
        External flux density [T].
    step_fraction, group_size, charge_group_size : float, optional
        See `scattering.rigid_flight`.
    """

    def __init__(
        self,
        heat: float,
        spin: float = 1.5,
        field: tuple[float, float, float] = (0.0, 0.0, 0.0),
        step_fraction: float = STEP_FRACTION,
        group_size: float = GROUP_SIZE,
        charge_group_size: float = CHARGE_GROUP_SIZE,
    ):
        self.heat, self.spin_energy, self.field = heat, spin * heat, field
        self.step_fraction, self.group_sizes = step_fraction, (group_size, charge_group_size)
        self._now = Now(*(np.zeros((3, 0)) for _ in Now._fields))
        # one flight, whose arrays are used again
        self._flights = Flights(
            np.full(1, STREAMS, np.uint64), np.zeros(1, np.uint64), np.zeros(1), np.zeros(1),
            np.zeros((1, len(RESULTS))), np.zeros((1, AGGREGATES)),
        )  # fmt: skip

    def thermal(
        self, a: Body, b: Body, speed: float, impact_parameter: float, distance: float, event: tuple[int, int]
    ) -> FlightResult:
        """Flight from a plane at a distance [m], with the orientations and thermal spins of an event (seed, number)."""
        if any(self.field):
            approach = speed, impact_parameter, distance
            state = start_in_field((a, b), approach, self.heat, self.spin_energy, self.field, event)
            return self.onward(a, b, state, 0.0)
        flights = self._flights
        flights.numbers[0], flights.low[0], flights.high[0] = event[1], impact_parameter**2, impact_parameter**2
        return self._fly(a, b, self._start(speed, distance), event[0], 0.0)

    def onward(self, a: Body, b: Body, state: np.ndarray, escape: float) -> FlightResult:
        """Flight from a state (20,), until the bodies recede beyond `escape` [m]; 0: as a flight from a plane ends."""
        self._flights.ends[0] = state
        return self._fly(a, b, self._start(0.0, 0.0), 0, escape)

    def _start(self, speed: float, distance: float) -> InitialConditions:
        none = (0.0, 0.0, 0.0)
        energy, along = (self.spin_energy,) * 2, (1.0, 0.0, 0.0)
        return InitialConditions(
            speed, along, none, 0.0, distance, False, RANDOM, (none, none), energy, (along, along), -1.0
        )

    def _fly(self, a: Body, b: Body, start: InitialConditions, seed: int, escape: float) -> FlightResult:
        needed = max(groups.point.shape[1] for body in (a, b) for groups in (body.flying.groups, body.flying.charges))
        if self._now.position1.shape[1] < needed:
            self._now = Now(*(np.zeros((3, 2 * needed)) for _ in Now._fields))
        pair = FlyingPair(
            a.flying,
            b.flying,
            MAGNETIC,
            COULOMB,
            a.mass * b.mass / (a.mass + b.mass),
            min(a.radii[0], b.radii[0]),
            max(a.radii[1], b.radii[1]),
            attraction_between(a, b),
            self.field,
            escape,
            self.step_fraction,
            *self.group_sizes,
            MOST_FLIGHT_STEPS,
        )
        flights_of(are_charged(a, b))(np.uint64(seed), self._flights, start, pair, self._now)
        found = self._flights.results[0].tolist()
        values = dict(zip(RESULTS, found, strict=True)) | {"end": int(found[0]), "steps": int(found[3])}
        return FlightResult(**values, state=self._flights.ends[0].copy())


def are_charged(a: Body, b: Body) -> bool:
    """Whether both bodies have charged grains."""
    return a.charges.charge_sum * b.charges.charge_sum > 0.0


def attraction_between(a: Body, b: Body) -> tuple[float, ...]:
    """C₁, C₂, C₃ and R of charges (`dilute_charges`), 0 without, and α = 2 (μ₀/4π) Σ|μ| Σ|μ′| of moments [J m³]."""
    moments = float(contact_energy(a.moment_sum, b.moment_sum, 1.0, MAGNETIC))
    if not are_charged(a, b):
        return 0.0, 0.0, 0.0, 0.0, moments
    return (*map(float, attraction_of(sizes_of(a), sizes_of(b))), moments)


def kepler_start(a: Body, b: Body, approach: tuple[float, float], distance: float) -> tuple[float, float, float] | None:
    """Speed [m/s], impact parameter [m] and distance of the plane [m] of a start on the orbit of two charges.

    With Q = q q′/4πε₀ of the net charges, v and b at infinity, and r of `start_radius`: v′² = v² − 2Q/m̄r, b′v′ = b v,
    and the plane is at √(r² − b′²).  The direction of the orbit does not matter, as orientations are random.  None if
    bodies with charges never come so near.
    """
    speed, b_far = approach
    if not are_charged(a, b):
        return speed, b_far, distance
    product, reduced = COULOMB * a.charge * b.charge, a.mass * b.mass / (a.mass + b.mass)
    radius = start_radius(a, b, distance, b_far)
    square = speed**2 - 2.0 * product / (reduced * radius)
    if not square * radius**2 > (b_far * speed) ** 2:
        return None
    near = math.sqrt(square)
    offset = b_far * speed / near
    return near, offset, math.sqrt(max(radius**2 - offset**2, 0.0))


def start_distance(a: Body, b: Body, speed: float, bound: float, start: float = START) -> float:
    """Distance [m] at which a flight starts; at least that at which the bodies are clear.

    Without charges that of a plane, `start` b̂.  The orbit of net charges leads to a distance r at which the rest of −U
    is small: C₂/r² is at most ε m̄v², with ε = 1/(3^(3/2) start³), and so is C/r³, from r ≥ start √(3 (C/m̄v²)^(2/3) +
    e²), as of moments at `start` b̂.  C is C₃ of charges (`dilute_charges`) and α = 2k Σ|μ| Σ|μ′| of moments.
    """
    clear = a.extent + b.extent + 4.0 * max(a.radii[1], b.radii[1])
    if not are_charged(a, b):
        return max(start * bound, clear)
    _, second, third, nearest, moments = attraction_between(a, b)
    energy = speed * speed * a.mass * b.mass / (a.mass + b.mass)
    if energy == 0.0:
        return math.inf
    capture = (third + moments) / energy
    outer = start * math.sqrt(3.0 * capture ** (2.0 / 3.0) + (a.extent + b.extent) ** 2)
    return max(outer, math.sqrt(3.0**1.5 * start**3 * second / energy), nearest, clear)


def start_radius(a: Body, b: Body, distance: float, impact: float) -> float:
    """Distance of the centres [m] at the start: charges are on a sphere, other bodies on a plane with an offset b."""
    return distance if are_charged(a, b) else math.hypot(distance, impact)
