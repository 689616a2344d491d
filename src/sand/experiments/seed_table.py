"""A result of a campaign against one parameter, for each seed: means, intervals and where it falls below a level."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..analysis.fits import falls_below, jackknife

OUTSIDE = "outside the range of the campaign"
"""Text of an estimate that is NaN."""


class Interval(NamedTuple):
    """An estimate and its 95 % interval, NaN where it has none."""

    value: float
    low: float = math.nan
    high: float = math.nan

    def text(self, unit: str = "") -> str:
        """The estimate and its interval, such as "48 (44 … 52) m/s"."""
        if not math.isfinite(self.value):
            return OUTSIDE
        limits = f"{self.low:.3g} … {self.high:.3g}" if math.isfinite(self.low) else "no interval"
        return f"{self.value:.3g} ({limits}) {unit}".rstrip()

    def verdict(self, paper: float, reason: str, within: float = 0.0) -> str:
        """Text "agrees" if the interval or the value has a paper's value, "within …" near it; or why not."""
        low, high = (self.low, self.high) if math.isfinite(self.low) else (self.value, self.value)
        if low - within <= paper <= high + within:
            near = "" if low <= paper <= high else f" within {within:g}"
            near += " of the interval" * (bool(near) and math.isfinite(self.low))
            return "not decided: the interval is too wide" if high - low > abs(paper) + 2 * within else "agrees" + near
        if not math.isfinite(self.value):
            return reason
        return f"{self.value - paper:+.2g}{f' ({self.value / paper - 1.0:+.0%})' if paper else ''}: {reason}"


def mean_of(values: Sequence[float]) -> Interval:
    """Mean of the values of independent seeds, with its 95 % interval of Student's distribution; NaN if one is NaN."""
    one = np.array(values, float)
    without = (one.sum() - one) / max(len(one) - 1, 1)
    return Interval(float(one.mean()), *jackknife(float(one.mean()), without)[1:])


class SeedTable(NamedTuple):
    """Values against x > 0 for each seed, NaN where runs are missing."""

    x: np.ndarray  # (V,), increasing
    of_seeds: np.ndarray  # (S, V)

    @property
    def mean(self) -> np.ndarray:
        """Mean over the seeds that have a value, (V,)."""
        known = np.isfinite(self.of_seeds)
        total, count = np.where(known, self.of_seeds, 0.0).sum(axis=0), known.sum(axis=0)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    @property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest value of the seeds, (V,) each."""
        if not self.of_seeds.size:
            return self.mean, self.mean
        return np.fmin.reduce(self.of_seeds, axis=0), np.fmax.reduce(self.of_seeds, axis=0)

    def falls_below(self, level: float) -> Interval:
        """x at which the mean falls below a level, with the interval of a jackknife of ln x over the seeds."""
        found = falls_below(self.x, self.mean, level)
        fewer = [self._replace(of_seeds=np.delete(self.of_seeds, k, axis=0)) for k in range(len(self.of_seeds))]
        without = [falls_below(self.x, one.mean, level) for one in fewer]
        return Interval(found, *np.exp(jackknife(math.log(found), np.log(without))[1:]).tolist())


def seed_table(values: Mapping[tuple[Any, float], float]) -> SeedTable:
    """Table of values by seed and x."""
    seeds, x = (sorted({key[k] for key in values}) for k in range(2))
    of_seeds = np.full((len(seeds), len(x)), np.nan)
    for (seed, place), value in values.items():
        of_seeds[seeds.index(seed), x.index(place)] = value
    return SeedTable(np.array(x), of_seeds)
