"""Long checks behind ``--validate``: parts of them, and the record of the last complete run.

``pytest --validate --record`` writes ``tests/validated.md`` if every test passed; ``--validate-part 3/10`` runs the
fourth tenth of the long checks alone.
"""

from __future__ import annotations

import argparse
import datetime
import platform
import subprocess
import zlib
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

RECORD = Path(__file__).with_name("validated.md")


def parse_part(text: str) -> tuple[int, int]:
    """'3/10' as (3, 10).  Raises argparse.ArgumentTypeError."""
    first, _, count = text.partition("/")
    if not (first.isdecimal() and count.isdecimal() and int(first) < int(count)):
        raise argparse.ArgumentTypeError(f"{text!r} must be K/N with 0 <= K < N, such as 3/10")
    return int(first), int(count)


def part_of(nodeid: str, part: tuple[int, int]) -> bool:
    """Whether a test belongs to part K of N; independent of the machine and of other tests."""
    return zlib.crc32(nodeid.encode()) % part[1] == part[0]


class Recorder:
    """Adds up the time of each test file and writes the record when all tests have passed."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self.tests: Counter[str] = Counter()

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Add one phase of one test."""
        file = report.nodeid.split("::")[0]
        self.seconds[file] += report.duration
        self.tests[file] += report.when == "call"

    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        """Write the record."""
        if exitstatus == 0:
            RECORD.write_text(self.table(), encoding="utf-8")

    def table(self) -> str:
        """The record as Markdown."""
        top = Path(__file__).parents[1]
        commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=top, capture_output=True, text=True)
        machine = f"Python {platform.python_version()}, {platform.machine()}"
        lines = [
            "# Last green run of all tests with `--validate`",
            "",
            f"Commit {commit.stdout.strip() or 'unknown'}, {datetime.date.today()}, {machine}. "
            "Made by `pytest -n 2 --validate --record`.",
            "",
            "| file | tests | seconds |",
            "|---|---|---|",
        ]
        lines += [f"| {file} | {self.tests[file]} | {self.seconds[file]:.0f} |" for file in sorted(self.seconds)]
        lines.append(f"| all (summed over workers) | {self.tests.total()} | {self.seconds.total():.0f} |")
        return "\n".join(lines) + "\n"
