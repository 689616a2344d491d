"""What `sand collide` does with a case: collide, keep what is finished, put outcomes and figure into the folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from ..config.commands import command_for
from ..errors import BadInput
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
from .collision import run_to_end
from .collision_case import CollisionCase, read_collision, run_seeds, with_absolute_paths


def description_in(folder: Path) -> Path | None:
    """The case of the collisions in a folder, as `sand collide` left it there; None if it did not."""
    one, many = folder / ONE_COLLISION, folder / CASE
    if one.exists():
        return one
    return many if many.exists() and command_for(read_toml(many)) == "collide" else None


class CollisionJob:
    """The collisions of one case, in a folder.

    Parameters
    ----------
    path : str or Path
        of the case file.
    folder : Path or None, optional
        where the files go; by default as the case says, or by its name.
    seeds : list[int] or None, optional
        instead of those in the case.
    resume : bool, optional
        go on with what lies there.
    overwrite : bool, optional
        replace what lies there.

    Raises
    ------
    BadInput
        every mistake of the case, or a folder that is in use.
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
        self.content = with_absolute_paths(read_toml(path))
        if seeds is not None:
            self.case.impact.seeds = seeds
        self.content["impact"]["seeds"] = self.case.impact.seeds

    def run(self, executor: Executor | None = None, observers: Sequence[Any] = ()) -> dict[str, Any]:
        """All collisions that are not finished yet; returns what collision.json holds.

        Parameters
        ----------
        executor : Executor or None, optional
            for many seeds; by default they are computed here, one after the other.
        observers : Sequence[Any], optional
            of simulations in this process.

        Raises
        ------
        BadInput
            what only shows when bodies, forces and materials come together, or while they collide.
        Interrupted
            Ctrl-C; a job with `resume` goes on.
        """
        seeds = self.case.impact.seeds
        results = [self._one(seeds[0], observers)] if len(seeds) == 1 else self._many(seeds, executor, observers)
        counts = Counter(result["outcome"] for result in results)
        content = {
            "case": str(self.path),
            "folder": str(self.folder),
            "collisions": results,
            "counts": dict(counts),
        }
        write_json(self.folder / COLLISION, content)
        (self.folder / OUTCOMES).unlink(missing_ok=True)  # all of them are in collision.json
        return content

    def _one(self, seed: int, observers: Sequence[Any]) -> dict[str, Any]:
        """With all the files that a run leaves."""
        start, case = self._blamed(lambda: self.case.approach(seed)), self.case
        if self.resume and any(self.folder.glob("checkpoint-*.npz")):
            simulation = case.resume_collision(start, self.folder, observers=list(observers))
        else:  # without a checkpoint there is nothing to lose
            options = {"out": self.folder, "overwrite": self.overwrite or self.resume, "observers": list(observers)}
            simulation = self._blamed(lambda: case.prepare(start, **options))
            self._describe(ONE_COLLISION)
        return run_to_end(start, simulation).to_dict()

    def _many(self, seeds: list[int], executor: Executor | None, observers: Sequence[Any]) -> list[dict[str, Any]]:
        """Their outcomes alone, and a figure of all."""
        from ..plotting.collisions import collision_figure
        from ..plotting.run_figure import save

        self._blamed(self.case.check)
        if not self.resume:
            make_folder(self.folder, overwrite=self.overwrite)
            self._describe(CASE)
        with writing(self.folder):
            kept = GrowingOutcomes(self.folder / OUTCOMES, self.content, resume=self.resume)
            results = run_seeds(self.content, seeds, executor, kept.found, kept.add, observers)
            save(collision_figure(results), self.folder / FIGURE)
        return results

    def _describe(self, name: str) -> None:
        write_toml(self.folder / name, self.content, "sand collide: what was asked for; sand resume reads it")

    def _blamed(self, make: Any) -> Any:
        """`make()`; what is wrong there is wrong with the case file."""
        try:
            return make()
        except BadInput as error:
            raise error.at(str(self.path)) from None
