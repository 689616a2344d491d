"""Files of a run that the viewer reads besides the trajectory: the summary and the ledger."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..analysis.ledger_columns import LedgerColumns
from ..basics.errors import BadInput
from ..basics.paths import user_path
from ..io import run_folder as files
from ..io.ledger_table import read_rows

STALE_AFTER = 3600.0
"""Seconds without a new frame after which a run without summary is reported as possibly killed."""
PROBLEM = "problem"
"""Key of the error message that replaces an unreadable summary."""


def stale_note(age: float) -> str:
    """Note for an unfinished run whose last frame was written `age` seconds ago; empty for a recent frame."""
    if age < STALE_AFTER:
        return ""
    hours = age / 3600.0
    duration = f"{hours:.0f} h" if hours < 48.0 else f"{hours / 24.0:.0f} days"
    return f"no new frame for {duration}: the run may have been killed; sand resume continues it"


def find_run_folder(path: str | Path) -> Path | None:
    """Folder of the run at `path`: a run folder, or the trajectory.gsd in one; None for a trajectory without a run."""
    place = user_path(path)
    if place.is_dir():
        return place if (place / files.TRAJECTORY).exists() else None
    return place.parent if place.name == files.TRAJECTORY and (place.parent / files.CASE).exists() else None


def read_summary(folder: Path) -> Mapping[str, Any] | None:
    """Summary of a run; None before its end, and {PROBLEM: message} if the file cannot be read."""
    try:
        return files.read_json(folder / files.SUMMARY) if (folder / files.SUMMARY).exists() else None
    except BadInput as error:
        return {PROBLEM: str(error)}


class LedgerReader:
    """Ledger of a run folder, read again whenever the file has changed.

    Attributes
    ----------
    problem : str
        Message about missing or unreadable rows; empty if there is none.
    """

    def __init__(self, folder: Path):
        self._path, self.problem = folder / files.LEDGER, ""
        self._cache: tuple[tuple[int, int], LedgerColumns | None] = ((0, 0), None)

    def __call__(self) -> LedgerColumns | None:
        """Return the present ledger; None if there is none, or it cannot be read."""
        try:
            status = self._path.stat()
            stamp = (status.st_size, status.st_mtime_ns)
            if stamp != self._cache[0]:
                self._cache = (stamp, None)
                rows, self.problem = read_rows(self._path)
                self._cache = (stamp, LedgerColumns.from_rows(rows))
        except OSError:
            return None
        except BadInput as error:
            self.problem = str(error)
        return self._cache[1]
