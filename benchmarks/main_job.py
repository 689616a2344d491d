"""The time of the main job as README and docs quote it.

`python -m benchmarks --main-job` runs examples/iron-gas.toml by the command line, with an empty cache and with a full
one, and writes docs/main-job.json. The pages of the docs take the sentence from there; README has a copy, and
tests/unit/test_benchmarks.py compares the two.
"""

from __future__ import annotations

import datetime
import json
import os
import platform
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from .start_up import CASE, MAIN_JOB, SAND, begin

TOP = Path(__file__).parents[1]
FILE = TOP / "docs" / "main-job.json"


def processor() -> str:
    """Name of the processor, as the system gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def measure() -> dict[str, Any]:
    """Wall time [s] of the whole command, compiled before, and what compilation adds to the first run."""
    with tempfile.TemporaryDirectory() as place:
        top = Path(place)
        case, cache = top / "tiny.toml", top / "cache"
        case.write_text(CASE, "utf-8")
        first = begin(case, top / "first", cache)
        again = begin(case, top / "again", cache)
        words = [*SAND, "run", str(MAIN_JOB), "--out", str(top / "main"), "--quiet", "--threads", "1"]
        start = time.perf_counter()
        subprocess.run(words, env=os.environ | {"SAND_CACHE": str(cache)}, check=True, stderr=subprocess.DEVNULL)
        seconds = time.perf_counter() - start
        steps = json.loads((top / "main" / "summary.json").read_text("utf-8"))["steps"]
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=TOP, capture_output=True, text=True)
    return {
        "seconds": round(seconds, 1),
        "compilation": round(first - again, 1),
        "steps": steps,
        "processor": processor(),
        "commit": commit.stdout.strip(),
        "date": str(datetime.date.today()),
        "command": "python -m benchmarks --main-job",
    }


def sentence(measured: dict[str, Any]) -> str:
    """What README and docs say."""
    steps, seconds = f"{measured['steps'] / 1e6:.1f} million steps", f"{measured['seconds']:.0f} s"
    return (
        f"{steps} take {seconds} on one core ({measured['processor']}), "
        f"and compilation {measured['compilation']:.0f} s more before the first run"
    )


def write() -> str:
    """Measure, write docs/main-job.json, and return the sentence."""
    measured = measure()
    measured["sentence"] = sentence(measured)
    FILE.write_text(json.dumps(measured, indent=2) + "\n", encoding="utf-8")
    return str(measured["sentence"])
