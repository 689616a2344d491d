"""Flights of two bodies of dilute dust, to a touch or until they part for good."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..basics.constants import COULOMB, MAGNETIC
from .dilute_body import Body
from .dilute_start import start_in_field
from .scattering.encounters import MOST_FLIGHT_STEPS
from .scattering.flight_driver import Flights
from .scattering.initial_conditions import RANDOM, InitialConditions
from .scattering.rigid_flight import GROUP_SIZE, RESULTS, STEP_FRACTION, FlyingPair, Now, contact_energy, flights_of
from .scattering.two_aggregates import AGGREGATES

START = 2.0
"""Distance at which flights start, in units of b̂."""
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
    step_fraction, group_size : float, optional
        See `scattering.rigid_flight`.
    """

    def __init__(
        self,
        heat: float,
        spin: float = 1.5,
        field: tuple[float, float, float] = (0.0, 0.0, 0.0),
        step_fraction: float = STEP_FRACTION,
        group_size: float = GROUP_SIZE,
    ):
        self.heat, self.spin_energy, self.field = heat, spin * heat, field
        self.step_fraction, self.group_size = step_fraction, group_size
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
        needed = max(body.flying.groups.point.shape[1] for body in (a, b))
        if self._now.position1.shape[1] < needed:
            self._now = Now(*(np.zeros((3, 2 * needed)) for _ in Now._fields))
        charged = a.charge * b.charge > 0.0
        pair = FlyingPair(
            a.flying,
            b.flying,
            MAGNETIC,
            COULOMB,
            a.mass * b.mass / (a.mass + b.mass),
            min(a.radii[0], b.radii[0]),
            max(a.radii[1], b.radii[1]),
            float(contact_energy(a.moment_sum, b.moment_sum, 1.0, MAGNETIC)),
            COULOMB * a.charge * b.charge,
            self.field,
            escape,
            self.step_fraction,
            0.0 if charged else self.group_size,  # a group has no charge
            MOST_FLIGHT_STEPS,
        )
        flights_of(charged)(np.uint64(seed), self._flights, start, pair, self._now)
        found = self._flights.results[0].tolist()
        values = dict(zip(RESULTS, found, strict=True)) | {"end": int(found[0]), "steps": int(found[3])}
        return FlightResult(**values, state=self._flights.ends[0].copy())


def charge_of(body: Body) -> float:
    """Net charge [C]."""
    return float(body.grains.charge.sum())


def kepler_start(a: Body, b: Body, approach: tuple[float, float], distance: float) -> tuple[float, float, float] | None:
    """Speed [m/s], impact parameter [m] and distance of the plane [m] of a start on the orbit of two charges.

    With Q = q q′/4πε₀ of the net charges, v and b at infinity, and r² = distance² + b²: v′² = v² − 2Q/m̄r, b′v′ = b v,
    and the plane is at √(r² − b′²).  The direction of the orbit does not matter, as orientations are random.  None if
    the charges repel the bodies before they come so near.
    """
    speed, b_far = approach
    product = COULOMB * charge_of(a) * charge_of(b)
    if product == 0.0:
        return speed, b_far, distance
    radius, reduced = math.hypot(distance, b_far), a.mass * b.mass / (a.mass + b.mass)
    square = speed**2 - 2.0 * product / (reduced * radius)
    if not square * radius**2 > (b_far * speed) ** 2:
        return None
    near = math.sqrt(square)
    offset = b_far * speed / near
    return near, offset, math.sqrt(radius**2 - offset**2)


def start_distance(a: Body, b: Body, bound: float, start: float = START) -> float:
    """Distance [m] of the plane on which a flight starts: 2 b̂, but at least that at which the bodies are clear."""
    return max(start * bound, a.extent + b.extent + 4.0 * max(a.radii[1], b.radii[1]))
