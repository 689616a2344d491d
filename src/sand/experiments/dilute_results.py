"""Numbers of a population of dilute dust: scaled times, degree of growth, exponents of its aggregates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..analysis.clusters import cluster_labels
from ..analysis.fits import power_law
from .dilute_state import BODY

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
    """λ of dS/dt = S^λ/τ with S = 1 at t = 0: least squares of ln t, t = τ (S^(1−λ) − 1)/(1 − λ), at sizes S > 1."""
    from scipy.optimize import minimize_scalar

    def scatter(value: float) -> float:
        return float(np.var(np.log(times) - np.log(np.expm1((1.0 - value) * np.log(sizes)) / (1.0 - value))))

    return float(minimize_scalar(scatter, bounds=(-3.0, 0.999), method="bounded", options={"xatol": 1e-7}).x)


def exponents(aggregates: Mapping[str, np.ndarray], between: tuple[float, float] = RANGE) -> tuple[float, float]:
    """γ and D_f of aggregates with N in a range, μ ∝ N^γ and N ∝ r_g^D_f, of which copies count once.

    Regressions of ln μ and ln r_g on ln N; NaN with fewer than ten aggregates, or without moments.

    Parameters
    ----------
    aggregates : mapping
        Columns of aggregates.csv.
    """
    own = np.unique(aggregates["body"], return_index=True)[1]
    grains = aggregates["grains"][own]
    slopes = []
    for name in ("moment", "gyration_radius"):
        values = aggregates[name][own]
        used = (grains >= between[0]) & (grains <= between[1]) & (values > 0.0)
        known = used.sum() >= FEWEST and np.ptp(grains[used]) > 0.0
        slopes.append(power_law(grains[used], values[used]).exponent if known else math.nan)
    return slopes[0], 1.0 / slopes[1]


def without_copies(rows: dict[str, np.ndarray], frame: Any, least: int) -> dict[str, np.ndarray]:
    """Rows of `aggregate_statistics` of a frame of a population, with each body and its copies once.

    Parameters
    ----------
    rows : dict
        Its columns of the aggregates of at least `least` grains.
    frame : Frame
        The frame; its grains have the numbers of their bodies, `dilute_state.BODY`.
    least : int
        Smallest number of grains.
    """
    labels = cluster_labels(len(frame.position), frame.pair)
    sizes, first = np.bincount(labels), np.unique(labels, return_index=True)[1]
    order = np.argsort(-sizes, kind="stable")  # that of the rows
    numbers = frame.own[BODY][first[order[sizes[order] >= least]]]
    own = np.sort(np.unique(numbers, return_index=True)[1])
    return {name: column[own] for name, column in rows.items()}


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
