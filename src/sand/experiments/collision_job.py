"""Job of `sand collide`: simulates collisions, saves each outcome, and writes results and figure to the folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from ..compiler.progress import announce
from ..config.case import with_absolute_files
from ..errors import BadInput
from ..io.checkpoint_files import checkpoint_files
from ..io.lock import writing
from ..io.run_folder import (
    CASE,
    COLLISION,
    FIGURE,
    ONE_COLLISION,
    OUTCOMES,
    make_folder,
    read_toml,
    write_json,
    write_toml,
)
from ..io.table import GrowingOutcomes
from .collision import prepare, resume_collision, run_to_end
from .collision_case import CollisionCase, read_collision, run_seeds
from .collision_outcome import collision_title


class CollisionJob:
    """Collisions of one case, in a folder.

    Parameters
    ----------
    path : str or Path
        Case file.
    folder : Path or None, optional
        Output folder; by default that of the case, or the name of the case file.
    seeds : list of int or None, optional
        Replaces the seeds of the case.
    resume : bool, optional
        Resume the job in the folder.
    overwrite : bool, optional
        Replace earlier files.

    Raises
    ------
    BadInput
        All errors of the case.
    """

    def __init__(
        self,
        path: str | Path,
        folder: Path | None = None,
        seeds: list[int] | None = None,
        *,
        resume: bool = False,
        overwrite: bool = False,
    ):
        self.path, self.resume, self.overwrite = path, resume, overwrite
        self.case: CollisionCase = read_collision(path)
        self.folder = folder or Path(self.case.impact.out or Path(path).stem)
        self.content = with_absolute_files(read_toml(path), path)
        if seeds is not None:
            self.case.impact.seeds = seeds
        self.content["impact"]["seeds"] = self.case.impact.seeds

    def run(
        self,
        executor: Executor | None = None,
        observers: Sequence[Any] = (),
        progress: Callable[[int, int], None] | None = None,
    ) -> dict[str, Any]:
        """Simulate all collisions that are not finished; returns the content of collision.json.

        Parameters
        ----------
        executor : Executor or None, optional
            Executor for several seeds; None computes in this process.
        observers : sequence, optional
            Observers of the simulations in this process.
        progress : callable, optional
            Called with the numbers of finished and of all collisions, if there are several.

        Raises
        ------
        BadInput
            If bodies, forces and materials do not fit together, or a simulation stopped for physical reasons.
        Interrupted
            By Ctrl-C; a job with `resume` resumes.
        """
        seeds = self.case.impact.seeds
        if len(seeds) == 1:
            results = [self._one(seeds[0], observers)]
        else:
            results = self._many(seeds, executor, observers, progress or (lambda done, total: None))
        counts = Counter(result["outcome"] for result in results)
        content = {"case": str(self.path), "folder": str(self.folder), "collisions": results, "counts": dict(counts)}
        write_json(self.folder / COLLISION, content)
        (self.folder / OUTCOMES).unlink(missing_ok=True)  # its content is in collision.json
        return content

    def _one(self, seed: int, observers: Sequence[Any]) -> dict[str, Any]:
        """Simulate a single collision with all files of a run."""
        start, case, own = self._with_case_name(lambda: self.case.approach(seed)), self.case, list(observers)
        if self.resume and checkpoint_files(self.folder):
            simulation = resume_collision(start, self.folder, *case.physics(), observers=own)
        else:  # without a checkpoint there is nothing to resume
            replace = self.overwrite or self.resume
            simulation = self._with_case_name(
                lambda: prepare(start, *case.physics(), out=self.folder, overwrite=replace, observers=own)
            )
            self._describe(ONE_COLLISION)
        return run_to_end(start, simulation).to_dict()

    def _many(
        self,
        seeds: list[int],
        executor: Executor | None,
        observers: Sequence[Any],
        progress: Callable[[int, int], None],
    ) -> list[dict[str, Any]]:
        """Compute the outcomes of several seeds, and a figure of all."""
        from ..plotting.collisions import collision_figure
        from ..plotting.run_figure import save

        self._with_case_name(self.case.check)
        if not self.resume:
            make_folder(self.folder, overwrite=self.overwrite)
            self._describe(CASE)
        with writing(self.folder):
            kept = GrowingOutcomes(self.folder / OUTCOMES, self.content, resume=self.resume)
            done = len(kept.found.keys() & set(seeds))

            def keep(seed: int, outcome: dict[str, Any]) -> None:
                nonlocal done
                kept.add(seed, outcome)
                done += 1
                progress(done, len(set(seeds)))

            progress(done, len(set(seeds)))
            results = run_seeds(self.content, seeds, executor, kept.found, keep, observers)
            announce("drawing the figure")
            title = collision_title(results, self.case.approach(seeds[0]).bodies())
            save(collision_figure(results, title), self.folder / FIGURE)
        return results

    def _describe(self, name: str) -> None:
        write_toml(self.folder / name, self.content, "settings of sand collide, read by sand resume")

    def _with_case_name(self, make: Any) -> Any:
        """Call `make()`; its errors are reported as errors of the case file."""
        try:
            return make()
        except BadInput as error:
            raise error.at(str(self.path)) from None
