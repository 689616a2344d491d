"""Figure of a population of dilute dust: sizes over time, moments and radii over sizes, kernel over that of Eq. 14."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..plotting.papers import Curve, Guide, Panel, panels_figure
from .dilute_kernel import CLASSES, capture_sums

POINTS = 40
"""Points of S(t)."""
LEAST_HITS = 10
"""Fewest hits of a class in the figure."""


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
        Mean radius of the grains [m], mean moment of the magnetic ones [A m²], and the temperature [K].
    """
    radius, moment, temperature = unit
    times, size = ledger["time"], ledger["mean_cluster_size"]
    # points at equal distances of ln S
    later = np.unique(np.searchsorted(np.log(size), np.linspace(0.0, math.log(size[-1]), POINTS)))
    later = later[(later < len(times)) & (times[np.minimum(later, len(times) - 1)] > 0.0)]
    curves = [Curve("S", times[later], size[later]), Curve("n/n₀", times[later], ledger["number_ratio"][later])]
    sizes = Panel("time (s)", "S,  n/n₀", curves, log="xy")
    grains = aggregates["grains"]
    of_radii = [_means(grains, aggregates["gyration_radius"] / radius, "r_g/r")]
    guides = [Guide("N^(1/1.2)", np.array([2.0, grains.max()]), np.array([2.0, grains.max()]) ** (1.0 / 1.2))]
    panels = [sizes, Panel("grains N", "r_g/r", of_radii, guides, log="xy")]
    if moment > 0.0:
        of_moments = [_means(grains, aggregates["moment"] / moment, "μ/μ₁")]
        law = [Guide("N^0.63, the paper", np.array([2.0, grains.max()]), np.array([2.0, grains.max()]) ** 0.63)]
        number, hits, expected, every = capture_sums(encounters, temperature)
        enough = hits >= LEAST_HITS
        value, error = hits[enough] / expected[enough], every[enough]
        share = Curve("c", number[enough], value, value - error, value + error)
        panels += [
            Panel("grains N", "μ/μ₁", of_moments, law, log="xy"),
            Panel("grains of the larger body", "c = K/⟨π b_max² v⟩", [share]),
        ]
    last = f"S = {size[-1]:.3g} after {times[-1]:.3g} s, {int(ledger['hits'][-1])} hits"
    return panels_figure(panels, f"dilute dust: {last}")


def _means(grains: np.ndarray, values: np.ndarray, label: str) -> Curve:
    """Geometric means of values by classes of sizes."""
    number = np.searchsorted(CLASSES, grains, "right")
    present = np.unique(number[values > 0.0])
    chosen: Sequence[np.ndarray] = [(number == k) & (values > 0.0) for k in present]
    x = np.array([np.exp(np.log(grains[each]).mean()) for each in chosen])
    return Curve(label, x, np.array([np.exp(np.log(values[each]).mean()) for each in chosen]))
