"""Growth S(t) by kernels of any degree λ: how far the degree alone determines it.

S of single grains obeys dS/dt = R(S)/τ, R(1) = 1, and the local degree d ln R/d ln S tends to λ. Before that it depends
on how the kernel varies with the ratio of the masses: for λ = ½ it is 0.36 … 0.53 at S = 1.5, 0.44 … 0.54 at S = 5. The
kernels of `EXPONENTS` cover this range: K = [½(N1^(η/2) + N2^(η/2))]² [2N1N2/(N1 + N2)]^ν with η + ν = λ.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from . import kinetics
from .smoluchowski import coagulate, log_sizes

EXPONENTS: dict[str, Callable[[float], tuple[float, float]]] = {
    "thermal speed": lambda degree: (degree + 0.5, -0.5),
    "constant speed": lambda degree: (degree, 0.0),
    "reduced mass": lambda degree: (0.0, degree),
}
"""η and ν of the kernels, for each λ.

K of a grain and a cluster of N grains grows as N^(λ + ½), N^λ and N⁰. Kernels with the first exponent above 1, λ > ½,
have no solution in principle, because a cluster without limit grows at once; up to λ = ¾ this does not affect the S of
interest.
"""
CENTRAL = "constant speed"
"""The kernel whose local degree lies between those of the others."""
DEGREES = np.array([-1.0, -0.5, 0.0, 0.25, 0.5, 0.75])
"""Degrees for which the coagulation equation is solved; between and beyond these ln R is linear in λ."""
POINTS = 200
"""Number of S of a curve, evenly in ln S."""
SIZES_PER_DECADE = 20
OUTPUTS = 150
BEYOND = 100.0
"""Largest cluster of the solution, relative to the largest S."""


class GrowthCurves(NamedTuple):
    """Growth of single grains by the kernels of one family, for any degree λ.

    Attributes
    ----------
    log_size : ndarray
        u = ln S (P,), from 0.
    log_rate : ndarray
        ln R (L, P) of the degrees `DEGREES`.
    """

    log_size: np.ndarray
    log_rate: np.ndarray

    def times(self, degree: float, grains: float = np.inf) -> np.ndarray:
        """Times t/τ at which ln S reaches `log_size`, ∫ dS/[R(S) (1 − S/N)^(1 + λ/2)], by the trapezoidal rule.

        In a box of N grains two clusters of a pair are different ones. Without the pairs of a cluster with itself dS/dt
        is smaller by 1 − ⟨s^(1+λ)⟩/(N ⟨s⟩⟨s^λ⟩) for K = ½(s1^λ + s2^λ), averages over mass; with the exponential size
        distribution of late times this is 1 − (1 + λ/2) S/N. The power is exact for λ = 0.

        Parameters
        ----------
        degree : float
            λ.
        grains : float, optional
            N; infinite for the coagulation equation.
        """
        first = int(np.clip(np.searchsorted(DEGREES, degree) - 1, 0, len(DEGREES) - 2))
        part = (degree - DEGREES[first]) / (DEGREES[first + 1] - DEGREES[first])
        log_rate = (1.0 - part) * self.log_rate[first] + part * self.log_rate[first + 1]
        left = np.maximum(1.0 - np.exp(self.log_size) / grains, np.finfo(float).eps)
        slowness = np.exp(self.log_size - log_rate) * left ** (-1.0 - 0.5 * degree)
        steps = 0.5 * (slowness[1:] + slowness[:-1]) * np.diff(self.log_size)
        return np.append(0.0, np.cumsum(steps))


def power_curves(log_size: np.ndarray) -> GrowthCurves:
    """Curves of dS/dt = S^λ/τ: ln R = λ u at the given u = ln S (P,), increasing."""
    return GrowthCurves(log_size, np.outer(DEGREES, log_size))


@lru_cache(maxsize=32)
def kernel_curves(family: str, largest: float) -> GrowthCurves:
    """Curves of a family of kernels, from solutions of the coagulation equation.

    Parameters
    ----------
    family : str
        A key of `EXPONENTS`.
    largest : float
        Largest S of the curves, > 1.
    """
    log_size = np.linspace(0.0, np.log(largest), POINTS)
    sizes = log_sizes(BEYOND * largest, SIZES_PER_DECADE)
    single = np.append(1.0, np.zeros(len(sizes) - 1))
    rows = []
    for degree in DEGREES.tolist():
        kernel = kinetics.power(2.0, 1.0, *EXPONENTS[family](degree))  # of two grains: dS/dt = 2 n at S = 1, n = 1
        latest = 10.0 * largest ** max(1.0 - degree, 0.3)
        grown = coagulate(
            kernel, sizes, single, np.geomspace(0.01, latest, OUTPUTS),
            mass=1.0, until_size=1.3 * largest, accuracy=1e-4, may_lose=1e-3,
        )  # fmt: skip
        known = np.append(0.0, np.log(grown.mean_size)), np.append(0.0, np.log(0.5 * grown.rate))
        last = float(known[0][-1])  # below `largest` where a few clusters grow without limit: then with the degree λ
        rows.append(np.interp(log_size, *known) + degree * np.maximum(log_size - last, 0.0))
    return GrowthCurves(log_size, np.array(rows))
