"""Tables of numbers as CSV: written at once, or row by row while a long job runs."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import zlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..basics.errors import BadInput, warn
from .damage import DIGEST, digest_of, sealed
from .run_folder import append_text, read_text, replace_file


def write_table(path: Path, rows: Sequence[Mapping[str, Any]], names: Sequence[str] = ()) -> None:
    """Write a header, by default the names in the first row, and one line per row, numbers to full precision.

    Cells that rows lack are empty.  Raises FilesFailed.
    """
    out = io.StringIO()
    writer = csv.DictWriter(out, names or list(rows[0] if rows else ()), lineterminator="\n", restval="")
    writer.writeheader()
    writer.writerows(rows)
    replace_file(path, out.getvalue().encode())


def read_table(path: Path, needed: Iterable[str] = (), what: str = "a table") -> list[list[str]]:
    """Cells of all lines of a table, the first of which are the names of its columns.

    Raises
    ------
    BadInput
        If it lacks columns that are `needed`, of what is called `what`, or its lines differ in length.
    """
    lines = list(csv.reader(read_text(path).splitlines()))
    if not lines or not set(needed) <= set(lines[0]) or any(len(line) != len(lines[0]) for line in lines):
        raise BadInput(f"{path} is not {what}, or it is damaged")
    return lines


CHECK = "check"
"""Last column of a growing table: the CRC-32 of the text of the row before it."""


class GrowingTable:
    """A CSV table to which rows are appended, each with a check sum in a last column.

    Rows that are incomplete, as after a kill, or do not match their check sum are dropped on reading, the latter with a
    warning.

    Parameters
    ----------
    path : Path
        The file; replaced unless `resume`.
    columns : Sequence[str]
        Names of the columns.
    resume : bool, optional
        Whether existing rows are kept.
    most : int or None, optional
        Number of rows that are kept at most.

    Raises
    ------
    BadInput
        If the file has other columns, or is not a table.
    FilesFailed
        If it cannot be written.
    """

    def __init__(self, path: Path, columns: Sequence[str], *, resume: bool = False, most: int | None = None):
        self.path, self.columns = path, [*columns, CHECK]
        head = ",".join(self.columns)
        found = _lines(path, head, "does not have the columns of this job; give another folder") if resume else []
        found = found[:most]
        lines = [line for line in found if line == _checked(line.rpartition(",")[0])]
        self.rows = [[float(part) for part in line.split(",")[:-1]] for line in lines]
        _report_bad_rows(path, len(found) - len(lines))
        replace_file(path, ("\n".join([head, *lines]) + "\n").encode())

    def add(self, rows: Iterable[Sequence[float]]) -> None:
        """Append rows; integers are written without a decimal point.  Raises FilesFailed."""
        texts = (",".join(_shortest(value) for value in row) for row in rows)
        append_text(self.path, "".join(_checked(text) + "\n" for text in texts))

    def sort(self) -> None:
        """Sort the lines by their numbers, so that the file does not depend on the order of completion."""
        head, *lines = read_text(self.path).split("\n")[:-1]
        lines.sort(key=lambda line: [float(part) for part in line.split(",")])
        replace_file(self.path, ("\n".join([head, *lines]) + "\n").encode())


class GrowingOutcomes:
    """Outcomes of the parts of a job, one JSON object with its digest a line.

    Lines that are incomplete, as after a kill, or do not match their digest are dropped on reading, the latter with a
    warning.

    Parameters
    ----------
    path : Path
        The file; replaced unless `resume`.
    case : dict[str, Any]
        The case of the outcomes, written to the first line.
    resume : bool, optional
        Whether existing outcomes are kept.

    Raises
    ------
    BadInput
        If the file belongs to another case.
    FilesFailed
        If it cannot be written.
    """

    def __init__(self, path: Path, case: dict[str, Any], *, resume: bool = False):
        self.path = path
        head = json.dumps({"case": case}, sort_keys=True)
        problem = "holds outcomes of another case; restore the case, or use another folder"
        lines = _lines(path, head, problem) if resume else []
        self.found: dict[int, dict[str, Any]] = {}
        whole = []
        for line in lines:
            with contextlib.suppress(ValueError, TypeError, KeyError, RecursionError):
                entry = json.loads(line)
                if entry[DIGEST] == digest_of(entry):
                    self.found[int(entry["seed"])] = dict(entry["outcome"])
                    whole.append(line)
        _report_bad_rows(path, len(lines) - len(whole))
        replace_file(path, "".join(line + "\n" for line in [head, *whole]).encode())

    def add(self, seed: int, outcome: dict[str, Any]) -> None:
        """Append one outcome; its numbers are stored to full precision.  Raises FilesFailed."""
        self.found[seed] = outcome
        append_text(self.path, json.dumps(sealed({"seed": seed, "outcome": outcome})) + "\n")


def _checked(text: str) -> str:
    """A row with its check sum."""
    return f"{text},{zlib.crc32(text.encode())}"


def _report_bad_rows(path: Path, number: int) -> None:
    if number:
        rows = "1 row of it does" if number == 1 else f"{number} rows of it do"
        warn(f"{path} was changed or damaged: {rows} not match the check sum, and what they held is computed again")


def _lines(path: Path, head: str, problem: str) -> list[str]:
    """Complete lines of a file after its first one, `head`; none without a file.  Raises BadInput with `problem`."""
    lines = read_text(path, errors="replace").split("\n")[:-1] if path.exists() else []
    if lines and lines[0] != head:
        raise BadInput(f"{path} {problem}")
    return lines[1:]


def _shortest(value: float) -> str:
    number = float(value)
    return str(int(number)) if number.is_integer() and abs(number) < 2**53 else repr(number)
