"""Collision kernel by classes of sizes, from the encounters of dilute dust."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..basics.constants import BOLTZMANN, MAGNETIC
from .dilute_majorant import mean_power
from .scattering.rigid_flight import contact_energy

CLASSES = (1, 2, 3, 5, 9, 17, 33, 65, 129, 257, 513, 1025)
"""Smallest numbers of grains of the classes: 1, 2, 3–4, 5–8, …"""


class Kernel(NamedTuple):
    """Kernel of pairs of classes; NaN where nothing was drawn."""

    edges: np.ndarray  # (C + 1,) class k has edges[k] … edges[k + 1] − 1 grains
    value: np.ndarray  # (C, C) K [m³/s], symmetric
    error: np.ndarray  # (C, C) its standard error
    hits: np.ndarray  # (C, C) hits from which it follows
    draws: np.ndarray  # (C, C)
    sizes: np.ndarray  # (C,) mean number of grains in the draws of a class

    def rows(self, mass: float, draws: int = 1) -> list[tuple[float, float, float, float]]:
        """Rows (m1, m2, K over 1 m/s, 1 m/s) of all pairs of classes with hits, as `kernel_table.measured` takes them.

        `mass` is that of a grain [kg]; pairs with fewer than `draws` draws, whose K is uncertain, are left out.
        """
        pairs = zip(*np.nonzero(np.triu(self.hits) * (self.draws >= draws)), strict=True)
        return [(mass * self.sizes[i], mass * self.sizes[j], self.value[i, j], 1.0) for i, j in pairs]


def kernel_of(encounters: Sequence[Mapping[str, np.ndarray]], edges: Sequence[int] | None = None) -> Kernel:
    """K = Σ hits/Σ (1/K̂) over draws of pairs of two classes: unbiased, as a pair is drawn at the rate K̂/V.

    Draws with a body and its own copy are left out. Of one population the error is that of the number of hits, K/√hits;
    of several it is that of their mean, from the scatter of the populations.

    Parameters
    ----------
    encounters : sequence of mapping
        Columns of encounters.csv of each population.
    edges : sequence of int or None, optional
        Smallest numbers of grains of the classes, increasing, and the end of the last one.
    """
    bounds = np.array(CLASSES if edges is None else edges, float)
    hits, weight, draws = (np.zeros((len(encounters), len(bounds) - 1, len(bounds) - 1)) for _ in range(3))
    grains, bodies = np.zeros(len(bounds) - 1), np.zeros(len(bounds) - 1)
    for k, each in enumerate(encounters):
        first, second = (np.searchsorted(bounds, each[f"grains{n}"], "right") - 1 for n in (1, 2))
        inside = (np.minimum(first, second) >= 0) & (np.maximum(first, second) < len(bounds) - 1)
        inside &= each["body1"] != each["body2"]
        low, high = np.minimum(first, second)[inside], np.maximum(first, second)[inside]
        np.add.at(hits[k], (low, high), each["end"][inside] == 0)
        np.add.at(weight[k], (low, high), 1.0 / each["kernel"][inside])
        np.add.at(draws[k], (low, high), 1.0)
        for number, column in ((first, "grains1"), (second, "grains2")):
            np.add.at(grains, number[inside], each[column][inside])
            np.add.at(bodies, number[inside], 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = hits.sum(axis=0) / weight.sum(axis=0)
        error = value / np.sqrt(hits.sum(axis=0))
        if len(encounters) > 1:
            apart = (hits - value * weight).std(axis=0, ddof=1) * math.sqrt(len(encounters))
            error = np.maximum(apart / weight.sum(axis=0), error)
    total = value, error, hits.sum(axis=0), draws.sum(axis=0)
    both = [np.triu(each) + np.triu(each, 1).T for each in total]
    return Kernel(bounds.astype(int), both[0], both[1], both[2], both[3], grains / np.maximum(bodies, 1.0))


class CaptureSums(NamedTuple):
    """Hits, and those expected of Eq. 14, by classes of the larger body; c = hits/expected."""

    sizes: np.ndarray  # (C,) mean number of grains of the larger body, 0 without draws
    hits: np.ndarray  # (C,)
    expected: np.ndarray  # (C,)


def capture_sums(encounters: Mapping[str, np.ndarray], temperature: float, mass: float) -> CaptureSums:
    """Hits, and Σ ⟨π b_max² v⟩/K̂ over draws: the ratio is c = K/⟨π b_max² v⟩ with the actual net moments (Eq. 14).

    Both sums are unbiased, as a pair is drawn at the rate K̂/V. Draws of bodies without a moment are left out.

    Parameters
    ----------
    encounters : mapping
        Columns of encounters.csv.
    temperature, mass : float
        T [K], and the mass of a grain [kg].
    """
    columns = ("grains1", "grains2", "moment1", "moment2", "kernel", "end")
    magnetic = (encounters["moment1"] > 0.0) & (encounters["moment2"] > 0.0)
    grains1, grains2, moment1, moment2, kernel, end = (encounters[name][magnetic] for name in columns)
    reduced = mass * grains1 * grains2 / (grains1 + grains2)
    alpha = contact_energy(moment1, moment2, 1.0, MAGNETIC)
    spread = np.sqrt(BOLTZMANN * temperature / reduced)
    law = math.pi * 3.0 * np.cbrt(alpha / reduced) ** 2 * mean_power(-1.0 / 3.0, spread)
    larger = np.maximum(grains1, grains2)
    number, count = np.searchsorted(CLASSES, larger, "right") - 1, len(CLASSES)
    sizes = np.bincount(number, larger, count) / np.maximum(np.bincount(number, minlength=count), 1)
    return CaptureSums(sizes, np.bincount(number, end == 0, count), np.bincount(number, law / kernel, count))
