"""The figure of Seizinger et al. 2012: filling factors at pressures, of synthetic rows with known answers."""

import math

import numpy as np
import pytest

from sand.experiments.paper_cake import at_pressure, cake_panels, compare_cakes, filling_at
from sand.io.sweep_files import read_runs, write_sweep
from sand.plotting.papers import panels_figure
from sand.theory.compression import guettler_filling


def rows(shift=0.0, seed=1, roll=8.0, noise=0.0):
    """A run with φ(P) = that of Güttler et al. plus a shift; a floor that bears 2 % more."""
    load = np.geomspace(50.0, 5e4, 60)
    filling = guettler_filling(load) + shift
    return [
        {
            "seed": seed,
            "forces.contact.roll_factor": roll,
            "forces.contact.slide_factor": 2.5 if roll > 1.0 else 1.0,
            "stress": float(p * (1.0 + noise * (-1) ** k)),
            "mean_filling": float(phi),
            "mean_pressure_lid": float(p),
            "mean_pressure_floor": float(1.02 * p),
            "coordination": 2.0,
        }
        for k, (p, phi) in enumerate(zip(load, filling, strict=True))
    ]


def test_filling_factor_at_a_pressure():
    """φ is interpolated in ln P: of a linear function of ln P it is exact; with noise the last crossing counts."""
    line = [{"stress": math.exp(k), "mean_filling": 0.1 + 0.01 * k} for k in range(10)]
    assert filling_at(line, math.exp(4.3)) == pytest.approx(0.143, rel=1e-12, abs=0.0)
    noisy = [*line[:6], {"stress": math.exp(2.0), "mean_filling": 0.155}, *line[6:]]
    assert filling_at(noisy, math.exp(4.0)) == pytest.approx(0.155 + 0.005 * 2.0 / 4.0, rel=1e-12, abs=0.0)
    assert filling_at([{"stress": -1.0, "mean_filling": 0.1}, *line], 0.5) == pytest.approx(0.1, rel=1e-12, abs=0.0)
    assert math.isnan(filling_at(line, math.exp(9.5))) and math.isnan(filling_at(line, 0.5))


def test_mean_of_the_seeds():
    """Two seeds 0.01 above and 0.03 above the curve: 0.02 above it; one has no interval."""
    found, paper = at_pressure([*rows(0.01), *rows(0.03, 2)], 3e3), float(guettler_filling(3e3))
    assert found.value == pytest.approx(paper + 0.02, rel=1e-3, abs=0.0) and found.low < paper + 0.02 < found.high
    assert math.isnan(at_pressure(rows(), 3e3).low)


def test_comparison_and_figure():
    """Cakes 0.01 and 0.1 above the measured curve: the first agrees within 0.02, the second does not."""
    both = [*rows(0.01), *rows(0.1, roll=1.0)]
    compared = compare_cakes(both)
    assert [one.verdict.startswith("agrees") for one in compared] == [True] * 3 + [False] * 5
    assert compared[1].what == "φ at 3 kPa, rolling x 8, sliding x 2.5"
    assert compared[1].paper.startswith(f"{guettler_filling(3e3):.3g} (Güttler et al. 2009")
    assert compared[4].verdict.startswith("+0.1 (") and "roll and slide too easily" in compared[4].verdict
    assert compared[3].ours == "0.02 at most, 0.02 in the mean"
    axes = panels_figure(cake_panels(both), "").axes
    x, y = axes[0].get_lines()[0].get_data()
    assert y == pytest.approx(guettler_filling(x) + 0.01, rel=1e-9, abs=0.0)


def test_a_campaign_without_a_run(tmp_path):
    """Interrupted before its first run is done, a campaign leaves a table without rows, which is read."""
    write_sweep(tmp_path, [])
    assert read_runs(tmp_path) == []
