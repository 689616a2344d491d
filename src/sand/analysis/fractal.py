"""Fractal dimension, by three methods that do not agree exactly and are not meant to.

* `ensemble_dimension`: N = k (r_g/a)^D over many aggregates of many sizes; the cleanest, if there are many.
* `correlation_dimension`: of one aggregate, from the number of grains within a distance of a grain.
* `box_dimension`: of one aggregate, from the number of boxes it takes to cover it. Boxes at the rim are part empty,
  which makes it too low, for compact bodies by as much as a half; for chains and fluffy ones it is as good as the
  others.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ..arguments import checked
from ..errors import BadInput
from .fits import PowerLawFit, power_law
from .shape import gyration_radius

FEWEST = 32
"""Grains that one aggregate must have for the methods that look at one."""
WINDOW = (2.0, 0.7)
"""Distances of the correlation integral: from so many grain distances to so many radii of gyration."""
CORE = 1.0
"""It is looked around from grains within so many radii of gyration of the centre: the rim has nothing beyond it."""
BOXES = (2.0, 0.5)
"""Sides of boxes: from so many grain distances to so many radii of gyration."""
RANGE = 3.0
"""Largest over smallest number of grains that an ensemble must have at least."""
ABOVE = 1.0 + 1e-9
"""Lengths that are the same but for rounding count as such: whole numbers of grain distances, the grains of a ring."""
POINTS = 12
SHIFTS = 32


class Dimension(NamedTuple):
    """A fractal dimension."""

    value: float
    error: float  # standard error; that of the window is in it where there is one aggregate only
    prefactor: float  # k of N = k (x/a)^D, a half a grain distance
    window: tuple[float, float]  # distances [m], or numbers of grains, that were used


@checked
def ensemble_dimension(
    sizes: np.ndarray, gyration: np.ndarray, grain_radius: float, groups: np.ndarray | None = None, least: int = 5
) -> Dimension:
    """D of N = k (r_g/a)^D.

    Parameters
    ----------
    sizes : ndarray
        N (K,) of the aggregates.
    gyration : ndarray
        r_g (K,) [m].
    grain_radius : float
        a [m].
    groups : ndarray or None, optional
        (K,) box or run of each, for errors; each its own by default.
    least : int, optional
        aggregates of fewer grains are left out.

    Raises
    ------
    BadInput
        fewer than two different sizes from `least` on.
    """
    n, r = np.asarray(sizes, float), np.asarray(gyration, float)
    used = n >= least
    if not used.any() or n[used].max() < RANGE * n[used].min():
        raise BadInput(
            f"a fractal dimension needs aggregates from {least} grains on, "
            f"the largest at least {RANGE:g} times the smallest"
        )
    # N is what is known, r_g scatters about what N makes of it
    fit = power_law(n[used], r[used] / grain_radius, None if groups is None else np.asarray(groups)[used])
    if not fit.exponent > 0.1:
        raise BadInput("the sizes of aggregates do not grow with their number of grains: too few of them")
    value = 1.0 / fit.exponent
    return Dimension(value, fit.error * value**2, fit.prefactor**-value, (float(n[used].min()), float(n[used].max())))


def _one(position: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Positions, the usual distance of neighbours, and r_g [m] of an aggregate that is large enough."""
    place = np.asarray(position, dtype=np.float64)
    if place.ndim != 2 or place.shape[1] != 3 or len(place) < FEWEST:
        raise BadInput(f"the fractal dimension of one aggregate needs at least {FEWEST} grains, not {len(place)}")
    nearest = cKDTree(place).query(place, k=2)[0][:, 1]
    return place, float(np.median(nearest)), gyration_radius(place)


@checked
def correlation_dimension(position: np.ndarray, window: tuple[float, float] | None = None) -> Dimension:
    """D of n(r) ∝ r^D, the mean number of grains within r of a grain that is not at the rim, itself counted.

    Parameters
    ----------
    position : ndarray
        (N, 3) [m], N ≥ 32, of a whole aggregate.
    window : tuple[float, float] or None, optional
        distances [m] to fit between; 2 grain distances to 0.7 r_g by default.

    Raises
    ------
    BadInput
        too few grains, or a window without room.

    The error is the scatter of the slope between thirds of the window: fractals of this size are no straight lines.
    """
    place, unit, size = _one(position)
    low, high = window or (WINDOW[0] * unit, max(WINDOW[1] * size, 2.0 * WINDOW[0] * unit))
    # half-way between shells of neighbours: a straight chain then has dimension 1 exactly
    radii = (np.unique((_spaced(low, high) / unit * ABOVE).astype(int)) + 0.5) * unit
    core = np.linalg.norm(place - place.mean(axis=0), axis=1) <= CORE * size * ABOVE
    return _of_slopes(radii, grains_within(place[core], place, radii), unit, (low, high))


def grains_within(centres: np.ndarray, place: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Mean number of grains within each distance (K,) of the centres, which count themselves."""
    return cKDTree(centres).count_neighbors(cKDTree(place), radii) / len(centres)


@checked
def box_dimension(position: np.ndarray, window: tuple[float, float] | None = None, seed: int = 0) -> Dimension:
    """D of box counting: n(s) ∝ s^−D boxes of side s are needed, the fewest over shifted and turned grids.

    Parameters
    ----------
    position : ndarray
        (N, 3) [m], N ≥ 32, of a whole aggregate.
    window : tuple[float, float] or None, optional
        sides [m] to fit between; 2 grain distances to half r_g by default.
    seed : int, optional
        of shifts and turns.

    Raises
    ------
    BadInput
        too few grains, or a window without room.
    """
    place, unit, size = _one(position)
    low, high = window or (BOXES[0] * unit, max(BOXES[1] * size, 2.0 * BOXES[0] * unit))
    sides, rng = _spaced(low, high), np.random.default_rng(seed)
    needed = np.full((SHIFTS, len(sides)), np.inf)
    for shift in range(SHIFTS):
        turned = place @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
        for k, side in enumerate(sides):
            cell = np.floor(turned / side + rng.random(3)).astype(np.int64)
            cell -= cell.min(axis=0)
            span = cell.max(axis=0) + 1
            needed[shift, k] = len(np.unique((cell[:, 0] * span[1] + cell[:, 1]) * span[2] + cell[:, 2]))
    return _of_slopes(sides, len(place) / needed.min(axis=0), unit, (low, high))


def _spaced(low: float, high: float) -> np.ndarray:
    if not 0.0 < low < high:
        raise BadInput(f"the window from {low:.3g} m to {high:.3g} m has no room; the second must be above the first")
    return np.geomspace(low, high, POINTS)


def _of_slopes(x: np.ndarray, y: np.ndarray, unit: float, window: tuple[float, float]) -> Dimension:
    """The slope over the whole window; its error from the slopes of the three thirds."""
    used = y > 0
    if used.sum() < 3:
        raise BadInput("there is nothing within most of the window")
    whole: PowerLawFit = power_law(x[used], y[used])
    thirds = [part for part in np.array_split(np.flatnonzero(used), 3) if len(part) > 1]
    thirds = thirds if len(thirds) > 1 else [np.arange(2), np.arange(len(x) - 2, len(x))]
    slopes = [power_law(x[part], y[part]).exponent for part in thirds]
    error = float(np.std(slopes, ddof=1) / np.sqrt(len(slopes)))
    return Dimension(whole.exponent, error, whole.prefactor * (0.5 * unit) ** whole.exponent, window)
