"""Tables of numbers as CSV: whole ones, and ones that grow while a long job runs."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ..errors import BadInput, FilesFailed
from .run_folder import read_text, replace_file


def write_table(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """A header and a line per row, numbers to the last bit.  Raises FilesFailed."""
    out = io.StringIO()
    writer = csv.DictWriter(out, list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({k: repr(v) if isinstance(v, float) else v for k, v in row.items()})
    replace_file(path, out.getvalue().encode())


class GrowingTable:
    """Rows of numbers that are added piece by piece; a row that a kill tore in two is dropped when it is read again.

    Parameters
    ----------
    path : Path
        of the file; made anew unless `resume`.
    columns : Sequence[str]
        names.
    resume : bool, optional
        keep what is there.

    Raises
    ------
    BadInput
        the file has other columns, or is no table.
    FilesFailed
        it cannot be written.
    """

    def __init__(self, path: Path, columns: Sequence[str], *, resume: bool = False):
        self.path, self.columns = path, list(columns)
        head = ",".join(self.columns)
        lines: list[str] = []
        if resume and path.exists():
            text = read_text(path).split("\n")[:-1]
            if text and text[0] != head:
                raise BadInput(f"{path} does not have the columns of this job; give another folder")
            lines = [line for line in text[1:] if line.count(",") == head.count(",")]
        try:
            self.rows = [[float(part) for part in line.split(",")] for line in lines]
        except ValueError:
            raise BadInput(f"{path} holds something that is not a number; give another folder") from None
        replace_file(path, ("\n".join([head, *lines]) + "\n").encode())

    def add(self, rows: Iterable[Sequence[float]]) -> None:
        """Append them; whole numbers are written without a point.  Raises FilesFailed."""
        text = "".join(",".join(_told(value) for value in row) + "\n" for row in rows)
        try:
            with open(self.path, "a", encoding="utf-8", newline="") as file:
                file.write(text)
        except OSError as error:
            raise FilesFailed(f"cannot write {self.path}: {error.strerror}") from error

    def sort(self) -> None:
        """Put the lines into the order of their numbers, so that the file is the same however they came."""
        head, *lines = read_text(self.path).split("\n")[:-1]
        lines.sort(key=lambda line: [float(part) for part in line.split(",")])
        replace_file(self.path, ("\n".join([head, *lines]) + "\n").encode())


class GrowingOutcomes:
    """Outcomes of the parts of a job, one JSON object a line; a line that a kill tore in two is dropped.

    Parameters
    ----------
    path : Path
        of the file; made anew unless `resume`.
    case : dict[str, Any]
        what the outcomes are of, the first line of the file.
    resume : bool, optional
        keep what is there.

    Raises
    ------
    BadInput
        the file is no such list, or one of another case.
    FilesFailed
        it cannot be written.
    """

    def __init__(self, path: Path, case: dict[str, Any], *, resume: bool = False):
        self.path = path
        head = json.dumps({"case": case}, sort_keys=True)
        lines = read_text(path).split("\n")[:-1] if resume and path.exists() else []
        if lines and lines[0] != head:
            raise BadInput(f"{path} holds outcomes of another case; put the case back, or begin anew elsewhere")
        self.found: dict[int, dict[str, Any]] = {}
        for line in lines[1:]:
            try:
                entry = json.loads(line)
                self.found[int(entry["seed"])] = dict(entry["outcome"])
            except (ValueError, TypeError, KeyError, RecursionError):
                raise BadInput(f"{path} is not a list of outcomes; remove it, they are then computed again") from None
        replace_file(path, "".join(line + "\n" for line in [head, *lines[1:]]).encode())

    def add(self, seed: int, outcome: dict[str, Any]) -> None:
        """Keep one outcome; its numbers are read back to the last bit.  Raises FilesFailed."""
        try:
            with open(self.path, "a", encoding="utf-8", newline="") as file:
                file.write(json.dumps({"seed": seed, "outcome": outcome}) + "\n")
        except OSError as error:
            raise FilesFailed(f"cannot write {self.path}: {error.strerror}") from error


def _told(value: float) -> str:
    number = float(value)
    return str(int(number)) if number.is_integer() and abs(number) < 2**53 else repr(number)
