"""Several runs in one figure, and s² n_s."""

import json

import numpy as np
import pytest

from sand.analysis.frame_statistics import mass_spectrum
from sand.cli.main import main
from sand.io.file_frames import open_frames
from sand.plotting.overlay import COLOURS, Overlaid, overlaid_grains, overlaid_history, spectrum_figure
from sand.plotting.plots import HISTORY

from ..synthetic_frames import frame_of


def test_the_mass_spectrum_against_a_sum_over_all_sizes():
    """A class from a up to b − 1 has Σ s² n_s/(b − a) over its whole numbers, n_s clusters per grain; Σ s n_s = 1.

    Brute force over every whole number, classes read off from 5 per decade: 1, 2, 3, 4–6, 7–9, 10–15, 16–25, 26–39.
    Equal to rounding.
    """
    sizes = np.random.default_rng(3).integers(1, 40, 300)
    n = {s: np.count_nonzero(sizes == s) / sizes.sum() for s in range(1, 40)}
    assert sum(s * each for s, each in n.items()) == pytest.approx(1.0, rel=1e-12, abs=0.0)
    classes = [(1, 1), (2, 2), (3, 3), (4, 6), (7, 9), (10, 15), (16, 25), (26, int(sizes.max()))]
    s, value, error = mass_spectrum(sizes)
    np.testing.assert_allclose(s, [np.sqrt(a * b) for a, b in classes], rtol=1e-12)
    expected = [sum(k * k * n[k] for k in range(a, b + 1)) / (b + 1 - a) for a, b in classes]
    np.testing.assert_allclose(value, expected, rtol=1e-12)
    counts = [np.count_nonzero((sizes >= a) & (sizes <= b)) for a, b in classes]
    np.testing.assert_allclose(error, 1.0 / np.sqrt(counts), rtol=1e-12)


def test_a_spectrum_of_equal_clusters():
    """N clusters of one grain: s² n_s = 1 at s = 1, with the relative error 1/√N; no cluster: no class."""
    s, value, error = mass_spectrum(np.ones(16, int))
    assert (s.tolist(), value.tolist(), error.tolist()) == ([1.0], [1.0], [0.25])


def test_the_figure_of_spectra():
    """Each run has its colour and its points."""
    pair = frame_of([[0, 0, 0], [2e-8, 0, 0], [9e-8, 0, 0]], [(0, 1)])
    single = frame_of([[0, 0, 0], [9e-8, 0, 0]])
    figure = spectrum_figure([Overlaid("a", frame=pair), Overlaid("b", frame=single)])
    lines = [one for one in figure.axes[0].get_lines() if one.get_marker() in "os"]
    assert [one.get_color() for one in lines] == list(COLOURS[:2])
    np.testing.assert_allclose(lines[0].get_ydata(), [1 / 3, 4 / 3], rtol=1e-12)
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["a", "b"]


def test_histograms_are_shares():
    """The bars of each run add up to 1, also of runs with different numbers of grains."""
    small, large = (
        frame_of(np.c_[np.arange(n) * 3e-8, np.zeros((n, 2))], velocity=np.random.default_rng(n).normal(size=(n, 3)))
        for n in (5, 40)
    )
    runs = [Overlaid("small", frame=small), Overlaid("large", frame=large)]
    for name in ("speed", "cluster"):
        steps = overlaid_grains(runs, name).axes[0].patches
        assert [float(np.sum(one.get_data().values)) for one in steps] == pytest.approx([1.0, 1.0], rel=1e-12, abs=0.0)
    bars = overlaid_grains(runs, "material").axes[0].patches
    assert [bar.get_height() for bar in bars] == [1.0, 1.0]


@pytest.mark.slow
@pytest.mark.compiled("fields")
def test_runs_over_time(run_in_field, tmp_path, capsys):
    """`sand plot A B`: all figures, with the labels; the lines of equal runs are equal, in two colours."""
    out = tmp_path / "there"
    words = ["plot", str(run_in_field), str(run_in_field), "--labels", "one, two", "--out", str(out), "--json"]
    assert main(words) == 0
    files = json.loads(capsys.readouterr().out)["files"]
    assert files == [str(out / f"{name}.png") for name in (*HISTORY, "mass_spectrum")]
    from sand.analysis.ledger_columns import LedgerColumns
    from sand.io.ledger_table import read_ledger

    ledger = LedgerColumns.from_rows(read_ledger(run_in_field / "ledger.csv"))
    figure = overlaid_history([Overlaid("one", ledger), Overlaid("two", ledger)], "size")
    first, _, second, _ = figure.axes[0].get_lines()
    np.testing.assert_array_equal(first.get_ydata(), ledger["mean_cluster_size"])
    np.testing.assert_array_equal(first.get_ydata(), second.get_ydata())
    assert [first.get_color(), second.get_color()] == list(COLOURS[:2])


@pytest.mark.compiled("fields")
def test_refused_combinations(run_in_field, tmp_path, capsys):
    """Labels that do not fit the runs, the same ones, a still of several runs: a line each, and nothing is written."""
    runs = [str(run_in_field)] * 2
    for words, text in (
        (["--labels", "a"], "--labels names 1 of 2 runs; give one label for each, separated by commas"),
        (["--labels", "a,a"], "--labels gives the same label twice; labels must differ"),
        (["--what", "still"], "--what still shows one run; give one, or leave still out"),
    ):
        assert main(["plot", *runs, *words, "--out", str(tmp_path / "there")]) == 2
        assert capsys.readouterr().err == f"sand: {text}\n"
    assert not (tmp_path / "there").exists()


@pytest.mark.compiled("fields")
def test_a_spectrum_of_one_run(run_in_field, tmp_path):
    """Also of a trajectory alone."""
    assert main(["plot", str(run_in_field), "--what", "mass_spectrum", "--out", str(tmp_path / "a")]) == 0
    assert (tmp_path / "a" / "mass_spectrum.png").stat().st_size > 1000
    frames = open_frames(run_in_field / "trajectory.gsd")
    assert spectrum_figure([Overlaid("", frame=frames[-1])]).axes[0].get_legend() is None
