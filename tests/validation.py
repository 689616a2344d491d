"""Long checks behind ``--validate``: parts of them; and the record of numbers beside their bounds.

``--validate-part 3/10`` runs the fourth tenth of the long checks alone.  ``--record FILE`` writes the numbers that
tests compare with a bound by the fixture `record_bound` to a table: test, quantity, value, bounds, date and commit.
Without it a number that the table in the repository has not, or with other bounds, fails its test.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import functools
import math
import subprocess
import zlib
from pathlib import Path
from typing import Any

import pytest

from .claims import RECORD, TOP, rows_of

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


def without_group(nodeid: str) -> str:
    """The name of a test without "@group", which pytest-xdist adds."""
    head, bracket, tail = nodeid.rpartition("]")
    return head + bracket + tail.partition("@")[0]


class BoundRecorder:
    """The fixture `record_bound` of one test: checks numbers, and keeps them for the table.

    `properties` is `user_properties` of the test, which pytest-xdist sends to the process that writes the table.
    `recorded` has the quantities that the table must have, with their bounds as it has them, or is None.
    """

    def __init__(self, properties: list[tuple[str, object]], recorded: set[tuple[str, str, str]] | None = None):
        self._properties, self._recorded = properties, recorded

    def __call__(self, quantity: str, value: float, *, least: float = -math.inf, most: float = math.inf) -> None:
        """Check least ≤ value ≤ most; `quantity` says what it is, with its unit unless it is a plain number."""
        value, bounds = float(value), [float(least), float(most)]
        assert not all(map(math.isinf, bounds)), "give a bound"
        self._properties.append(("bound", [quantity, value, *bounds]))
        assert bounds[0] <= value <= bounds[1], f"{quantity} = {value:.6g} is not within {least:.6g} … {most:.6g}"
        known = self._recorded is None or (quantity, *map(written, bounds)) in self._recorded
        assert known, f"{RECORD.name} lacks '{quantity}' with these bounds: run this test with --record {RECORD}"


def written(number: float) -> str:
    """A number as the table has it; an infinite bound is empty."""
    return "" if math.isinf(number) else f"{number:.6g}"


@functools.cache
def recorded() -> dict[str, set[tuple[str, str, str]]]:
    """Quantities of the table with their bounds, by test without its case."""
    found: dict[str, set[tuple[str, str, str]]] = {}
    for row in rows_of(RECORD):
        found.setdefault(row["test"].partition("[")[0], set()).add((row["quantity"], row["least"], row["most"]))
    return found


def exists(test: str) -> bool:
    """Whether a test, by its name in the table, exists."""
    file, _, name = test.partition("::")
    return (TOP / file).exists() and f"def {name.partition('[')[0]}(" in (TOP / file).read_text("utf-8")


class Recorder:
    """Collects the numbers of all tests and writes the table at the end.

    Rows of tests that ran are replaced, those of tests that failed are removed, as those of tests and cases that no
    longer exist, and others keep the date and commit of their own run.  `cases` has the names of all cases of the tests
    in the files that were collected, also of those that did not run.
    """

    def __init__(self, path: Path):
        self.path, self.ran, self.rows = path, set[str](), list[dict[str, str]]()
        self.cases = set[str]()

    def is_gone(self, test: str) -> bool:
        """Whether there is no such test, or no such case of it among those that were collected."""
        known = test.partition("[")[0] in {case.partition("[")[0] for case in self.cases}
        return not exists(test) or (known and test not in self.cases)

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Take the numbers of a test that ran."""
        if report.when != "call" or report.skipped:
            return
        self.ran.add(without_group(report.nodeid))
        now = {"date": str(datetime.date.today()), "commit": commit()}
        for name, content in report.user_properties if report.passed else ():
            if name == "bound":
                quantity, *values = content
                row = dict(zip(("value", "least", "most"), map(written, values), strict=True))
                self.rows.append({"test": without_group(report.nodeid), "quantity": quantity} | row | now)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write the table."""
        kept = [row for row in rows_of(self.path) if row["test"] not in self.ran and not self.is_gone(row["test"])]
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
