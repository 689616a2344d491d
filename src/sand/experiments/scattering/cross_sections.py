"""Capture cross-sections of two magnetic bodies by Monte Carlo sampling of the impact parameter.

A flight starts at a given distance on a straight line, without earlier deflection. It ends at a hit (the surfaces
touch) or when the bodies recede beyond the starting distance. Steps have a prescribed error (Dormand & Prince, order 8,
1e-8 of the scales). All random numbers are functions of (seed, stratum, number).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from time import monotonic, perf_counter
from typing import Any

import numpy as np

from ...basics.arguments import checked
from ...basics.errors import BadInput, warn
from ...basics.units import si
from ..executors import results_of
from .encounters import Flight
from .flight_driver import BOUND, FLIGHT_FAILED, HIT
from .flights import COLUMNS, Trajectory, count_inaccurate, fly, inaccurate_text, replay, trajectory
from .problem import flight
from .sampling import CERTAIN, Strata, Task, cut

PIECE, TRIAL, MOST = 0.5, 16, 4096
"""Target duration of a batch [s]; flights of the first batch; largest number of flights of a batch."""
END, SPEED, DRIFT = (COLUMNS.index(name) for name in ("end", "speed", "drift"))


@dataclass(frozen=True)
class CrossSection:
    """Capture cross-section of one set-up; SI.

    Attributes
    ----------
    sigma : float
        Area of the impact parameters that lead to a hit [m²]. For a target with random velocity: ⟨σ(u) u⟩/v∞, u the
        relative speed, which is the rate of hits over number density and v∞.
    sigma_error : float
        Standard error [m²].
    interval : tuple of float
        95 % confidence interval [m²].
    geometric : float
        π (r1 + r2)² [m²], of bounding spheres for aggregates.
    analytic : float
        Eq. 14 of Dominik & Nübold (2002) [m²] at the relative speed, with Σ|μ| for aggregates; averaged like `sigma`
        for a target with random velocity.
    flights, hits : int
        Their numbers.
    bound, failed : int
        Flights that ended as neither hit nor miss; they count as misses.
    speed, distance : float
        Speed of the projectile [m/s] and distance of the start [m].
    seed : int
        Seed of the random numbers.
    profile : ndarray
        Rows (b₋, b₊, flights, hits) of each annulus, (K, 4).
    drift : float
        Largest energy error of a flight over the largest kinetic energy of its relative motion.
    seconds : float
        Wall time of the computation.
    inaccurate : int
        Number of flights with a drift above 1e-6; they count as the others do, with a warning.
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
    inaccurate: int = 0

    @property
    def enhancement(self) -> float:
        """Enhancement over the geometric cross-section, σ/π(r1 + r2)², as in Eqs. 5 and 26."""
        return self.sigma / self.geometric

    @property
    def enhancement_error(self) -> float:
        """Standard error of `enhancement`."""
        return self.sigma_error / self.geometric

    @property
    def c(self) -> float:
        """Coefficient c = σ over Eq. 14 (Eq. 27); NaN without moments."""
        return self.sigma / self.analytic if self.analytic > 0.0 else float("nan")

    @property
    def c_error(self) -> float:
        """Standard error of `c`."""
        return self.sigma_error / self.analytic if self.analytic > 0.0 else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """All attributes and derived values, for JSON."""
        derived = ("enhancement", "enhancement_error", "c", "c_error")
        return vars(self) | {name: getattr(self, name) for name in derived}


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
    """Capture cross-section σ of two magnetic grains, averaged over orientations and spins.

    Parameters
    ----------
    radius, material, moment, temperature, speed, **options
        See `flight`.
    relative_error : float, optional
        Standard error of σ, relative to σ, at which sampling stops, 1e-4 … 0.5.
    seed : int, optional
        Seed of the random numbers, ≥ 0.
    executor : Executor, optional
        Any `concurrent.futures.Executor`; None computes in this process. Results do not depend on it.

    Returns
    -------
    CrossSection
        σ with its error.

    Raises
    ------
    BadInput
        If arguments are invalid; one line for each.
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
    progress: Callable[[int, float, float], None] | None = None,
) -> CrossSection:
    """Capture cross-section of a `Flight`, see `cross_section`.

    Parameters
    ----------
    setup : Flight
        Bodies and initial conditions, from `flight`.
    relative_error, seed, executor
        As for `cross_section`.
    known, keep : optional
        See `run_flights`.
    progress : callable, optional
        Called with the number of flights, σ [m²] and its error after each round.
    """
    goal = si(relative_error, "1", "relative_error", above=0.0)
    if not 1e-4 <= goal <= 0.5:
        raise BadInput(f"relative_error = {relative_error!r} must lie in 1e-4 … 0.5")
    start = monotonic()
    strata = Strata(setup.scales.widest, setup.distance if setup.sphere else np.inf)
    before = rows_by_flight(known)
    # with a random target velocity σ is a rate over v∞; with a fixed one it is measured in the frame of the target
    unit = setup.speed if setup.drift_spread > 0.0 else setup.relative_speed
    rows: list[np.ndarray] = []
    while tasks := strata.round(goal):
        for new in run_flights(setup, tasks, strata.width, seed, executor, before, keep):
            rows.append(new)
            strata.add(new[:, 0], new[:, 1], new[:, END] == HIT, new[:, SPEED] / unit)
        if progress is not None:
            progress(sum(len(r) for r in rows), strata.estimate().value, strata.error())
    whole = np.concatenate(rows)
    _warn(strata, whole)
    return _result(setup, strata, whole, seed, monotonic() - start)


def _warn(strata: Strata, rows: np.ndarray) -> None:
    """Warn if σ is unreliable. Raises BadInput if more than 1 % of the flights failed."""
    failed = int((rows[:, END] == FLIGHT_FAILED).sum())
    if failed > 0.01 * len(rows):
        raise BadInput(f"{failed} of {len(rows)} flights cannot be computed: speed, start or spin is extreme")
    if text := inaccurate_text(count_inaccurate(rows), len(rows), float(rows[:, DRIFT].max())):
        warn(text)
    if failed:
        warn(f"{failed} of {len(rows)} flights could not be computed and count as misses")
    hits, _ = strata.counts()
    if not hits.any():
        warn(f"none of {len(rows)} flights hit: sigma is 0 within the error")
    if hits[-1] and (len(strata) + 1) * strata.width > strata.farthest * (1 + 1e-9):
        warn("flights hit at all impact parameters up to the radius of the start: sigma is truncated there")


def seed_of(seed: int, setup: int) -> int:
    """Seed of one set-up of a job, so that the errors of different set-ups are independent.

    The first set-up uses the seed itself; the others add multiples of 2⁶⁴ over the golden ratio.
    """
    return (seed + setup * 0x9E3779B97F4A7C15) % 2**64


def rows_by_flight(rows: Iterable[Sequence[float]]) -> dict[tuple[int, int], np.ndarray]:
    """Rows of `COLUMNS` by (stratum, number)."""
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
    """Compute all flights of the tasks; yields their rows in batches of arbitrary order.

    Parameters
    ----------
    setup : Flight
        Bodies and initial conditions.
    tasks : sequence of Task
        Flights to compute.
    width : float
        Width of an annulus [m].
    seed : int
        Seed of the random numbers.
    executor : Executor, optional
        Any `concurrent.futures.Executor`; None computes in this process.
    known : mapping, optional
        Rows of earlier flights by (stratum, number), which are not computed again.
    keep : callable, optional
        Called with the rows of each new batch.
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
    """Flights of a task that are not known yet."""
    missing = [number for stratum, number in task.addresses() if (stratum, number) not in known]
    breaks = [k for k in range(1, len(missing)) if missing[k] != missing[k - 1] + 1]
    edges = [0, *breaks, len(missing)]
    return [Task(task.stratum, missing[a], missing[b - 1] + 1) for a, b in pairwise(edges) if b > a]


