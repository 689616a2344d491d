"""`python -m benchmarks --quoted`: measure what README and docs quote and a few minutes can measure.

It installs SAND in a new virtual environment, runs examples/iron-gas.toml by the command line, with an empty cache
and with a full one, draws the pictures of README and docs from its last frame (`pictures.py`, by a Chromium), runs
the scripts of README and of the first page of the docs, and writes docs/measured.json and the copies in README,
CONTRIBUTING and ARCHITECTURE. Times are CPU times of one thread, because machines are shared. Records that it does
not measure stay as they are. `--tests` adds the wall time of the default tests on two cores.
"""

from __future__ import annotations

import datetime
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from . import page_code, pictures, quoted, start_up
from .timing import ran

SAND = start_up.SAND
FIRST_PAGE = quoted.TOP / "docs" / "start.md"
RUN_CELLS = "from pathlib import Path; from benchmarks import page_code as p; p.run_cells(p.cells(Path({!r})))"


def processor() -> str:
    """Name of the processor and number of cores, as the system gives them."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
        name = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        name = platform.processor() or platform.machine()
    return f"{name}, {os.cpu_count()} cores"


def commit() -> str:
    """The commit of the sources, and whether they differ from it."""
    git = ["git", "-C", str(quoted.TOP)]
    done = subprocess.run([*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True)
    changed = subprocess.run([*git, "diff", "--quiet", "HEAD", "--", "src"]).returncode if done.stdout else 0
    return done.stdout.strip() + " and changes" * bool(changed)


def duration(seconds: float) -> list[Any]:
    """Two digits of a time and its unit: [4.7, "s"], [26, "s"], [4.5, "minutes"]."""
    value, unit = (seconds, "s") if seconds < 90.0 else (seconds / 60.0, "minutes")
    rounded = float(f"{value:.2g}")
    return [int(rounded) if rounded >= 10.0 else rounded, unit]


def environment(cache: Path) -> dict[str, str]:
    """That of a program that uses these sources, one thread and a cache of its own, and may call `sand`."""
    paths = [str(quoted.TOP / "src"), str(quoted.TOP), os.environ.get("PYTHONPATH", "")]
    places = [str(Path(sys.executable).parent), os.environ.get("PATH", "")]
    told = {"PYTHONPATH": os.pathsep.join(filter(None, paths)), "PATH": os.pathsep.join(places)}
    told |= {"SAND_CACHE": str(cache), "SAND_EXAMPLES": str(quoted.TOP / "examples"), "SAND_NO_BROWSER": "1"}
    return os.environ | told | {"NUMBA_NUM_THREADS": "1", "MPLBACKEND": "Agg"}


def installation(top: Path) -> dict[str, Any]:
    """CPU time of the first commands of README: a virtual environment, and SAND with what it needs in it."""
    folder = top / "venv"
    taken = ran([sys.executable, "-m", "venv", str(folder)])[0]
    return {"time": duration(taken + ran([str(folder / "bin" / "pip"), "install", str(quoted.TOP)])[0])}


def main_job(top: Path) -> dict[str, Any]:
    """Steps, CPU time of the whole command, compiled before, and what compilation adds to the first run."""
    taken = []
    for name in ("first", "again"):
        words = [*SAND, "run", str(start_up.MAIN_JOB), "--out", str(top / name), "--quiet", "--threads", "1"]
        taken.append(ran(words, env=environment(top / "cache"))[0])
    summary = json.loads((top / "again" / "summary.json").read_text("utf-8"))
    return {
        "time": duration(taken[1]),
        "compilation": duration(taken[0] - taken[1]),
        "steps": [summary["steps"], ""],
        "contact_steps": [summary["rigid_clusters"]["contact_steps"], ""],
    }


def picture(top: Path) -> dict[str, Any]:
    """Draw the most extended cluster of the main job, and a film of a collision; how many grains the cluster has."""
    pictures.film(top, environment(top / "cache"))
    return {"grains": [pictures.draw(top / "again", top, environment(top / "cache")), ""]}


def script(top: Path) -> dict[str, Any]:
    """CPU time and output of the script of README."""
    (code,) = page_code.scripts(quoted.TOP / "README.md")
    words = [sys.executable, "-W", "ignore", "-c", code]
    taken, printed = ran(words, cwd=top, env=environment(top / "cache"))
    return {"time": duration(taken), "printed": printed.strip()}


def first_page(top: Path) -> dict[str, Any]:
    """CPU time of all code of the first page of the docs."""
    folder = top / "page"
    folder.mkdir()
    words = [sys.executable, "-W", "ignore", "-c", RUN_CELLS.format(str(FIRST_PAGE))]
    return {"time": duration(ran(words, cwd=folder, env=environment(top / "cache"))[0])}


def commands(top: Path) -> dict[str, Any]:
    """CPU time of `sand --help`, `sand info`, and of `sand run` until its first step, compiled before."""
    rows = {row["name"]: row["ours"] for row in start_up.commands()}
    names = {"help": "sand --help", "info": "sand info DIR", "first_step": "sand run, compiled, to the first step"}
    return {short: duration(rows[name]) for short, name in names.items()}


def tests(top: Path) -> dict[str, Any]:
    """Wall time of the default tests with an empty cache on two cores, and of those that compile nothing."""
    taken = []
    for words in (["-n", "2"], ["-m", "quick"]):
        empty = os.environ | {"SAND_CACHE": str(top / f"tests{len(taken)}")}
        start = time.perf_counter()
        subprocess.run([sys.executable, "-m", "pytest", *words], cwd=quoted.TOP, env=empty, check=True)
        taken.append(time.perf_counter() - start)
    return {"default": duration(taken[0]), "quick": duration(taken[1])}


def write(with_tests: bool) -> str:
    """Measure, and write docs/measured.json, the pictures and the copies; the values as text."""
    measures = [installation, main_job, picture, script, first_page, commands, *([tests] if with_tests else [])]
    records = quoted.read()
    about = {"commit": commit(), "date": str(datetime.date.today()), "machine": processor()}
    told = []
    with tempfile.TemporaryDirectory() as place:
        for measure in measures:
            values = measure(Path(place))
            name = measure.__name__
            records[name] |= about | {"values": values}
            told += [f"{name}.{key}: {quoted.text_of(value)}" for key, value in values.items()]
    quoted.write(records)
    quoted.write_copies()
    return "\n".join(told)
