"""Flights of two bodies: many in one compiled call, or a single one with its full trajectory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ...basics.errors import BadInput
from ...basics.grains import Grains
from ...basics.units import si
from .encounters import Flight
from .flight_driver import FLIGHT_RESULTS, HIT, Flights, allocate_workspace, flights_of
from .initial_conditions import R, U
from .problem import impact_parameter
from .sampling import Task
from .two_spheres import DIRECTION1, DIRECTION2, SPIN1, SPIN2

ENDS = ("hit", "miss", "bound", "failed", "bounce")
BOUNCE = 4
"""End of a hit that does not stick, if sticking is computed."""
OFFSETS = {
    "moment_projectile": DIRECTION1,
    "moment_target": DIRECTION2,
    "spin_projectile": SPIN1,
    "spin_target": SPIN2,
}
COLUMNS = ("stratum", "number", *FLIGHT_RESULTS)
"""Columns of the rows of `fly` and of flights.csv."""
LARGEST_DRIFT = 1e-6
"""Energy error of a flight, over the largest kinetic energy of its relative motion, above which it is counted."""


def fly(setup: Flight, tasks: Sequence[Task], width: float, seed: int = 0) -> np.ndarray:
    """Compute flights; returns one row of `COLUMNS` each, (K, 10).

    Parameters
    ----------
    setup : Flight
        Bodies and initial conditions.
    tasks : sequence of Task
        Numbers of flights in each stratum.
    width : float
        Width of an annulus of the impact parameter [m].
    seed : int, optional
        Seed of the random numbers.
    """
    strata = np.concatenate([np.full(t.last - t.first, t.stratum) for t in tasks])
    numbers = np.concatenate([np.arange(t.first, t.last) for t in tasks])
    low, high = (strata * width) ** 2, ((strata + 1) * width) ** 2
    results, ends, _ = _run(setup, strata, numbers, low, high, seed)
    if setup.contact:
        from .sticking import sticks

        for k in np.flatnonzero(results[:, 0] == HIT):
            if not sticks(setup, ends[k]):
                results[k, 0] = BOUNCE
    return np.column_stack([strata, numbers, results])


def count_inaccurate(rows: np.ndarray) -> int:
    """Number of flights, of rows as those of `fly`, whose energy error exceeds `LARGEST_DRIFT`."""
    return int(np.count_nonzero(rows[:, COLUMNS.index("drift")] > LARGEST_DRIFT))


def inaccurate_text(count: int, flights: int, drift: float) -> str:
    """What is said of such flights; "" if there are none."""
    if not count:
        return ""
    return (
        f"{count} of {flights} flights have an energy error above {LARGEST_DRIFT:g} of the largest kinetic energy of "
        f"their relative motion, up to {drift:.1e}; a smaller tolerance lowers it (1e-8 by default, at least 1e-13)"
    )


def _run(
    setup: Flight,
    strata: np.ndarray,
    numbers: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    seed: int,
    azimuth: float = -1.0,
    rows: int = 0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Results (K, 8), states at the end (K, size), and the history of the last flight."""
    for name, value in (("seed", seed), ("stratum", strata.min()), ("number", numbers.min())):
        if isinstance(value, bool) or int(value) != value or not 0 <= value < 2**64:
            raise BadInput(f"{name} = {value!r} must be a whole number of at least 0, below 2^64")
    model, parameters = setup.pair()
    work = allocate_workspace(model.size, rows)
    flights = Flights(
        strata.astype(np.uint64),
        numbers.astype(np.uint64),
        low.astype(float),
        high.astype(float),
        np.zeros((numbers.size, len(FLIGHT_RESULTS))),
        np.zeros((numbers.size, model.size)),
    )
    flights_of(model)(np.uint64(seed), flights, work, setup.start(azimuth), parameters, setup.limits())
    return flights.results, flights.ends, work.history


