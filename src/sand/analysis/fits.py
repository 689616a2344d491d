"""Fits of power laws, with jackknife errors over independent boxes, intervals of means, and falls below a level.

Data of one box are correlated; the jackknife therefore omits whole boxes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput

SAME = 1e-9
"""Difference of two logarithms that is attributed to rounding."""


class PowerLawFit(NamedTuple):
    """Least-squares fit of y = prefactor · x^exponent to the logarithms."""

    exponent: float
    error: float  # standard error, by a jackknife over groups
    low: float  # 95 % interval, Student's t
    high: float
    prefactor: float
    points: int
    groups: int

    def at(self, x: np.ndarray | float) -> np.ndarray | float:
        """Value of the fit at x."""
        return self.prefactor * np.asarray(x) ** self.exponent


@checked
def power_law(x: np.ndarray, y: np.ndarray, groups: np.ndarray | None = None) -> PowerLawFit:
    """Fit y ∝ x^exponent by linear regression of the logarithms, with jackknife errors over groups.

    Parameters
    ----------
    x, y : ndarray
        (K,), all above 0, K ≥ 2.
    groups : ndarray or None, optional
        Number (K,) of the box or run of each point; by default each point is its own group.

    Returns
    -------
    PowerLawFit
        Exponent with standard error and 95 % interval, and prefactor.

    Raises
    ------
    BadInput
        If there are fewer than two different x, or values are not positive and finite.
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    if x.shape != y.shape or x.ndim != 1 or not ((x > 0) & (y > 0) & np.isfinite(x) & np.isfinite(y)).all():
        raise BadInput("a power-law fit needs x and y of equal length, all finite and above 0")
    if len(x) < 2 or np.ptp(np.log(x)) < SAME:
        raise BadInput("a power-law fit needs at least two different x")
    if groups is not None and np.shape(groups) != x.shape:
        raise BadInput(f"groups must have one entry for each of {len(x)} points, not {np.size(groups)}")
    group = np.arange(len(x)) if groups is None else np.unique(np.asarray(groups), return_inverse=True)[1]
    # centred, so that sums of squares lose no digits
    mean = float(np.log(x).mean())
    u, v = np.log(x) - mean, np.log(y)
    count = int(group.max()) + 1
    sums = np.array([np.bincount(group, w, count) for w in (np.ones_like(u), u, v, u * u, u * v)])
    slope, offset = _line(sums.sum(axis=1))
    slopes, _ = _line(sums.sum(axis=1)[:, None] - sums)
    error, low, high = jackknife(float(slope), slopes)
    return PowerLawFit(float(slope), error, low, high, float(np.exp(offset - slope * mean)), len(x), count)


@checked
def jackknife(estimate: float, without: np.ndarray) -> tuple[float, float, float]:
    """Standard error and 95 % interval of an estimate by the jackknife.

    Parameters
    ----------
    estimate : float
        Estimate from all groups.
    without : ndarray
        Estimates (n,) that omit one of n independent groups each.

    Returns
    -------
    error, low, high : float
        NaN for a single group, or if an estimate is not finite.
    """
    from scipy.stats import t

    without = np.asarray(without, float)
    n = len(without)
    if n < 2 or not np.isfinite(without).all():
        return np.nan, np.nan, np.nan
    error = float(np.sqrt((n - 1) / n * ((without - without.mean()) ** 2).sum()))
    half_width = float(t.ppf(0.975, n - 1)) * error
    return error, estimate - half_width, estimate + half_width


def _line(sums: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slope and intercept of linear regression from n, Σu, Σv, Σu², Σuv."""
    n, u, v, uu, uv = sums
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = n * uu - u * u
        # the slope is undefined if all x are equal
        slope = np.where(spread > 1e-12 * n * uu, (n * uv - u * v) / spread, np.nan)
        return slope, (v - slope * u) / n


@checked
def mean_interval(values: np.ndarray) -> tuple[float, float]:
    """95 % interval of the mean of a skewed positive quantity of independent boxes, such as S (Cox's method).

    For lognormal values the mean is exp(m + s²/2), with the mean m and the variance s² of the n logarithms; the limits
    are exp(m + s²/2 ± t √(s²/n + s⁴/2(n − 1))), t of Student's distribution with n − 1 degrees of freedom.

    Parameters
    ----------
    values : ndarray
        (n,), all above 0.

    Returns
    -------
    low, high : float
        NaN for a single value.

    Raises
    ------
    BadInput
        If values are not positive and finite.

    References
    ----------
    Olsson (2005), J. Stat. Educ. 13(1).
    """
    from scipy.stats import t

    given = np.asarray(values, float)
    if given.ndim != 1 or not len(given) or not (np.isfinite(given) & (given > 0.0)).all():
        raise BadInput("an interval of a mean needs values that are all finite and above 0")
    n = len(given)
    if n < 2:
        return np.nan, np.nan
    logarithms = np.log(given)
    variance = float(logarithms.var(ddof=1))
    centre = float(logarithms.mean()) + 0.5 * variance
    half = float(t.ppf(0.975, n - 1)) * np.sqrt(variance / n + 0.5 * variance**2 / (n - 1))
    return float(np.exp(centre - half)), float(np.exp(centre + half))


@checked
def separation(first: np.ndarray, second: np.ndarray) -> float:
    """Difference of two means in standard errors (Welch statistic), positive if `first` is larger.

    Parameters
    ----------
    first, second : ndarray
        Values of independent boxes, at least two each.

    Raises
    ------
    BadInput
        If one has fewer than two values.
    """
    a, b = np.asarray(first, float), np.asarray(second, float)
    if a.size < 2 or b.size < 2:
        raise BadInput("two ensembles need at least two boxes each to be compared")
    error = np.sqrt(a.var(ddof=1) / a.size + b.var(ddof=1) / b.size)
    difference = a.mean() - b.mean()
    rounding = 4.0 * np.finfo(float).eps * max(np.abs(a).max(), np.abs(b).max())
    if abs(difference) <= rounding:
        return 0.0
    return float(difference / error) if error > rounding else float(np.copysign(np.inf, difference))


def falls_below(x: np.ndarray, y: np.ndarray, level: float) -> float:
    """First x at which y falls below a level, by linear interpolation of y over ln x; NaN if it does not.

    Parameters
    ----------
    x, y : ndarray
        (V,), x > 0 and increasing; points whose y is NaN are left out.
    """
    known = np.isfinite(y)
    u, f = np.log(x[known]), y[known] - level
    below = np.flatnonzero((f[1:] < 0.0) & (f[:-1] >= 0.0))
    if not below.size:
        return np.nan
    k = int(below[0])
    return float(np.exp(u[k] + (u[k + 1] - u[k]) * f[k] / (f[k] - f[k + 1])))
