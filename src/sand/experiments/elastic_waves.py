"""Waves in a packing at rest: standing waves, and pulses that a knock sends through it; see `elastic`."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..basics.box import Box
from ..basics.errors import BadInput
from ..basics.grains import Grains
from ..setup.from_frame import Start
from ..simulation.simulation import Simulation

WIDTH = 0.08
"""Standard deviation of the velocities of a knock along the packing, over L."""
DISTANCES = np.linspace(0.12, 0.37, 11)
"""Distances at which the arrival of a knock is timed, over L: a whole copy of the packing, with four of them."""
FINER = 1.05
"""Factor between the moments at which a standing wave is looked at."""
LATEST = 300.0
"""Time over that of the affine wave after which a standing wave must have turned."""
MOMENTS = 60
"""Moments at which a pulse is looked at."""


def repeated(start: Start, axis: int, number: int) -> Start:
    """A periodic packing as `number` copies of itself side by side along an axis, in a box as many times as long."""
    grains, contacts, box, count = start.grains, start.contacts, start.box, len(start.grains)
    lengths: Any = list(box.lengths)
    length = lengths[axis]
    copies = np.repeat(np.arange(number), count)
    position = np.tile(box.wrap(grains.position), (number, 1))
    position[:, axis] += (copies - 0.5 * (number - 1)) * length
    vectors: dict[str, Any] = {
        name: np.tile(getattr(grains, name), (number, 1)) for name in ("velocity", "spin", "moment")
    }
    scalars: dict[str, Any] = {name: np.tile(getattr(grains, name), number) for name in ("charge", "mass")}
    materials = [grains.materials[k] for k in grains.material] * number
    many = Grains(position, np.tile(grains.radius, number), materials, **vectors, **scalars)
    lengths[axis] = number * length
    if contacts is not None:
        apart = position[contacts.pair[:, 0]] - position[contacts.pair[:, 1]]  # of the first copy
        crossed = np.rint(apart[:, axis] / length).astype(np.int64)
        first = np.arange(number)[:, None]
        pair = np.stack([contacts.pair[:, 0] + first * count, contacts.pair[:, 1] + (first + crossed) % number * count])
        each = {name: np.concatenate([value] * number) for name, value in contacts._asdict().items()}
        contacts = contacts._replace(**each | {"pair": pair.reshape(2, -1).T})
    return Start(many, contacts, Box(tuple(lengths)), start.note)


class Wave(NamedTuple):
    """Axes along which a wave runs, and along which its grains move: the same one for longitudinal waves."""

    along: int
    polarised: int


class Motion:
    """The motion that a velocity profile begins in a packing at rest.

    Grains begin to move at ± speed × profile in two copies: half the difference of both motions is free of all that
    goes on without them.

    Parameters
    ----------
    rest : Simulation
        The packing, without drag.
    wave : Wave
        Its directions.
    speed : float
        Speed [m/s].
    profile : ndarray
        (N,) velocities over `speed`; their mean is taken away.
    """

    def __init__(self, rest: Simulation, wave: Wave, speed: float, profile: np.ndarray):
        self.start, self.polarised, self.speed, self.pair = rest.time, wave.polarised, speed, []
        for sign in (1.0, -1.0):
            each = rest.copy()
            with each.change() as change:
                change.velocity[:, wave.polarised] += (
                    sign * speed * (profile - profile @ rest.grains.mass / _mass(rest))
                )
            self.pair.append(each)

    def at(self, time: float) -> np.ndarray:
        """Velocities (N,) over `speed` at a time [s] after the start, not before the last one."""
        if time > 0.0:
            for each in self.pair:
                each.run(until=self.start + time)
        one, other = (each.grains.velocity[:, self.polarised] for each in self.pair)
        return np.asarray(0.5 * (one - other) / self.speed)

    def drift(self) -> float:
        """Largest energy error of both copies."""
        return max(abs(each.ledger.drift) for each in self.pair)


def standing_wave(rest: Simulation, wave: Wave, strain: float, stiffest: float, expected: float = 0.0) -> float:
    """Phase speed ω/k [m/s] of the standing wave with k = 2π/L: velocities v cos kx, the mean of which turns at π/2ω.

    Parameters
    ----------
    rest : Simulation
        The packing, without drag.
    strain : float
        k v/ω, about.
    stiffest : float
        Speed of waves of affine motion [m/s], an upper bound.
    expected : float, optional
        v/`strain` [m/s]; by default the speed that a first wave finds, whose strain is at most `strain`.
    """
    # no wave that turns in time is slower than stiffest/LATEST
    expected = expected or standing_wave(rest, wave, strain, stiffest, stiffest / LATEST)
    length = _side(rest, wave)
    profile = np.cos(2.0 * math.pi * rest.grains.position[:, wave.along] / length)
    first = 0.25 * length / stiffest
    weights = profile * rest.grains.mass
    motion, time = Motion(rest, wave, strain * expected, profile), 0.5 * first
    before = 0.0, float(weights @ motion.at(0.0))
    while time < LATEST * first:
        now = float(weights @ motion.at(time))
        if now <= 0.0:
            quarter = before[0] + (time - before[0]) * before[1] / (before[1] - now)
            return 0.25 * length / quarter
        before, time = (time, now), time * FINER
    raise BadInput(f"a standing wave along {'xyz'[wave.along]} does not turn within {time:.3g} s: no elastic packing")


class Knock(NamedTuple):
    """A pulse that a knock has sent through a packing."""

    speed: float  # c [m/s]
    widening: float  # Γ [m²/s]
    misfit: float  # root of the mean square of what the fit leaves of `passed`
    distances: np.ndarray  # (D,) [m]
    arrivals: np.ndarray  # (D,) times at which half of the momentum has passed [s]; NaN where it does not
    times: np.ndarray  # (T,) [s]
    passed: np.ndarray  # (T, D) momentum beyond the distances, over that of the knock
    drift: float  # energy error


def knock(rest: Simulation, wave: Wave, strain: float, expected: float) -> Knock:
    """Speed of a pulse from a layer across the packing, which gets a velocity, from its arrival at several distances.

    Velocities are v exp(−d²/2w²) at the distance d from the layer, w = WIDTH L. Seen is the momentum beyond some
    distances, on both sides of the layer, until the pulses meet; a grain counts by a share that rises from 0 to 1
    within ± w of a distance. The speed is that of `passed_momentum`, fitted by least squares.

    Parameters
    ----------
    rest : Simulation
        The packing, without drag.
    strain : float
        v over the speed of the pulse, about.
    expected : float
        Expected speed [m/s], for the length of the record and the start of the fit.
    """
    from scipy.optimize import least_squares  # slow import

    length, mass = _side(rest, wave), rest.grains.mass
    apart = np.abs(rest.box.nearest(rest.grains.position)[:, wave.along])
    distances, profile = DISTANCES * length, np.exp(-0.5 * (apart / (WIDTH * length)) ** 2)
    motion, given = Motion(rest, wave, strain * expected, profile), float(profile @ mass)
    part = np.clip(0.5 + (apart - distances[:, None]) / (2.0 * WIDTH * length), 0.0, 1.0)
    beyond = part * mass / given
    times = np.linspace(0.0, 0.45 * length / expected, MOMENTS + 1)
    passed = np.array([beyond @ (motion.at(float(time)) + given / _mass(rest)) for time in times])

    def left(logarithms: np.ndarray) -> np.ndarray:
        speed, widening = np.exp(logarithms)
        return np.ravel(passed_momentum(times, distances, length, speed, widening) - passed)

    found = least_squares(left, np.log([expected, 0.1 * WIDTH * length * expected]))
    speed, widening = np.exp(found.x).tolist()
    arrivals = np.array([first_above(times, column, 0.5) for column in passed.T])
    misfit = float(np.sqrt(np.mean(found.fun**2)))
    return Knock(speed, widening, misfit, distances, arrivals, times, passed, motion.drift())


def passed_momentum(
    times: np.ndarray, distances: np.ndarray, length: float, speed: float, widening: float
) -> np.ndarray:
    """Momentum (T, D) beyond distances from a layer, over that of a knock on it, in a period L.

    Two pulses of Gaussian form run apart with the speed c; scattering and damping widen them, as those of sound in any
    medium: the variance of a pulse is (1 + 1/3) w² + 2Γt, of which w²/3 is that of the shares of grains. With the
    normal distribution N, until the pulses meet, n = 0, 1, it is

        Σ_n N((ct − d + nL)/s) − N((ct − L + d + nL)/s).
    """
    from scipy.special import ndtr

    wide = np.sqrt(4.0 / 3.0 * (WIDTH * length) ** 2 + 2.0 * widening * times)[:, None]
    run, d = speed * times[:, None], distances[None]
    images = (ndtr((run - d + n * length) / wide) - ndtr((run - length + d + n * length) / wide) for n in (0, 1))
    return np.asarray(sum(images))


def first_above(times: np.ndarray, values: np.ndarray, level: float) -> float:
    """Time at which values first come to a level, linear between two of them; NaN if they do not."""
    above = np.flatnonzero(values >= level)
    if not len(above) or above[0] == 0:
        return math.nan
    k = int(above[0])
    part = (level - values[k - 1]) / (values[k] - values[k - 1])
    return float(times[k - 1] + part * (times[k] - times[k - 1]))


def _mass(simulation: Simulation) -> float:
    return float(simulation.grains.mass.sum())


def _side(rest: Simulation, wave: Wave) -> float:
    lengths: Any = rest.box.lengths
    return float(lengths[wave.along])
