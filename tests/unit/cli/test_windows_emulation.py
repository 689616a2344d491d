"""SAND on other systems: Python without what Windows lacks, and files that behave as on Windows."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).parents[3]
BEGIN = """
import importlib, pathlib, pkgutil, sys, warnings
from tests.windows_emulation import become_windows
become_windows()
for package in ("sand", "tests", "benchmarks"):
    warnings.filterwarnings("error", "'encoding' argument not specified", EncodingWarning, rf"{package}\\.")
"""
PACKAGE = """
import sand
for module in pkgutil.walk_packages(sand.__path__, "sand."):
    if module.name != "sand.__main__":
        importlib.import_module(module.name)
"""
CASE = """
[run]
until = "2 ps"
frame_every = "1 ps"

[stepping]
step = "0.1 ps"

[box]
periodic = "0.3 um"

[grains]
kind = "gas"
number = 3
radius = "10 nm"
material = "silica"
temperature = "300 K"

[forces.contact]
"""
COMMANDS = """
from sand.cli.main import main
from sand.plotting import run_figure as figure
figure.run_figure = figure.save = lambda *_: None  # drawing takes seconds, and is the same everywhere
chain = ["build", "chain", "--grains", "3", "--radius", "0.1 um", "--material", "silica", "--out"]
for words in (
    ["--help"],
    ["info", "case.toml"],
    [*chain, "chain.gsd"],
    [*chain, "chain.xyz"],
    ["info", "chain.gsd"],
    ["run", "case.toml", "--out", "run"],
    ["resume", "run", "--until", "3 ps"],
    ["info", "run"],
):
    code = main(words)
    assert code == 0, (words, code)
ended = sand.resume("run")
ended.run(until="4 ps")
assert main(["run", "case.toml", "--out", "run", "--overwrite", "--quiet"]) == 0, "an ended run keeps files open"
"""
TESTS = """
import pytest
for path in sorted(pathlib.Path("tests").rglob("test_*.py")):
    try:
        importlib.import_module(".".join(path.with_suffix("").parts))
    except pytest.skip.Exception as why:
        print(path, why)
for path in sorted(pathlib.Path("benchmarks").glob("*.py")):
    if path.stem != "__main__":
        importlib.import_module(f"benchmarks.{path.stem}")
"""


def run_as_windows(program: str, folder: Path, *, compiled: bool) -> str:
    """Output of a program that runs in the emulation, with or without the compiler."""
    paths = [str(TOP), str(TOP / "src"), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {
        "NUMBA_DISABLE_JIT": str(int(not compiled)),
        "PYTHONPATH": os.pathsep.join(filter(None, paths)),
        "LC_ALL": "C",  # text files are ASCII unless they are opened with an encoding
        "PYTHONUTF8": "0",
        "PYTHONCOERCECLOCALE": "0",
    }
    words = [sys.executable, "-X", "warn_default_encoding", "-c", BEGIN + program]
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def test_every_module_and_the_commands_work(tmp_path):
    """All modules can be imported; help, info, build, run, resume and --overwrite work."""
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    run_as_windows(PACKAGE + COMMANDS, tmp_path, compiled=False)
    assert (tmp_path / "run" / "summary.json").stat().st_size > 0


@pytest.mark.validate
def test_every_test_can_be_imported():
    """pytest can collect all tests; only modules that need other programs are skipped."""
    output = run_as_windows(TESTS, TOP, compiled=True)
    unexpected = [line for line in output.splitlines() if not line.startswith(("tests/peers", "tests/browser"))]
    assert not unexpected, unexpected
