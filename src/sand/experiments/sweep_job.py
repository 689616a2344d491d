"""Sweeps: many runs of one case with other values of some of its keys, in a folder that any process can continue."""

from __future__ import annotations

import math
import time
import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, ErrorCollector, import_optional, naming, shown, warn
from ..basics.paths import user_path
from ..config.case import with_absolute_files
from ..config.folders import content_of
from ..config.key_errors import validate
from ..io import run_folder as files
from ..io.damage import digest_of
from ..io.lock import CLAIM, holder, writing
from ..io.run_folder import ROW, RUNS
from ..io.sweep_files import DONE, FAILED, PARQUET, STATE, read_row, read_rows, read_sweep, write_row
from ..results import Sweep
from .executors import results_of
from .job import Job, Progress, ignored
from .sweep_case import Expected
from .sweep_cases import CASES, case_kind
from .sweep_design import (
    DESIGNS,
    EVERY,
    Design,
    SweepSection,
    changed_content,
    flat_keys,
    key_error,
    several,
    takes_whole_numbers,
    value_read,
    without_keys,
)
from .sweep_row import Row, kind_of, named, new_row, run_row, texts_of
from .sweep_table import NOTES, PATIENCE, SweepTable

MOST_LOSSES = 3
"""Times that the process of a run may die before the run counts as failed."""
SET_UP, MOST_SET_UP, SET_UP_SECONDS = 8, 64, 20.0
"""Runs that are set up before the first one is computed: at least, and at most; fewer after this wall time [s]."""
ROW_BYTES = 12e3
"""Disk space of the row of a run [bytes]."""


