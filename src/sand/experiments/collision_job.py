"""Job of `sand collide`: simulates collisions, saves each outcome, and writes results and figure to the folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any

from ..basics.errors import BadInput
from ..compiler.progress import announce
from ..io.checkpoint_files import checkpoint_files
from ..io.run_folder import COLLISION, FIGURE, ONE_COLLISION, OUTCOMES, write_json
from .collision import prepare, resume_collision, run_to_end
from .collision_case import read_collision, run_seed
from .collision_outcome import collision_title
from .job import Job, Progress, ignored


class CollisionJob(Job):
    """Collisions of one case: of many seeds, each with its outcome, or of a single one with all files of a run.

    Parameters
    ----------
    path : str or Path
        Case file.
    folder : str or Path or None, optional
        Output folder; by default that of the case, or the name of the case file.
    seeds : list of int or None, optional
        Replaces the seeds of the case.
    **how
        As for `Job`.

    Raises
    ------
    BadInput
        All errors of the case.
    """

    COMMAND, RESULTS, KEPT, PARTS = "collide", COLLISION, OUTCOMES, "collisions"

    def __init__(self, path: str | Path, folder: str | Path | None = None, seeds: list[int] | None = None, **how: bool):
        self.case = read_collision(path)
        super().__init__(path, folder or self.case.impact.out, **how)
        self.content["impact"]["seeds"] = self.case.impact.seeds = seeds or self.case.impact.seeds

    @property
    def is_single(self) -> bool:
        """Whether the job is a single simulation."""
        return len(self.case.impact.seeds) == 1

    def tasks(self) -> list[int]:
        """The seeds."""
        return self.case.impact.seeds

    def work(self) -> Callable[..., dict[str, Any]]:
        """Simulate the collision of a seed."""
        return partial(run_seed, self.content)

    def run(
        self, executor: Executor | None = None, observers: Sequence[Any] = (), progress: Progress = ignored
    ) -> dict[str, Any]:
        """Simulate all collisions that are not finished, see `Job.run`."""
        if not self.is_single:
            self._with_case_name(self.case.check)
            return super().run(executor, observers, progress)
        content = self._content([self._one(self.case.impact.seeds[0], list(observers))])
        write_json(self.folder / COLLISION, content)
        return content

    def _one(self, seed: int, observers: list[Any]) -> dict[str, Any]:
        """Simulate a single collision with all files of a run."""
        start, physics = self._with_case_name(lambda: self.case.approach(seed)), self.case.physics()
        if self.resume and checkpoint_files(self.folder):
            simulation = resume_collision(start, self.folder, *physics, observers=observers)
        else:  # without a checkpoint there is nothing to resume
            replace = self.overwrite or self.resume
            simulation = self._with_case_name(
                lambda: prepare(
                    start, *physics, self.case.ending(), out=self.folder, overwrite=replace, observers=observers
                )
            )
            self.describe(ONE_COLLISION)
        return run_to_end(start, simulation, self.case.ending()).to_dict()

    def results(self, outcomes: list[dict[str, Any]]) -> dict[str, Any]:
        """All outcomes and how often each occurred; draws a figure."""
        from ..plotting.collisions import collision_figure
        from ..plotting.run_figure import save

        announce("drawing the figure")
        title = collision_title(outcomes, self.case.approach(self.case.impact.seeds[0]).bodies())
        save(collision_figure(outcomes, title), self.folder / FIGURE)
        return self._content(outcomes)

    def _content(self, outcomes: list[dict[str, Any]]) -> dict[str, Any]:
        counts = Counter(outcome["outcome"] for outcome in outcomes)
        return {"case": str(self.path), "folder": str(self.folder), "collisions": outcomes, "counts": dict(counts)}

    def _with_case_name(self, make: Callable[[], Any]) -> Any:
        """Call `make()`; its errors are reported as errors of the case file."""
        try:
            return make()
        except BadInput as error:
            raise error.at(str(self.path)) from None
