"""Figure of a population of dilute dust: sizes over time, moments and radii over sizes, kernel over that of Eq. 14."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..basics.constants import BOLTZMANN, MAGNETIC
from ..plotting.papers import Curve, Guide, Panel, panels_figure
from .dilute_kernel import CLASSES
from .dilute_majorant import mean_power
from .scattering.rigid_flight import contact_energy

POINTS = 40
"""Points of S(t)."""
LEAST_HITS = 10
"""Fewest hits of a class in the figure."""


def capture_share(encounters: Mapping[str, np.ndarray], temperature: float, mass: float) -> tuple[np.ndarray, ...]:
    """c = K/⟨π b_max² v⟩ with the actual net moments (Eq. 14), by the number of grains of the larger body.

    The mean of 1/K̂ times that kernel over draws, and hits, give c = Σ hits/Σ (K_14/K̂): both are unbiased.

    Parameters
    ----------
    encounters : mapping
        Columns of encounters.csv.
    temperature, mass : float
        T [K], and the mass of a grain [kg].

    Returns
    -------
    sizes, value, error, hits : ndarray
        Mean number of grains of the classes with at least one hit, c, its standard error and hits.
    """
    first, second = encounters["grains1"] * mass, encounters["grains2"] * mass
    reduced = first * second / (first + second)
    alpha = contact_energy(encounters["moment1"], encounters["moment2"], 1.0, MAGNETIC)
    spread = np.sqrt(BOLTZMANN * temperature / reduced)
    law = math.pi * 3.0 * np.cbrt(alpha / reduced) ** 2 * mean_power(-1.0 / 3.0, spread)
    larger = np.maximum(encounters["grains1"], encounters["grains2"])
    number = np.searchsorted(CLASSES, larger, "right") - 1
    is_hit, count = encounters["end"] == 0, len(CLASSES)
    hits, expected = np.bincount(number, is_hit, count), np.bincount(number, law / encounters["kernel"], count)
    sizes = np.bincount(number, larger, count) / np.maximum(np.bincount(number, minlength=count), 1)
    chosen = (hits > 0.0) & (expected > 0.0)
    value = hits[chosen] / expected[chosen]
    return sizes[chosen], value, value / np.sqrt(hits[chosen]), hits[chosen]


def dilute_figure(
    ledger: Mapping[str, np.ndarray],
    aggregates: Mapping[str, np.ndarray],
    encounters: Mapping[str, np.ndarray],
    unit: Any,
) -> Figure:
    """Figure of one population.

    Parameters
    ----------
    ledger, aggregates, encounters : mapping
        Columns of the files of the population.
    unit : tuple
        Mass [kg], radius [m] and moment [A m²] of a grain, and the temperature [K].
    """
    mass, radius, moment, temperature = unit
    # points at equal distances of ln S
    steps = np.linspace(0.0, math.log(ledger["mean_cluster_size"][-1]), POINTS)
    later = np.unique(np.searchsorted(np.log(ledger["mean_cluster_size"]), steps))
    later = later[(later < len(ledger["time"])) & (ledger["time"][np.minimum(later, len(ledger["time"]) - 1)] > 0.0)]
    time = ledger["time"][later]
    sizes = Panel(
        "time (s)",
        "S,  n/n₀",
        [Curve("S", time, ledger["mean_cluster_size"][later]), Curve("n/n₀", time, ledger["number_ratio"][later])],
        log="xy",
    )
    grains = aggregates["grains"]
    of_radii = [_means(grains, aggregates["gyration_radius"] / radius, "r_g/r")]
    guides = [Guide("N^(1/1.2)", np.array([2.0, grains.max()]), np.array([2.0, grains.max()]) ** (1.0 / 1.2))]
    panels = [sizes, Panel("grains N", "r_g/r", of_radii, guides, log="xy")]
    if moment > 0.0:
        of_moments = [_means(grains, aggregates["moment"] / moment, "μ/μ₁")]
        law = [Guide("N^0.63, the paper", np.array([2.0, grains.max()]), np.array([2.0, grains.max()]) ** 0.63)]
        number, value, error, hits = capture_share(encounters, temperature, mass)
        enough = hits >= LEAST_HITS
        low, high = value - error, value + error
        share = Curve("c", number[enough], value[enough], low[enough], high[enough])
        panels += [
            Panel("grains N", "μ/μ₁", of_moments, law, log="xy"),
            Panel("grains of the larger body", "c = K/⟨π b_max² v⟩", [share]),
        ]
    last = f"S = {ledger['mean_cluster_size'][-1]:.3g} after {time[-1]:.3g} s, {int(ledger['hits'][-1])} hits"
    return panels_figure(panels, f"dilute dust: {last}")


def _means(grains: np.ndarray, values: np.ndarray, label: str) -> Curve:
    """Geometric means of values by classes of sizes."""
    number = np.searchsorted(CLASSES, grains, "right")
    present = np.unique(number[values > 0.0])
    chosen: Sequence[np.ndarray] = [(number == k) & (values > 0.0) for k in present]
    x = np.array([np.exp(np.log(grains[each]).mean()) for each in chosen])
    return Curve(label, x, np.array([np.exp(np.log(values[each]).mean()) for each in chosen]))
