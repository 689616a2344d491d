"""Fit of the dynamic exponent z of growth by a power of time, and its confidence interval.

S ∝ (t − t0)^z implies dS/dt ∝ S^λ with λ = 1 − 1/z (Eq. 20): λ is the slope of ln(dS/dt) over ln S for any t0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..basics.errors import BadInput

MAX_SUMS = 10
"""Upper limit of the number of sums over all sizes whose rounding errors enter S or dS/dt."""


class ExponentFit(NamedTuple):
    """Exponent z of S ∝ (t − t0)^z in a range of S, from dS/dt ∝ S^λ, z = 1/(1 − λ), with its 95 % interval.

    The interval accounts for the curvature of ln(dS/dt) over ln S within the fitted outputs.  For λ near 1 the
    curvature persists up to the largest S that can be computed, and the asymptotic z, S → ∞, may lie outside the
    interval.
    """

    exponent: float  # z; infinite for λ ≥ 1
    low: float  # limits of z from those of λ (Student's t); infinite for λ ≥ 1
    high: float
    degree: float  # λ
    degree_error: float  # error of λ, the largest of those in `exponent_fit`
    half_width: float  # half-width of the 95 % interval of λ
    points: int  # number of outputs fitted


class Outputs(NamedTuple):
    """S (T,) and dS/dt (T,) [1/s] at the fitted outputs."""

    size: np.ndarray
    rate: np.ndarray


def exponent_fit(found: Outputs, others: tuple[Outputs, ...], sizes: int) -> ExponentFit:
    """Fit z by linear regression, λ = Σ(u − ū)(v − v̄)/Σ(u − ū)², u = ln S, v = ln(dS/dt).

    The error of λ is the largest of

    * the standard error of the regression, √(Σ(v − v̄ − λ(u − ū))²/(T − 2)/Σ(u − ū)²);
    * the difference of λ between the first and the last half of the outputs (curvature);
    * the changes of λ with other solutions: a tolerance ten times smaller; mass that left the grid included;
    * rounding.  S and dS/dt are sums over K sizes, with relative errors up to ε = 10 K 2⁻⁵², which change λ by
      Σ(u − ū)(δv − λδu)/Σ(u − ū)² ≤ (1 + |λ|) ε/σ_u (Cauchy–Schwarz), σ_u² the mean of (u − ū)².

    Parameters
    ----------
    found : Outputs
        T ≥ 3 outputs, all above 0.
    others : tuple[Outputs, ...]
        The same outputs of the other solutions.
    sizes : int
        K, number of sizes of the grid.

    Returns
    -------
    ExponentFit
        z, λ and their intervals.

    Raises
    ------
    BadInput
        If S hardly changes between the outputs.
    """
    from scipy.special import stdtrit

    u, v = _logarithms(found)
    rounding = MAX_SUMS * sizes * float(np.finfo(float).eps)
    spread, points = float(np.sqrt((u * u).mean())), len(u)
    if not spread > rounding:
        raise BadInput("S hardly changes between these outputs; use later times, or more decades")
    degree = _slope(u, v)
    scatter = float(np.sqrt(((v - degree * u) ** 2).sum() / (points - 2) / points)) / spread
    half = (points + 1) // 2
    first, last = (
        _slope(*_logarithms(Outputs(found.size[part], found.rate[part]))) for part in (slice(half), slice(-half, None))
    )
    # outputs that are not positive have no logarithms and determine no λ
    changes = [abs(degree - _slope(*_logarithms(other))) if np.min(other) > 0.0 else np.inf for other in others]
    error = max(scatter, abs(last - first), *changes, (1.0 + abs(degree)) * rounding / spread)
    half_width = float(stdtrit(points - 2, 0.975)) * error
    z, low, high = (1.0 / (1.0 - x) if x < 1.0 else np.inf for x in (degree, degree - half_width, degree + half_width))
    return ExponentFit(z, low, high, degree, error, half_width, points)


def _logarithms(outputs: Outputs) -> tuple[np.ndarray, np.ndarray]:
    """ln S and ln(dS/dt) minus their means, which reduces cancellation in the slope."""
    logarithms = (np.log(values / values[-1]) for values in outputs)
    u, v = (values - values.mean() for values in logarithms)
    return u, v


def _slope(u: np.ndarray, v: np.ndarray) -> float:
    squares = float((u * u).sum())
    return float((u * v).sum()) / squares if squares > 0.0 else 0.0
