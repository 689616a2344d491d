"""ledger.csv: one row per entry, written to the last bit, and checked when it is read."""

from __future__ import annotations

import hashlib
import math
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path

from ..errors import BadInput, FilesFailed
from .damage import set_aside
from .run_folder import LEDGER, SUMMARY, read_json, read_text, replace_file

ROUNDING = 1e-14
"""Difference of a total from the sum of its columns, as a part of the sum of their sizes, that is rounding."""
ROWS, ROWS_DIGEST = "ledger_rows", "ledger_sha256"
"""Keys of summary.json: how many rows ledger.csv has, and the digest of its text down to the last of them."""

Row = dict[str, float]


class LedgerFile:
    """ledger.csv: one row per entry, numbers to the last bit; opened anew for each row, so nothing is held.

    Parameters
    ----------
    path : Path
        of the file; what it held before is replaced.
    columns : Sequence[str]
        names, the first being `step`.
    rows : Iterable[Row], optional
        that it begins with.
    """

    def __init__(self, path: Path, columns: Sequence[str], rows: Iterable[Row] = ()):
        self.path, self.columns = path, list(columns)
        given = list(rows)
        text = _text(self.columns, given)
        replace_file(path, text)
        self._rows, self._digest = len(given), hashlib.sha256(text)

    def append(self, row: Row) -> None:
        """Raises FilesFailed."""
        line = _line(self.columns, row)
        try:
            with open(self.path, "ab") as file:
                file.write(line)
        except OSError as error:
            raise FilesFailed(f"cannot write {self.path}: {error.strerror}") from error
        self._rows += 1
        self._digest.update(line)

    def described(self) -> dict[str, int | str]:
        """Number of rows and digest of what was written, for summary.json."""
        return {ROWS: self._rows, ROWS_DIGEST: self._digest.hexdigest()}


def _line(columns: Sequence[str], row: Row) -> bytes:
    return (",".join(repr(row[name]) for name in columns) + "\n").encode()


def _text(columns: Sequence[str], rows: Iterable[Row]) -> bytes:
    return (",".join(columns) + "\n").encode() + b"".join(_line(columns, row) for row in rows)


def keep_if_damaged(path: Path, columns: Sequence[str], rows: Sequence[Row]) -> None:
    """Before a ledger is written anew from these rows: if it holds others, it is renamed, with a warning.

    A file that is missing, or has only some of the rows, or more of them, is no reason.

    Raises
    ------
    OSError
        it cannot be renamed.
    """
    if not path.exists():
        return
    right = _text(columns, rows)
    try:
        there = read_text(path).encode()
    except BadInput:
        there = b"\0\n"
    if there.startswith(right) or right.startswith(there[: there.rfind(b"\n") + 1]):
        return
    aside = set_aside(path)
    warnings.warn(
        f"{path} did not hold what the run had written; it is now {aside.name}, a new one is made", stacklevel=2
    )


def read_ledger(path: Path) -> list[Row]:
    """The rows of ledger.csv as numbers; a last one that a kill tore in two is left out.

    A warning is given where there are fewer rows than the run has written.

    Raises
    ------
    BadInput
        no ledger, or one whose numbers are not those that were written.
    """
    rows, note = read_rows(path)
    if note:
        warnings.warn(note, stacklevel=2)
    return rows


def read_rows(path: Path) -> tuple[list[Row], str]:
    """The same, and in place of a warning its text, empty where all rows are there."""
    lines = read_text(path).split("\n")[:-1]
    columns = lines[0].split(",") if lines else []
    if "step" not in columns or len(set(columns)) < len(columns):
        raise BadInput(f"{path} is not a ledger of SAND")
    rows = [_row(path, number, columns, line) for number, line in enumerate(lines[1:], 1)]
    for number, row in enumerate(rows, 1):
        if said := _wrong(row, rows[number - 2] if number > 1 else None, last=number == len(rows)):
            raise BadInput(f"{path} is damaged: row {number} {said}")
    return rows, _fewer(path, lines)


def _row(path: Path, number: int, columns: Sequence[str], line: str) -> Row:
    """One line as numbers.  Raises BadInput."""
    texts = line.split(",")
    if len(texts) != len(columns):
        raise BadInput(f"{path} is damaged: row {number} has {len(texts)} columns, not {len(columns)}")
    try:
        values = [int(text) if text.lstrip("-").isdecimal() else float(text) for text in texts]
    except ValueError:
        raise BadInput(f"{path} is damaged: row {number} holds something that is not a number") from None
    for name, text, value in zip(columns, texts, values, strict=True):
        if repr(value) != text:
            raise BadInput(f"{path} is damaged: row {number} has {name} = {text[:40]!r}, which no run writes like that")
    return dict(zip(columns, values, strict=True))


def _wrong(row: Row, before: Row | None, *, last: bool) -> str:
    """What is wrong with a row beside the one before it; nothing if it is right."""
    if not all(map(math.isfinite, row.values())):
        # the physics may stop a run because numbers are no longer finite: its last row says so
        return "" if last else "holds numbers that are not finite"
    if not isinstance(row["step"], int) or row["step"] < 0:
        return f"has step {row['step']}"
    if before is not None:
        if row["step"] <= before["step"] or row.get("time", 0.0) < before.get("time", 0.0):
            return f"is of step {row['step']}, after step {before['step']}: steps and times must grow"
        if strange := [name for name in row if type(row[name]) is not type(before[name])]:
            return f"has {strange[0]} = {row[strange[0]]!r}, the row before {before[strange[0]]!r}"
    names = list(row)
    if "total" in names and "time" in names:
        parts = [row[name] for name in names[names.index("time") + 1 : names.index("total")]]
        if abs(row["total"] - math.fsum(parts)) > ROUNDING * math.fsum(map(abs, parts)):
            return f"has total = {row['total']!r} J, but its columns add up to {math.fsum(parts)!r} J"
    return ""


def _fewer(path: Path, lines: Sequence[str]) -> str:
    """What is to be said of a ledger beside the summary of its run, if there is one that has ended.

    Raises
    ------
    BadInput
        its rows are not those that the summary's digest was taken of.
    """
    place = path.with_name(SUMMARY)
    if path.name != LEDGER or not place.exists():
        return ""
    try:
        summary = read_json(place)
    except BadInput:  # whoever asks for the summary is told
        return ""
    count, digest = summary.get(ROWS), summary.get(ROWS_DIGEST)
    if not isinstance(count, int) or digest is None:  # of an earlier version
        return ""
    if len(lines) - 1 < count:
        return f"{path} has {len(lines) - 1} of the {count} rows that the run had written"
    if hashlib.sha256(("\n".join(lines[: count + 1]) + "\n").encode()).hexdigest() != digest:
        raise BadInput(
            f"{path} is damaged: its numbers are not those that were written, as the digest in {SUMMARY} tells"
        )
    return ""
