"""Job of `sand collide`: simulates collisions, saves each outcome, and writes results and figure to the folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any

from ..basics.errors import naming
from ..compiler.progress import announce
from ..io.checkpoint_files import checkpoint_files
from ..io.run_folder import COLLISION, FIGURE, ONE_COLLISION, OUTCOMES, write_json
from .collision import prepare, resume_collision, run_to_end
from .collision_case import CollisionCase, read_collision, run_seed
from .collision_outcome import collision_title
from .job import JobOfSeeds, Progress, ignored


class CollisionJob(JobOfSeeds):
    """Collisions of one case: of many seeds, each with its outcome, or of a single one with all files of a run.

    See `JobOfSeeds` for its parameters.
    """

    COMMAND, RESULTS, KEPT, PARTS = "collide", COLLISION, OUTCOMES, "collisions"
    case: CollisionCase

    def read(self, path: str | Path) -> tuple[CollisionCase, str]:
        """The case, and the name of its table with the seeds."""
        return read_collision(path), "impact"

    @property
    def is_single(self) -> bool:
        """Whether the job is a single simulation."""
        return len(self.seeds) == 1

    def work(self) -> Callable[..., dict[str, Any]]:
        """Simulate the collision of a seed."""
        return partial(run_seed, self.content)

    def run(
        self, executor: Executor | None = None, observers: Sequence[Any] = (), progress: Progress = ignored
    ) -> dict[str, Any]:
        """Simulate all collisions that are not finished, see `Job.run`."""
        if not self.is_single:
            with naming(self.path):
                self.case.check()
            return super().run(executor, observers, progress)
        content = self._content([self._one(self.seeds[0], list(observers))])
        write_json(self.folder / COLLISION, content)
        return content

    def _one(self, seed: int, observers: list[Any]) -> dict[str, Any]:
        """Simulate a single collision with all files of a run."""
        with naming(self.path):
            start, physics = self.case.approach(seed), self.case.physics()
        if self.resume and checkpoint_files(self.folder):
            simulation = resume_collision(start, self.folder, *physics, observers=observers)
        else:  # without a checkpoint there is nothing to resume
            replace = self.overwrite or self.resume
            with naming(self.path):
                simulation = prepare(
                    start, *physics, self.case.ending(), out=self.folder, overwrite=replace, observers=observers
                )
            self.describe(ONE_COLLISION)
        return run_to_end(start, simulation, self.case.ending()).to_dict()

    def results(self, outcomes: list[dict[str, Any]]) -> dict[str, Any]:
        """All outcomes and how often each occurred; draws a figure."""
        from ..plotting.collisions import collision_figure
        from ..plotting.run_figure import save

        announce("drawing the figure")
        title = collision_title(outcomes, self.case.approach(self.seeds[0]).bodies())
        save(collision_figure(outcomes, title), self.folder / FIGURE)
        return self._content(outcomes)

    def _content(self, outcomes: list[dict[str, Any]]) -> dict[str, Any]:
        counts = Counter(outcome["outcome"] for outcome in outcomes)
        return {"case": str(self.path), "folder": str(self.folder), "collisions": outcomes, "counts": dict(counts)}
