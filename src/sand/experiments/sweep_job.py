"""Sweeps: many runs of one case with other values of some of its keys, in a folder that any process can continue."""

from __future__ import annotations

import math
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, ErrorCollector, FilesFailed, shown, warn
from ..basics.paths import user_path
from ..basics.version import __version__
from ..compiler.jit import cache_folder
from ..config.case import with_absolute_files
from ..config.commands import command_for
from ..config.key_errors import validate
from ..io import run_folder as files
from ..io.damage import digest_of
from ..io.lock import FolderLock, holder, writing
from ..io.sweep_files import CLAIM, DONE, FAILED, ROW, RUNS, STATE, flat, read_row, read_rows, write_row, write_sweep
from ..results import Sweep
from ..simulation.displays import DISPLAYS
from .executors import results_of
from .job import Job, Progress, ignored
from .sweep_cases import CASES, Expected
from .sweep_design import (
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

PATIENCE = 10.0
"""Longest wall time [s] to wait for another process that writes to the folder for a moment, or that is ending."""
TABLE_EVERY, TABLE_COST = 30.0, 0.02
"""Shortest wall time [s] between two tables of an unfinished sweep, and the largest part of the time that they take."""
MOST_LOSSES = 3
"""Times that the process of a run may die before the run counts as failed."""
SET_UP, MOST_SET_UP, SET_UP_SECONDS = 8, 64, 20.0
"""Runs that are set up before the first one is computed: at least, and at most; fewer after this wall time [s]."""
ROW_BYTES = 12e3
"""Disk space of a run of which only the row is kept [bytes]."""
NOTES = 5
"""Warnings of runs that are shown, the most frequent ones."""


class Row(NamedTuple):
    """A run of a sweep."""

    name: str  # of its folder: a digest of its case and seed
    values: dict[str, Any]  # by key
    seed: int


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
        self.retry, self.parquet = retry, parquet
        self.command = command_for(self.content) or ""
        if self.command not in CASES:
            raise BadInput(f"{path} is no case that a sweep can vary; write one with sand new NAME --for sweep")
        self.kind, self._is_set_up = CASES[self.command], False
        self.notes: list[str] = []  # warnings of the runs that were set up
        self.keys, self.rows = self._rows()

    def _rows(self) -> tuple[list[str], list[Row]]:
        """The keys that change, and all runs; their cases are checked.  Raises BadInput."""
        name, errors = str(self.path), ErrorCollector()
        model = self.kind.model(self.content)
        given = self.kind.GIVEN
        keys = [key for table in ({**self.section.vary}, *self.section.together) for key in table]
        for key in keys:
            if key in given or key.partition(".")[0] in given:
                errors.problems.append(f"{name}: {key}: give seeds as --seeds, the folder as --out, or in [sweep]")
            elif problem := key_error(model, self.content, key):
                errors.problems.append(f"{name}: {problem}")
        errors.done()
        try:
            design = Design(self.section, partial(takes_whole_numbers, model))
        except BadInput as error:
            raise error.at(f"{name}: sweep") from None
        self.seeds = self.section.seeds or errors.take(self._seeds, next(design.combinations()), instead=[0])
        self.content = without_keys(self.content, list(given))
        self.defaults = self._defaults(keys)
        found: dict[str, Row] = {}
        for values in design.combinations():
            read = errors.take(self._checked, values, instead={})
            for seed in self.seeds:
                row = Row(self._name_of(read, seed), read, seed)
                found.setdefault(row.name, row)
        errors.problems = list(dict.fromkeys(errors.problems))
        errors.done()
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
        return digest_of({"command": self.command, "case": case, "seed": seed})[:12]

    def expected(self, left: Sequence[Row]) -> Expected:
        """Set up some runs in memory, which finds further errors, and estimate the cost of all that are left.

        A random sample in which every value occurs, at least `SET_UP` runs: their mean time and disk space stands for
        those of the others.

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
                place = f"{self.path}: {_named(row)}"
                try:
                    found.append(self.kind(changed_content(self.content, row.values), place).expected(row.seed))
                except BadInput as error:
                    errors.problems += error.at(place).problems
        self.notes = _texts(noted)
        for text in self.notes[:NOTES]:
            warn(text)
        errors.done()
        share, keeps = len(left) / max(len(found), 1), self.section.files == "all"
        seconds = [one.seconds for one in found if one.seconds is not None]
        disk = [one.disk for one in found if one.disk is not None] if keeps else [ROW_BYTES] * len(found)
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
        table = _Table(self, progress, 1 if executor is None else getattr(executor, "_max_workers", None))
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
            If the folder holds something else, or a sweep of another case.
        """
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
        content = files.read_toml(path) if files.was_written_by_sand(path) else {}
        if "sweep" not in content:
            kind = f"a job or run of `sand {command_for(content)}`" if command_for(content) else "other files"
            raise BadInput(f"{self.folder} holds {kind}, no sweep; give another folder with --out")
        theirs = content.pop("sweep")
        varied = [*self.keys, *(key for part in _tables_of(theirs) for key in part)]
        before, now = without_keys(content, varied), without_keys(self.content, varied)
        if changed := [name for name in {**before, **now} if before.get(name) != now.get(name)]:
            raise BadInput(
                f"{self.folder} holds a sweep of another case, with different [{changed[0]}]; give another folder with "
                "--out, or the same case"
            )

    def _compute(self, executor: Executor | None, observers: Sequence[Any], table: _Table) -> None:
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
            if not table.busy or attempt + 1 == int(PATIENCE):
                break
            time.sleep(1.0)  # processes whose parent was killed end soon
            table.busy.clear()

    def _lost(self, rows: Sequence[Row], dead: Mapping[int, str]) -> list[str]:
        """Names of the runs that dead processes were computing, by the numbers of these; says so."""
        begun = [row.name for row in rows if (self.folder / RUNS / row.name / CLAIM).exists()]
        lost = [name for name in begun if holder(self.folder / RUNS / name, CLAIM) in dead]
        how = ", ".join(dict.fromkeys(dead.values())) or "for an unknown reason"
        warn(f"a worker process died ({how}); the sweep goes on with new ones")
        return lost

    def _given_up(self, row: Row) -> dict[str, Any]:
        """The row of a run whose process died too often."""
        message = f"the process that computed it died {MOST_LOSSES} times; memory may be exhausted"
        found = _row(self.command, changed_content(self.content, row.values), row, FAILED, message)
        write_row(self.folder / RUNS / row.name, found)
        return found


class _Table:
    """The rows of a sweep: known ones, those that arrive, and the table that is written of them."""

    def __init__(self, job: SweepJob, progress: Progress, workers: int | None):
        self.job, self._progress, self._workers = job, progress, workers
        self.known: dict[str, dict[str, Any]] = {}
        self.busy: set[str] = set()  # runs that other processes compute
        self.notes: Counter[str] = Counter()
        self._written, self._took = time.monotonic(), 0.0
        self._place = {row.name: k for k, row in enumerate(job.rows)}
        self._states: Counter[str] = Counter()  # of the runs of the design
        self._take_all()
        self._named_versions: set[str] = {version()}
        self._name_versions()
        self._show()

    def _name_versions(self) -> None:
        """Warn of rows that other versions have made, once of each version."""
        number = Counter(cells["version"] for cells in self.known.values())
        if others := [f"{number[name]} by {name}" for name in number if name not in self._named_versions]:
            warn(f"{self.job.folder} has runs of other versions of SAND: {', '.join(others)}; this one is {version()}")
        self._named_versions |= number.keys()

    def _take_all(self) -> None:
        """Take the rows of all runs that have ended, also those of other processes."""
        for name, row in read_rows(self.job.folder, without=self.known):
            self._take(name, row)

    def _take(self, name: str, row: dict[str, Any]) -> None:
        if name in self._place and name not in self.known:
            self._states[row[STATE]] += 1
        self.known[name] = _cells(name, row, self.job.keys, self.job.defaults)

    def add(self, row: Row, found: dict[str, Any] | None) -> None:
        """Take the row of a run that has ended; None if another process computes it."""
        if found is None:
            self.busy.add(row.name)
            return
        self._take(row.name, found)
        self.notes.update(text for text in found.get("notes", []) if text not in self.job.notes)
        line = f"  run {row.name} failed ({_named(row)}): {found['message']}" if found[STATE] == FAILED else ""
        self._show(line)
        now = time.monotonic()
        if now - self._written > max(TABLE_EVERY, self._took / TABLE_COST):
            self.write()

    def counts(self) -> dict[str, int]:
        """Numbers of runs of the design that are done, that failed, and that are left."""
        states, total = self._states, len(self._place)
        return {"runs": total, DONE: states[DONE], FAILED: states[FAILED], "left": total - states.total()}

    def _show(self, line: str = "") -> None:
        count = self.counts()
        running = "" if self._workers is None else f"{min(self._workers, count['left'])} running, "
        text = f"{count[DONE]} of {count['runs']} runs done, {running}{count[FAILED]} failed, {count['left']} left"
        self._progress(text, 1.0 - count["left"] / max(count["runs"], 1), line)

    def write(self) -> None:
        """Write the table of all runs that have ended: those of the design in its order, then earlier ones."""
        began = time.monotonic()
        place, known = self._place, self.known
        keys = [*self.job.keys, *sorted({key for cells in known.values() for key in cells["keys"]} - {*self.job.keys})]
        order = sorted(known, key=lambda name: (place.get(name, len(place)), str(known[name]["values"]), name))
        rows = []
        for name in order:
            cells = dict(known[name])
            values = cells.pop("values")
            del cells["keys"]
            rows.append({key: values.get(key) for key in keys} | cells)
        write_sweep(self.job.folder, rows, self.job.parquet)
        self._written = time.monotonic()
        self._took = self._written - began

    def finish(self) -> dict[str, Any]:
        """Write the table with the rows of all processes and, if no run is left, the results file.

        Returns
        -------
        dict
            The content of the results file.
        """
        with writing(self.job.folder, patience=PATIENCE):
            self._take_all()
            self._name_versions()
            self.write()
            count = self.counts()
            failed = {row.name: self._message(row) for row in self.job.rows if self._state(row) == FAILED}
            content = {"folder": str(self.job.folder), **count, "failures": failed, "version": version()}
            if not count["left"]:
                files.write_json(self.job.folder / self.job.RESULTS, content)
        for text, number in self.notes.most_common(NOTES):
            warn(f"in {number} run{'s' * (number > 1)}: {text}")
        return content

    def _state(self, row: Row) -> str | None:
        return self.known.get(row.name, {}).get(STATE)

    def _message(self, row: Row) -> str:
        return f"{_named(row)}: {self.known[row.name]['message']}"


def _named(row: Row) -> str:
    """Values and seed of a run in words."""
    return ", ".join([*(f"{key} = {value}" for key, value in row.values.items()), f"seed {row.seed}"])


def _cells(name: str, row: dict[str, Any], keys: Sequence[str], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Cells of the table of one row, with its keys and their values."""
    values = {key: value_read(row["case"], key, defaults.get(key)) for key in dict.fromkeys([*keys, *row["keys"]])}
    values |= {key: _listed(row["keys"][key]) for key in row["keys"]}
    shared = {"seed": row["seed"], STATE: row[STATE], **flat(row["results"])}
    costs = {key: row[key] for key in ("message", "seconds", "cpu_seconds", "version")}
    return {**shared, **costs, "run": name, "values": values, "keys": tuple(row["keys"])}


def _listed(value: Any) -> Any:
    return " ".join(map(str, value)) if isinstance(value, list) else value


def version() -> str:
    """The version of SAND, with the beginning of the digest of its source."""
    return f"{__version__}+{cache_folder().name[:12]}"


def _row(command: str, case: dict[str, Any], row: Row, state: str, message: str = "", **more: Any) -> dict[str, Any]:
    content = {"command": command, "case": case, "keys": row.values, "seed": row.seed, STATE: state}
    known = {"message": message, "results": {}, "seconds": 0.0, "cpu_seconds": 0.0, "notes": [], "version": version()}
    return {**content, **known, "run": row.name, **more}


def _texts(noted: Sequence[warnings.WarningMessage]) -> list[str]:
    """Texts of warnings for users, each once."""
    return list(dict.fromkeys(str(one.message) for one in noted if issubclass(one.category, UserWarning)))


@contextmanager
def _without_figures() -> Iterator[None]:
    """In the block, runs draw no figure at their end, which would take longer than a short run."""
    before = DISPLAYS.get("save figure")
    DISPLAYS["save figure"] = lambda *_: None
    try:
        yield
    finally:
        if before is not None:
            DISPLAYS["save figure"] = before


def run_row(
    command: str, base: dict[str, Any], folder: str, keeps: bool, row: Row, *, observers: Sequence[Any] = ()
) -> dict[str, Any] | None:
    """Compute a run of a sweep, and write its row; runs in worker processes.

    Parameters
    ----------
    base : dict
        Content of the case that all runs share.
    folder : str
        Folder of the sweep.
    keeps : bool
        Whether the files of the run are kept.

    Returns
    -------
    dict or None
        The row, also if it was there already; None if another process computes it.

    Raises
    ------
    FilesFailed
        If a file cannot be written.
    """
    place = Path(folder) / RUNS / row.name
    place.mkdir(parents=True, exist_ok=True)
    with warnings.catch_warnings(record=True) as noted:
        warnings.simplefilter("always")
        try:
            claim = FolderLock(place, name=CLAIM)
        except BadInput:
            return None
        try:
            if (known := read_row(place)) is not None:
                return known
            case, began = changed_content(base, row.values), (time.monotonic(), time.process_time())
            state, message, results = DONE, "", {}
            try:
                with _without_figures():
                    results = CASES[command](case, "case").run(row.seed, place if keeps else None, observers)
            except FilesFailed:
                raise
            except BadInput as error:
                state, message = FAILED, "; ".join(error.problems)
            except Exception as error:
                state, message = FAILED, " ".join(f"{type(error).__name__}: {error}".split())
            costs = {"seconds": time.monotonic() - began[0], "cpu_seconds": time.process_time() - began[1]}
            found = _row(command, case, row, state, message, results=results, notes=_texts(noted), **costs)
            write_row(place, found)
            return files.plain(found)
        finally:
            claim.release()


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
