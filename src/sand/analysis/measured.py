"""Size and fractal dimension of one aggregate, for `sand build`, until `analysis.shape` and `.fractal` are there."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

CORE = 0.5
"""Grains within this many radii of gyration of the centre are looked around from: the rim has nothing beyond it."""
LEAST, FROM, UP_TO = 30, 2.5, 1.0
"""Fewest grains; the fit goes from 2.5 distances of neighbours to one radius of gyration."""
MOST = 2000


def gyration_radius(position: np.ndarray, mass: np.ndarray) -> float:
    """r_g [m] of the centres of grains about their centre of mass: r_g² = Σ m |x − x₀|² / Σ m."""
    middle = np.average(position, axis=0, weights=mass)
    return float(np.sqrt(np.average(((position - middle) ** 2).sum(axis=1), weights=mass)))


def correlation_dimension(position: np.ndarray) -> tuple[float, float]:
    """D of C(r) ∝ r^D, and its error; NaN for too few grains.

    C(r) is the mean number of grains within r of one, itself counted, over grains in the core of the aggregate, at
    r = 2½, 3½, … median distances of next neighbours, evenly thinned in ln r, up to r_g.  The error is half the
    difference of the slopes below and above the middle of that range.
    """
    count = len(position)
    if count < LEAST:
        return float("nan"), float("nan")
    centre = position.mean(axis=0)
    far = np.linalg.norm(position - centre, axis=1)
    size = float(np.sqrt((far**2).mean()))
    tree = cKDTree(position)
    step = float(np.median(tree.query(position, k=2)[0][:, 1]))
    numbers = np.unique(np.geomspace(FROM, max(UP_TO * size / step, FROM + 3.0), 16).astype(int)) + 0.5
    core = np.flatnonzero(far <= max(CORE * size, np.sort(far)[min(count - 1, 20)]))
    core = core[:: max(1, len(core) // MOST)]
    within = cKDTree(position[core]).count_neighbors(tree, numbers * step) / len(core)
    x, y = np.log(numbers), np.log(within)
    half = len(x) // 2 + 1
    low, high = (float(np.polyfit(x[part], y[part], 1)[0]) for part in (slice(half), slice(half - 2, None)))
    return float(np.polyfit(x, y, 1)[0]), 0.5 * abs(high - low)
