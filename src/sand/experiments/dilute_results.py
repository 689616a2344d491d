"""Numbers of a population of dilute dust: scaled times, degree of growth, exponents of its aggregates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..analysis.fits import power_law

RANGE = (3, 100)
"""Range of N of the fits of γ and D_f."""
RATIOS = (0.5, 0.2)
"""n/n₀ whose times are given: they scatter less than those of S."""
FEWEST = 10
"""Fewest aggregates of a fit."""


def scaled_time(ledger: Mapping[str, np.ndarray], reached: np.ndarray) -> float:
    """n₀t [s/m³] of the first row of a ledger for which `reached` (K,) is true; NaN if none is."""
    start = ledger["clusters"][0] / ledger["volume"][0]
    return float(start * ledger["time"][np.argmax(reached)]) if reached.any() else math.nan


def degree(sizes: np.ndarray, times: np.ndarray) -> float:
    """λ of dS/dt = S^λ/τ at four sizes S or more: t = t₀ + τ (S^(1−λ) − 1)/(1 − λ), least squares of relative times.

    t₀ is free, because the local degree is not yet λ at the smallest sizes. Solutions of the coagulation equation with
    kernels of degree 0.536, 0.685 (Eq. 14) and 0.643 (Brownian) give 0.534, 0.676 and 0.671 from S = 8 to 96; with
    t₀ = 0 and from S = 2, 0.526, 0.663 and 0.688.
    """
    from scipy.optimize import minimize_scalar

    def scatter(value: float) -> float:
        columns = np.stack((np.ones_like(times), np.expm1((1.0 - value) * np.log(sizes)) / (1.0 - value))) / times
        rest = 1.0 - columns.T @ np.linalg.lstsq(columns.T, np.ones_like(times), rcond=None)[0]
        return float(rest @ rest)

    return float(minimize_scalar(scatter, bounds=(-3.0, 0.999), method="bounded", options={"xatol": 1e-7}).x)


def exponents(aggregates: Mapping[str, np.ndarray], between: tuple[float, float] = RANGE) -> tuple[float, float]:
    """γ and D_f of aggregates with N in a range, μ ∝ N^γ and N ∝ r_g^D_f, copies included.

    Regressions of ln μ and ln r_g on ln N; NaN with fewer than ten aggregates, or without moments. A copy stands for
    another body of the doubled volume: without copies, bodies that joined after the last doubling, which have none,
    would count twice as much as those from before it. The aggregates are not independent; errors are those between
    populations.

    Parameters
    ----------
    aggregates : mapping
        Columns of aggregates.csv.
    """
    grains = aggregates["grains"]
    slopes = []
    for name in ("moment", "gyration_radius"):
        values = aggregates[name]
        used = (grains >= between[0]) & (grains <= between[1]) & (values > 0.0)
        known = used.sum() >= FEWEST and np.ptp(grains[used]) > 0.0
        slopes.append(power_law(grains[used], values[used]).exponent if known else math.nan)
    return slopes[0], 1.0 / slopes[1]


def results_of(grown: Any) -> dict[str, Any]:
    """Results of a population, as `dilute_growth.Grown`: S, n₀t at n/n₀ = 0.5 and 0.2, γ, D_f, counts, outcome."""
    ledger = grown.ledger
    counts = {"draws": "step", "flights": "flights", "hits": "hits", "grains": "grains", "bodies": "clusters"}
    gamma, dimension = exponents(grown.aggregates) if len(grown.aggregates["grains"]) else (math.nan, math.nan)
    times = {f"n0t_{ratio:g}": scaled_time(ledger, ledger["number_ratio"] <= ratio) for ratio in RATIOS}
    return {
        "outcome": grown.outcome,
        "time": float(ledger["time"][-1]),
        "mean_cluster_size": float(ledger["mean_cluster_size"][-1]),
        "number_ratio": float(ledger["number_ratio"][-1]),
        **times,
        "moment_exponent": gamma,
        "fractal_dimension": dimension,
        **{name: int(ledger[column][-1]) for name, column in counts.items()},
        "others": float(ledger["others"][-1]),
    }
