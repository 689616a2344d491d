"""Job of `sand compress`, `sand stretch` and `sand shear`: one run for each seed, with a table and a figure of all."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any

from ..basics.errors import BadInput, naming
from ..basics.units import format_quantity
from ..compiler.progress import announce
from ..config.build import resume
from ..io.checkpoint_files import checkpoint_files
from ..io.run_folder import FIGURE, LABORATORY, LOADED, RESULTS_CSV
from ..io.table import write_table
from ..simulation.observers import Observer
from ..simulation.serialise import changed_tables
from .job import JobOfSeeds, Progress, ignored
from .laboratory import Plan, run_to_end, simulation_of, slow_from
from .laboratory_case import OF_COMMAND, LaboratoryCase, model_of, read_laboratory


class LaboratoryJob(JobOfSeeds):
    """Packings that are loaded, one for each seed, each in its own folder seed-N with all files of a run.

    Parameters are those of `JobOfSeeds`, with the command "compress", "stretch" or "shear".
    """

    COMMAND, RESULTS, KEPT, PARTS = "", LABORATORY, LOADED, "runs"
    case: LaboratoryCase

    def read(self, path: str | Path) -> tuple[LaboratoryCase, str]:
        """The case, and the name of its table with the seeds."""
        return read_laboratory(path, self.COMMAND), OF_COMMAND[self.COMMAND]

    def work(self) -> Callable[..., dict[str, Any]]:
        """Run the packing of a seed."""
        return partial(run_seed, self.content, str(self.folder.absolute()), self.resume)

    def run(
        self, executor: Executor | None = None, observers: Sequence[Any] = (), progress: Progress = ignored
    ) -> dict[str, Any]:
        """As `Job.run`; the first packing is set up before, to find errors, and tells of its rate."""
        with naming(self.path):
            planned = self.case.first_plan()
            simulation_of(planned, self.case.physics(), stepping=self.case.stepping)
        slow_from(planned)
        return super().run(executor, [*observers, Shown(self.seeds, progress)], progress)

    def line(self, outcome: dict[str, Any]) -> str:
        """Seed, filling factor, strain and stress at the end."""
        return f"  {said(outcome['seed'], outcome)}"

    def results(self, outcomes: list[dict[str, Any]]) -> dict[str, Any]:
        """All outcomes; writes the table of all rows, and draws the figure."""
        from ..plotting.run_figure import save
        from .laboratory_figure import laboratory_figure

        write_table(self.folder / RESULTS_CSV, [row for one in outcomes for row in rows_of(one)])
        announce("drawing the figure")
        save(laboratory_figure(outcomes), self.folder / FIGURE)
        return {"case": str(self.path), "folder": str(self.folder), "loading": self.COMMAND, "runs": outcomes}


def rows_of(outcome: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of the table of a run, with its seed."""
    columns = outcome["table"]
    return [
        {"seed": outcome["seed"], **dict(zip(columns, row, strict=True))} for row in zip(*columns.values(), strict=True)
    ]


def said(seed: int, row: dict[str, Any]) -> str:
    """A row in words."""
    text = f"seed {seed}: filling factor {row['filling']:.3g}, strain {row['strain']:.3g}"
    if math.isnan(row["stress"]):
        return text
    rounded = float(f"{row['stress']:.3g}")
    return f"{text}, stress {format_quantity(rounded, 'Pa')}"


class Shown(Observer):
    """Shows filling factor, strain and stress of the runs of this process."""

    plan: Plan  # of the present run

    def __init__(self, seeds: Sequence[int], progress: Progress):
        self._seeds, self._progress = list(seeds), progress

    def see(self, simulation: Any, row: dict[str, float]) -> None:
        """Show a new row."""
        rows = simulation.ledger.rows
        found = self.plan.row(rows[-2] if len(rows) > 1 else None, row)
        done = (self._seeds.index(simulation.seed) + min(row["time"] / self.plan.until, 1.0)) / len(self._seeds)
        self._progress(said(simulation.seed, found), done)


def run_seed(
    content: dict[str, Any], folder: str, resumed: bool, seed: int, observers: Sequence[Any] = ()
) -> dict[str, Any]:
    """Run, or continue, the packing of a seed in the folder seed-N of a job; runs in worker processes."""
    case = model_of(content).model_validate(content)
    return {"seed": seed, **loaded(case, seed, Path(folder) / f"seed-{seed}", observers, resumed=resumed)}


def loaded(
    case: LaboratoryCase, seed: int, place: Path | None, observers: Sequence[Any] = (), *, resumed: bool
) -> dict[str, Any]:
    """Run the packing of a seed; `resumed`: from the last checkpoint in the folder `place`, if there is one.

    Raises
    ------
    BadInput
        If the folder holds a run of another case, or the run stopped for physical reasons.
    """
    planned, forces, own = case.plan(seed), case.physics(), list(observers)
    given: dict[str, Any] = {"stepping": case.stepping, "seed": seed}
    for shown in (one for one in own if isinstance(one, Shown)):
        shown.plan = planned
    if resumed and place is not None and checkpoint_files(place):
        simulation = resume(place, observers=own)
        if changed := changed_tables(simulation_of(planned, forces, **given), simulation):
            raise BadInput(
                f"{place} contains a run with different [{changed[0]}]; give another folder, or the same case"
            )
    else:  # a run killed at its very start leaves a folder without a checkpoint
        simulation = simulation_of(planned, forces, out=place, overwrite=True, observers=own, **given)
    return run_to_end(planned, simulation).to_dict()