class SweepJob(Job):
    """Runs of one case with other values of some keys, each in a folder of its own below `runs`.

    Several processes may work in the same folder: each takes runs that no other one computes.

    Parameters
    ----------
    path : str or Path
        Case file of any command of `sweep_cases.CASES`, with or without [sweep].
    folder : str or Path or None, optional
        Output folder, by default that of [sweep], or the name of the case file with "-sweep".
    settings : mapping, optional
        Keys of [sweep] that replace those of the case file; of `vary` and `together` those with the same keys.
    content : dict or None, optional
        The case itself, where there is no file.
    retry : bool, optional
        Whether runs that failed are computed again.
    parquet : bool, optional
        Whether the table is written as Parquet, too, as it is in any case where the folder has such a table.

    Raises
    ------
    BadInput
        All errors of keys, values and cases.

    Attributes
    ----------
    keys : list of str
        The keys that change.
    seeds : list of int
        The seeds of each combination.
    rows : list of Row
        All runs, in their order.
    """

    COMMAND, RESULTS, PARTS = "sweep", files.SWEEP, "runs"

    def __init__(
        self,
        path: str | Path,
        folder: str | Path | None = None,
        settings: Mapping[str, Any] | None = None,
        *,
        content: dict[str, Any] | None = None,
        resume: bool = False,
        retry: bool = False,
        parquet: bool = False,
    ):
        self.path, self.resume, self.overwrite = Path(path), resume, False
        self.content = with_absolute_files(files.read_toml(path) if content is None else content, path)
        own = self.content.pop("sweep", {})
        if not isinstance(own, dict):
            raise BadInput(f"{path}: sweep = {shown(own)} must be a table, [sweep]")
        self.section = validate(SweepSection, _replaced(own, settings or {}), str(path), table="sweep")
        self.folder = user_path(folder or self.section.out or f"{self.path.stem}-sweep", "folder")
        self.retry, self.parquet = retry, parquet or (self.folder / PARQUET).exists()
        self.command = case_kind(self.content)
        if not self.command:
            raise BadInput(f"{path} is no case that a sweep can vary; write one with sand new NAME --for sweep")
        self.kind, self._is_set_up = CASES[self.command], False
        self.notes: list[str] = []  # warnings of the runs that were set up
        self.keys, self.rows = self._rows()

    def _rows(self) -> tuple[list[str], list[Row]]:
        """The keys that change, and all runs; their cases are checked.  Raises BadInput."""
        name, errors = str(self.path), ErrorCollector()
        model = self.kind.model(self.content)
        given = self.kind.GIVEN
        keys = [key for table in (self.section.vary, *self.section.together) for key in table]
        for key in keys:
            if key in given or key.partition(".")[0] in given:
                errors.problems.append(f"{name}: {key}: give seeds as --seeds, the folder as --out, or in [sweep]")
            elif problem := key_error(model, self.content, key):
                errors.problems.append(f"{name}: {problem}")
        errors.done()
        with naming(f"{name}: sweep"):
            design = Design(self.section, partial(takes_whole_numbers, model))
        self.seeds = self.section.seeds or errors.take(self._seeds, next(design.combinations()), instead=[0])
        self.content = without_keys(self.content, list(given))
        self.command = case_kind(self.content)  # of boxes of sand grow: run, as that of case.toml
        self.defaults = self._defaults(keys)
        found, again = dict[str, Row](), list[Row]()
        for values in design.combinations():
            read = errors.take(self._checked, values, instead={})
            for seed in self.seeds:
                row = Row(self._name_of(read, seed), read, seed)
                if found.setdefault(row.name, row) is not row:
                    again.append(row)
        errors.problems = list(dict.fromkeys(errors.problems))
        errors.done()
        if again:
            warn(
                f"{len(again)} of {len(found) + len(again)} runs have the values of others, such as {named(again[0])}: "
                f"each is computed once, {len(found)} in all"
            )
        return keys, list(found.values())

    def _defaults(self, keys: Sequence[str]) -> dict[str, Any]:
        """Values of keys that the case file does not give; none if it is no case without them."""
        missing = [key for key in keys if value_read(self.content, key, None) is None]
        try:
            case = self.kind(self.content, "").case if missing else None
        except BadInput:
            return {}
        return {key: value for key in missing if (value := value_read(case, key, None)) is not None}

    def _seeds(self, values: dict[str, Any]) -> list[int]:
        return self.kind(changed_content(self.content, values), str(self.path)).seeds

    def _checked(self, values: dict[str, Any]) -> dict[str, Any]:
        """The values as the case reads them, numbers in SI.  Raises BadInput."""
        content = with_absolute_files(changed_content(self.content, values), self.path)
        case = self.kind(content, str(self.path)).case
        read = {key: value_read(case, key, value) for key, value in values.items()}
        return {key: value_read(content, key, value) if key.endswith("file") else value for key, value in read.items()}

    def _name_of(self, values: dict[str, Any], seed: int) -> str:
        """A digest of case and seed; keys that have the default of a case without them change nothing."""
        case = changed_content(self.content, {k: v for k, v in values.items() if v != self.defaults.get(k)})
        return digest_of({"command": self.command, "case": self.named_by(case), "seed": seed})[:12]

    def named_by(self, case: dict[str, Any]) -> dict[str, Any]:
        """What of the case of a run, besides its seed, gives its name: all."""
        return case

    def expected(self, left: Sequence[Row]) -> Expected:
        """Set up some runs in memory, which finds further errors, and estimate the cost of all that are left.

        A random sample in which every value occurs, at least `SET_UP` runs: their mean time and disk space are
        taken for all others.

        Returns
        -------
        Expected
            Sum of the wall times [s] of all runs and of their files [bytes], and the largest memory of one [bytes].

        Raises
        ------
        BadInput
            All errors of the runs in the sample.
        """
        errors, found, self._is_set_up = ErrorCollector(), list[Expected](), True
        with warnings.catch_warnings(record=True) as noted:
            warnings.simplefilter("always")
            latest = time.monotonic() + SET_UP_SECONDS
            for row in self._sample(left):
                if found and time.monotonic() > latest:
                    break
                place = f"{self.path}: {named(row)}"
                try:
                    found.append(self.kind(changed_content(self.content, row.values), place).expected(row.seed))
                except BadInput as error:
                    errors.problems += error.at(place).problems
        self.notes = list({kind_of(text): text for text in texts_of(noted)[::-1]}.values())[::-1]
        for text in self.notes[:NOTES]:
            warn(text)
        errors.done()
        share, keeps = len(left) / max(len(found), 1), self.section.files == "all"
        seconds = [one.seconds for one in found if one.seconds is not None]
        disk = [ROW_BYTES + (one.disk or 0.0) * keeps for one in found if not (keeps and one.disk is None)]
        return Expected(
            share * math.fsum(seconds) if len(seconds) == len(found) else None,
            max((one.memory for one in found), default=0.0),
            share * math.fsum(disk) if len(disk) == len(found) else None,
        )

    def _sample(self, rows: Sequence[Row]) -> list[Row]:
        """Some runs, in random order, in which every value of every key occurs; of random designs only some values."""
        order = np.random.default_rng(0).permutation(len(rows))
        seen, chosen = set[str](), list[Row]()
        most = MOST_SET_UP if self.section.design == EVERY else SET_UP
        for row in (rows[k] for k in order):
            values = {f"{key} = {value}" for key, value in row.values.items()}
            if len(chosen) < SET_UP or (values - seen and len(chosen) < most):
                chosen.append(row)
                seen |= values
        return chosen

    def left(self) -> list[Row]:
        """Runs that have not ended; with `retry` also those that failed."""
        known = {name: row[STATE] for name, row in read_rows(self.folder)}
        return [row for row in self.rows if known.get(row.name) not in ((DONE,) if self.retry else (DONE, FAILED))]

    def all_rows(self) -> dict[str, tuple[dict[str, Any], int, str]]:
        """Values, seed and state ("": left) of all runs by name: of this design, and others in the folder.

        Also of runs that are in the table alone, because the folder `runs` was removed.
        """
        is_finished, ended = (self.folder / self.RESULTS).exists(), dict[str, tuple[dict[str, Any], int, str]]()
        left = {} if is_finished else {row.name: (row.values, row.seed, "") for row in self.rows}
        if (self.folder / files.SWEEP_CSV).exists():
            table = {name: column.tolist() for name, column in read_sweep(self.folder).items()}
            keys = list(table)[: list(table).index("seed")]
            columns = (table[name] for name in ("run", "seed", STATE, *keys))
            for name, seed, state, *values in zip(*columns, strict=True):
                ended[name] = dict(zip(keys, values, strict=True)), seed, state
        rows = read_rows(self.folder, without=ended)
        return left | ended | {name: (row["keys"], row["seed"], row[STATE]) for name, row in rows}

    def run(
        self, executor: Executor | None = None, observers: Sequence[Any] = (), progress: Progress = ignored
    ) -> dict[str, Any]:
        """Compute all runs that have not ended, and write the table; see `Job.run`.

        Returns
        -------
        dict
            Numbers of runs by how they ended, and the messages of those that failed.
        """
        self.refuse_others()
        if not self._is_set_up:
            self.expected(self.left())
        self.begin()
        workers = 1 if executor is None else getattr(executor, "_max_workers", None)
        how: Any = {"progress": progress, "workers": workers, "shown": self.notes, "parquet": self.parquet}
        table = SweepTable(self.folder, self.rows, {key: self.defaults.get(key) for key in self.keys}, **how)
        try:
            self._compute(executor, observers, table)
        finally:
            content = table.finish()
        return content

    def begin(self) -> None:
        """Create the folder or take the one of this sweep.

        Raises
        ------
        BadInput
            If the folder holds something else, or a sweep of another case; or if Parquet cannot be written.
        """
        if self.parquet:
            import_optional("pyarrow.parquet", "--parquet")
        files.make_folder(self.folder, shared=True)
        with writing(self.folder, patience=PATIENCE):
            (self.folder / RUNS).mkdir(exist_ok=True)
            (self.folder / self.RESULTS).unlink(missing_ok=True)
            design = self.section.model_dump(exclude={"out"}, exclude_defaults=True) | {"seeds": self.seeds}
            if not (self.resume and (self.folder / files.CASE).exists()):
                text = "case and settings of sand sweep, read by sand resume"
                files.write_toml(self.folder / files.CASE, {**self.content, "sweep": design}, text)
        if self.retry:
            for row in self.rows:
                place = self.folder / RUNS / row.name
                if (known := read_row(place)) and known[STATE] == FAILED:
                    for path in [place / ROW, *files.files_of_runs(place)]:
                        path.unlink(missing_ok=True)

    def refuse_others(self) -> None:
        """Raise BadInput if the folder holds something else than runs of this case."""
        path = self.folder / files.CASE
        if self.folder.is_file():
            raise BadInput(f"{self.folder} is a file; give another folder with --out")
        if not files.is_used(self.folder):
            return
        if not path.exists() and (self.folder / files.LOCK).exists():
            with writing(self.folder, patience=PATIENCE):  # wait for another process that is about to write it
                pass
        content = files.read_toml(path) if files.was_written_by_sand(path) else {}
        if "sweep" not in content:
            raise BadInput(f"{self.folder} holds {content_of(self.folder)}, no sweep; give another folder with --out")
        theirs = content.pop("sweep")
        varied = [*self.keys, *(key for part in _tables_of(theirs) for key in part)]
        before, now = without_keys(content, varied), without_keys(self.content, varied)
        if changed := [name for name in {**before, **now} if before.get(name) != now.get(name)]:
            raise BadInput(
                f"{self.folder} holds a sweep of another case, with different [{changed[0]}]; give another folder with "
                "--out, or the same case"
            )

    def _compute(self, executor: Executor | None, observers: Sequence[Any], table: SweepTable) -> None:
        """Compute what is left; after the death of a worker process the pool is started again."""
        place = str(self.folder.absolute())  # workers may be in another folder
        keeps = self.section.files == "all"
        work = partial(run_row, self.command, self.content, place, keeps)
        if executor is None:
            work = partial(work, observers=observers)
        losses: Counter[str] = Counter()
        for attempt in range(int(PATIENCE)):
            left = [row for row in self.rows if row.name not in table.known]
            while left:
                try:
                    for row, found in results_of(executor, work, left):
                        table.add(row, found)
                    break
                except BrokenExecutor:
                    renew = getattr(executor, "renew", None)
                    if renew is None:
                        raise
                    losses.update(self._lost(left, renew()))
                    left = [row for row in left if row.name not in table.known]
                    for row in [row for row in left if losses[row.name] >= MOST_LOSSES]:
                        table.add(row, self._given_up(row))
                        left.remove(row)
            if not table.busy or attempt + 1 == int(PATIENCE):
                break
            time.sleep(1.0)  # processes whose parent was killed end soon
            table.busy.clear()

    def _lost(self, rows: Sequence[Row], dead: Mapping[int, str]) -> list[str]:
        """Names of the runs that dead processes were computing, by the ids of these; warns."""
        begun = [row.name for row in rows if (self.folder / RUNS / row.name / CLAIM).exists()]
        lost = [name for name in begun if holder(self.folder / RUNS / name, CLAIM) in dead]
        how = ", ".join(dict.fromkeys(dead.values())) or "for an unknown reason"
        warn(f"a worker process died ({how}); the sweep goes on with new ones")
        return lost

    def _given_up(self, row: Row) -> dict[str, Any]:
        """The row of a run whose process died too often."""
        message = f"the process that computed it died {MOST_LOSSES} times; memory may be exhausted"
        found = new_row(self.command, changed_content(self.content, row.values), row, FAILED, message)
        write_row(self.folder / RUNS / row.name, found)
        return found


