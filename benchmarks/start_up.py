"""Rows of what happens before the first step, and of the main job as a whole."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sand.config.build import simulation_of
from sand.config.case import read_case

from .table import row
from .timing import of_command, thread

SAND = [sys.executable, "-m", "sand.cli.main"]
CASE = """
[run]
until = "1 ps"
[box]
periodic = "1.2 um"
[grains]
number = 100
radius = "10 nm"
moment = "200 A m^2/kg"
temperature = "100 K"
[forces.contact]
[forces.dipoles]
"""
BEGIN = """
import sys, time
from sand.cli.main import main
from sand.engine.engine import Engine
begin = Engine.begin
def told(self):
    begin(self)
    print("began", time.process_time(), flush=True)
Engine.begin = told
main(sys.argv[1:])
"""
"""`sand` with the words that follow; tells the CPU time used until the driver has come back for the first time."""
MAIN_JOB = Path(__file__).parents[1] / "examples" / "iron-gas.toml"
UNTIL = 5e-6
"""Seconds of the main job."""


def begin(case: Path, out: Path, cache: Path) -> float:
    """CPU seconds from the start of `sand run` until the first loads are there."""
    words = [sys.executable, "-c", BEGIN, "run", str(case), "--out", str(out)]
    env = os.environ | {"SAND_CACHE": str(cache)}
    done = subprocess.run(words, env=env, capture_output=True, text=True, check=True)
    return next(float(line.split()[1]) for line in done.stdout.splitlines() if line.startswith("began"))


def commands() -> Iterator[dict[str, Any]]:
    """`sand --help`, `sand info`, and `sand run` with an empty cache and with a full one: CPU time."""
    with tempfile.TemporaryDirectory() as place:
        top = Path(place)
        case, cache = top / "tiny.toml", top / "cache"
        case.write_text(CASE, "utf-8")
        yield row("sand --help", of_command([*SAND, "--help"]), "s", 0.3)
        first = begin(case, top / "run", cache)
        yield row("sand info DIR", of_command([*SAND, "info", str(top / "run")]), "s", 0.3)
        yield row("sand run, first compile, to the first step", first, "s", 10.0)
        warm = min(begin(case, top / f"run{k}", cache) for k in range(3))
        yield row("sand run, compiled, to the first step", warm, "s", 1.0)


def main_job(quick: bool) -> dict[str, Any]:
    """The main job with its files, on one core, compiled before."""
    part = 10 if quick else 1
    with tempfile.TemporaryDirectory() as place:
        sim = simulation_of(read_case(MAIN_JOB), Path(place) / "run")
        sim.run(steps=1)
        seconds = part * thread(lambda: sim.run(until=UNTIL / part))
    name = "main job: its first tenth × 10" if quick else "main job"
    return row(name, seconds, "s", 25.0, note=f"{sim.state.steps:.2g} steps")


def all_rows(quick: bool) -> Iterator[dict[str, Any]]:
    """Commands, main job."""
    yield from commands()
    yield main_job(quick)
