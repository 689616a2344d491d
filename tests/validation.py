"""Long checks behind ``--validate``: parts of them; and the record of numbers beside their bounds.

``--validate-part 3/10`` runs the fourth tenth of the long checks alone.  ``--record FILE`` writes the numbers that
tests compare with a bound by the fixture `record_bound` to a table: test, quantity, value, bounds, date and commit.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import math
import subprocess
import zlib
from pathlib import Path
from typing import Any

import pytest

TOP = Path(__file__).parents[1]
RECORD = TOP / "tests" / "reference" / "validation.csv"
"""The table in the repository."""
COLUMNS = ("test", "quantity", "value", "least", "most", "date", "commit")


def parse_part(text: str) -> tuple[int, int]:
    """'3/10' as (3, 10).  Raises argparse.ArgumentTypeError."""
    first, _, count = text.partition("/")
    if not (first.isdecimal() and count.isdecimal() and int(first) < int(count)):
        raise argparse.ArgumentTypeError(f"{text!r} must be K/N with 0 <= K < N, such as 3/10")
    return int(first), int(count)


def part_of(nodeid: str, part: tuple[int, int]) -> bool:
    """Whether a test belongs to part K of N; independent of the machine and of other tests."""
    return zlib.crc32(nodeid.encode()) % part[1] == part[0]


class BoundRecorder:
    """The fixture `record_bound` of one test: checks numbers, and keeps them for the table.

    `properties` is `user_properties` of the test, which pytest-xdist sends to the process that writes the table.
    """

    def __init__(self, properties: list[tuple[str, object]]):
        self._properties = properties

    def __call__(self, quantity: str, value: float, *, least: float = -math.inf, most: float = math.inf) -> None:
        """Check least ≤ value ≤ most; `quantity` says what it is, with its unit unless it is a plain number."""
        value, bounds = float(value), [float(least), float(most)]
        assert not all(map(math.isinf, bounds)), "give a bound"
        self._properties.append(("bound", [quantity, value, *bounds]))
        assert bounds[0] <= value <= bounds[1], f"{quantity} = {value:.6g} is not within {least:.6g} … {most:.6g}"


def read_record(path: Path) -> list[dict[str, str]]:
    """Rows of the table; none if there is no file."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def exists(test: str) -> bool:
    """Whether a test, by its name in the table, exists, or a file of tests."""
    file, _, name = test.partition("::")
    path = TOP / file
    return path.exists() and (not name or f"def {name.split('[')[0]}(" in path.read_text("utf-8"))


class Recorder:
    """Collects the numbers of all tests and writes the table at the end.

    Rows of tests that ran are replaced, those of tests that failed or no longer exist are removed, and others keep the
    date and commit of their own run.  Rows of a file say how many of its tests passed with ``--validate`` before there
    were numbers; they are removed when any test of the file runs.
    """

    def __init__(self, path: Path):
        self.path, self.ran, self.rows = path, set[str](), list[dict[str, str]]()

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Take the numbers of a test that ran."""
        if report.when != "call" or report.skipped:
            return
        self.ran |= {report.nodeid, report.nodeid.partition("::")[0]}
        now = {"date": str(datetime.date.today()), "commit": commit()}
        for name, content in report.user_properties if report.passed else ():
            if name == "bound":
                quantity, value, *bounds = content
                least, most = ("" if math.isinf(bound) else f"{bound:.4g}" for bound in bounds)
                row = {"test": report.nodeid, "quantity": quantity, "value": f"{value:.4g}", "least": least}
                self.rows.append(row | {"most": most} | now)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write the table."""
        kept = [row for row in read_record(self.path) if row["test"] not in self.ran and exists(row["test"])]
        with self.path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(sorted(kept + self.rows, key=lambda row: row["test"]))


def commit() -> str:
    """The present commit, with a + if files differ from it."""
    found = subprocess.run(
        ["git", "describe", "--always", "--exclude=*", "--dirty=+"], cwd=TOP, capture_output=True, text=True
    )
    return found.stdout.strip() or "unknown"
