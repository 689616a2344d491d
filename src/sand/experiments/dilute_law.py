"""Kernel of several populations of dilute dust: c times Eq. 14 with μ = μ₁ N^γ, a table, and Smoluchowski's S(t)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..analysis.fits import jackknife
from ..basics.errors import BadInput
from ..basics.units import si
from ..results import Run
from ..theory.kinetics import CollisionKernel, capture
from ..theory.smoluchowski import coagulate, log_sizes
from .dilute_case import is_dilute
from .dilute_growth import Grown
from .dilute_kernel import Kernel, capture_sums, kernel_of
from .kernel_table import measured
from .seed_table import Interval

EXPONENTS = (-0.5, 2.0)
"""Range of γ of the fit."""
LEAST_DRAWS = 30
"""Fewest draws of a pair of classes in the table for the coagulation equation."""
BEYOND = 300.0
"""Largest size of the grid, in units of the largest S: few clusters are larger."""
POINTS = 60
"""Times of the solution."""


class CaptureLaw(NamedTuple):
    """K(N, N') = c ⟨π b_max² v⟩ (Eq. 14 at thermal speed), with 95 % intervals by a jackknife over populations."""

    factor: Interval  # c with μ = μ₁ N^γ
    exponent: Interval  # γ
    net_factor: Interval  # c with the actual net moments

    def kernel(self, radius: Any, mass: Any, moment: Any, temperature: Any) -> CollisionKernel:
        """The kernel for radius [m], mass [kg] and moment [A m²] of a grain, and T [K]: `theory.kinetics.capture`."""
        gamma, c = self.exponent.value, self.factor.value
        return capture(radius, mass, moment, temperature, exponent=gamma, reading="aligned", speed="thermal", c=c)


def capture_law(
    encounters: Sequence[Mapping[str, np.ndarray]], radius: float, mass: float, moment: float, temperature: float
) -> CaptureLaw:
    """Fit c and γ of K = c ⟨π b_max² v⟩ with μ = μ₁ N^γ to the hits of populations of equal magnetic grains.

    Hits are a Poisson process with the rate K/V of each pair. In its likelihood Σ_hits ln K − Σ_pairs ∫ K dt/V the
    integral is estimated by the draws, Σ_draws K/K̂, as a pair is drawn at the rate K̂/V. With f(N, N'; γ) ∝ K the
    maximum is at the γ of the largest Σ_hits ln f − H ln Σ_draws f/K̂, and c = H/Σ_draws f/K̂. There ⟨ln NN'⟩ of the
    hits equals that of the draws with the weights f/K̂. Without one population γ may be at an end of `EXPONENTS`: then
    there is no interval.

    Parameters
    ----------
    encounters : sequence of mapping
        Columns of encounters.csv of each population.
    radius, mass, moment, temperature : float
        Of a grain [m], [kg], [A m²], and T [K].

    Raises
    ------
    BadInput
        If there are no moments, no hits of bodies of different sizes, or γ is at an end of `EXPONENTS`.
    """
    if not moment > 0.0:
        raise BadInput("the law of capture needs grains with a moment")
    flat = capture(radius, mass, moment, temperature, exponent=0.0, reading="aligned", speed="thermal")
    parts, sums = [], []
    for each in encounters:
        own = each["body1"] != each["body2"]
        first, second = each["grains1"][own], each["grains2"][own]
        weight = flat(mass * first, mass * second) / each["kernel"][own]
        parts.append((np.log(first * second), each["end"][own] == 0, weight))
        sums.append(np.sum(capture_sums(each, temperature)[1:3], axis=1))  # hits and expected ones
    if not any(np.ptp(size[is_hit]) > 0.0 for size, is_hit, _ in parts if is_hit.any()):
        raise BadInput("the law of capture needs hits of bodies of different sizes; grow the dust further")

    def fitted(chosen: Sequence[int]) -> tuple[float, float, float]:
        size, is_hit, weight = (np.concatenate([parts[k][n] for k in chosen]) for n in range(3))
        hits, expected = np.sum([sums[k] for k in chosen], axis=0).tolist()
        return (*_likeliest(size, is_hit, weight), hits / expected if expected > 0.0 else math.nan)

    everything = range(len(parts))
    found = fitted(everything)
    if math.isnan(found[1]):
        raise BadInput(
            "the exponent of the law of capture is not between -0.5 and 2: too few hits; grow the dust further"
        )
    without = [fitted([k for k in everything if k != left]) for left in everything] if len(parts) > 1 else []
    ends = [jackknife(value, np.array([one[n] for one in without]))[1:] for n, value in enumerate(found)]
    return CaptureLaw(*(Interval(value, *end) for value, end in zip(found, ends, strict=True)))


def _likeliest(size: np.ndarray, is_hit: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """c and γ; α ∝ (N N')^γ, and f ∝ α^(2/3).  NaN if the likelihood has no maximum within `EXPONENTS`."""
    from scipy.optimize import brentq

    def terms(exponent: float) -> np.ndarray:
        return weight * np.exp(2.0 / 3.0 * exponent * size)

    def score(exponent: float) -> float:
        """⟨ln NN'⟩ of the draws, which increases with γ, less that of the hits."""
        return float(np.average(size, weights=terms(exponent)) - size[is_hit].mean())

    if not is_hit.any() or not score(EXPONENTS[0]) < 0.0 < score(EXPONENTS[1]):
        return math.nan, math.nan
    exponent = float(brentq(score, *EXPONENTS, xtol=1e-9))
    return int(is_hit.sum()) / float(terms(exponent).sum()), exponent


class PopulationKernel(NamedTuple):
    """Kernel of the populations of a case; what cannot be known is None or empty, with the reason in `missing`."""

    kernel: Kernel | None  # by classes of sizes
    law: CaptureLaw | None
    mass: float  # of a grain [kg]; the mean, if they differ
    time: np.ndarray  # (K,) [s]
    size: np.ndarray  # (K,) S of the coagulation equation with this kernel
    missing: dict[str, str]  # of "kernel", "law" and "coagulation"

    def table(self) -> CollisionKernel:
        """K(m1, m2) from the classes, for the coagulation equation and `kernel_table`.

        Raises
        ------
        BadInput
            If there is no kernel, or fewer than two classes have enough draws.
        """
        if self.kernel is None:
            raise BadInput(self.missing["kernel"])
        return measured(self.kernel.rows(LEAST_DRAWS), extrapolate=True)

    def to_dict(self) -> dict[str, Any]:
        """Entry of analysis.json; K in m³/s by pairs of classes, None where unknown."""
        law = self.law and {name: value._asdict() for name, value in self.law._asdict().items()}
        return {"law": law, "grain_mass": self.mass, "classes": self.rows(), "missing": self.missing}

    def rows(self) -> list[dict[str, Any]]:
        """K of each pair of classes with hits, which have at least `grains1` and `grains2` grains."""
        found = self.kernel
        if found is None:
            return []
        i, j = np.nonzero(np.triu(found.hits))
        sizes = {"grains1": found.edges[i], "grains2": found.edges[j], "mean1": found.sizes[i], "mean2": found.sizes[j]}
        columns = sizes | {
            "kernel": found.value[i, j],
            "error": found.error[i, j],
            "hits": found.hits[i, j].astype(int),
        }
        return [
            dict(zip(columns, row, strict=True)) for row in zip(*map(np.ndarray.tolist, columns.values()), strict=True)
        ]


def _no_kernel_of_sizes(case: Mapping[str, Any], frame: Any) -> str:
    """Why K is no function of two numbers of grains alone, of a case and its first frame; empty if it is one."""
    if case["method"].get("between") == "own":
        return "K depends on the motion of bodies, which they keep (between = 'own'), not on their sizes alone"
    if np.asarray(getattr(frame, "charge", np.zeros(1))).any():
        return "K depends on the charges of bodies, not on their sizes alone"
    values = frame.radius, frame.mass, np.linalg.norm(frame.moment, axis=1)
    if any(np.ptp(each) > 1e-6 * np.abs(each).max() for each in values):
        return "K depends on the grains of bodies, which differ in radius, mass or moment, not on their sizes alone"
    return ""


def kernel_of_populations(folders: Sequence[Path]) -> PopulationKernel | None:
    """Kernel of populations of a case, its law, and S(t) of the coagulation equation with it; None for boxes.

    There is none for bodies that keep their motion, for charges, and for grains that differ in radius, mass or moment.
    """
    runs = [Run(folder) for folder in folders]
    if not all(is_dilute(run.case) for run in runs):
        return None
    first = runs[0].frames[0]
    found = PopulationKernel(None, None, float(np.mean(first.mass)), np.zeros(0), np.zeros(0), {})
    if reason := _no_kernel_of_sizes(runs[0].case, first):
        return found._replace(missing=dict.fromkeys(("kernel", "law", "coagulation"), reason))
    moment, radius = float(np.linalg.norm(first.moment[0])), float(first.radius[0])
    temperature = si(runs[0].case["grains"]["temperature"], "K", "temperature")
    encounters = [Grown(folder, "").encounters for folder in folders]
    found = found._replace(kernel=kernel_of(encounters))
    try:
        found = found._replace(law=capture_law(encounters, radius, found.mass, moment, temperature))
    except BadInput as error:
        found.missing["law"] = str(error)
    ledgers = [run.ledger for run in runs]
    density = float(ledgers[0]["clusters"][0] / ledgers[0]["volume"][0])
    end, largest = (max(float(ledger[name][-1]) for ledger in ledgers) for name in ("time", "mean_cluster_size"))
    try:
        grid, times = log_sizes(BEYOND * largest), np.linspace(0.0, end, POINTS)
        solved = coagulate(found.table(), grid, density, times, mass=found.mass, accuracy=1e-6)
    except BadInput as error:  # fewer than two classes have enough draws
        found.missing["coagulation"] = f"no table of K from classes with {LEAST_DRAWS} draws: {error}"
        return found
    return found._replace(time=solved.times, size=solved.mean_size)
