"""One run of a sweep: computed in a worker process, with its row in its folder."""

from __future__ import annotations

import re
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from ..basics.errors import BadInput, FilesFailed
from ..basics.version import __version__
from ..compiler.jit import cache_folder
from ..io import run_folder as files
from ..io.lock import CLAIM, FolderLock
from ..io.run_folder import RUNS
from ..io.sweep_files import DONE, FAILED, STATE, read_row, write_row
from ..simulation.displays import DISPLAYS
from .sweep_cases import CASES
from .sweep_design import changed_content


class Row(NamedTuple):
    """A run of a sweep."""

    name: str  # of its folder: a digest of its case and seed
    values: dict[str, Any]  # by key
    seed: int


def named(row: Row) -> str:
    """Values and seed of a run in words."""
    return ", ".join([*(f"{key} = {value}" for key, value in row.values.items()), f"seed {row.seed}"])


def version() -> str:
    """The version of SAND, with the beginning of the digest of its source."""
    return f"{__version__}+{cache_folder().name[:12]}"


def new_row(command: str, case: dict[str, Any], row: Row, state: str, message: str = "", **more: Any) -> dict[str, Any]:
    """A row, with its results and costs in `more`; `message` is that of a run that failed."""
    content = {"command": command, "case": case, "keys": row.values, "seed": row.seed, STATE: state}
    known = {"message": message, "results": {}, "seconds": 0.0, "cpu_seconds": 0.0, "notes": [], "version": version()}
    return {**content, **known, "run": row.name, **more}


def kind_of(text: str) -> str:
    """Text of a warning without its numbers: the same for all runs that it concerns."""
    return re.sub(r"\d+(\.\d+)?(e[+-]?\d+)?", "#", text)


def texts_of(noted: Sequence[warnings.WarningMessage]) -> list[str]:
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
            found = new_row(command, case, row, state, message, results=results, notes=texts_of(noted), **costs)
            write_row(place, found)
            return files.plain(found)
        finally:
            claim.release()
