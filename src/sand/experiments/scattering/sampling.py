"""Stratified sampling of the impact parameter: which flights are needed for a cross-section, and what they tell.

Strata are annuli of equal width in b.  Flight `number` of stratum `k` is the same whoever asks for it, so results do
not depend on how the work was split, on the order in which it came back, nor on interruptions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

STRATA = 24
"""Annuli up to the first guess of where no hit is possible."""
HEADROOM = 1.2
"""First guess over the widest impact parameter of a central potential."""
EMPTY = 4
"""Outermost annuli that must be without a hit; otherwise more are added."""
PILOT = 48
"""Flights in each annulus to begin with."""
STEP_UP = 3.0
"""A round has at most so many times the flights of all rounds before, because its plan is only as good as they."""
ONE_SIGMA, CERTAIN = 1.0, 1.96
"""Normal deviates of an error bar and of an interval of 95 %."""


class Task(NamedTuple):
    """Flights to be flown: first ≤ number < last of one stratum."""

    stratum: int
    first: int
    last: int

    def addresses(self) -> Iterator[tuple[int, int]]:
        """Stratum and number of each."""
        return ((self.stratum, number) for number in range(self.first, self.last))


class Estimate(NamedTuple):
    """A sum over strata with its bounds."""

    value: float
    low: float
    high: float


def wilson(hits: np.ndarray, tries: np.ndarray, z: float) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of a probability from so many hits in so many tries (Wilson 1927); 0 and 1 without a try."""
    n = np.maximum(tries, 1)
    p = hits / n
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    low, high = np.maximum(middle - half, 0.0), np.minimum(middle + half, 1.0)
    return np.where(tries > 0, np.where(hits > 0, low, 0.0), 0.0), np.where(
        tries > 0, np.where(hits < tries, high, 1.0), 1.0
    )


class Strata:
    """What is known of each annulus.

    Parameters
    ----------
    width : float
        of an annulus [m].
    count : int
        how many annuli.
    """

    def __init__(self, width: float, count: int):
        self.width = width
        self.flown: list[dict[int, tuple[float, float]]] = [{} for _ in range(count)]

    @classmethod
    def up_to(cls, widest: float, farthest: float = math.inf) -> Strata:
        """The first guess; b may not go beyond `farthest` [m], where a sphere of starts ends."""
        return cls(min(HEADROOM * widest, farthest) / STRATA, STRATA)

    def __len__(self) -> int:
        return len(self.flown)

    def edges(self, stratum: int | np.ndarray) -> tuple[float | np.ndarray, float | np.ndarray]:
        """Least and largest b [m]."""
        return stratum * self.width, (stratum + 1) * self.width

    def area(self) -> np.ndarray:
        """π (b₊² − b₋²) (K,) [m²]."""
        k = np.arange(len(self))
        return math.pi * self.width**2 * (2 * k + 1.0)

    def add(self, stratum: int, number: int, hit: float, weight: float) -> None:
        """One flight: 1 or 0, and what it counts for."""
        while stratum >= len(self):
            self.flown.append({})
        self.flown[stratum][number] = (hit, weight)

    def counts(self) -> tuple[np.ndarray, np.ndarray]:
        """Hits and flights (K,) of the annuli."""
        hits = np.array([sum(hit for hit, _ in values_in_order(one)) for one in self.flown])
        return hits, np.array([len(one) for one in self.flown])

    def weights(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and variance (K,) of what hits count for; 1 and 0 where none is known."""
        mean, spread = np.ones(len(self)), np.zeros(len(self))
        for k, one in enumerate(self.flown):
            found = np.array([weight for hit, weight in values_in_order(one) if hit > 0.0])
            if found.size:
                mean[k], spread[k] = found.mean(), found.var()
        return mean, spread

    def estimate(self, z: float = ONE_SIGMA) -> Estimate:
        """σ = Σ A ⟨w hit⟩ [m²]; bounds from Wilson's, added in squares (Donner & Zou 2012)."""
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
        """Half the width of one standard deviation to both sides [m²]."""
        found = self.estimate()
        return 0.5 * (found.high - found.low)

    def round(self, relative_error: float, farthest: float = math.inf) -> list[Task]:
        """The flights that are to come next; none if σ is known well enough.

        First so many in each annulus, and more annuli as long as the outermost have hits; then where they help most,
        n ∝ A √(p(1 − p)) (Neyman 1934), with p from the neighbours.
        """
        hits, tries = self.counts()
        pilot = [Task(k, int(n), PILOT) for k, n in enumerate(tries) if n < PILOT]
        if pilot:
            return pilot
        room = farthest / self.width - len(self) + 1e-9
        if hits[-EMPTY:].any() and room >= 1.0:
            further = int(min(max(len(self) // 4, 1), room))
            return [Task(len(self) + k, 0, PILOT) for k in range(further)]
        found = self.estimate()
        goal = relative_error * found.value
        if self.error() <= goal or found.value == 0.0:
            return []
        p = (neighbour_sums(hits) + 0.5) / (neighbour_sums(tries) + 1.0)
        mean, spread = self.weights()
        worth = self.area() * np.sqrt(mean**2 * p * (1 - p) + p * spread)
        wanted = worth * worth.sum() / goal**2
        # rounding up leaves at least one in each annulus that is not settled
        more = np.maximum(np.ceil(wanted) - tries, 0.0)
        budget = STEP_UP * tries.sum()
        if more.sum() > budget:
            more = np.ceil(more * budget / more.sum())
        if not more.any():
            more = np.ceil(0.2 * tries * (worth > 0.0))
        return [Task(k, int(n), int(n + m)) for k, (n, m) in enumerate(zip(tries, more, strict=True)) if m > 0]


def neighbour_sums(counts: np.ndarray) -> np.ndarray:
    """Sums over the two annuli to either side, without the annulus itself.

    Were an annulus given flights by its own hits, one that had too few by chance would get too few to find out.
    """
    padded = np.pad(np.asarray(counts, float), 2)
    return sum(padded[2 + k : 2 + k + len(counts)] for k in (-2, -1, 1, 2))  # type: ignore[return-value]


def values_in_order(flights: dict[int, tuple[float, float]]) -> Iterator[tuple[float, float]]:
    """In the order of their numbers, so that sums are the same bits however they came."""
    return (flights[number] for number in sorted(flights))


def cut(tasks: list[Task], most: int) -> tuple[list[Task], list[Task]]:
    """The first `most` flights, and all others, in their order."""
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
