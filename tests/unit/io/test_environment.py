"""Settings of the environment and of Python that must not change what SAND does."""

import os
import subprocess
import sys

import pytest

import sand
from sand.cli.main import main
from tests.unit.synthetic_trajectories import write_trajectory

pytestmark = pytest.mark.slow


def python(*words, **env):
    """Standard output of another Python, which must end without a message."""
    done = subprocess.run([sys.executable, *words], env=os.environ | env, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


FIGURE = """
import os, sand.plotting.style as style, matplotlib
from matplotlib.figure import Figure
with style.plot_style():
    Figure().savefig("figure.png")
print(os.environ["MPLBACKEND"], matplotlib.rcParams["backend"])
"""


@pytest.mark.parametrize(
    "backend",
    ["svg", "backend_of_a_notebook", pytest.param("module://of_another.environment", marks=pytest.mark.validate)],
)
def test_figures_need_no_backend(backend, tmp_path, monkeypatch):
    """MPLBACKEND may name one that does not exist; one that exists is kept for the user's own windows."""
    monkeypatch.chdir(tmp_path)
    named, used = python("-c", FIGURE, MPLBACKEND=backend).split()
    assert named == backend and (tmp_path / "figure.png").stat().st_size > 1000
    assert used == backend or backend == "backend_of_a_notebook"


def test_help_and_case_files_without_docstrings(tmp_path, monkeypatch, capsys):
    """`python -OO` strips docstrings; helps, and meanings and units of the keys of a case file, stay the same."""
    monkeypatch.chdir(tmp_path)
    words = ["--help"], ["run", "--help"], ["new", "case", "--overwrite", "--json"]
    script = f"from sand.cli.main import main\nfor words in {words}:\n    if main(words):\n        raise SystemExit(1)"
    stripped = python("-OO", "-c", script), (tmp_path / "case.toml").read_text("utf-8")
    assert not any(map(main, words))
    assert stripped == (capsys.readouterr().out, (tmp_path / "case.toml").read_text("utf-8"))
    assert "Usage: " in stripped[0] and "case.toml" in stripped[0]


KEPT = """
import os, sand
os.kept = sand.open({folder!r})  # lives longer than the modules
print(len(os.kept.frames[0]))
"""


def test_a_program_that_keeps_a_run_open_ends_without_a_message(tmp_path):
    """The reader of a trajectory is closed before Python takes the modules of the program apart."""
    write_trajectory(tmp_path / "trajectory.gsd", [[], []], 3)
    assert python("-c", KEPT.format(folder=str(tmp_path))) == "3\n"


WRITING = """
import os, sys
from pathlib import Path
from tests.unit.synthetic_trajectories import append
from sand.io.trajectory import TrajectoryWriter
os.kept = TrajectoryWriter(Path(sys.argv[1]))
append(os.kept, [[], []], 3)
"""


def test_a_program_that_ends_while_it_writes_a_run_leaves_its_frames(tmp_path):
    """As after an exception between two frames."""
    path = tmp_path / "trajectory.gsd"
    assert python("-c", WRITING, str(path)) == ""
    assert len(sand.open(tmp_path).frames) == 2
