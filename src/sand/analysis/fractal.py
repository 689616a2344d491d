"""Fractal dimension by three methods, which differ systematically.

* `ensemble_dimension`: N = k (r_g/a)^D over aggregates of many sizes; the most reliable with a large ensemble.
* `correlation_dimension`: of one aggregate, from the number of grains within a distance of a grain.
* `box_dimension`: of one aggregate, from the number of boxes that cover it. Partly empty boxes at the surface bias it
  downwards, by up to one half for compact aggregates; for chains and fluffy aggregates it is as good as the others.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ..basics.arguments import checked
from ..basics.errors import BadInput, shown
from ..basics.units import seed_given, si
from .fits import power_law
from .shape import gyration_radius

FEWEST = 32
"""Smallest number of grains for the dimension of one aggregate."""
WINDOW = (2.0, 0.7)
"""Range of distances of the correlation integral: in grain distances (lower) and radii of gyration (upper)."""
CORE = 1.0
"""Largest distance of reference grains from the centre, in radii of gyration; excludes the surface."""
BOXES = (2.0, 0.5)
"""Range of the sides of boxes: in grain distances (lower) and radii of gyration (upper)."""
RANGE = 3.0
"""Smallest ratio of the largest to the smallest number of grains of an ensemble."""
ABOVE = 1.0 + 1e-9
"""Factor that includes lengths equal to a limit but for rounding, as in chains and rings."""
POINTS = 12
"""Number of distances or sides."""
SHIFTS = 32
"""Number of shifted and rotated grids."""


class Dimension(NamedTuple):
    """Fractal dimension with error."""

    value: float
    error: float  # standard error; of one aggregate it includes the dependence on the window
    prefactor: float  # k of N = k (x/a)^D, a half a grain distance
    window: tuple[float, float]  # range of distances [m], or of numbers of grains


@checked
def ensemble_dimension(
    sizes: np.ndarray, gyration: np.ndarray, grain_radius: float, groups: np.ndarray | None = None, least: int = 5
) -> Dimension:
    """Fractal dimension D of an ensemble from N = k (r_g/a)^D.

    Parameters
    ----------
    sizes : ndarray
        Numbers of grains N (K,) of the aggregates.
    gyration : ndarray
        Radii of gyration r_g (K,) [m]; percolating aggregates have none and must be left out.
    grain_radius : float
        Radius of a grain a [m].
    groups : ndarray or None, optional
        Box or run (K,) of each aggregate, for errors; by default each is its own.
    least : int, optional
        Smallest aggregate that is used.

    Raises
    ------
    BadInput
        If the aggregates used do not span a factor of 3 in N, r_g does not grow with N, or is not a number.
    """
    n, r = np.asarray(sizes, float), np.asarray(gyration, float)
    grain_radius = si(grain_radius, "m", "grain_radius", above=0.0)
    if n.ndim != 1 or n.shape != r.shape or (groups is not None and np.shape(groups) != n.shape):
        raise BadInput(f"sizes {n.shape}, gyration {r.shape} and groups must be (K,), one entry for each aggregate")
    used = n >= least
    if (unknown := np.isnan(r[used]).sum()) > 0:
        raise BadInput(f"{unknown} of the aggregates percolate and have no radius of gyration; leave them out")
    if not used.any() or n[used].max() < RANGE * n[used].min():
        raise BadInput(
            f"a fractal dimension needs aggregates from {least} grains on, "
            f"the largest at least {RANGE:g} times the smallest"
        )
    # N is exact and r_g scatters, so that r_g is regressed on N
    fit = power_law(n[used], r[used] / grain_radius, None if groups is None else np.asarray(groups)[used])
    if not fit.exponent > 0.1:
        raise BadInput("the radii of gyration do not grow with the number of grains: too few aggregates")
    value = 1.0 / fit.exponent
    return Dimension(value, fit.error * value**2, fit.prefactor**-value, (float(n[used].min()), float(n[used].max())))


def _window(given: tuple[float, float] | None) -> tuple[float, float] | None:
    """Two numbers, or None.  Raises BadInput."""
    if given is None:
        return None
    low, high = (si(one, "m", "window", above=0.0) for one in given)
    if not low < high:
        raise BadInput(f"window = {shown(given)} is empty; give two distances in m, the smaller one first")
    return low, high


def _one(position: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Positions, median nearest-neighbour distance [m] and r_g [m]. Raises BadInput for too few grains."""
    position = np.asarray(position, dtype=np.float64)
    if position.ndim != 2 or position.shape[1] != 3 or len(position) < FEWEST:
        raise BadInput(f"the fractal dimension of one aggregate needs at least {FEWEST} grains, not {len(position)}")
    nearest = cKDTree(position).query(position, k=2)[0][:, 1]
    return position, float(np.median(nearest)), gyration_radius(position)


