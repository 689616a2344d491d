"""Job of `sand scatter`: computes flights, saves each batch, and writes results and figure to the folder."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...io.run_folder import FIGURE, FLIGHTS, RESULTS_CSV, SCATTERING
from ...io.table import GrowingTable, write_table
from ...plotting.run_figure import save
from ...simulation.run_writer import versions
from ..job import Job, Progress
from .cross_sections import measure, seed_of
from .encounters import Flight
from .flights import COLUMNS, LARGEST_DRIFT, Trajectory, trajectory
from .maps import probability_map
from .scatter_case import read_scattering

Measured = tuple[list[dict[str, Any]], Any, dict[str, Any]]
"""Rows of results.csv, the figure, and the content of scattering.json."""
POINTS = 1001
"""Number of rows of a trajectory in results.csv, equally spaced in time."""


class ScatterJob(Job):
    """One case of `sand scatter`; its flights are kept as rows of flights.csv, as which are next follows from them.

    Parameters
    ----------
    path, folder, **how
        As for `Job`; the folder is by default that of the case.

    Raises
    ------
    BadInput
        All errors of the case.
    """

    COMMAND, RESULTS = "scatter", SCATTERING

    def __init__(self, path: str | Path, folder: str | Path | None = None, **how: bool):
        self.case, self.flights = read_scattering(path)
        super().__init__(path, folder or self.case.measure.out, **how)
        self.before: dict[int, list[list[float]]] = {}
        self.table: GrowingTable | None = None

    def compute(self, executor: Executor | None, observers: Sequence[Any], progress: Progress) -> dict[str, Any]:
        """Compute all flights, tables and the figure; returns the content of scattering.json."""
        settings = self.case.measure
        if settings.job != "trajectories":
            self.table = GrowingTable(self.folder / FLIGHTS, ("setup", *COLUMNS), resume=self.resume)
            for row in self.table.rows:
                self.before.setdefault(int(row[0]), []).append(row[1:])
        measure_all = {"cross-section": self._cross_sections, "map": self._map, "trajectories": self._trajectories}
        rows, figure, results = measure_all[settings.job](executor, progress)
        write_table(self.folder / RESULTS_CSV, rows)
        save(figure, self.folder / FIGURE)
        if self.table is not None:
            self.table.sort()
        return {"job": settings.job, "seed": settings.seed, "versions": versions(), **results}

    def _keep(self, setup: int, rows: np.ndarray) -> None:
        assert self.table is not None
        self.table.add([setup, *row] for row in rows.tolist())

    def _cross_sections(self, executor: Executor | None, progress: Progress) -> Measured:
        from ...plotting.scattering import sigma_figure

        def show(setup: int, flights: int, sigma: float, error: float) -> None:
            speed = self.flights[setup].speed
            text = f"{speed:.4g} m/s: {flights} flights, sigma = {sigma:.4g} +- {error:.1g} m^2"
            progress(text, setup / len(self.flights))

        found = [
            measure(
                one,
                relative_error=self.case.measure.relative_error,
                seed=seed_of(self.case.measure.seed, k),
                executor=executor,
                known=self.before.get(k, ()),
                keep=partial(self._keep, k),
                progress=partial(show, k),
            )
            for k, one in enumerate(self.flights)
        ]
        rows = [one.to_dict() for one in found]
        flat = [{k: v for k, v in row.items() if k not in ("profile", "interval", "seconds")} for row in rows]
        return flat, sigma_figure(found, _title(self.flights)), {"cross_sections": rows}

    def _map(self, executor: Executor | None, progress: Progress) -> Measured:
        from ...plotting.scattering import map_figure

        settings = self.case.measure
        found = probability_map(
            self.flights,
            cells=settings.cells,
            per_cell=settings.per_cell,
            seed=settings.seed,
            executor=executor,
            known=self.before,
            keep=self._keep,
            progress=lambda n, total: progress(f"{n} of {total} flights", n / total),
        )
        rows = found.to_rows()
        content = {"r1_plus_r2": found.geometric, "drift": found.drift, "inaccurate": found.inaccurate}
        return rows, map_figure(found, _title(self.flights)), {"cells": rows, **content}

    def _trajectories(self, executor: Executor | None, progress: Progress) -> Measured:
        from ...plotting.scattering import trajectories_figure

        groups: list[list[Trajectory]] = []
        for k, one in enumerate(self.flights):
            groups.append([])
            for n, b in enumerate(self.case.impact_parameters(one)):
                groups[-1].append(trajectory(one, b, seed=self.case.measure.seed, stratum=k, number=n))
                progress(f"flight {n + 1} of set-up {k + 1}", k / len(self.flights))
        rows = [row for k, group in enumerate(groups) for row in _path_rows(k, group)]
        names = [str(spin) for spin in self.case.measure.spins or [self.case.flight.spin]]
        figure = trajectories_figure(groups, names, self.flights[0].scales, _title(self.flights))
        kept = ("end", "impact_parameter", "speed", "closest", "exchanged", "drift")
        results = [
            {"setup": k, **{name: getattr(one, name) for name in kept}}
            for k, group in enumerate(groups)
            for one in group
        ]
        drifts = [one["drift"] for one in results]
        inaccurate, unit = sum(drift > LARGEST_DRIFT for drift in drifts), self.flights[0].scales.capture
        return rows, figure, {"trajectories": results, "b_max": unit, "drift": max(drifts), "inaccurate": inaccurate}


def _path_rows(setup: int, group: list[Trajectory]) -> list[dict[str, Any]]:
    """Time and positions of both bodies, `POINTS` rows for each flight."""
    names = ["time", *(f"{body}_{axis}" for body in ("projectile", "target") for axis in "xyz")]
    rows: list[dict[str, Any]] = []
    for n, one in enumerate(group):
        times = np.linspace(0.0, one.time[-1], POINTS)
        table = np.column_stack([times, *one.at(times)]).tolist()
        rows += [{"setup": setup, "flight": n, **dict(zip(names, values, strict=True))} for values in table]
    return rows


def _title(flights: list[Flight]) -> str:
    """Description of bodies and start in one line."""
    one = flights[0]
    from ...plotting.style import format_si

    def body(grains: Any) -> str:
        names = ", ".join(m.name for m in grains.materials)
        radius = format_si(float(grains.radius.mean()), "m")
        return f"{names}, r = {radius}" if len(grains) == 1 else f"{len(grains)} grains of {names}, r = {radius}"

    parts = [body(one.projectile)]
    if body(one.target) != parts[0]:
        parts.append(body(one.target))
    heat = f", {format_si(one.temperature, 'K')}" if one.temperature > 0.0 else ""
    shape = "sphere" if one.sphere else "plane"
    far = [format_si(f(each.distance for each in flights), "m") for f in (min, max)]
    return f"{' on '.join(parts)}{heat}; starts on a {shape}, {' to '.join(dict.fromkeys(far))}"
