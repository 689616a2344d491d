"""The table of a sweep: known rows, those that arrive, and the files that are written of them."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..basics.errors import warn
from ..io import run_folder as files
from ..io.lock import writing
from ..io.sweep_files import DONE, FAILED, STATE, TABLE, cell_of, flat, read_rows, write_sweep
from .job import Progress
from .sweep_design import value_read
from .sweep_row import Row, kind_of, named, version

TABLE_EVERY, TABLE_COST = 30.0, 0.02
"""Shortest wall time [s] between two tables of an unfinished sweep, and the largest part of the time that they take."""
PATIENCE = 10.0
"""Longest wall time [s] to wait for another process that writes to the folder for a moment, or that is ending."""
NOTES = 5
"""Warnings of runs that are shown, the most frequent ones."""


class SweepTable:
    """The rows of a sweep: known ones, those that arrive, and the table that is written of them.

    Parameters
    ----------
    folder : Path
        Folder of the sweep.
    rows : sequence of Row
        All runs.
    defaults : mapping
        The keys that change, with their values in rows that do not give them, or None.
    progress : callable
        See `job.Progress`.
    workers : int or None
        Number of processes, if it is known.
    shown : sequence of str
        Warnings that were shown before the first run.
    parquet : bool
        Whether the table is written as Parquet, too.
    """

    def __init__(
        self,
        folder: Path,
        rows: Sequence[Row],
        defaults: Mapping[str, Any],
        *,
        progress: Progress,
        workers: int | None,
        shown: Sequence[str],
        parquet: bool,
    ):
        self._folder, self._rows, self._defaults = folder, rows, defaults
        self._progress, self._workers, self._parquet = progress, workers, parquet
        self.known: dict[str, dict[str, Any]] = {}
        self.busy: set[str] = set()  # runs that other processes compute
        self._shown = {kind_of(text) for text in shown}
        self.notes: dict[str, list[str]] = {}  # warnings of runs by their kind
        self._written, self._took = time.monotonic(), 0.0
        self._place = {row.name: k for k, row in enumerate(rows)}
        self._states: Counter[str] = Counter()  # of the runs of the design
        self._take_all()
        self._named_versions: set[str] = {version()}
        self._name_versions()
        self._show()

    def _name_versions(self) -> None:
        """Warn of rows that other versions have made, once of each version."""
        number = Counter(cells["version"] for cells in self.known.values())
        if others := [f"{number[name]} by {name}" for name in number if name not in self._named_versions]:
            warn(f"{self._folder} has runs of other versions of SAND: {', '.join(others)}; this one is {version()}")
        self._named_versions |= number.keys()

    def _take_all(self) -> None:
        """Take the rows of all runs that have ended, also those of other processes."""
        for name, row in read_rows(self._folder, without=self.known):
            self._take(name, row)

    def _take(self, name: str, row: dict[str, Any]) -> None:
        if name in self._place and name not in self.known:
            self._states[row[STATE]] += 1
        self.known[name] = _cells(name, row, self._defaults)

    def add(self, row: Row, found: dict[str, Any] | None) -> None:
        """Take the row of a run that has ended; None if another process computes it."""
        if found is None:
            self.busy.add(row.name)
            return
        self._take(row.name, found)
        for text in found.get("notes", []):
            if (kind := kind_of(text)) not in self._shown:
                self.notes.setdefault(kind, []).append(text)
        line = f"  run {row.name} failed ({named(row)}): {found['message']}" if found[STATE] == FAILED else ""
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
        keys = [
            *self._defaults,
            *sorted({key for cells in known.values() for key in cells["keys"]} - {*self._defaults}),
        ]
        order = sorted(known, key=lambda name: (place.get(name, len(place)), str(known[name]["values"]), name))
        rows = []
        for name in order:
            cells = dict(known[name])
            values = cells.pop("values")
            del cells["keys"]
            rows.append({key: values.get(key) for key in keys} | cells)
        write_sweep(self._folder, rows, self._parquet)
        self._written = time.monotonic()
        self._took = self._written - began

    def finish(self) -> dict[str, Any]:
        """Write the table with the rows of all processes and, if no run is left, the results file.

        Returns
        -------
        dict
            The content of the results file.
        """
        with writing(self._folder, patience=PATIENCE):
            self._take_all()
            self._name_versions()
            self.write()
            count = self.counts()
            failed = {row.name: self._message(row) for row in self._rows if self._state(row) == FAILED}
            content = {"folder": str(self._folder), **count, "failures": failed, "version": version()}
            if not count["left"]:
                files.write_json(self._folder / files.SWEEP, content)
        for texts in sorted(self.notes.values(), key=len, reverse=True)[:NOTES]:
            example = ", for example" if len(set(texts)) > 1 else ""
            warn(f"in {len(texts)} run{'s' * (len(texts) > 1)}{example}: {texts[0]}")
        return content

    def _state(self, row: Row) -> str | None:
        return self.known.get(row.name, {}).get(STATE)

    def _message(self, row: Row) -> str:
        return f"{named(row)}: {self.known[row.name]['message']}"


def _cells(name: str, row: dict[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Cells of the table of one row, with its keys and their values."""
    values = {key: value_read(row["case"], key, defaults.get(key)) for key in dict.fromkeys([*defaults, *row["keys"]])}
    values |= {key: cell_of(value) for key, value in row["keys"].items()}
    results = dict(row["results"])
    table = {TABLE: results.pop(TABLE)} if TABLE in results else {}
    shared = {"seed": row["seed"], STATE: row[STATE], **flat(results), **table}
    costs = {key: row[key] for key in ("message", "seconds", "cpu_seconds", "version")}
    return {**shared, **costs, "run": name, "values": values, "keys": tuple(row["keys"])}