def _tables_of(section: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Tables of keys that change together, of [sweep]; each key of `vary` is one."""
    vary = [{key: value} for key, value in flat_keys(section.get("vary", {})).items()]
    return [*vary, *several(section.get("together", []), "together")]


def _replaced(own: dict[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """[sweep] with other settings; keys that these vary are no longer varied as before."""
    given = {key: value for key, value in settings.items() if value is not None}
    new = _tables_of(given)
    keys = {key for table in new for key in table}
    if keys:
        kept = [table for table in _tables_of(own) if not keys & table.keys()]
        given["vary"] = {k: v for table in [*kept, *new] if len(table) == 1 for k, v in table.items()}
        given["together"] = [table for table in [*kept, *new] if len(table) > 1]
    if "samples" in given and own.get("design", EVERY) == EVERY:
        given.setdefault("design", DESIGNS[1])
    return {**own, **given}


@checked
def sweep(
    case: Any,
    vary: Any = None,
    *,
    together: Any = None,
    seeds: Any = None,
    design: str | None = None,
    samples: int | None = None,
    design_seed: int | None = None,
    files: str | None = None,
    folder: str | Path | None = None,
    executor: Executor | None = None,
    retry: bool = False,
    parquet: bool = False,
    progress: Callable[..., None] | None = None,
) -> Sweep:
    """Run a case for many values of its keys; what is in the folder already is not computed again.

    Parameters
    ----------
    case : str, Path or dict
        Case file of `sand run`, `collide`, `scatter` or `grow`, or its content; with or without [sweep].
    vary : dict or None, optional
        Values by dotted key, such as `{"impact.speed": "log(10 m/s, 200 m/s, 10)", "projectile.grains": [500, 4000]}`.
    together : list of dict or None, optional
        Tables of keys that change together, each with equally many values.
    seeds : int or list of int or None, optional
        How many seeds, from 1, or a list; by default those of the case.
    design, samples, design_seed, files, parquet
        As in [sweep] and for `sand sweep`.
    folder : str or Path or None, optional
        Folder of the sweep, by default the name of the case with "-sweep".
    executor : Executor or None, optional
        Any `concurrent.futures.Executor`, such as a ProcessPoolExecutor; None computes in this process.
    retry : bool, optional
        Whether runs that failed are computed again.
    progress : callable or None, optional
        Called with a line of progress, the part that is done, and a line about a failed run or "".

    Returns
    -------
    Sweep
        The table of all runs, also of failed ones.

    Raises
    ------
    BadInput
        All errors of keys, values and cases before the first run; or if the folder holds something else.
    """
    names = ("vary", "together", "seeds", "design", "samples", "design_seed", "files")
    values = (vary, together, seeds, design, samples, design_seed, files)
    settings = dict(zip(names, values, strict=True))
    path, content = ("case", case) if isinstance(case, dict) else (case, None)
    job = SweepJob(path, folder, settings, content=content, retry=retry, parquet=parquet)
    job.run(executor, progress=progress or ignored)
    return Sweep(job.folder)
