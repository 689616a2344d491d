"""A job: work in many parts on one case, in a folder that keeps the parts that are finished."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from ..basics.errors import BadInput
from ..basics.version import __version__
from ..config.case import with_absolute_files
from ..config.commands import command_for
from ..io.lock import writing
from ..io.run_folder import CASE, make_folder, read_toml, write_json, write_toml
from ..io.table import GrowingOutcomes
from .executors import results_of

Progress = Callable[..., None]
"""Called with a line of progress, the fraction that is done, and optionally a line that stays."""


def ignored(text: str, part: float, line: str = "") -> None:
    """Show no progress."""


class Job:
    """Base class of the jobs of the command line.

    A subclass names its files, lists its tasks, computes one of them, and makes the results and the figure of all; or,
    where tasks follow from the results of earlier ones, or keep files of their own, it replaces `compute`.

    Parameters
    ----------
    path : str or Path
        Case file.
    folder : str or Path or None, optional
        Output folder, by default the name of the case file.
    resume : bool, optional
        Whether to continue the job in the folder.
    overwrite : bool, optional
        Whether files of an earlier job may be replaced.

    Attributes
    ----------
    content : dict
        The case, with absolute paths.
    COMMAND, RESULTS, KEPT, PARTS, AGAIN : str
        Command, results file, file that keeps finished parts until the results are written ("": none), what the
        parts are called in the line of progress, and how to continue after an interruption ("": by `sand resume`).
    """

    COMMAND: ClassVar[str]
    RESULTS: ClassVar[str]
    KEPT: ClassVar[str] = ""
    PARTS: ClassVar[str] = "parts"
    AGAIN: ClassVar[str] = ""

    def __init__(
        self, path: str | Path, folder: str | Path | None = None, *, resume: bool = False, overwrite: bool = False
    ):
        self.path, self.folder = Path(path), Path(folder or Path(path).stem)
        self.content = with_absolute_files(read_toml(path), path)
        self.resume, self.overwrite = resume, overwrite

    @property
    def is_single(self) -> bool:
        """Whether the job is a single simulation, with all files of a run."""
        return False

    def tasks(self) -> Sequence[int]:
        """Numbers of the parts, such as seeds."""
        raise NotImplementedError

    def work(self) -> Callable[..., dict[str, Any]]:
        """A function that worker processes call with one task: returns its outcome, for JSON.

        In this process it is called with `observers`, too.
        """
        raise NotImplementedError

    def line(self, outcome: dict[str, Any]) -> str:
        """A line of progress that stays after a part is finished; none by default."""
        return ""

    def results(self, outcomes: list[dict[str, Any]]) -> dict[str, Any]:
        """The content of the results file, of the outcomes in the order of the tasks; draws the figure."""
        raise NotImplementedError

    def run(
        self, executor: Executor | None = None, observers: Sequence[Any] = (), progress: Progress = ignored
    ) -> dict[str, Any]:
        """Compute all that is not finished; returns the content of the results file.

        Parameters
        ----------
        executor : Executor or None, optional
            Any `concurrent.futures.Executor`; None computes in this process.
        observers : sequence, optional
            Observers of the simulations in this process.
        progress : callable, optional
            See `Progress`.

        Raises
        ------
        BadInput
            If parts of the case do not fit together, the folder contains another case, or a simulation stopped for
            physical reasons.
        Interrupted
            By Ctrl-C; a job with `resume` resumes.
        """
        if not self.resume:
            make_folder(self.folder, overwrite=self.overwrite)
        with writing(self.folder):
            self.describe(CASE)
            content = {**self.compute(executor, observers, progress), "sand": __version__}
            write_json(self.folder / self.RESULTS, content)
            if self.KEPT:  # its content is in the results
                (self.folder / self.KEPT).unlink(missing_ok=True)
        return content

    def describe(self, name: str) -> None:
        """Write the case to a file in the folder.  Raises BadInput if the job that is resumed has another case."""
        place = self.folder / name
        if not (self.resume and place.exists()):
            write_toml(place, self.content, f"settings of sand {self.COMMAND}, read by sand resume")
        elif not place.samefile(self.path) and read_toml(place) != self.content:
            raise BadInput(f"{place} is another case than the one given; give another folder, or --overwrite")

    def compute(self, executor: Executor | None, observers: Sequence[Any], progress: Progress) -> dict[str, Any]:
        """Compute the tasks that are not finished, keep each outcome, and make the results of all."""
        tasks = self.tasks()
        work = partial(self.work(), observers=observers) if executor is None else self.work()
        kept = GrowingOutcomes(self.folder / self.KEPT, self.content, resume=self.resume)

        def show(line: str = "") -> None:
            done, total = len(kept.found.keys() & set(tasks)), len(set(tasks))
            progress(f"{done} of {total} {self.PARTS}", done / max(total, 1), *([line] if line else ()))

        show()
        left = [task for task in dict.fromkeys(tasks) if task not in kept.found]
        for task, outcome in results_of(executor, work, left):
            kept.add(task, outcome)
            show(self.line(outcome))
        return self.results([kept.found[task] for task in tasks])


class JobOfSeeds(Job):
    """Base class of jobs with one part for each seed of the case.

    Parameters
    ----------
    path : str or Path
        Case file.
    folder : str or Path or None, optional
        Output folder; by default that of the case, or the name of the case file.
    seeds : list of int or None, optional
        Replaces the seeds of the case.
    command : str or None, optional
        Command of a job of several commands; by default that of the case.
    **how
        As for `Job`.

    Raises
    ------
    BadInput
        All errors of the case.

    Attributes
    ----------
    case : Section
        The case, checked.
    """

    def __init__(
        self,
        path: str | Path,
        folder: str | Path | None = None,
        seeds: list[int] | None = None,
        command: str | None = None,
        **how: bool,
    ):
        self.COMMAND = command or self.COMMAND or command_for(read_toml(path)) or ""  # type: ignore[misc]
        self.case, table = self.read(path)
        section = getattr(self.case, table)
        super().__init__(path, folder or section.out, **how)
        self.seeds: list[int] = seeds or list(section.seeds)
        self.content[table]["seeds"] = section.seeds = self.seeds

    def read(self, path: str | Path) -> tuple[Any, str]:
        """The case, and the name of its table with `seeds` and `out`.  Raises BadInput."""
        raise NotImplementedError

    def tasks(self) -> list[int]:
        """The seeds."""
        return self.seeds
