"""What `sand info` expects of each example and template beside what the run takes: benchmarks/estimates.csv.

`python -m benchmarks --estimates` runs every case in a process of its own with a full cache of code, shortened to an
end that takes some seconds, and counts its CPU time: machines are shared.  The estimate is that of the shortened case,
once with an empty table of speeds (`first`), and once after a run of 17 steps (`after a tiny run`).
"""

from __future__ import annotations

import csv
import json
import os
import subprocess
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import tomli_w

from .start_up import SAND

TOP = Path(__file__).parents[1]
FILE = Path(__file__).parent / "estimates.csv"
FACTOR = 3.0
"""Largest ratio of expectation and truth that is no miss."""
SHARE = {
    "aggregate-gas": 0.05,
    "charged-mixture": 0.03,
    "dilute-gas": 0.03,
    "field-off": 0.1,
    "growth": 0.01,
    "growth-plain": 0.15,
    "logarithmic-frames": 0.02,
    "one-cluster": 0.02,
    "rotating-field": 0.2,
    "silica-gas": 0.1,
    "template": 0.5,
}
"""Part of the planned time that is run; all of it where no part is given."""
FEW = {"figure3": ("measure", "per_cell", 4), "collision": ("impact", "seeds", [1])}
"""Other keys that are changed to shorten a job: table, key, value."""
COLUMNS = (
    *("case", "time", "steps expected", "steps", "contact steps expected", "contact steps"),
    *("CPU s first", "CPU s after a tiny run", "CPU s", "ratio first", "ratio after", "miss"),
)


def cases(folder: Path) -> list[Path]:
    """Shortened case files of all examples, and the template."""
    _call("new", str(folder / "template.toml"))
    found = []
    for path in [*sorted((TOP / "examples").glob("*.toml")), folder / "template.toml"]:
        content = tomllib.loads(path.read_text("utf-8"))
        if path.stem in SHARE:
            number, unit = content["run"]["until"].split()
            content["run"]["until"] = f"{float(number) * SHARE[path.stem]:g} {unit}"
        if path.stem in FEW:
            table, key, value = FEW[path.stem]
            content[table][key] = value
        found.append(_written(folder / path.name, content))
    return found


def _written(path: Path, content: dict[str, Any]) -> Path:
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    return path


def measure(path: Path) -> dict[str, Any]:
    """Expected and measured steps and CPU time of one case."""
    content, folder = tomllib.loads(path.read_text("utf-8")), path.with_suffix("")
    verb = "collide" if "impact" in content else "scatter" if "flight" in content else "run"
    speeds = path.parent / "cache" / "step-speeds.json"
    speeds.unlink(missing_ok=True)
    first = after = _expected(path)
    if verb == "run":
        ends = {key: value for key, value in content["run"].items() if key not in ("until", "stop")} | {"steps": 17}
        tiny = _written(path.with_name(f"{path.stem}-tiny.toml"), content | {"run": ends})
        _call("run", str(tiny), "--out", f"{folder}-tiny", "--quiet")
        after = _expected(path)
    words = [verb, str(path), "--out", str(folder), "--json"]
    _call(*words)  # compiles what is not compiled yet
    import resource  # Windows has none

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    _call(*words, "--overwrite")
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = spent.ru_utime + spent.ru_stime - before.ru_utime - before.ru_stime
    summary = folder / "summary.json"
    told = json.loads(summary.read_text("utf-8")) if summary.exists() else {}
    ratios = [one["seconds"] / seconds for one in (first, after)]
    return {
        "case": path.stem,
        "time": told.get("time", ""),
        "steps expected": _rounded(first.get("steps")),
        "steps": told.get("steps", ""),
        "contact steps expected": _rounded(first.get("contact_steps")),
        "contact steps": told.get("rigid_clusters", {}).get("contact_steps", ""),
        "CPU s first": _rounded(first["seconds"]),
        "CPU s after a tiny run": _rounded(after["seconds"]),
        "CPU s": _rounded(seconds),
        "ratio first": _rounded(ratios[0]),
        "ratio after": _rounded(ratios[1]),
        "miss": first.get("bound", "") or ("" if all(1.0 / FACTOR <= r <= FACTOR for r in ratios) else "MISSED"),
    }


def _rounded(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def _expected(path: Path) -> dict[str, Any]:
    told: dict[str, Any] = json.loads(_call("info", str(path), "--json"))["cost"]
    return told


def _call(*words: str) -> str:
    done = subprocess.run([*SAND, *words], check=True, capture_output=True, text=True, env=os.environ)
    return done.stdout


def write() -> str:
    """Measure all cases, write the table row by row, and return it as text."""
    with tempfile.TemporaryDirectory() as place, FILE.open("w", encoding="utf-8", newline="") as file:
        folder = Path(place)
        os.environ["SAND_CACHE"] = str(folder / "cache")
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        for path in cases(folder):
            table.writerow(measure(path))
            file.flush()
    return FILE.read_text("utf-8")
