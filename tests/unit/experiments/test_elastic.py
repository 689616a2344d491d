"""Moduli of packings at rest: means, the linear range, pulses, the figure and jobs."""

import csv
import json
import math

import numpy as np
import pytest

import sand
from sand.cli.main import main
from sand.experiments import elastic_job
from sand.experiments.elastic import Elastic, begin, linear_range, mean_moduli
from sand.experiments.elastic_figure import elastic_figure
from sand.experiments.elastic_waves import WIDTH, first_above, passed_momentum

D = 2e-7 - sand.theory.contact("ice", "0.1 um").rest_overlap
CASE = f"""
[aggregate]
kind = "lattice"
shape = [4, 4, 4]
radius = "0.1 um"
material = "ice"
[elastic]
box = {4 * D!r}
strains = [1e-6, 1e-5]
copies = 1
seeds = [1, 2]
[forces.contact]
"""


def test_means_of_an_isotropic_matrix():
    """K = λ + 2G/3, M = λ + 2G and G of C_ab = λ + 2G δ_ab."""
    found = mean_moduli(3.0 + 2.0 * 5.0 * np.eye(3))
    assert found == pytest.approx(
        {"bulk": 3 + 10 / 3, "longitudinal": 13, "shear": 5, "anisotropy": 0}, rel=1e-12, abs=1e-12
    )
    uneven = mean_moduli(np.diag([1.0, 2.0, 3.0]))
    assert uneven["anisotropy"] == pytest.approx(1.0, rel=1e-12, abs=0.0)


def test_the_linear_range_ends_at_the_first_strain_beyond_it():
    """K within 5 % of that of the smallest strain; larger strains that come back do not count."""
    assert linear_range([(1e-6, 100.0), (1e-5, 104.0), (1e-4, 94.0), (1e-3, 100.0)]) == 1e-5


def test_momentum_beyond_a_distance():
    """It is the integral of two Gaussian pulses, and of their images, over what grains count by; it is even in time.

    In place of the Gaussian share of the formula, of variance w²/3, grains count by a ramp: the same variance, and
    a difference of a few thousandths.
    """
    length, speed = 2.0, 3.0
    x = np.linspace(-1.0, 1.0, 8001)
    distances, times = np.array([0.3, 0.5, 0.7]), np.array([0.0, 0.05, 0.12, 0.2])
    wide = WIDTH * length
    expected = []
    for time in times:
        gauss = sum(
            0.5 * np.exp(-0.5 * ((x - way * speed * time + n * length) / wide) ** 2)
            for way in (1, -1)
            for n in (-1, 0, 1)
        )
        share = np.clip(0.5 + (np.abs(x) - distances[:, None]) / (2.0 * wide), 0.0, 1.0)
        expected.append((share * gauss).sum(axis=1) / gauss.sum())
    found = passed_momentum(times, distances, length, speed, 0.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.01)
    # a pulse that widens passes its middle at the same time
    for widening in (0.0, 0.01):
        moments = np.linspace(0.0, 0.3, 301)
        column = passed_momentum(moments, distances, length, speed, widening)[:, 1]
        assert first_above(moments, column, 0.5) == pytest.approx(0.5 / speed, rel=0.01, abs=0.0)
    assert math.isnan(first_above(moments, column, 2.0))


@pytest.mark.compiled("deformation")
def test_a_job(tmp_path, monkeypatch, capsys):
    """`sand elastic` of a crystal: K = k_n/3D in all rows; after an interruption it is resumed; info describes it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "crystal.toml").write_text(CASE)
    assert main(["info", "crystal.toml"]) == 0
    assert "sand elastic crystal.toml" in capsys.readouterr().out
    measure = elastic_job.measure_seed

    def interrupted(content, seed, observers=()):
        if seed == 2:
            raise KeyboardInterrupt
        return measure(content, seed, observers)

    monkeypatch.setattr(elastic_job, "measure_seed", interrupted)
    assert main(["elastic", "crystal.toml"]) == 130
    monkeypatch.setattr(elastic_job, "measure_seed", measure)
    capsys.readouterr()
    assert main(["info", "crystal"]) == 0 and "interrupted" in capsys.readouterr().out
    assert main(["resume", "crystal", "--json"]) == 0
    runs = json.loads(capsys.readouterr().out)["runs"]
    assert [run["seed"] for run in runs] == [1, 2]
    first, second = ({name: value for name, value in run.items() if name != "seed"} for run in runs)
    assert first == second  # nothing in a crystal is random
    bulk = sand.theory.contact("ice", "0.1 um").normal_stiffness / (3 * D)
    assert [run["bulk"] for run in runs] == pytest.approx([bulk] * 2, rel=1e-6, abs=0.0)
    with open("crystal/results.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["strain"]) for row in rows] == [1e-6, 1e-5, 1e-6, 1e-5]
    assert [float(row["bulk"]) for row in rows] == pytest.approx([bulk] * 4, rel=1e-5, abs=0.0)
    assert main(["info", "crystal"]) == 0 and "seed 2" in capsys.readouterr().out
    assert (
        main(["sweep", "crystal.toml", "--vary", "elastic.sound=false", "--seeds", "1", "--out", "swept", "--quiet"])
        == 0
    )
    assert sand.open("swept").table["bulk"] == pytest.approx([bulk], rel=1e-6, abs=0.0)


def test_a_tilted_box_is_refused():
    """Copies in a row, and strains along its sides, are those of a box with right angles."""
    body = sand.setup.lattice(4, radius="0.1 um", material="ice")
    with pytest.raises(sand.BadInput, match="the box is tilted; the moduli need a box with right angles"):
        begin(body, Elastic(box=sand.Box.periodic(4 * D, tilt=1e-7)), None, {})


def test_figure():
    """Lines are where the outcomes are: moduli over strain, distances over arrivals in ns and µm."""
    wave = {"arrivals": [1e-9, 2e-9], "distances": [1e-7, 2e-7]}
    waves = [{"along": "x", "polarised": "x", **wave}, {"along": "x", "polarised": "y", **wave}]
    columns = {"strain": [1e-6, 1e-4], "bulk": [1e4, 2e4], "longitudinal": [3e4, 4e4], "shear": [5e3, 6e3]}
    run = {"grains": 9, "filling": 0.2, "affine_longitudinal": 1e7, "table": columns, "waves": waves}
    run |= {"speed_longitudinal_static": 100.0, "speed_transverse_static": 50.0}
    more = run | {"table": columns | {"bulk": [3e4, 4e4]}}
    moduli, arrivals = elastic_figure([run, more]).axes[:2]
    assert moduli.get_lines()[0].get_ydata() == pytest.approx([2e4, 3e4], rel=1e-12, abs=0.0)
    assert arrivals.get_lines()[0].get_xydata() == pytest.approx(np.array([[1.0, 0.1], [2.0, 0.2]]), rel=1e-12, abs=0.0)
    assert len(elastic_figure([run | {"waves": []}]).axes) == 1
