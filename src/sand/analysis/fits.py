"""Fits of power laws and growth laws, with jackknife errors over independent boxes.

Data of one box are correlated; the jackknife therefore omits whole boxes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arguments import checked
from ..errors import BadInput

STEEPEST = 0.99
"""Largest degree λ, z = 100; faster growth is indistinguishable from exponential growth."""

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
    if np.ptp(np.log(x)) < SAME:
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


class RateLaw(NamedTuple):
    """Growth law dS/dt = S^degree/τ with S(0) = 1, that is S = (1 + t/zτ)^z with z = 1/(1 − degree)."""

    exponent: float  # z; infinite from degree 1 on
    error: float  # standard error, from that of the degree
    low: float  # 95 % interval, from that of the degree
    high: float
    degree: float  # λ = η + ν of Eq. 20
    degree_error: float
    time: float  # τ [s]
    points: int
    groups: int

    def at(self, time: np.ndarray | float) -> np.ndarray | float:
        """S at a time [s]."""
        return np.exp(_log_grown(np.asarray(time), self.degree, self.time))


@checked
def rate_law(time: np.ndarray, sizes: np.ndarray) -> RateLaw:
    """Fit S = (1 + t/zτ)^z to ln S of the mean over boxes, with jackknife errors over boxes.

    Unlike a straight line in ln S over ln t, this includes S(0) = 1, which affects the local slope for long: for S ∝
    t² at late times, the local slope z(1 − S^(−1/z)) is 0.6 at S = 2 and 1.4 at S = 10.

    Parameters
    ----------
    time : ndarray
        (K,) [s] > 0.
    sizes : ndarray
        Mean cluster size S (boxes, K) ≥ 1.

    Returns
    -------
    RateLaw
        Exponent z and degree with errors, and τ.

    Raises
    ------
    BadInput
        If there are fewer than three times, or S does not grow.
    """
    t, s = np.asarray(time, float), np.asarray(sizes, float)
    fits = t.ndim == 1 and len(t) >= 3 and s.shape[1:] == t.shape
    if not fits or not (t > 0).all() or not (s.mean(axis=0)[-1] > 1.0 + SAME):
        raise BadInput("a growth law needs at least three times above 0, and sizes that grow beyond 1")
    degree, tau = _rate(t, s.mean(axis=0))
    if degree > STEEPEST:
        raise BadInput(f"S grows faster than any power of time (dS/dt ∝ S^{degree:.2f})")
    boxes = len(s)
    without = [_rate(t, np.delete(s, k, axis=0).mean(axis=0))[0] for k in range(boxes)] if boxes > 1 else []
    degree_error, *ends = jackknife(degree, np.array(without))
    z, low, high = (np.inf if value >= 1.0 else 1.0 / (1.0 - value) for value in (degree, *ends))
    return RateLaw(z, degree_error * z * z, low, high, degree, degree_error, tau, t.size, boxes)


def _log_grown(time: np.ndarray, degree: float, tau: float) -> np.ndarray:
    """ln S of the solution of dS/dt = S^degree/τ, S(0) = 1: (1 + (1 − degree) t/τ)^(1/(1 − degree)).

    It is exponential at degree 1; the logarithm is accurate near it, and strongly negative after a divergence of S.
    """
    rest = 1.0 - degree
    if abs(rest) < 1e-15:
        return time / tau
    return np.log1p(np.maximum(rest * time / tau, -1.0 + 1e-16)) / rest


def _rate(time: np.ndarray, size: np.ndarray) -> tuple[float, float]:
    """Degree and τ [s] = 1/Ṡ(0) of the least-squares fit to one S(t)."""
    from scipy.optimize import least_squares

    first = time[-1] / max(float(np.log(size[-1])), 1e-3)

    def residuals(free: np.ndarray) -> np.ndarray:
        return _log_grown(time, float(free[0]), first * float(np.exp(free[1]))) - np.log(size)

    found = least_squares(residuals, [0.5, 0.5], bounds=([-3.0, -5.0], [1.5, 5.0]))
    return float(found.x[0]), float(first * np.exp(found.x[1]))


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
