"""What a story reads besides frames: which folder is meant, how its run ended, its ledger."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..analysis.ledger_columns import Books
from ..errors import BadInput
from ..io import run_folder as files
from ..io.ledger_table import read_rows

STALE = 3600.0
"""Seconds without a frame after which a run that has not ended may be one that was killed."""


def killed_note(age: float) -> str:
    """What to say of a run without an end whose last frame is so old [s]; nothing while it may be going."""
    if age < STALE:
        return ""
    hours = age / 3600.0
    format_quantity = f"{hours:.0f} h" if hours < 48.0 else f"{hours / 24.0:.0f} days"
    return f"no frame for {format_quantity}: it may have been killed; sand resume goes on"


def find_run_folder(place: str | Path) -> Path | None:
    """The folder of the run that a path means: itself, or that of its trajectory.gsd; None for a file by itself."""
    place = Path(place)
    if place.is_dir():
        return place if (place / files.TRAJECTORY).exists() else None
    return place.parent if place.name == files.TRAJECTORY and (place.parent / files.CASE).exists() else None


PROBLEM = "problem"
"""Key of what is to be said of a summary that cannot be read."""


def summary_of(folder: Path) -> Mapping[str, Any] | None:
    """How a run ended; None while it has not; what is wrong, under PROBLEM, where that cannot be read."""
    try:
        return files.read_json(folder / files.SUMMARY) if (folder / files.SUMMARY).exists() else None
    except BadInput as error:
        return {PROBLEM: str(error)}


class RunBooks:
    """The ledger of a run, read again when it has changed; None while there is none, or none that can be read.

    `problem` says what is wrong with it, if anything is.
    """

    def __init__(self, folder: Path):
        self._path, self.problem = folder / files.LEDGER, ""
        self._known: tuple[tuple[int, int], Books | None] = ((0, 0), None)

    def __call__(self) -> Books | None:
        try:
            found = self._path.stat()
            stamp = (found.st_size, found.st_mtime_ns)
            if stamp != self._known[0]:
                self._known = (stamp, None)
                rows, self.problem = read_rows(self._path)
                self._known = (stamp, Books.of(rows))
        except OSError:
            return None
        except BadInput as error:
            self.problem = str(error)
        return self._known[1]
