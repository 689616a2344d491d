"""Stratified sampling of the impact parameter with adaptive allocation of flights.

Strata are annuli of equal width in b. Flight `number` of stratum `k` has fixed random numbers, so that results do not
depend on how the work is distributed, on the order of completion, or on interruptions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

STRATA = 24
"""Initial number of annuli."""
HEADROOM = 1.2
"""Initial range of impact parameters, in units of the largest one captured by a central potential."""
EMPTY = 4
"""Number of outermost annuli that must be without hits; otherwise annuli are added."""
PILOT = 48
"""Initial number of flights in each annulus."""
STEP_UP = 3.0
"""Largest ratio of the flights of a round to those of all earlier rounds, on which its allocation is based."""
ONE_SIGMA, CERTAIN = 1.0, 1.96
"""Normal deviates of a standard error and of a 95 % interval."""


class Task(NamedTuple):
    """Flights to compute: first ≤ number < last of one stratum."""

    stratum: int
    first: int
    last: int

    def addresses(self) -> Iterator[tuple[int, int]]:
        """(stratum, number) of each flight."""
        return ((self.stratum, number) for number in range(self.first, self.last))


class Estimate(NamedTuple):
    """Sum over strata with its bounds."""

    value: float
    low: float
    high: float


def wilson(hits: np.ndarray, tries: np.ndarray, z: float) -> tuple[np.ndarray, np.ndarray]:
    """Wilson score interval of a probability (Wilson 1927); (0, 1) without trials.

    Parameters
    ----------
    hits, tries : ndarray
        Numbers of hits and trials.
    z : float
        Normal deviate.

    Returns
    -------
    low, high : ndarray
        Bounds of the probability.
    """
    n = np.maximum(tries, 1)
    p = hits / n
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    low, high = np.maximum(middle - half, 0.0), np.minimum(middle + half, 1.0)
    return np.where(tries > 0, np.where(hits > 0, low, 0.0), 0.0), np.where(
        tries > 0, np.where(hits < tries, high, 1.0), 1.0
    )


class Strata:
    """Results of the flights of each annulus.

    Parameters
    ----------
    widest : float
        Largest impact parameter captured by a central potential [m].
    farthest : float, optional
        Limit of the impact parameter [m], the radius of a starting sphere.

    Attributes
    ----------
    width : float
        Width of an annulus [m].
    """

    def __init__(self, widest: float, farthest: float = math.inf):
        self.width, self.farthest = min(HEADROOM * widest, farthest) / STRATA, farthest
        self._count = STRATA
        self._flights = np.zeros((0, 4))  # stratum, number, hit and weight, in the order of strata and numbers

    def __len__(self) -> int:
        return self._count

    def edges(self, stratum: int | np.ndarray) -> tuple[float | np.ndarray, float | np.ndarray]:
        """Smallest and largest b of a stratum [m]."""
        return stratum * self.width, (stratum + 1) * self.width

    def area(self) -> np.ndarray:
        """Areas π (b₊² − b₋²) (K,) [m²]."""
        k = np.arange(len(self))
        return math.pi * self.width**2 * (2 * k + 1.0)

    def add(self, stratum: np.ndarray, number: np.ndarray, hit: np.ndarray, weight: np.ndarray) -> None:
        """Add results of flights (K,): hit (1 or 0), and weight."""
        both = np.vstack([self._flights, np.column_stack([stratum, number, hit, weight])])
        # sorted, so that sums have equal bits in any order of completion
        self._flights = both[np.lexsort((both[:, 1], both[:, 0]))]
        self._count = max(self._count, int(self._flights[-1, 0]) + 1)

    def counts(self) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of hits and of flights (K,) of the annuli."""
        stratum = self._flights[:, 0].astype(int)
        return np.bincount(stratum, self._flights[:, 2], len(self)), np.bincount(stratum, minlength=len(self))

    def weights(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and variance (K,) of the weights of hits; 1 and 0 without hits."""
        mean, spread = np.ones(len(self)), np.zeros(len(self))
        hits = self._flights[self._flights[:, 2] > 0.0]
        for k in np.unique(hits[:, 0]).astype(int):
            found = hits[hits[:, 0] == k, 3]
            mean[k], spread[k] = found.mean(), found.var()
        return mean, spread

    def estimate(self, z: float = ONE_SIGMA) -> Estimate:
        """Estimate σ = Σ A ⟨w hit⟩ [m²], with Wilson bounds combined in quadrature (Donner & Zou 2012)."""
        hits, tries = self.counts()
        mean, spread = self.weights()
        area = self.area()
        p = hits / np.maximum(tries, 1)
        low, high = wilson(hits, tries, z)
        scatter = z * z * p * spread / np.maximum(tries, 1)
        value = float((area * mean * p).sum())
        down = math.sqrt(float((area**2 * ((mean * (p - low)) ** 2 + scatter)).sum()))
        up = math.sqrt(float((area**2 * ((mean * (high - p)) ** 2 + scatter)).sum()))
        return Estimate(value, value - down, value + up)

    def error(self) -> float:
        """Half the width of the one-standard-deviation interval [m²]."""
        found = self.estimate()
        return 0.5 * (found.high - found.low)

    def round(self, relative_error: float) -> list[Task]:
        """Flights of the next round; an empty list if σ is accurate enough.

        First, `PILOT` flights in each annulus, with further annuli as long as the outermost ones have hits. Then
        flights are allocated by n ∝ A √(p(1 − p)) (Neyman 1934), with p from neighbouring annuli.
        """
        hits, tries = self.counts()
        pilot = [Task(k, int(n), PILOT) for k, n in enumerate(tries) if n < PILOT]
        if pilot:
            return pilot
        possible = self.farthest / self.width - len(self) + 1e-9
        if hits[-EMPTY:].any() and possible >= 1.0:
            further = int(min(max(len(self) // 4, 1), possible))
            return [Task(len(self) + k, 0, PILOT) for k in range(further)]
        found = self.estimate()
        goal = relative_error * found.value
        if self.error() <= goal or found.value == 0.0:
            return []
        p = (neighbour_sums(hits) + 0.5) / (neighbour_sums(tries) + 1.0)
        mean, spread = self.weights()
        worth = self.area() * np.sqrt(mean**2 * p * (1 - p) + p * spread)
        wanted = worth * worth.sum() / goal**2
        # rounded up to at least one flight in each annulus that needs more
        more = np.maximum(np.ceil(wanted) - tries, 0.0)
        budget = STEP_UP * tries.sum()
        if more.sum() > budget:
            more = np.ceil(more * budget / more.sum())
        if not more.any():
            more = np.ceil(0.2 * tries * (worth > 0.0))
        return [Task(k, int(n), int(n + m)) for k, (n, m) in enumerate(zip(tries, more, strict=True)) if m > 0]


def neighbour_sums(counts: np.ndarray) -> np.ndarray:
    """Sums over two annuli on either side, without the annulus itself.

    Allocation by an annulus' own hits would be biased: an annulus with few hits by chance would get too few flights.
    """
    padded = np.pad(np.asarray(counts, float), 2)
    return sum(padded[2 + k : 2 + k + len(counts)] for k in (-2, -1, 1, 2))  # type: ignore[return-value]


def cut(tasks: list[Task], most: int) -> tuple[list[Task], list[Task]]:
    """Split tasks into the first `most` flights and the rest."""
    head: list[Task] = []
    for k, task in enumerate(tasks):
        size = task.last - task.first
        if size > most:
            middle = task.first + most
            split = [task._replace(last=middle)] if most else []
            return head + split, [task._replace(first=middle), *tasks[k + 1 :]]
        head.append(task)
        most -= size
    return head, []
