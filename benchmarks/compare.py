"""``python -m benchmarks --compare REV``: the rows of another revision and of this working tree, measured in turns.

Each round runs ``python -m benchmarks --quick --json`` of both revisions, each with its own sources, in alternating
order and without peers.  The ratio of a row is this revision over the other one within a round.  The interval of the
median ratio is distribution-free: of n rounds it spans the order statistics k and n + 1 - k, where k is the largest
number for which the sign test leaves at least 95 %, that is, 2 sum_{i<k} C(n, i) / 2^n <= 0.05.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

TOP = Path(__file__).parents[1]
ROUNDS = 7
"""Rounds by default; at least 6 are needed for an interval of 95 %."""


def median_interval(ratios: Sequence[float], coverage: float = 0.95) -> tuple[float, float, float]:
    """Median of independent ratios and the distribution-free interval that covers it with at least `coverage`.

    Parameters
    ----------
    ratios : sequence of float
        One for each round.
    coverage : float, optional
        Probability, in (0, 1).

    Returns
    -------
    median, low, high : float
        The interval is infinite where there are too few rounds for the coverage.
    """
    ordered, n = np.sort(np.asarray(ratios, float)), len(ratios)
    tail, k = 0.0, 0
    while k < n // 2 and 2.0 * (tail + math.comb(n, k) / 2.0**n) <= 1.0 - coverage:
        tail += math.comb(n, k) / 2.0**n
        k += 1
    if k == 0:
        return float(np.median(ordered)), -math.inf, math.inf
    return float(np.median(ordered)), float(ordered[k - 1]), float(ordered[n - k])


def compare(revision: str, rounds: int) -> list[dict[str, Any]]:
    """Rows with the median ratio of this working tree to a revision, and its interval of 95 %.

    Parameters
    ----------
    revision : str
        Anything that git understands, or the folder of another working tree.
    rounds : int
        Runs of each of both.

    Returns
    -------
    list of dict
        `name`, `unit`, `before` and `now` (least of all rounds), `ratio`, `low`, `high`.
    """
    with tempfile.TemporaryDirectory() as folder:
        given = Path(revision)
        other = given.absolute() if given.is_dir() else Path(folder) / "before"
        if not given.is_dir():
            words = ["git", "-C", str(TOP), "worktree", "add", "--quiet", "--detach", str(other), revision]
            if subprocess.run(words, stdout=sys.stderr, check=False).returncode:
                raise SystemExit(f"--compare {revision}: neither a revision that git knows nor a folder")
        try:
            (Path(folder) / "lammps.py").write_text('raise ImportError("no peers here")\n', "utf-8")
            found: dict[str, list[dict[str, dict[str, Any]]]] = {"before": [], "now": []}
            for number in range(rounds):
                trees = {"before": other, "now": TOP}
                for name in list(trees)[:: 1 if number % 2 == 0 else -1]:
                    found[name].append(_rows(trees[name], Path(folder)))
                    print(f"round {number + 1} of {rounds}: {name}", file=sys.stderr, flush=True)
        finally:
            if not given.is_dir():
                subprocess.run(["git", "-C", str(TOP), "worktree", "remove", "--force", str(other)], stdout=sys.stderr)
    return _ratios(found["before"], found["now"])


def _rows(tree: Path, folder: Path) -> dict[str, dict[str, Any]]:
    """The rows of one run of a revision's own benchmarks, by name."""
    paths = [str(folder), str(tree / "src"), str(tree)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    words = [sys.executable, "-m", "benchmarks", "--quick", "--json"]
    done = subprocess.run(words, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"the benchmarks of {tree} failed:\n{done.stderr}")
    return {row["name"]: row for row in json.loads(done.stdout)["rows"]}


def _ratios(before: list[dict[str, dict[str, Any]]], now: list[dict[str, dict[str, Any]]]) -> list[dict[str, Any]]:
    alone = sorted(set(before[0]) ^ set(now[0]))
    if alone:
        print("not compared, in one revision only: " + "; ".join(alone), file=sys.stderr)
    rows = []
    for name in now[0]:
        pairs = [(b[name]["ours"], n[name]["ours"]) for b, n in zip(before, now, strict=True) if name in b]
        if not pairs:
            continue
        ratio, low, high = median_interval([n / b for b, n in pairs])
        least = {"before": min(b for b, _ in pairs), "now": min(n for _, n in pairs)}
        rows.append({"name": name, "unit": now[0][name]["unit"], **least, "ratio": ratio, "low": low, "high": high})
    return rows


def show(rows: list[dict[str, Any]], most: float = 1.05) -> None:
    """Print the rows; rows are marked that are slower (interval above 1), or may be slower than `most`."""
    print(f"{'what':44} {'before':>9} {'now':>9}  {'unit':16} {'ratio':>6}  95 % interval of the median")
    for row in rows:
        mark = "  SLOWER" if row["low"] > 1.0 else f"  MAY EXCEED {most:g}" if row["high"] > most else ""
        cost = f"{row['before']:9.3g} {row['now']:9.3g}  {row['unit']:16}"
        print(f"{row['name']:44} {cost} {row['ratio']:6.3f}  {row['low']:.3f} to {row['high']:.3f}{mark}")
