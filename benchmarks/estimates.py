"""What `sand info` expects of each example and template beside what the run takes: benchmarks/estimates.csv.

`python -m benchmarks --estimates` runs every case in a process of its own with a full cache of code, shortened to an
end that takes some seconds, and counts its CPU time: machines are shared.  The estimate is that of the shortened case,
once with an empty table of speeds (`first`), and once after a run of a tenth of its time (`after a short run`), or
after one collision.  Flights are not recorded.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import tomli_w

from sand.compiler.jit import cache_folder
from sand.config.commands import command_for
from sand.experiments.templates import TEMPLATES

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
    "growth-coasting": 0.2,
    "growth-in-gas": 0.2,
    "growth-plain": 0.15,
    "logarithmic-frames": 0.02,
    "one-cluster": 0.02,
    "rotating-field": 0.2,
    "silica-gas": 0.1,
    "template-grow": 0.3,
    "template-run": 0.5,
}
"""Part of the planned time that is run; all of it where no part is given."""
LOADING = 2.0
"""Longest time [s] in which compiled code is loaded; a run that spends more compiles some."""
SHORT = 0.1
"""Part of that time of the short run from which the second estimate has its speeds."""
FEW = {
    "figure3": ("measure", "per_cell", 4),
    "collision": ("impact", "seeds", [1]),
    "compression": ("compression", "to", 0.1),
    "growth-coasting": ("run", "seed", 1),
    "growth-in-gas": ("run", "seed", 1),
    "template-grow": ("grow", "seeds", [1]),
}
"""Other keys that are set, to shorten a job and to determine it: table, key, value."""
COLUMNS = (
    *("case", "time", "steps expected", "steps", "contact steps expected", "contact steps"),
    *("CPU s first", "CPU s after a short run", "CPU s", "ratio first", "ratio after", "miss"),
)


def cases(folder: Path) -> list[Path]:
    """Shortened case files of all examples, and the templates."""
    templates = [folder / f"template-{command}.toml" for command in sorted(TEMPLATES.keys() - {"sweep"})]
    for path in templates:
        _call("new", str(path), "--for", path.stem.removeprefix("template-"))
    found = []
    for path in [*sorted((TOP / "examples").glob("*.toml")), *templates]:
        content = tomllib.loads(path.read_text("utf-8"))
        if path.stem in FEW:
            table, key, value = FEW[path.stem]
            content[table][key] = value
        found.append(_written(folder / path.name, _shortened(content, SHARE.get(path.stem, 1.0))))
    return found


def _shortened(content: dict[str, Any], share: float) -> dict[str, Any]:
    """A case that ends after a part of its time, if it is one of a run that ends at a time."""
    if "until" not in content.get("run", {}):
        return content
    number, unit = content["run"]["until"].split()
    return content | {"run": content["run"] | {"until": f"{float(number) * share:g} {unit}"}}


def _written(path: Path, content: dict[str, Any]) -> Path:
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    return path


def measure(path: Path) -> dict[str, Any]:
    """Expected and measured steps and CPU time of one case."""
    content, folder = tomllib.loads(path.read_text("utf-8")), path.with_suffix("")
    verb = command_for(content) or "run"
    short = _written(path.with_name(f"{path.stem}-short.toml"), _shortened(content, SHORT))
    speeds = path.parent / "cache" / "step-speeds.json"

    def run(case: Path) -> float:
        """CPU time [s] of a case."""
        shutil.rmtree(folder, ignore_errors=True)
        before = _cpu_seconds()
        _call(verb, str(case), "--out", str(folder), "--json")
        return _cpu_seconds() - before

    run(short)  # compiles most of what is not compiled yet
    after = _expected(path) if verb == "collide" else {}
    speeds.unlink(missing_ok=True)
    first = _expected(path)
    if verb in ("run", "grow"):
        run(short)
        after = _expected(path)
    seconds, told = run(path), _summary(folder)
    if told.get("wall_compilation", 0.0) > LOADING:  # something is compiled by what happens later
        seconds = run(path)
    ratios = [one["seconds"] / seconds if one else None for one in (first, after)]
    bound = first.get("bound", "")
    return {
        "case": path.stem,
        "time": told.get("time", ""),
        "steps expected": _rounded(first.get("steps")),
        "steps": told.get("steps", ""),
        "contact steps expected": _rounded(first.get("contact_steps")),
        "contact steps": told.get("rigid_clusters", {}).get("contact_steps", ""),
        "CPU s first": _rounded(first["seconds"]),
        "CPU s after a short run": _rounded(after.get("seconds")),
        "CPU s": _rounded(seconds),
        "ratio first": _rounded(ratios[0]),
        "ratio after": _rounded(ratios[1]),
        "miss": "MISSED" if any(_misses(ratio, bound) for ratio in ratios) else bound,
    }


def _summary(folder: Path) -> dict[str, Any]:
    """The summary of a run, or of the first box; empty for other jobs."""
    found = [*folder.glob("summary.json"), *folder.glob("seed-*/summary.json")]
    return json.loads(found[0].read_text("utf-8")) if found else {}


def _misses(ratio: float | None, bound: str) -> bool:
    """Whether an estimate is off by more than the factor; an upper bound may be too long."""
    return ratio is not None and (ratio < 1.0 / FACTOR or (ratio > FACTOR and not bound))


def _cpu_seconds() -> float:
    """CPU time of all processes that this one has started, and these, as far as they have ended."""
    import resource  # Windows has none

    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


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
        if cache_folder().is_dir():
            shutil.copytree(cache_folder(), folder / "cache" / cache_folder().name)
        os.environ["SAND_CACHE"] = str(folder / "cache")
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        for path in cases(folder):
            table.writerow(measure(path))
            file.flush()
    return FILE.read_text("utf-8")
