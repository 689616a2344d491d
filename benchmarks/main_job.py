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

from .start_up import MAIN_JOB, SAND

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
        taken = []
        for name in ("first", "again"):
            words = [*SAND, "run", str(MAIN_JOB), "--out", str(top / name), "--quiet", "--threads", "1"]
            environment = os.environ | {"SAND_CACHE": str(top / "cache")}
            start = time.perf_counter()
            subprocess.run(words, env=environment, check=True, stderr=subprocess.DEVNULL)
            taken.append(time.perf_counter() - start)
        summary = json.loads((top / "again" / "summary.json").read_text("utf-8"))
        steps, contact_steps = summary["steps"], summary["rigid_clusters"]["contact_steps"]
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=TOP, capture_output=True, text=True)
    return {
        "seconds": round(taken[1], 1),
        "compilation": round(taken[0] - taken[1], 1),
        "steps": steps,
        "contact_steps": contact_steps,
        "processor": processor(),
        "commit": commit.stdout.strip(),
        "date": str(datetime.date.today()),
        "command": "python -m benchmarks --main-job",
    }


def sentence(measured: dict[str, Any]) -> str:
    """What README and docs say."""
    steps = f"{measured['steps']:,} steps of bodies and {measured['contact_steps']:,} contact steps"
    seconds = f"{measured['seconds']:.0f} s"
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
