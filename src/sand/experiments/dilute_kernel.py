"""Collision kernel by classes of sizes, from the encounters of dilute dust."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..basics.constants import BOLTZMANN, MAGNETIC
from .dilute_majorant import mean_power
from .scattering.rigid_flight import contact_energy

CANCELLED = 1e-9
"""Net moment of a body, in units of the largest of its population, below which its moments cancel to rounding."""
CLASSES = (1, 2, 3, 5, 9, 17, 33, 65, 129, 257, 513, 1025)
"""Smallest numbers of grains of the classes: 1, 2, 3–4, 5–8, …"""


class Kernel(NamedTuple):
    """Kernel of pairs of classes; NaN where nothing was drawn."""

    edges: np.ndarray  # (C + 1,) class k has edges[k] … edges[k + 1] − 1 grains
    value: np.ndarray  # (C, C) K [m³/s], symmetric
    error: np.ndarray  # (C, C) its standard error
    hits: np.ndarray  # (C, C) hits from which it follows
    draws: np.ndarray  # (C, C)
    # of bodies of a class, means over the pairs that K is the mean of; 0 if none was drawn
    sizes: np.ndarray  # (C,) number of grains
    masses: np.ndarray  # (C,) mass [kg]

    def rows(self, draws: int = 1) -> list[tuple[float, float, float, float]]:
        """Rows (m1, m2, K over 1 m/s, 1 m/s) of all pairs of classes with hits, as `kernel_table.measured` takes them.

        Pairs with fewer than `draws` draws, whose K is uncertain, are left out.
        """
        pairs = zip(*np.nonzero(np.triu(self.hits) * (self.draws >= draws)), strict=True)
        return [(self.masses[i], self.masses[j], self.value[i, j], 1.0) for i, j in pairs]


def kernel_of(encounters: Sequence[Mapping[str, np.ndarray]], edges: Sequence[int] | None = None) -> Kernel:
    """K = Σ hits/Σ (1/K̂) over draws of pairs of two classes, which converges to K: a pair is drawn at the rate K̂/V.

    In a time t each pair adds Kt/V to the mean of the first sum, and t/V to that of the second one, so that the ratio
    is K, averaged over the pairs that were there; a finite number of draws gives a bias of the order 1/draws. Sizes and
    masses of a class are means over the same pairs, Σ (N/K̂)/Σ (1/K̂). Draws of a body and its own copy are left out.

    The error of one population is `ratio_error`; of several it is at least this, and otherwise that from the
    scatter of the populations. It is NaN without hits.

    Parameters
    ----------
    encounters : sequence of mapping
        Columns of encounters.csv of each population.
    edges : sequence of int or None, optional
        Smallest numbers of grains of the classes, increasing, and the end of the last one.
    """
    bounds = np.array(CLASSES if edges is None else edges, float)
    count, sums = len(bounds) - 1, []
    bodies = np.zeros((3, count))  # Σ N/K̂, m/K̂, 1/K̂
    for each in encounters:
        first, second = (np.searchsorted(bounds, each[f"grains{n}"], "right") - 1 for n in (1, 2))
        inside = (np.minimum(first, second) >= 0) & (np.maximum(first, second) < count)
        inside &= each["body1"] != each["body2"]
        weight, pair = 1.0 / each["kernel"][inside], np.minimum(first, second) * count + np.maximum(first, second)
        sums.append(_hit_sums(pair[inside], each["end"][inside] == 0, weight, count**2))
        for n, number in ((1, first[inside]), (2, second[inside])):
            columns = each[f"grains{n}"][inside], each[f"mass{n}"][inside], 1.0
            bodies += [np.bincount(number, column * weight, count) for column in columns]
    draws, hits, weights, _, _ = total = np.sum(sums, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        value, error = hits / weights, ratio_error(total)
        if len(encounters) > 1:
            apart = np.std([each[1] - value * each[2] for each in sums], axis=0, ddof=1)
            error = np.maximum(error, apart * math.sqrt(len(encounters)) / weights)
        means = np.where(bodies[2] > 0.0, bodies[:2] / bodies[2], 0.0)
    both = (np.triu(one) + np.triu(one, 1).T for one in np.reshape((value, error, hits, draws), (4, count, count)))
    return Kernel(bounds.astype(int), *both, *means)


def _hit_sums(number: np.ndarray, is_hit: np.ndarray, weight: np.ndarray, count: int) -> np.ndarray:
    """Σ 1, h, w, hw and w² of draws by their class, (5, count); h is 1 for a hit, or 0."""
    terms = np.ones_like(weight), is_hit, weight, is_hit * weight, weight**2
    return np.array([np.bincount(number, each, count) for each in terms])


def ratio_error(sums: np.ndarray) -> np.ndarray:
    """Standard error of K = Σh/Σw, from the sums (5, …) of 1, h, w, hw and w² over draws; h is 1 for a hit, or 0.

    Draws of a pair are a Poisson process, so that Σ (h − Kw) has the variance of the mean of Σ (h − Kw)². If the pairs
    have the same K, a draw hits with the probability Kw, and this is Σh − K² Σw²: binomial, less than Poisson's Σh. If
    their K differ the sum of squares, which is used, holds, too. It is small by chance if no draw misses: Σh then.
    The weight w is 1/K̂, or that times a law of K. NaN without hits.
    """
    draws, hits, weights, both, squares = sums
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = hits / weights
        variance = np.where(hits < draws, hits - 2.0 * ratio * both + ratio**2 * squares, hits)
        return np.where(hits > 0.0, np.sqrt(np.maximum(variance, 0.0)) / weights, math.nan)


class CaptureSums(NamedTuple):
    """Hits, and those expected of Eq. 14, by classes of the larger body; c = hits/expected."""

    sizes: np.ndarray  # (C,) mean number of grains of the larger body of the expected hits, 0 without draws
    hits: np.ndarray  # (C,)
    expected: np.ndarray  # (C,)
    error: np.ndarray  # (C,) standard error of c of this population, NaN without hits


def capture_sums(encounters: Mapping[str, np.ndarray], temperature: float) -> CaptureSums:
    """Hits, and Σ ⟨π b_max² v⟩/K̂ over draws: the ratio is c = K/⟨π b_max² v⟩ with the actual net moments (Eq. 14).

    It converges to c, as a pair is drawn at the rate K̂/V: a mean of c over pairs with the weight ⟨π b_max² v⟩, and the
    size of a class is the mean of N with this weight. Draws of a body and its own copy are left out, and those of
    bodies without a net moment, which Eq. 14 does not describe.

    Parameters
    ----------
    encounters : mapping
        Columns of encounters.csv.
    temperature : float
        T [K].
    """
    columns = ("grains1", "grains2", "mass1", "mass2", "moment1", "moment2", "kernel", "end")
    net = np.minimum(encounters["moment1"], encounters["moment2"])
    largest = max(encounters["moment1"].max(initial=0.0), encounters["moment2"].max(initial=0.0))
    chosen = (net > CANCELLED * largest) & (encounters["body1"] != encounters["body2"])
    grains1, grains2, mass1, mass2, moment1, moment2, kernel, end = (encounters[name][chosen] for name in columns)
    reduced = mass1 * mass2 / (mass1 + mass2)
    alpha = contact_energy(moment1, moment2, 1.0, MAGNETIC)
    spread = np.sqrt(BOLTZMANN * temperature / reduced)
    law = math.pi * 3.0 * np.cbrt(alpha / reduced) ** 2 * mean_power(-1.0 / 3.0, spread)
    larger = np.maximum(grains1, grains2)
    number, count = np.searchsorted(CLASSES, larger, "right") - 1, len(CLASSES)
    weight = law / kernel
    sums = _hit_sums(number, end == 0, weight, count)
    sizes = np.bincount(number, larger * weight, count) / np.where(sums[2] > 0.0, sums[2], 1.0)
    return CaptureSums(sizes, sums[1], sums[2], ratio_error(sums))
