"""What docs/validation.md claims, read from the sources of the tests, the recorded numbers and the figures of papers.

A test with the mark ``validates(tier, claim)`` shows a claim; its numbers are the rows of `validation.csv` that
`record_bound` wrote.  A campaign of ``sand reproduce`` is a row of `campaigns.csv`; its numbers are in the comparison
that comes with SAND.  Nothing here imports pytest or SAND, so that the docs are built without the tests.
"""

from __future__ import annotations

import ast
import csv
import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

TOP = Path(__file__).parents[1]
RECORD = TOP / "tests" / "reference" / "validation.csv"
"""Numbers of tests beside their bounds."""
CAMPAIGNS = TOP / "tests" / "reference" / "campaigns.csv"
"""Campaigns of ``sand reproduce``: tier, claim, date of the last run, and digest of the table of runs."""
PAPERS = TOP / "examples" / "papers"
TIERS = ("closed form", "other program", "experiment", "published figure", "self-consistency")


class Claim(NamedTuple):
    """What a test shows."""

    tier: str
    text: str
    test: str  # tests/FOLDER/FILE.py::FUNCTION
    differs: str  # the reason why the result is not that of the literature; empty if it is


class Number(NamedTuple):
    """Recorded values of one quantity of a test, of all its cases with the same bounds."""

    quantity: str
    values: tuple[float, ...]
    least: str
    most: str
    date: str  # of the oldest
    commit: str


class Comparison(NamedTuple):
    """One number of a paper beside that of a campaign."""

    what: str
    paper: str
    ours: str
    verdict: str

    @property
    def kind(self) -> str:
        """ "agrees", "differs", "undecided", or "" where nothing is compared."""
        if not self.verdict:
            return ""
        if self.verdict.startswith("not decided"):
            return "undecided"
        return "agrees" if re.match(r"agrees|\S+ \(\S+\): within \d+%$", self.verdict) else "differs"


class Campaign(NamedTuple):
    """A figure of a paper that ``sand reproduce`` computes, with its comparison."""

    name: str
    tier: str
    claim: str
    date: str
    digest: str
    lines: tuple[Comparison, ...]


def rows_of(path: Path) -> list[dict[str, str]]:
    """Rows of a table; none if there is no file."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def claims_in(path: Path) -> Iterator[Claim]:
    """Claims of the test functions of one file, whose marks have only literal arguments."""
    text = path.read_text("utf-8")
    for node in ast.parse(text).body if "pytest.mark.validates(" in text else ():
        if not isinstance(node, ast.FunctionDef):
            continue
        for mark in node.decorator_list:
            if isinstance(mark, ast.Call) and ast.unparse(mark.func) == "pytest.mark.validates":
                tier, text = (ast.literal_eval(argument) for argument in mark.args)
                options = {one.arg: ast.literal_eval(one.value) for one in mark.keywords}
                name = path.relative_to(TOP).as_posix() if path.is_relative_to(TOP) else path.name
                yield Claim(tier, text, f"{name}::{node.name}", **({"differs": ""} | options))


def claims() -> list[Claim]:
    """Claims of all tests, in the order of the files."""
    return [claim for path in sorted((TOP / "tests").rglob("test_*.py")) for claim in claims_in(path)]


def numbers() -> dict[str, list[Number]]:
    """Recorded numbers by test function; cases with the same quantity and bounds are together."""
    found: dict[str, dict[tuple[str, str, str], list[dict[str, str]]]] = {}
    for row in rows_of(RECORD):
        test, _, case = row["test"].partition("[")
        quantity = row["quantity"].removeprefix(f"{case.rstrip(']')}: ")
        found.setdefault(test, {}).setdefault((quantity, row["least"], row["most"]), []).append(row)
    return {test: [_number(key, rows) for key, rows in groups.items()] for test, groups in found.items()}


def _number(key: tuple[str, str, str], rows: list[dict[str, str]]) -> Number:
    oldest = min(rows, key=lambda row: row["date"])
    return Number(key[0], tuple(float(row["value"]) for row in rows), *key[1:], oldest["date"], oldest["commit"])


def campaigns() -> list[Campaign]:
    """All campaigns."""
    return [
        Campaign(**row, lines=tuple(Comparison(**line) for line in rows_of(PAPERS / row["name"] / "comparison.csv")))
        for row in rows_of(CAMPAIGNS)
    ]


def digest_of(name: str) -> str:
    """Beginning of the SHA-256 of the table of runs of a campaign."""
    return hashlib.sha256((PAPERS / name / "sweep.csv").read_bytes().replace(b"\r\n", b"\n")).hexdigest()[:12]
