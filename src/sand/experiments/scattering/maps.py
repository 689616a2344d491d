"""Map of the hit probability over speed and impact parameter (Dominik & Nübold 2002, Figure 3)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...basics.arguments import checked
from ...basics.errors import BadInput, shown, warn
from .cross_sections import rows_by_flight, run_flights, seed_of
from .encounters import Flight
from .flight_driver import HIT
from .flights import COLUMNS, count_inaccurate, inaccurate_text
from .sampling import HEADROOM, Task, wilson

END, STRATUM, DRIFT = (COLUMNS.index(name) for name in ("end", "stratum", "drift"))


@dataclass(frozen=True)
class ProbabilityMap:
    """Hit probability P(hit | b, v); SI.

    Attributes
    ----------
    speeds : ndarray
        (V,) [m/s].
    edges : ndarray
        Edges of the cells in b, (V, B + 1) [m].
    hits, flights : ndarray
        Numbers (V, B).
    capture : ndarray
        b_max of each speed (V,) [m] (Eqs. 12, 13).
    geometric : float
        r1 + r2 [m].
    drift : float
        Largest energy error of a flight over the largest kinetic energy of its relative motion.
    inaccurate : int
        Number of flights with a drift above 1e-6; they count as the others do, with a warning.
    """

    speeds: np.ndarray
    edges: np.ndarray
    hits: np.ndarray
    flights: np.ndarray
    capture: np.ndarray
    geometric: float
    drift: float = 0.0
    inaccurate: int = 0

    @property
    def probability(self) -> np.ndarray:
        """Fraction of hits (V, B)."""
        return self.hits / np.maximum(self.flights, 1)

    def interval(self, z: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Wilson bounds (V, B) for `z` standard deviations."""
        return wilson(self.hits, self.flights, z)

    def to_rows(self) -> list[dict[str, float]]:
        """One row for each cell."""
        low, high = self.interval()
        return [
            {
                "speed": float(self.speeds[v]),
                "b_from": float(self.edges[v, k]),
                "b_to": float(self.edges[v, k + 1]),
                "flights": int(self.flights[v, k]),
                "hits": int(self.hits[v, k]),
                "probability": float(self.probability[v, k]),
                "low": float(low[v, k]),
                "high": float(high[v, k]),
                "b_max": float(self.capture[v]),
            }
            for v in range(self.speeds.size)
            for k in range(self.edges.shape[1] - 1)
        ]


@checked
def probability_map(
    flights: Sequence[Flight],
    *,
    cells: int = 24,
    per_cell: int = 64,
    seed: int = 0,
    executor: Executor | None = None,
    known: Mapping[int, Iterable[Sequence[float]]] | None = None,
    keep: Callable[[int, np.ndarray], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> ProbabilityMap:
    """Compute `per_cell` flights in each cell of speed and impact parameter; b² is uniform within a cell.

    Parameters
    ----------
    flights : sequence of Flight
        One set-up for each speed.
    cells : int, optional
        Number of cells in b for each speed, up to 1.2 times the largest b captured by a central potential.
    per_cell : int, optional
        Flights in each cell.
    seed : int, optional
        Seed of the first set-up; the others use `seed_of`.
    executor : Executor, optional
        Any `concurrent.futures.Executor`; None computes in this process.
    known, keep : optional
        As for `scattering.run_flights`, with the index of the set-up.
    progress : callable, optional
        Called with the numbers of flights done and of all flights.

    Raises
    ------
    BadInput
        If there is no set-up, or a number of cells or flights is below 1.
    """
    flights = list(flights)
    if wrong := [one for one in flights if not isinstance(one, Flight)]:
        raise BadInput(f"flights: {shown(wrong[0])} is no set-up; make each with sand.experiments.scattering.flight(…)")
    if not flights or cells < 1 or per_cell < 1:
        raise BadInput(f"a map needs speeds, and cells = {cells} and per_cell = {per_cell} of at least 1")
    most = [min(HEADROOM * one.scales.widest, one.distance if one.sphere else np.inf) for one in flights]
    hits, done = np.zeros((len(flights), cells)), np.zeros((len(flights), cells))
    tasks = [Task(k, 0, per_cell) for k in range(cells)]
    drift, inaccurate = 0.0, 0
    for v, one in enumerate(flights):
        before = rows_by_flight((known or {}).get(v, ()))
        keep_rows = None if keep is None else partial(keep, v)
        for rows in run_flights(one, tasks, most[v] / cells, seed_of(seed, v), executor, before, keep_rows):
            cell = rows[:, STRATUM].astype(int)
            np.add.at(hits[v], cell, rows[:, END] == HIT)
            np.add.at(done[v], cell, 1)
            drift, inaccurate = max(drift, float(rows[:, DRIFT].max())), inaccurate + count_inaccurate(rows)
            if progress is not None:
                progress(int(done.sum()), done.size * per_cell)
    if text := inaccurate_text(inaccurate, int(done.sum()), drift):
        warn(text)
    return ProbabilityMap(
        np.array([one.speed for one in flights]),
        np.linspace(0.0, np.array(most), cells + 1, axis=1),
        hits,
        done,
        np.array([one.scales.capture for one in flights]),
        flights[0].scales.touch,
        drift,
        inaccurate,
    )