@checked
def correlation_dimension(position: np.ndarray, window: tuple[float, float] | None = None) -> Dimension:
    """Correlation dimension D of one aggregate from n(r) ∝ r^D.

    n(r) is the mean number of grains within r of a grain, itself included, averaged over grains away from the surface.

    Parameters
    ----------
    position : ndarray
        (N, 3) [m], N ≥ 32, unwrapped.
    window : tuple of float or None, optional
        Range of distances [m] of the fit; by default 2 grain distances to 0.7 r_g.

    Returns
    -------
    Dimension
        Its error is the scatter of the slopes of thirds of the window, because n(r) of aggregates of this size is not
        an exact power law.

    Raises
    ------
    BadInput
        If there are too few grains, or the window is empty.
    """
    position, unit, size = _one(position)
    low, high = _window(window) or (WINDOW[0] * unit, max(WINDOW[1] * size, 2.0 * WINDOW[0] * unit))
    # half-way between neighbour shells, so that a straight chain has dimension 1 exactly
    radii = (np.unique((_spaced(low, high) / unit * ABOVE).astype(int)) + 0.5) * unit
    core = np.linalg.norm(position - position.mean(axis=0), axis=1) <= CORE * size * ABOVE
    return _of_slopes(radii, grains_within(position[core], position, radii), unit, (low, high))


def grains_within(centres: np.ndarray, position: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Mean number of grains within each distance (K,) of the centres, each of which is counted too."""
    return cKDTree(centres).count_neighbors(cKDTree(position), radii) / len(centres)


@checked
def box_dimension(position: np.ndarray, window: tuple[float, float] | None = None, seed: int = 0) -> Dimension:
    """Box-counting dimension D of one aggregate: n(s) ∝ s^−D boxes of side s cover it.

    n(s) is the minimum over randomly shifted and rotated grids.

    Parameters
    ----------
    position : ndarray
        (N, 3) [m], N ≥ 32, unwrapped.
    window : tuple of float or None, optional
        Range of sides [m] of the fit; by default 2 grain distances to half r_g.
    seed : int, optional
        Seed of shifts and rotations.

    Returns
    -------
    Dimension
        Dimension with error, see `correlation_dimension`.

    Raises
    ------
    BadInput
        If there are too few grains, or the window is empty.
    """
    position, unit, size = _one(position)
    low, high = _window(window) or (BOXES[0] * unit, max(BOXES[1] * size, 2.0 * BOXES[0] * unit))
    sides, rng = _spaced(low, high), np.random.default_rng(seed_given(seed))
    needed = np.full((SHIFTS, len(sides)), np.inf)
    for shift in range(SHIFTS):
        turned = position @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
        for k, side in enumerate(sides):
            cell = np.floor(turned / side + rng.random(3)).astype(np.int64)
            cell -= cell.min(axis=0)
            span = cell.max(axis=0) + 1
            needed[shift, k] = len(np.unique((cell[:, 0] * span[1] + cell[:, 1]) * span[2] + cell[:, 2]))
    return _of_slopes(sides, len(position) / needed.min(axis=0), unit, (low, high))


def _spaced(low: float, high: float) -> np.ndarray:
    if not 0.0 < low < high:
        raise BadInput(f"the window from {low:.3g} m to {high:.3g} m is empty; the second must be above the first")
    return np.geomspace(low, high, POINTS)


def _of_slopes(x: np.ndarray, y: np.ndarray, unit: float, window: tuple[float, float]) -> Dimension:
    """Dimension from the slope over the whole window; error from the slopes of its thirds."""
    if len(x) < 3:
        raise BadInput("the window has fewer than three different distances; choose a wider one")
    whole = power_law(x, y)
    thirds = [part for part in np.array_split(np.arange(len(x)), 3) if len(part) > 1]
    thirds = thirds if len(thirds) > 1 else [np.arange(2), np.arange(len(x) - 2, len(x))]
    slopes = [power_law(x[part], y[part]).exponent for part in thirds]
    error = float(np.std(slopes, ddof=1) / np.sqrt(len(slopes)))
    return Dimension(whole.exponent, error, whole.prefactor * (0.5 * unit) ** whole.exponent, window)
