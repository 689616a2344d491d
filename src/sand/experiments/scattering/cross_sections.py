"""Cross-sections of two magnetic bodies: single flights, σ with its error, maps of the probability to meet.

A flight starts at a stated distance, as a straight line would bring it there, and ends at a hit (surfaces touch) or
when the projectile is as far away again and on its way out.  Errors of a step are prescribed (Dormand & Prince's order
8, 1e-8 of the scales), and everything drawn by chance is a function of (seed, stratum, number).
"""

from __future__ import annotations

import time as wall
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...arguments import checked
from ...errors import BadInput, warn
from ...units import si
from .encounters import Flight
from .flight_driver import BOUND, FAILED, HIT
from .flights import COLUMNS, Trajectory, fly, replay, trajectory
from .problem import flight
from .sampling import CERTAIN, Strata, Task, cut

PIECE, TRIAL, MOST = 0.5, 16, 4096
"""Seconds that a piece of work should take; flights of the first one; most of any."""
END, SPEED, DRIFT = (COLUMNS.index(name) for name in ("end", "speed", "drift"))


@dataclass(frozen=True)
class CrossSection:
    """σ of one set-up; SI.

    Attributes
    ----------
    sigma : float
        area of the impact parameters that lead to a hit [m²]; for a target that moves by chance the rate of
        hits over number density and v∞, ⟨σ(u) u⟩/v∞, u the relative speed. sigma_error: one standard deviation;
        interval: 95 %.
    geometric : float
        π (r1 + r2)² [m²], of outer spheres for aggregates; analytic: Eq. 14 [m²] at the relative speed, with
        Σ|μ| for aggregates, averaged as σ is for a target that moves by chance.
    flights, hits : int
        how many; bound, failed: of them, neither hit nor miss; counted as misses.
    speed : float
        [m/s]; distance: of the start [m]; seed.
    profile : ndarray
        rows (b₋, b₊, flights, hits) of each annulus, (K, 4).
    drift : float
        largest change of a flight's energy over the largest kinetic energy of its relative motion.
    seconds : float
        spent.
    """

    sigma: float
    sigma_error: float
    interval: tuple[float, float]
    geometric: float
    analytic: float
    flights: int
    hits: int
    bound: int
    failed: int
    speed: float
    distance: float
    seed: int
    profile: np.ndarray
    drift: float
    seconds: float

    @property
    def enhancement(self) -> float:
        """σ/π(r1 + r2)², as in Eqs. 5 and 26."""
        return self.sigma / self.geometric

    @property
    def enhancement_error(self) -> float:
        """Of one standard deviation."""
        return self.sigma_error / self.geometric

    @property
    def c(self) -> float:
        """σ over Eq. 14 (Eq. 27); NaN without moments."""
        return self.sigma / self.analytic if self.analytic > 0.0 else float("nan")

    @property
    def c_error(self) -> float:
        """Of one standard deviation."""
        return self.sigma_error / self.analytic if self.analytic > 0.0 else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        own = {name: getattr(self, name) for name in self.__dataclass_fields__}
        more = {name: getattr(self, name) for name in ("enhancement", "enhancement_error", "c", "c_error")}
        return own | more


@checked
def cross_section(
    radius: Any = None,
    material: Any = None,
    moment: Any = 0.0,
    temperature: Any = 0.0,
    speed: Any = None,
    *,
    relative_error: Any = 0.02,
    seed: int = 0,
    executor: Executor | None = None,
    **options: Any,
) -> CrossSection:
    """σ of two magnetic grains: the area of impact parameters that lead to a hit, over all orientations and spins.

    Parameters
    ----------
    radius, material, moment, temperature, speed, options
        see `flight`.
    relative_error : optional
        of σ at which to stop, one standard deviation, 1e-4 … 0.5.
    seed : int, optional
        ≥ 0, of all that is drawn by chance.
    executor : Executor or None, optional
        any `concurrent.futures.Executor`; None: here. The numbers are the same.

    Raises
    ------
    BadInput
        one line for each mistake.
    """
    setup = flight(radius, material, moment, temperature, speed, **options)
    return measure(setup, relative_error=relative_error, seed=seed, executor=executor)


@checked
def measure(
    setup: Flight,
    *,
    relative_error: Any = 0.02,
    seed: int = 0,
    executor: Executor | None = None,
    known: Iterable[Sequence[float]] = (),
    keep: Callable[[np.ndarray], None] | None = None,
    watch: Callable[[int, float, float], None] | None = None,
) -> CrossSection:
    """As `cross_section`, of a `Flight`.

    Parameters
    ----------
    known, keep : optional
        see `run_flights`.
    watch : Callable[[int, float, float], None] or None, optional
        called with the number of flights, σ [m²] and its error after each round.
    """
    goal = si(relative_error, "1", "relative_error", above=0.0)
    if not 1e-4 <= goal <= 0.5:
        raise BadInput(f"relative_error = {relative_error!r} must lie in 1e-4 … 0.5")
    begun = wall.monotonic()
    farthest = setup.distance if setup.sphere else np.inf
    strata = Strata.up_to(setup.scales.widest, farthest)
    before = rows_by_flight(known)
    # a target that moves by chance is met at a rate; one that moves along is at rest in its own frame
    unit = setup.speed if setup.drift_spread > 0.0 else setup.relative_speed
    rows: list[np.ndarray] = []
    while tasks := strata.round(goal, farthest):
        for new in run_flights(setup, tasks, strata.width, seed, executor, before, keep):
            rows.append(new)
            for row in new:
                strata.add(int(row[0]), int(row[1]), float(row[END] == HIT), float(row[SPEED]) / unit)
        if watch is not None:
            watch(sum(len(r) for r in rows), strata.estimate().value, strata.error())
    whole = np.concatenate(rows)
    _warn(strata, whole, farthest)
    return _told(setup, strata, whole, seed, wall.monotonic() - begun)


