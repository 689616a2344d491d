"""Job of `sand elastic`: moduli and sound of one packing for each seed, with a table and a figure of all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any

from ..basics.errors import naming
from ..compiler.progress import announce
from ..io.run_folder import FIGURE, LABORATORY, LOADED, RESULTS_CSV
from ..io.table import write_table
from ..simulation.observers import Observer
from .elastic import measure
from .job import JobOfSeeds, Progress, ignored
from .laboratory_case import ElasticCase, model_of, read_laboratory


class ElasticJob(JobOfSeeds):
    """Packings at rest, one for each seed; see `JobOfSeeds` for the parameters."""

    COMMAND, RESULTS, KEPT, PARTS = "elastic", LABORATORY, LOADED, "packings"
    case: ElasticCase

    def read(self, path: str | Path) -> tuple[ElasticCase, str]:
        """The case, and the name of its table with the seeds."""
        return read_laboratory(path, self.COMMAND), self.COMMAND

    def work(self) -> Callable[..., dict[str, Any]]:
        """Measure the packing of a seed."""
        return partial(measure_seed, self.content)

    def run(
        self, executor: Executor | None = None, observers: Sequence[Any] = (), progress: Progress = ignored
    ) -> dict[str, Any]:
        """As `Job.run`; the first packing is set up before, to find errors."""
        with naming(self.path):
            self.case.first_plan()
        return super().run(executor, [*observers, Shown(self.seeds, progress)], progress)

    def line(self, outcome: dict[str, Any]) -> str:
        """Seed, filling factor and moduli."""
        k, g = outcome["bulk"], outcome["shear"]
        return f"  seed {outcome['seed']}: filling factor {outcome['filling']:.3g}, K {k:.3g} Pa, G {g:.3g} Pa"

    def results(self, outcomes: list[dict[str, Any]]) -> dict[str, Any]:
        """All outcomes; writes the table of all strains, and draws the figure."""
        from ..plotting.run_figure import save
        from .elastic_figure import elastic_figure

        rows = [row for one in outcomes for row in rows_of(one)]
        write_table(self.folder / RESULTS_CSV, rows)
        announce("drawing the figure")
        save(elastic_figure(outcomes), self.folder / FIGURE)
        return {"case": str(self.path), "folder": str(self.folder), "loading": self.COMMAND, "runs": outcomes}


class Shown(Observer):
    """Shows what is measured in this process."""

    def __init__(self, seeds: Sequence[int], progress: Progress):
        self._seeds, self._progress = list(seeds), progress

    def tell(self, seed: int, text: str, part: float) -> None:
        """Show what is done, and which part of it."""
        self._progress(f"seed {seed}: {text}", (self._seeds.index(seed) + part) / len(self._seeds))


def rows_of(outcome: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of the table of a packing, one for each strain, with what is the same in all."""
    shared = {name: value for name, value in outcome.items() if not isinstance(value, (list, dict))}
    columns = outcome["table"]
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    return [shared | row for row in rows]


def measure_seed(content: dict[str, Any], seed: int, observers: Sequence[Any] = ()) -> dict[str, Any]:
    """Measure the packing of a seed; runs in worker processes."""
    return {"seed": seed, **measured(model_of(content).model_validate(content), seed, observers)}


def measured(case: ElasticCase, seed: int, observers: Sequence[Any] = ()) -> dict[str, Any]:
    """Results of the packing of a seed."""
    shown = [one for one in observers if isinstance(one, Shown)]
    how: dict[str, Any] = {"progress": partial(shown[0].tell, seed)} if shown else {}
    body, settings = case.packing(seed), case.section.settings()
    return measure(
        body, settings, forces=case.physics(), stepping=case.stepping, seed=seed, observers=observers, **how
    ).to_dict()
