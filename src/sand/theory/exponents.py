"""The exponent z of growth as a power of time, fitted to S and dS/dt, and how well it is known.

S ∝ (t − t0)^z means dS/dt ∝ S^λ with λ = 1 − 1/z (Eq. 20): λ is the slope of ln(dS/dt) over ln S, whatever t0 is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import BadInput

SUMS = 10
"""Sums over all sizes, at most, that rounding enters S or dS/dt through."""


class ExponentFit(NamedTuple):
    """z of S ∝ (t − t0)^z over some decades of S, from dS/dt ∝ S^λ, z = 1/(1 − λ).

    As far as the line bends within these outputs, that is in the interval.  Where λ comes near 1 it goes on bending
    slowly at the largest S that can be computed, and z of S → ∞ may lie outside.
    """

    exponent: float  # z; infinite from λ = 1 on
    low: float  # 95 % interval, from that of λ, Student's t; infinite from λ = 1 on
    high: float
    degree: float  # λ
    degree_error: float  # the largest of: standard error of the line, its bend, changes with other outputs, rounding
    reach: float  # half the 95 % interval of λ
    points: int


class Outputs(NamedTuple):
    """S (T,) and dS/dt (T,) [1/s] at the outputs that are fitted."""

    size: np.ndarray
    rate: np.ndarray


def exponent_fit(found: Outputs, others: tuple[Outputs, ...], sizes: int) -> ExponentFit:
    """z and its interval, from λ = Σ(u − ū)(v − v̄)/Σ(u − ū)², u = ln S, v = ln(dS/dt).

    The error of λ is the largest of

    * the standard error of the line, √(Σ(v − v̄ − λ(u − ū))²/(T − 2)/Σ(u − ū)²);
    * the difference of λ between the first and the last half of the outputs, since the line still bends;
    * the changes of λ with other outputs that should be the same: the equation solved ten times more exactly; and what
      left the grid counted with the rest;
    * rounding.  S and dS/dt are sums over K sizes, each known to ε = 10 K 2⁻⁵² at best, which changes λ by
      Σ(u − ū)(δv − λδu)/Σ(u − ū)² ≤ (1 + |λ|) ε/σ_u (Cauchy and Schwarz), σ_u² the mean of (u − ū)².

    Parameters
    ----------
    found : Outputs
        T ≥ 3 outputs, all above 0.
    others : tuple[Outputs, ...]
        the same outputs found otherwise.
    sizes : int
        K.

    Raises
    ------
    BadInput
        S hardly differs between the outputs.
    """
    from scipy.special import stdtrit

    u, v = _logarithms(found)
    rounding = SUMS * sizes * float(np.finfo(float).eps)
    spread, points = float(np.sqrt((u * u).mean())), len(u)
    if not spread > rounding:
        raise BadInput("S hardly changes between these outputs; give later times, or more decades")
    degree = _slope(u, v)
    scatter = float(np.sqrt(((v - degree * u) ** 2).sum() / (points - 2) / points)) / spread
    half = (points + 1) // 2
    first, last = (
        _slope(*_logarithms(Outputs(found.size[part], found.rate[part]))) for part in (slice(half), slice(-half, None))
    )
    changes = [abs(degree - _slope(*_logarithms(other))) if _positive(other) else np.inf for other in others]
    error = max(scatter, abs(last - first), *changes, (1.0 + abs(degree)) * rounding / spread)
    reach = float(stdtrit(points - 2, 0.975)) * error
    z, low, high = (1.0 / (1.0 - x) if x < 1.0 else np.inf for x in (degree, degree - reach, degree + reach))
    return ExponentFit(z, low, high, degree, error, reach, points)


def _positive(outputs: Outputs) -> bool:
    """False where S or dS/dt has no logarithm: then these outputs say nothing about λ."""
    return all(bool((values > 0.0).all()) for values in outputs)


def _logarithms(outputs: Outputs) -> tuple[np.ndarray, np.ndarray]:
    """ln S and ln(dS/dt), each about its mean, which costs fewer digits than the slope of large numbers."""
    both = (np.log(values / values[-1]) for values in outputs)
    u, v = (values - values.mean() for values in both)
    return u, v


def _slope(u: np.ndarray, v: np.ndarray) -> float:
    squares = float((u * u).sum())
    return float((u * v).sum()) / squares if squares > 0.0 else 0.0
