"""Every example runs."""

import runpy
import sys
from pathlib import Path

import pytest

from sand.experiments.collision_case import read_collision
from sand.run.case import read_case

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda p: p.name)
def test_case_files_are_without_mistakes(path):
    """Each is read by the command that its first comment names."""
    reads = {"run": read_case, "collide": read_collision}
    comment = path.read_text().split("[", 1)[0]
    command = next(word for word in reads if f"sand {word} examples/{path.name}" in comment)
    reads[command](path)


def test_figure_4(tmp_path, monkeypatch, capsys):
    """The script draws its figure and finds a T where hit-and-stick has none."""
    monkeypatch.setattr(sys, "argv", ["figure4.py", str(tmp_path / "figure4.png")])
    runpy.run_path(str(EXAMPLES / "figure4.py"), run_name="__main__")
    told = capsys.readouterr().out
    assert ": T, crossbar" in told
    assert "hit-and-stick gives: straight" in told
    assert 10_000 < (tmp_path / "figure4.png").stat().st_size < 300_000