def _pieces(
    setup: Flight, tasks: list[Task], width: float, seed: int, executor: Executor | None
) -> Iterator[np.ndarray]:
    """Rows of all tasks in batches of about `PIECE` seconds; the first batch, computed here, measures the speed."""
    size = TRIAL
    while tasks:
        bundle, tasks = cut(tasks, size)
        start = perf_counter()
        rows = fly(setup, bundle, width, seed)
        size = min(max(int(PIECE * len(rows) / max(perf_counter() - start, 1e-9)), 1), MOST)
        yield rows
        if executor is not None:
            break
    if executor is not None:
        bundles = []
        while tasks:
            bundle, tasks = cut(tasks, size)
            bundles.append(bundle)
        work = partial(fly, setup, width=width, seed=seed)
        yield from (rows for _, rows in results_of(executor, work, bundles))


def _result(setup: Flight, strata: Strata, rows: np.ndarray, seed: int, seconds: float) -> CrossSection:
    found, sure = strata.estimate(), strata.estimate(CERTAIN)
    hits, tries = strata.counts()
    low, high = strata.edges(np.arange(len(strata)))
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
        failed=int((ends == FLIGHT_FAILED).sum()),
        speed=setup.speed,
        distance=setup.distance,
        seed=seed,
        profile=np.column_stack([low, high, tries, hits]),
        drift=float(rows[:, DRIFT].max()),
        seconds=seconds,
        inaccurate=count_inaccurate(rows),
    )


__all__ = ["CrossSection", "Trajectory", "cross_section", "flight", "fly", "measure", "replay", "trajectory"]
