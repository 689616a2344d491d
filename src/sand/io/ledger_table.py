"""ledger.csv: one row per entry, written to full precision and checked on reading."""

from __future__ import annotations

import hashlib
import io
import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from ..basics.errors import BadInput, FilesFailed, warn
from .damage import set_aside
from .run_folder import LEDGER, SUMMARY, read_json, read_text, replace_file

ROUNDING = 1e-14
"""Difference between a total and the sum of its columns, relative to the sum of their magnitudes, due to rounding."""
TEMPERATURES = ("temperature_translation", "temperature_rotation", "temperature_rotation_median")
"""Columns of the temperatures of bodies [K], clusters and single grains alike; also keys of summary.json."""
ROWS, ROWS_DIGEST = "ledger_rows", "ledger_sha256"
"""Keys of summary.json: number of rows of ledger.csv, and the digest of its text up to the last of them."""

Row = dict[str, float]


class LedgerFile:
    """Writer of ledger.csv: one row per entry, numbers to full precision.

    The file stays open until `close`, between rows too; each row is handed to the system at once.

    Parameters
    ----------
    path : Path
        The file; replaced if it exists.
    columns : Sequence[str]
        Names of the columns, the first being `step`.
    rows : Iterable[dict[str, float]], optional
        Initial rows.
    """

    def __init__(self, path: Path, columns: Sequence[str], rows: Iterable[Row] = ()):
        self.path, self.columns = path, list(columns)
        given = list(rows)
        text = _text(self.columns, given)
        replace_file(path, text.encode())
        self._rows, self._digest = len(given), hashlib.sha256(text.encode())
        self._file: io.FileIO | None = None

    def append(self, row: Row) -> None:
        """Append a row.  Raises FilesFailed."""
        line = _line(self.columns, row).encode()
        try:
            if self._file is None:
                self._file = io.FileIO(self.path, "ab")
            rest = line
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self.close()
            raise FilesFailed(f"cannot write {self.path}: {error.strerror}") from error
        self._rows += 1
        self._digest.update(line)

    def close(self) -> None:
        """Close the file, so that Windows can move or remove it; the next row opens it again."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def described(self) -> dict[str, int | str]:
        """Number of rows and digest of the text written, for summary.json."""
        return {ROWS: self._rows, ROWS_DIGEST: self._digest.hexdigest()}


def _line(columns: Sequence[str], row: Row) -> str:
    return ",".join(map(repr, map(row.__getitem__, columns))) + "\n"


def _text(columns: Sequence[str], rows: Iterable[Row]) -> str:
    return ",".join(columns) + "\n" + "".join(_line(columns, row) for row in rows)


def keep_if_damaged(
    path: Path, columns: Sequence[str], rows: Sequence[Row], report: Callable[[str], None] = warn
) -> None:
    """Rename a ledger that holds rows other than `rows` before it is rewritten from `rows`; `report` gets the warning.

    A missing file is accepted, and so is one with only some of the rows, or with further ones.

    Raises
    ------
    OSError
        If it cannot be renamed.
    """
    if not path.exists():
        return
    expected = _text(columns, rows)
    try:
        found = read_text(path)
    except BadInput:
        found = "\0\n"
    if found.startswith(expected) or expected.startswith(found[: found.rfind("\n") + 1]):
        return
    aside = set_aside(path)
    report(f"{path} did not hold what the run had written; it is now {aside.name}, replaced by a new one")


def read_ledger(path: Path) -> list[Row]:
    """Read the rows of ledger.csv; an incomplete last row, left by a kill, is dropped.

    A warning is issued if there are fewer rows than the run has written.

    Raises
    ------
    BadInput
        If there is no ledger, or its numbers have been changed.
    """
    rows, note = read_rows(path)
    if note:
        warnings.warn(note, stacklevel=2)
    return rows


def read_rows(path: Path) -> tuple[list[Row], str]:
    """As `read_ledger`, but returns the text of the warning, empty where all rows exist."""
    lines = read_text(path).split("\n")[:-1]
    columns = lines[0].split(",") if lines else []
    if "step" not in columns or len(set(columns)) < len(columns):
        raise BadInput(f"{path} is not a ledger of SAND")
    rows = [_row(path, number, columns, line) for number, line in enumerate(lines[1:], 1)]
    for number, row in enumerate(rows, 1):
        if message := _row_error(row, rows[number - 2] if number > 1 else None, last=number == len(rows)):
            raise BadInput(f"{path} is damaged: row {number} {message}")
    return rows, _missing_rows(path, lines)


def _row(path: Path, number: int, columns: Sequence[str], line: str) -> Row:
    """Convert one line to numbers.  Raises BadInput."""
    texts = line.split(",")
    if len(texts) != len(columns):
        raise BadInput(f"{path} is damaged: row {number} has {len(texts)} columns, not {len(columns)}")
    try:
        values = [int(text) if text.lstrip("-").isdecimal() else float(text) for text in texts]
    except ValueError:
        raise BadInput(f"{path} is damaged: row {number} holds something that is not a number") from None
    return dict(zip(columns, values, strict=True))


def _row_error(row: Row, before: Row | None, *, last: bool) -> str:
    """What is wrong with a row, given the row before it; empty if nothing is."""
    if not all(map(math.isfinite, row.values())):
        # a run may have been stopped because numbers are no longer finite, which its last row shows
        return "" if last else "holds numbers that are not finite"
    if not isinstance(row["step"], int) or row["step"] < 0:
        return f"has step {row['step']}"
    if before is not None:
        step, time = row["step"] - before["step"], row.get("time", 0.0) - before.get("time", 0.0)
        if step < 0.0 or time < 0.0 or step == time == 0.0:
            return f"is of step {row['step']}, after step {before['step']}: steps and times must grow"
    names = list(row)
    if "total" in names and "time" in names:
        parts = [row[name] for name in names[names.index("time") + 1 : names.index("total")]]
        if abs(row["total"] - math.fsum(parts)) > ROUNDING * math.fsum(map(abs, parts)):
            return f"has total = {row['total']!r} J, but its columns add up to {math.fsum(parts)!r} J"
    return ""


def _missing_rows(path: Path, lines: Sequence[str]) -> str:
    """Warning if a ledger has fewer rows than the summary of its run states; empty if not, or if the run has not ended.

    Raises
    ------
    BadInput
        If the digest in the summary does not match the rows.
    """
    summary_file = path.with_name(SUMMARY)
    if path.name != LEDGER or not summary_file.exists():
        return ""
    try:
        summary = read_json(summary_file)
    except BadInput:  # reported when the summary itself is read
        return ""
    count, digest = summary.get(ROWS), summary.get(ROWS_DIGEST)
    if not isinstance(count, int) or digest is None:
        return ""
    if len(lines) - 1 < count:
        return f"{path} has {len(lines) - 1} of the {count} rows that the run had written"
    if hashlib.sha256(("\n".join(lines[: count + 1]) + "\n").encode()).hexdigest() != digest:
        raise BadInput(f"{path} is damaged: its numbers do not match the digest in {SUMMARY}")
    return ""
