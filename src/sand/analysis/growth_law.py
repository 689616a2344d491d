"""Growth laws dS/dt ∝ S^λ of an ensemble of boxes: the degree λ of the kernel, z = 1/(1 − λ), and the local degree.

S = (1 + t/zτ)^z holds for λ = 0 alone, because the local degree of other kernels changes with S at first. The growth
of several kernels of the same λ is fitted instead; their difference is the error of not knowing the kernel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput
from ..theory.kernel_growth import CENTRAL, EXPONENTS, POINTS, GrowthCurves, kernel_curves, power_curves
from .fits import SAME, jackknife

STEEPEST = 0.99
"""Largest degree λ, z = 100; faster growth is indistinguishable from exponential growth."""
LIMITS = -3.0, 1.5
"""Range of fitted degrees."""
SPAN = 4.0
"""Ratio of the ends of a window of S in which the local degree is fitted."""
LEAST_SPAN = 1.5
"""Smallest ratio, of the only window."""


class RateLaw(NamedTuple):
    """Growth dS/dt ∝ S^λ of large S from S(0) = 1, with z = 1/(1 − λ).

    Attributes
    ----------
    exponent, error : float
        z with its standard error from the scatter between boxes; z is infinite from λ = 1 on.
    low, high : float
        95 % interval of z: that of the scatter, for all kernels of `degrees`.
    degree, degree_error : float
        λ = η + ν of Eq. 20 for the central kernel, with its standard error.
    degree_low, degree_high : float
        95 % interval of λ.
    degrees : dict[str, float]
        λ fitted with each kernel of `theory.kernel_growth.EXPONENTS`; their range is the error of the model.
    time : float
        τ [s] = 1/Ṡ(0).
    largest, grains : float
        Largest S of the fit, and number of grains of a box.
    points, groups : int
        Number of times and of boxes.
    """

    exponent: float
    error: float
    low: float
    high: float
    degree: float
    degree_error: float
    degree_low: float
    degree_high: float
    degrees: dict[str, float]
    time: float
    largest: float
    grains: float
    points: int
    groups: int

    def at(self, time: np.ndarray | float) -> np.ndarray | float:
        """S of the central kernel at a time [s], up to at least twice `largest`."""
        curves = kernel_curves(CENTRAL, _top(self.largest, self.grains))
        return np.exp(np.interp(np.asarray(time) / self.time, curves.times(self.degree, self.grains), curves.log_size))


class LocalDegree(NamedTuple):
    """Local degree λ(S) = d ln(dS/dt)/d ln S in a window of S, with its 95 % interval by a jackknife over boxes."""

    low_size: float  # window of S
    high_size: float
    degree: float
    error: float
    low: float
    high: float
    points: int


@checked
def rate_law(time: np.ndarray, sizes: np.ndarray, grains: float = np.inf) -> RateLaw:
    """Fit the degree λ of the collision kernel, and z = 1/(1 − λ), to S(t) of the mean over boxes that start at S = 1.

    The growth of three kernels of any degree (`theory.kernel_growth`), with the number of grains in a box, is fitted to
    ln S by least squares. The 95 % interval contains the intervals of all three, by Student's t with jackknife errors
    over boxes. It thus includes the error of not knowing the kernel, if that is homogeneous and lies between them.

    Parameters
    ----------
    time : ndarray
        (K,) [s] > 0.
    sizes : ndarray
        Mean cluster size S (boxes, K) ≥ 1.
    grains : float, optional
        Number of grains N of a box, above every S; infinite for solutions of the coagulation equation.

    Returns
    -------
    RateLaw
        z and λ with errors, and τ. NaN for errors and intervals of a single box.

    Raises
    ------
    BadInput
        If there are fewer than three times, S does not grow, or it grows faster than any power of time.
    """
    t, s = _checked_growth(time, sizes, grains)
    largest = float(s.mean(axis=0).max())
    found = {
        name: _with_interval(t, s, kernel_curves(name, _top(largest, grains)), grains, start=True) for name in EXPONENTS
    }
    degrees = {name: float(fit[0]) for name, (fit, _) in found.items()}
    (degree, log_tau), (error, *_) = found[CENTRAL]
    low, high = min(ends[1] for _, ends in found.values()), max(ends[2] for _, ends in found.values())
    if (degree if np.isnan(low) else low) > STEEPEST:
        raise BadInput(f"S grows faster than any power of time (dS/dt ∝ S^{degree:.2f})")
    z, z_low, z_high = (np.inf if value >= 1.0 else 1.0 / (1.0 - value) for value in (float(degree), low, high))
    return RateLaw(
        exponent=z,
        error=error * z * z,
        low=z_low,
        high=z_high,
        degree=float(degree),
        degree_error=error,
        degree_low=low,
        degree_high=high,
        degrees=degrees,
        time=float(np.exp(log_tau)),
        largest=largest,
        grains=float(grains),
        points=t.size,
        groups=len(s),
    )


@checked
def local_degrees(time: np.ndarray, sizes: np.ndarray, grains: float = np.inf) -> list[LocalDegree]:
    """Local degree λ(S) = d ln(dS/dt)/d ln S in windows of S.

    In each window dS/dt = S^λ (1 − S/N)^(1 + λ/2)/τ with a free S at its first time is fitted to ln S of the mean over
    boxes. The factor in N corrects for the number of grains in a box (`theory.kernel_growth`). The ends of a window
    have a ratio of 4, and the windows start about a factor of two apart; S that grows by less than 5.7 has one window.
    No kernel is assumed. For a homogeneous kernel λ(S) tends to its degree.

    Parameters as for `rate_law`.

    Returns
    -------
    list of LocalDegree
        One for each window with at least four times; NaN for errors and intervals of a single box.

    Raises
    ------
    BadInput
        If there are fewer than four times in each window, S does not grow, or it grows by less than a factor of 1.5.
    """
    t, s = _checked_growth(time, sizes, grains)
    mean = s.mean(axis=0)
    first, last = float(mean.min()), float(mean.max())
    if last < LEAST_SPAN * first:
        raise BadInput(
            f"a local degree needs S that grows by a factor of {LEAST_SPAN:g}, not from {first:.3g} to {last:.3g}"
        )
    more = np.log(last / first) - np.log(SPAN)
    count = 1 + max(round(more / np.log(2.0)), 0)
    windows = [(first, last)]
    if count > 1:
        windows = [(low, SPAN * low) for low in (first * np.exp(np.linspace(0.0, more, count))).tolist()]
    found = []
    for low, high in windows:
        used = (mean >= low * (1.0 - SAME)) & (mean <= high * (1.0 + SAME))
        if used.sum() < 4:
            continue
        curves = power_curves(
            np.linspace(np.log(low / 8.0), np.log(_top(high, grains)), POINTS)
        )  # single boxes are smaller
        fit, ends = _with_interval(t[used], s[:, used], curves, grains, start=False)
        found.append(LocalDegree(low, high, float(fit[0]), *ends, int(used.sum())))
    if not found:
        raise BadInput("a local degree needs at least four times in a window of S")
    return found


def _checked_growth(time: np.ndarray, sizes: np.ndarray, grains: float) -> tuple[np.ndarray, np.ndarray]:
    t, s = np.asarray(time, float), np.asarray(sizes, float)
    fits = t.ndim == 1 and len(t) >= 3 and s.shape[1:] == t.shape
    if not fits or not (t > 0).all() or not (s.mean(axis=0)[-1] > 1.0 + SAME):
        raise BadInput("a growth law needs at least three times above 0, and sizes that grow beyond 1")
    largest = s.mean(axis=0).max()
    if not largest < grains:
        raise BadInput(f"S reaches {largest:.4g} of the {grains:g} grains of a box; use times at which S is smaller")
    return t, s


def _top(size: float, grains: float) -> float:
    """Largest S of the curves: a power of two well above the data, below the number of grains."""
    return float(min(2.0 ** np.ceil(np.log2(3.0 * size)), 0.999 * grains))


def _with_interval(
    time: np.ndarray, sizes: np.ndarray, curves: GrowthCurves, grains: float, start: bool
) -> tuple[np.ndarray, tuple[float, float, float]]:
    """Fit to the mean over boxes, and standard error and 95 % interval of its degree by a jackknife over boxes."""
    found = _fit(time, sizes.mean(axis=0), curves, grains, start)
    boxes = len(sizes)
    without = [
        _fit(time, np.delete(sizes, k, axis=0).mean(axis=0), curves, grains, start, found)[0]
        for k in range(boxes if boxes > 1 else 0)
    ]
    return found, jackknife(float(found[0]), np.array(without))


def _fit(
    time: np.ndarray,
    size: np.ndarray,
    curves: GrowthCurves,
    grains: float,
    start: bool,
    guess: np.ndarray | None = None,
) -> np.ndarray:
    """Degree and ln(τ [s]) of the least-squares fit to one S(t) with S(0) = 1.

    Without `start`, ln S at the first time is free; its difference from the datum is the third number.
    """
    from scipy.optimize import least_squares

    log_size = np.log(size)
    time0, log_size0 = (0.0, 0.0) if start else (time[0], log_size[0])
    ends = np.interp([log_size0, log_size[-1]], curves.log_size, curves.times(0.5, grains))
    unit = (time[-1] - time0) / max(float(ends[1] - ends[0]), 1e-3)

    def residuals(free: np.ndarray) -> np.ndarray:
        at = curves.times(float(free[0]), grains)
        origin = np.interp(log_size0 + free[2:].sum(), curves.log_size, at)
        return np.interp(origin + (time - time0) / (unit * np.exp(free[1])), at, curves.log_size) - log_size

    limits = np.array([LIMITS, (-7.0, 7.0), (-0.6, 0.6)][: 2 if start else 3])
    first = np.array([0.5, np.log(unit), 0.0][: len(limits)]) if guess is None else guess.copy()
    first[1] -= np.log(unit)
    inside = np.clip(first, limits[:, 0] + 1e-3, limits[:, 1] - 1e-3)
    found = least_squares(residuals, inside, bounds=limits.T, diff_step=1e-4).x
    found[1] += np.log(unit)
    return np.asarray(found)