def _warn(strata: Strata, rows: np.ndarray, farthest: float) -> None:
    """Of a σ that is not what it seems.  Raises BadInput where flights could not be computed."""
    failed = int((rows[:, END] == FAILED).sum())
    if failed > 0.01 * len(rows):
        raise BadInput(f"{failed} of {len(rows)} flights cannot be computed: speed, start or spin are out of all range")
    if failed:
        warn(f"{failed} of {len(rows)} flights could not be computed and count as misses")
    hits, _ = strata.counts()
    if not hits.any():
        warn(f"none of {len(rows)} flights hit: sigma is 0 as far as they can tell")
    if hits[-1] and (len(strata) + 1) * strata.width > farthest * (1 + 1e-9):
        warn("flights hit at all b that begin on the sphere of starts: sigma is cut off there")


def seed_of(seed: int, setup: int) -> int:
    """Of the set-ups of a job: each draws for itself, so that errors at two speeds have nothing to do with each other.

    The seed itself for the first; multiples of 2⁶⁴/golden ratio are far from each other.
    """
    return (seed + setup * 0x9E3779B97F4A7C15) % 2**64


def rows_by_flight(rows: Iterable[Sequence[float]]) -> dict[tuple[int, int], np.ndarray]:
    """Rows of `COLUMNS` by stratum and number."""
    return {(int(row[0]), int(row[1])): np.asarray(row, float) for row in rows}


def run_flights(
    setup: Flight,
    tasks: Sequence[Task],
    width: float,
    seed: int,
    executor: Executor | None = None,
    known: Mapping[tuple[int, int], np.ndarray] | None = None,
    keep: Callable[[np.ndarray], None] | None = None,
) -> Iterator[np.ndarray]:
    """The rows of all flights asked for, in pieces and in any order.

    Parameters
    ----------
    known : Mapping[tuple[int, int], ndarray] or None, optional
        those that were run_flights before, which are not run_flights again.
    keep : Callable[[ndarray], None] or None, optional
        called with the rows of each piece of work as it is done.
    """
    before = known or {}
    ready = [before[key] for t in tasks for key in t.addresses() if key in before]
    if ready:
        yield np.array(ready)
    for new in _pieces(setup, [piece for t in tasks for piece in _gaps(t, before)], width, seed, executor):
        if keep is not None:
            keep(new)
        yield new


def _gaps(task: Task, known: Mapping[tuple[int, int], np.ndarray]) -> list[Task]:
    """What of a task is not known yet."""
    missing = [number for stratum, number in task.addresses() if (stratum, number) not in known]
    breaks = [k for k in range(1, len(missing)) if missing[k] != missing[k - 1] + 1]
    edges = [0, *breaks, len(missing)]
    return [Task(task.stratum, missing[a], missing[b - 1] + 1) for a, b in pairwise(edges) if b > a]


def _pieces(
    setup: Flight, tasks: list[Task], width: float, seed: int, executor: Executor | None
) -> Iterator[np.ndarray]:
    """The rows of all tasks in pieces of about `PIECE` seconds; a first one, run_flights here, tells how long a flight is."""
    size = TRIAL
    while tasks:
        bundle, tasks = cut(tasks, size)
        begun = wall.perf_counter()
        rows = fly(setup, bundle, width, seed)
        size = min(max(int(PIECE * len(rows) / max(wall.perf_counter() - begun, 1e-9)), 1), MOST)
        yield rows
        if executor is not None:
            break
    if executor is None:
        return
    waiting = []
    while tasks:
        bundle, tasks = cut(tasks, size)
        waiting.append(executor.submit(fly, setup, bundle, width, seed))
    try:
        for future in as_completed(waiting):
            yield future.result()
    finally:
        for future in waiting:
            future.cancel()


def _told(setup: Flight, strata: Strata, rows: np.ndarray, seed: int, seconds: float) -> CrossSection:
    found, sure = strata.estimate(), strata.estimate(CERTAIN)
    hits, tries = strata.counts()
    k = np.arange(len(strata))
    low, high = strata.edges(k)
    ends = rows[:, END]
    return CrossSection(
        sigma=found.value,
        sigma_error=strata.error(),
        interval=(sure.low, sure.high),
        geometric=float(np.pi * setup.scales.touch**2),
        analytic=setup.analytic,
        flights=int(tries.sum()),
        hits=int(hits.sum()),
        bound=int((ends == BOUND).sum()),
        failed=int((ends == FAILED).sum()),
        speed=setup.speed,
        distance=setup.distance,
        seed=seed,
        profile=np.column_stack([low, high, tries, hits]),
        drift=float(rows[:, DRIFT].max()),
        seconds=seconds,
    )


__all__ = ["CrossSection", "Trajectory", "cross_section", "flight", "fly", "measure", "replay", "trajectory"]