@dataclass(frozen=True)
class Trajectory:
    """One flight from start to end in the laboratory frame, with the target initially at the origin; SI.

    Attributes
    ----------
    end : str
        "hit", "miss", "bound" (together after the largest number of steps) or "failed".
    time : ndarray
        Time (K,) of each step.
    projectile, target : ndarray
        Positions (K, 3).
    velocity_projectile, velocity_target : ndarray
        Velocities (K, 3).
    moment_projectile, moment_target : ndarray
        Unit vectors (K, 3) of the moments of single grains; empty (0, 3) for aggregates.
    spin_projectile, spin_target : ndarray
        Spins (K, 3) of single grains; empty (0, 3) for aggregates.
    impact_parameter, speed : float
        Initial values.
    closest : float
        Smallest gap of the surfaces, 0 at a hit.
    exchanged : float
        Final kinetic energy of the target over the initial one of the projectile; NaN after a hit, or if the target
        moved initially.
    drift : float
        Change of the energy over the largest kinetic energy of the relative motion.
    """

    end: str
    time: np.ndarray
    projectile: np.ndarray
    target: np.ndarray
    velocity_projectile: np.ndarray
    velocity_target: np.ndarray
    moment_projectile: np.ndarray
    moment_target: np.ndarray
    spin_projectile: np.ndarray
    spin_target: np.ndarray
    impact_parameter: float
    speed: float
    closest: float
    exchanged: float
    drift: float

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions of projectile and target (T, 3) at the times (T,) [s], by cubic Hermite interpolation."""
        return (
            CubicHermiteSpline(self.time, self.projectile, self.velocity_projectile)(times),
            CubicHermiteSpline(self.time, self.target, self.velocity_target)(times),
        )


def trajectory(
    setup: Flight, b: Any, *, seed: int = 0, stratum: int = 0, number: int = 0, azimuth: Any = 0.0
) -> Trajectory:
    """Compute one flight with its full trajectory.

    Parameters
    ----------
    setup : Flight
        From `flight`.
    b : float or str
        Impact parameter ≥ 0 [m], or "0.95 b_max".
    seed, stratum, number : int, optional
        Identifier of the random numbers.
    azimuth : float, optional
        Azimuth of the impact parameter about the line of flight [rad]; 0 is +y for a flight along +x.

    Raises
    ------
    BadInput
        If b is out of range.
    """
    square = impact_parameter(b, setup) ** 2
    angle = si(azimuth, "1", "azimuth", least=0.0)
    return _recorded(setup, (stratum, number), (square, square), seed, angle)


def grains_at_contact(
    setup: Flight, b: Any, *, seed: int = 0, stratum: int = 0, number: int = 0
) -> tuple[str, Grains | None]:
    """Compute one flight and return the grains of both bodies at their first contact, to simulate what follows.

    Parameters
    ----------
    setup : Flight
        From `flight`.
    b : float or str
        Impact parameter ≥ 0 [m], or "0.95 b_max"; its azimuth is random.
    seed, stratum, number : int, optional
        Identifier of the random numbers.

    Returns
    -------
    end : str
        "hit", "miss", "bound" or "failed", as in `Trajectory`.
    grains : Grains or None
        Grains, the projectile's first, in the frame of the centre of mass; None without a hit.

    Raises
    ------
    BadInput
        If b is out of range.
    """
    from .sticking import grains_at

    square = np.array([impact_parameter(b, setup) ** 2])
    results, ends, _ = _run(setup, np.array([stratum]), np.array([number]), square, square, seed)
    end = int(results[0, FLIGHT_RESULTS.index("end")])
    return ENDS[end], grains_at(setup, ends[0])[0] if end == HIT else None


def replay(setup: Flight, stratum: int, number: int, width: float, seed: int = 0) -> Trajectory:
    """Repeat a flight of a cross-section or a map, with equal bits, and return its trajectory up to contact.

    Parameters
    ----------
    setup : Flight
        Bodies and initial conditions. The contact after a hit is not computed.
    stratum, number : int
        Identifier of the flight, as in flights.csv.
    width : float
        Width of an annulus [m], `CrossSection.profile[0, 1]`.
    seed : int, optional
        Seed of the random numbers.
    """
    return _recorded(setup, (stratum, number), ((stratum * width) ** 2, ((stratum + 1) * width) ** 2), seed, -1.0)


def _recorded(
    setup: Flight, flight_id: tuple[int, int], squares: tuple[float, float], seed: int, azimuth: float
) -> Trajectory:
    """One flight, repeated with a longer history if it had more steps than rows."""
    given = [np.array([value]) for value in (*flight_id, *squares)]
    rows = 4096
    while True:
        results, _, history = _run(setup, given[0], given[1], given[2], given[3], seed, azimuth, rows)
        steps = int(results[0, FLIGHT_RESULTS.index("steps")])
        if steps < rows:
            return _trajectory(setup, results[0], history[: steps + 1])
        rows = steps + 1


def _trajectory(setup: Flight, results: np.ndarray, history: np.ndarray) -> Trajectory:
    time, y = history[:, 0], history[:, 1:]
    m1, m2 = float(setup.projectile.mass.sum()), float(setup.target.mass.sum())
    separation, relative = y[:, R : R + 3], y[:, U : U + 3]
    drift = setup.speed * np.array(setup.along) - relative[0]  # velocity of the target, random or given
    centre_velocity = drift + m1 / (m1 + m2) * relative[0]
    centre = m1 / (m1 + m2) * separation[0] + time[:, None] * centre_velocity
    one, two = m2 / (m1 + m2), -m1 / (m1 + m2)
    v1, v2 = centre_velocity + one * relative, centre_velocity + two * relative
    single = setup.spheres
    has_exchange = results[0] != HIT and not drift.any()
    vectors = {name: y[:, k : k + 3] if single else np.zeros((0, 3)) for name, k in OFFSETS.items()}
    named = {name: float(value) for name, value in zip(FLIGHT_RESULTS, results, strict=True)}
    return Trajectory(
        end=ENDS[int(named["end"])],
        time=time,
        projectile=centre + one * separation,
        target=centre + two * separation,
        velocity_projectile=v1,
        velocity_target=v2,
        **vectors,
        impact_parameter=named["impact_parameter"],
        speed=named["speed"],
        closest=max(named["closest"], 0.0),
        exchanged=float(m2 * (v2[-1] @ v2[-1]) / (m1 * (v1[0] @ v1[0]))) if has_exchange else math.nan,
        drift=named["drift"],
    )
