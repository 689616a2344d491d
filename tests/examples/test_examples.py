"""Every example runs."""

import csv
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from sand.experiments import sampling
from sand.experiments.collision_case import read_collision
from sand.experiments.scattering_case import read_scattering
from sand.run.case import read_case

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda p: p.name)
def test_case_files_are_without_mistakes(path):
    """Each is read by the command that its first comment names."""
    reads = {"run": read_case, "grow": read_case, "collide": read_collision, "scatter": read_scattering}
    comment = path.read_text().split("[", 1)[0]
    command = next(word for word in reads if f"sand {word} examples/{path.name}" in comment)
    reads[command](path)


@pytest.mark.validate
def test_figure_4(tmp_path, monkeypatch, capsys):
    """The script draws its figure and finds a T where hit-and-stick has none."""
    monkeypatch.setattr(sys, "argv", ["figure4.py", str(tmp_path / "figure4.png")])
    runpy.run_path(str(EXAMPLES / "figure4.py"), run_name="__main__")
    told = capsys.readouterr().out
    assert ": T, crossbar" in told
    assert "hit-and-stick gives: straight" in told
    assert 10_000 < (tmp_path / "figure4.png").stat().st_size < 300_000


@pytest.mark.validate
def test_cross_sections(monkeypatch, capsys):
    """The table of docs/physics/cross-sections.csv at an error of 50 %: all rows, none far from the file's."""
    monkeypatch.setattr(sampling, "PILOT", 4)
    monkeypatch.setattr(sys, "argv", ["cross_sections.py", "0.5"])
    runpy.run_path(str(EXAMPLES / "cross_sections.py"), run_name="__main__")
    made, kept = (
        {row[0]: row[1:] for row in csv.reader(text.splitlines())}
        for text in (capsys.readouterr().out, (EXAMPLES.parent / "docs/physics/cross-sections.csv").read_text())
    )
    assert made.keys() == kept.keys()
    for name in list(made)[1:]:
        error = float(made[name][1])
        assert abs(float(made[name][0]) - float(kept[name][0])) < 4.0 * error, name


@pytest.mark.validate
def test_growth_variants(tmp_path, monkeypatch, capsys):
    """Two variants for a nanosecond: a row each, what is not known is a dash."""
    words = ["growth_variants.py", "--boxes", "1", "--until", "1 ns", "--only", "cold", "--only", "field"]
    monkeypatch.setattr(sys, "argv", [*words, "--out", str(tmp_path / "out")])
    runpy.run_path(str(EXAMPLES / "growth_variants.py"), run_name="__main__")
    rows = capsys.readouterr().out.splitlines()[1:]
    assert [row.split()[0] for row in rows] == ["cold", "field"]
    assert all(row.split()[1] == "1.00" for row in rows)


@pytest.mark.validate
def test_measured_kernel(tmp_path, monkeypatch, capsys):
    """Six pairs at an error of 50 %: σv is of the order of Eq. 14 with μ ∝ N; the table of DustPy is symmetric."""
    monkeypatch.setattr(sampling, "PILOT", 4)
    monkeypatch.setattr(sys, "argv", ["measured_kernel.py", "0.5", str(tmp_path / "kernel")])
    runpy.run_path(str(EXAMPLES / "measured_kernel.py"), run_name="__main__")
    rows = [line.split() for line in capsys.readouterr().out.splitlines()[1:-1]]
    assert len(rows) == 6
    assert all(0.2 < float(row[-2]) < 1.2 for row in rows)
    table = np.loadtxt(tmp_path / "kernel.txt")
    assert np.allclose(table[1:], table[1:].T)
