"""Power laws with honest errors: whole boxes are drawn again, because what happens in one box hangs together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.errors import BadInput

DRAWS = 2000
"""Bootstrap samples."""


class PowerLaw(NamedTuple):
    """y = prefactor · x^exponent, fitted to the logarithms by least squares."""

    exponent: float
    error: float  # standard deviation over samples
    low: float  # 95 % interval
    high: float
    prefactor: float
    points: int
    groups: int

    def at(self, x: np.ndarray | float) -> np.ndarray | float:
        """Its value at x."""
        return self.prefactor * np.asarray(x) ** self.exponent


def power_law(x: np.ndarray, y: np.ndarray, groups: np.ndarray | None = None, seed: int = 0) -> PowerLaw:
    """Fit y ∝ x^exponent; errors by a bootstrap over groups.

    Args:
        x, y: (K,), all above 0, K ≥ 2.
        groups: (K,) number of the box, or run, that a point is from; each point is its own group by default.
        seed: of the bootstrap.

    Raises:
        BadInput: fewer than two different x, or values that have no logarithm.
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    if x.shape != y.shape or x.ndim != 1 or not ((x > 0) & (y > 0) & np.isfinite(x) & np.isfinite(y)).all():
        raise BadInput("a power law needs as many y as x, all finite and above 0")
    if len(np.unique(x)) < 2:
        raise BadInput("a power law needs at least two different x")
    group = np.arange(len(x)) if groups is None else np.unique(np.asarray(groups), return_inverse=True)[1]
    # about the middle, so that sums of squares lose no digits
    middle = float(np.log(x).mean())
    u, v = np.log(x) - middle, np.log(y)
    count = int(group.max()) + 1
    sums = np.array([np.bincount(group, w, count) for w in (np.ones_like(u), u, v, u * u, u * v)])
    slope, offset = _line(sums.sum(axis=1))
    rng = np.random.default_rng(seed)
    weights = rng.multinomial(count, np.full(count, 1.0 / count), size=DRAWS)
    slopes, _ = _line(sums @ weights.T)
    slopes = slopes[np.isfinite(slopes)]
    if count > 1 and len(slopes):
        error, (low, high) = float(slopes.std()), np.percentile(slopes, (2.5, 97.5))
    else:  # one box tells nothing of others
        error = low = high = np.nan
    return PowerLaw(float(slope), error, float(low), float(high), float(np.exp(offset - slope * middle)), len(x), count)


def _line(sums: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slope and offset of least squares from n, Σu, Σv, Σu², Σuv."""
    n, u, v, uu, uv = sums
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = n * uu - u * u
        # a sample whose x are all alike has no slope
        slope = np.where(spread > 1e-12 * n * uu, (n * uv - u * v) / spread, np.nan)
        return slope, (v - slope * u) / n


def separation(first: np.ndarray, second: np.ndarray) -> float:
    """How far the mean of `first` lies above that of `second`, in standard errors of the difference (Welch).

    Args:
        first, second: values of independent boxes, at least two each.

    Raises:
        BadInput: fewer.
    """
    a, b = np.asarray(first, float), np.asarray(second, float)
    if a.size < 2 or b.size < 2:
        raise BadInput("two ensembles need at least two boxes each to be compared")
    error = np.sqrt(a.var(ddof=1) / a.size + b.var(ddof=1) / b.size)
    difference = a.mean() - b.mean()
    if error == 0.0:
        return 0.0 if difference == 0.0 else float(np.copysign(np.inf, difference))
    return float(difference / error)
