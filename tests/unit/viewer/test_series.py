"""Time series for the page: the ledger's columns, thinned."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from sand.analysis.ledger_columns import LedgerColumns
from sand.plotting.panels import linear_below, log_bottom
from sand.viewer import series as of_page
from sand.viewer.dataset import run_dataset
from sand.viewer.series import MAX_POINTS, evenly_spaced, quantity_ranges, series_from_ledger

from ..synthetic_trajectories import write_trajectory


@pytest.mark.compiled("fields")
def test_series_are_the_ledgers(finished_run):
    """Plots have the ledger's columns; the change of the total is computed before rounding; event counts."""
    folder, sim = finished_run
    series = run_dataset(folder).series()
    plots = {plot["id"]: {line["label"]: line["values"] for line in plot["lines"]} for plot in series["plots"]}
    assert list(plots) == ["clusters", "energies", "losses", "contacts", "balance"]  # fewer than ten bodies
    assert plots["clusters"]["mean size S = Σs²/Σs"] == pytest.approx(
        sim.ledger["mean_cluster_size"].tolist(), rel=1e-6, abs=0
    )
    assert plots["energies"]["magnetic"] == pytest.approx(sim.ledger["magnetic"].tolist(), rel=1e-6, abs=0)
    change = sim.ledger["total"] - sim.ledger["total"][0]
    assert plots["balance"]["change of the total energy"] == pytest.approx(change.tolist(), rel=1e-6, abs=1e-40)
    assert plots["contacts"]["contacts"] == sim.ledger["contacts"].tolist()
    assert plots["losses"]
    for label, lost in plots["losses"].items():  # a logarithmic axis cannot show 0
        name = {"external": "outside"}.get(label, label)
        assert [v is None for v in lost] == [v == 0.0 for v in sim.ledger[f"lost_{name}"]]
    scales = {plot["id"]: (plot["axis"], plot["least"]) for plot in series["plots"]}
    assert scales["losses"][0] == scales["clusters"][0] == "log" and scales["balance"] == ("linear", None)
    top = max(abs(v) for lost in plots["losses"].values() for v in lost if v)
    assert scales["losses"][1] >= 1e-6 * top  # six decades are shown
    for plot in series["plots"]:
        assert all(len(line["values"]) == len(series["time"]) for line in plot["lines"])
        assert all(line[ground].startswith("#") for line in plot["lines"] for ground in ("light", "dark"))


@pytest.mark.compiled("fields")
def test_long_and_broken_ledgers(finished_run):
    """At most 2000 points, the last included; no event is lost; NaN becomes null."""
    row = dict(finished_run[1].ledger.rows[-1])
    rows = [row | {"step": k, "time": 1e-9 * k, "made": 3 * k, "broken": k // 2} for k in range(5001)]
    rows[-1] = rows[-1] | {"total": float("nan"), "translation": float("inf")}
    series = series_from_ledger(LedgerColumns.from_rows(rows))
    assert len(series["time"]) == MAX_POINTS and series["time"][-1] == pytest.approx(5e-6, rel=1e-9, abs=0)
    assert sum(series["events"]["made"]) == 15000 and sum(series["events"]["broken"]) == 2500
    assert len(series["events"]["time"]) < MAX_POINTS
    values = {plot["id"]: plot["lines"][0]["values"] for plot in series["plots"]}
    assert values["balance"][-1] is None and values["energies"][-1] is None
    json.dumps(series, allow_nan=False)
    assert evenly_spaced(10, 20).tolist() == list(range(10)) and evenly_spaced(100, 3).tolist() == [0, 50, 99]


def test_without_a_ledger(tmp_path):
    """A trajectory file alone: clusters and contacts are counted in its frames."""
    dataset = run_dataset(write_trajectory(tmp_path / "a.gsd", [[], [(0, 1)], [(0, 1), (1, 2)]], 5))
    series = dataset.series()
    plots = {plot["id"]: {line["label"]: line["values"] for line in plot["lines"]} for plot in series["plots"]}
    assert plots["contacts"]["contacts"] == [0, 1, 2]
    assert plots["clusters"]["largest size"] == [1, 2, 3] and plots["clusters"]["clusters"] == [5, 4, 3]
    assert plots["clusters"]["mean size S = Σs²/Σs"] == pytest.approx([1.0, 7 / 5, 11 / 5], rel=1e-6, abs=0)
    series_points = dataset.manifest()
    assert not series_points["running"] and series_points["outcome"] is None and series_points["name"] == "a"


def test_axes_show_all_curves():
    """Symmetric logarithmic from a factor of 30 between peaks, linear below a power of ten; zeros count for nothing.

    A logarithmic axis begins a factor of 1.3 below the smallest number, but shows six decades at most.
    """
    zero, small, large = np.zeros(3), np.array([0.0, 2e-18, -1e-18]), np.array([0.0, -6e-15, -1e-15])
    assert linear_below([zero, small, large]) == pytest.approx(1e-18, rel=1e-12, abs=0)
    assert linear_below([zero, 29 * large, large]) is None and linear_below([31 * large, large]) is not None
    assert linear_below([large, 1e-20 * large]) == pytest.approx(1e-21, rel=1e-12, abs=0)
    assert linear_below([]) is None and linear_below([zero]) is None
    assert log_bottom([np.array([np.nan, 0.0, 2.0]), np.array([1.0, 5.0])]) == pytest.approx(1 / 1.3, rel=1e-12, abs=0)
    assert log_bottom([np.array([2e-27, 3e-15])]) == pytest.approx(3e-21, rel=1e-12, abs=0)
    assert log_bottom([]) == log_bottom([zero]) == 0.0


def test_an_outlier_does_not_set_the_range(monkeypatch):
    """One contact in a hundred with a thousand times the pressure: the range is that of the others, of those pressed.

    Of 97 numbers from 1 to 2 Pa, one of 1000 Pa and 300 zeros, the 98th percentile of what is not zero is below 2 Pa.
    """
    values = np.concatenate([np.linspace(1.0, 2.0, 97), [-1000.0], np.zeros(300)])
    monkeypatch.setattr(of_page, "measured", lambda frame, name: values)
    ranges = quantity_ranges([SimpleNamespace(own={}, moment=np.zeros((2, 3)))])
    for name in ("pressure", "load", "speed"):
        assert ranges[name][1] == 2.0 and 1.0 <= ranges[name][0] < 1.1
    assert ranges["size"] == [0.0, 1000.0]
