"""Single flights of two bodies past each other: many in one compiled call, or one with all that happened."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ...errors import BadInput
from ...units import si
from .encounters import Flight
from .flight_driver import HIT, RESULTS, flights_of, room_for
from .initial_conditions import R, U
from .problem import impact_parameter
from .sampling import Task
from .two_spheres import DIRECTION1, DIRECTION2, SPIN1, SPIN2

ENDS = ("hit", "miss", "bound", "failed", "bounce")
BOUNCE = 4
"""A hit that does not stick, where that is asked for."""
TURNS = {
    "moment_projectile": DIRECTION1,
    "moment_target": DIRECTION2,
    "spin_projectile": SPIN1,
    "spin_target": SPIN2,
}
COLUMNS = ("stratum", "number", *RESULTS)
"""Of the rows that `fly` returns and that flights.csv holds."""


def fly(flying: Flight, tasks: Sequence[Task], width: float, seed: int = 0) -> np.ndarray:
    """Fly them; a row of `COLUMNS` each, (K, 10).

    Parameters
    ----------
    tasks : Sequence[Task]
        which numbers of which annuli.
    width : float
        of an annulus [m].
    """
    strata = np.concatenate([np.full(t.last - t.first, t.stratum) for t in tasks])
    numbers = np.concatenate([np.arange(t.first, t.last) for t in tasks])
    low, high = (strata * width) ** 2, ((strata + 1) * width) ** 2
    told, ends, _ = _flown(flying, strata, numbers, low, high, seed)
    if flying.contact:
        from .sticking import sticks

        for k in np.flatnonzero(told[:, 0] == HIT):
            if not sticks(flying, ends[k]):
                told[k, 0] = BOUNCE
    return np.column_stack([strata, numbers, told])


def _flown(
    flying: Flight,
    strata: np.ndarray,
    numbers: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    seed: int,
    azimuth: float = -1.0,
    rows: int = 0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Results (K, 8), states at the end (K, size), and the trail of the last flight."""
    for name, value in (("seed", seed), ("stratum", strata.min()), ("number", numbers.min())):
        if isinstance(value, bool) or int(value) != value or not 0 <= value < 2**64:
            raise BadInput(f"{name} = {value!r} must be a whole number of at least 0, below 2^64")
    model, rules = flying.pair()
    room = room_for(model.size, rows)
    results, ends = np.zeros((numbers.size, len(RESULTS))), np.zeros((numbers.size, model.size))
    flights_of(model)(
        np.uint64(seed),
        strata.astype(np.uint64),
        numbers.astype(np.uint64),
        low.astype(float),
        high.astype(float),
        room,
        results,
        ends,
        flying.start(azimuth),
        rules,
        flying.limits(),
    )
    return results, ends, room.trail


@dataclass(frozen=True)
class Trajectory:
    """One flight from start to end, in the laboratory frame, where the target begins at the origin; SI.

    Attributes
    ----------
    end : str
        "hit", "miss", "bound" (together after the most steps) or "failed".
    time : ndarray
        (K,) at each step.
    projectile, target : ndarray
        positions (K, 3); velocity_projectile, velocity_target: (K, 3).
    moment_projectile, moment_target : ndarray
        unit vectors (K, 3); spin_projectile, spin_target: (K, 3). Of single grains;
        empty (0, 3) for aggregates.
    impact_parameter, speed : float
        at the start; closest: least distance of the surfaces, 0 at a hit.
    exchanged : float
        part of the projectile's kinetic energy that the target has at the end; NaN after a hit, and where
        the target moved from the start.
    drift : float
        change of the energy over the largest kinetic energy of the relative motion.
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
        """Positions of projectile and target (T, 3) at these times (T,) [s], by cubics through the steps."""
        return (
            CubicHermiteSpline(self.time, self.projectile, self.velocity_projectile)(times),
            CubicHermiteSpline(self.time, self.target, self.velocity_target)(times),
        )


def trajectory(
    flying: Flight, b: Any, *, seed: int = 0, stratum: int = 0, number: int = 0, azimuth: Any = 0.0
) -> Trajectory:
    """One flight with all that happened.

    Parameters
    ----------
    flying : Flight
        from `flight`.
    b
        impact parameter ≥ 0 [m], or "0.95 b_max".
    seed, stratum, number : int, optional
        address of what is drawn by chance.
    azimuth : optional
        of the impact parameter about the line of flight [rad]; 0: along +y for a flight along +x.

    Raises
    ------
    BadInput
        b is out of range.
    """
    square = impact_parameter(b, flying) ** 2
    angle = si(azimuth, "1", "azimuth", least=0.0)
    return _recorded(flying, (stratum, number), (square, square), seed, angle)


def replay(flying: Flight, stratum: int, number: int, width: float, seed: int = 0) -> Trajectory:
    """A flight of a cross-section or a map once more, to the bit, with all that happened up to a touch.

    Parameters
    ----------
    flying : Flight
        the set-up; what becomes of a hit in its contact is not followed here.
    stratum, number : int
        its address, as in flights.csv.
    width : float
        of an annulus [m], `CrossSection.profile[0, 1]`.
    """
    return _recorded(flying, (stratum, number), ((stratum * width) ** 2, ((stratum + 1) * width) ** 2), seed, -1.0)


def _recorded(
    flying: Flight, address: tuple[int, int], squares: tuple[float, float], seed: int, azimuth: float
) -> Trajectory:
    """One flight, again with more room if there was not enough for its steps."""
    given = [np.array([value]) for value in (*address, *squares)]
    rows = 4096
    while True:
        told, _, trail = _flown(flying, given[0], given[1], given[2], given[3], seed, azimuth, rows)
        steps = int(told[0, RESULTS.index("steps")])
        if steps < rows:
            return _trajectory(flying, told[0], trail[: steps + 1])
        rows = steps + 1


def _trajectory(flying: Flight, told: np.ndarray, trail: np.ndarray) -> Trajectory:
    time, y = trail[:, 0], trail[:, 1:]
    m1, m2 = float(flying.projectile.mass.sum()), float(flying.target.mass.sum())
    apart, moving = y[:, R : R + 3], y[:, U : U + 3]
    drift = flying.speed * np.array(flying.along) - moving[0]  # of the target, drawn by chance or given
    steady = drift + m1 / (m1 + m2) * moving[0]
    middle = m1 / (m1 + m2) * apart[0] + time[:, None] * steady
    one, two = m2 / (m1 + m2), -m1 / (m1 + m2)
    v1, v2 = steady + one * moving, steady + two * moving
    single = flying.spheres
    told_of = told[0] != HIT and not drift.any()
    turns = {name: y[:, k : k + 3] if single else np.zeros((0, 3)) for name, k in TURNS.items()}
    named = {name: float(value) for name, value in zip(RESULTS, told, strict=True)}
    return Trajectory(
        end=ENDS[int(named["end"])],
        time=time,
        projectile=middle + one * apart,
        target=middle + two * apart,
        velocity_projectile=v1,
        velocity_target=v2,
        **turns,
        impact_parameter=named["impact_parameter"],
        speed=named["speed"],
        closest=max(named["closest"], 0.0),
        exchanged=float(m2 * (v2[-1] @ v2[-1]) / (m1 * (v1[0] @ v1[0]))) if told_of else math.nan,
        drift=named["drift"],
    )
