"""Figures of sweeps: maps and shares of classes, lines of numbers, legends beside the axes."""

import numpy as np
import pytest

from sand.analysis.collision_kinds import KINDS
from sand.experiments.sweep_cases import units_of
from sand.plotting.style import LOOKS, looks_of
from sand.plotting.sweeps import label, sweep_figure

SPEEDS = np.geomspace(10.0, 200.0, 10).round(3).tolist()
KEYS = ["impact.speed", "impact.impact_parameter", "projectile.grains"]


def table(offsets=6, grains=(500,), seeds=3):
    """A sweep over speed, impact parameter, grains and seed, in which kinds follow each other with the speed."""
    rows = [
        (v, f"{b:.3f} b", n, s, [*KINDS][(i + j + s) % 8], 0.1 * i)
        for i, v in enumerate(SPEEDS)
        for j, b in enumerate(np.linspace(0.1, 0.9, offsets))
        for n in grains
        for s in range(seeds)
    ]
    names = (*KEYS, "seed", "kind", "growth_efficiency")
    return {name: np.array(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}


def marks(axes):
    """Colour, marker and places in pixels (K, 2) of the marks of each word in a panel."""
    axes.figure.draw_without_rendering()
    found = {}
    for line in (one for one in axes.lines if one.get_marker() != "None"):
        places = line.get_transform().transform(np.column_stack(line.get_data()))
        key = line.get_color(), line.get_marker()
        found.setdefault(key, []).append(places)
    return {key: np.vstack(places) for key, places in found.items()}


def test_kinds_have_their_own_colours_and_markers():
    """No two kinds of outcomes have the same colour or the same marker; other words get looks, too."""
    assert set(KINDS) <= set(LOOKS)
    colours, markers = zip(*looks_of(KINDS).values(), strict=True)
    assert len(set(colours)) == len(set(markers)) == len(KINDS) == 8
    words = looks_of(["finished", "stick", *"abcdefgh"])
    assert next(iter(words)) == "stick" and len(words) == 10
    assert len(set(words.values())) == 10


@pytest.mark.slow
def test_a_map_has_a_mark_for_each_run():
    """180 runs over two keys with three seeds: each is drawn once, as its kind, and no mark covers another."""
    runs = table()
    figure = sweep_figure(runs, KEYS, "kind")
    (axes,) = figure.axes
    found, looks = marks(axes), looks_of(KINDS)
    assert {look: len(places) for look, places in found.items() if len(places)} == {
        looks[kind]: int((runs["kind"] == kind).sum()) for kind in KINDS
    }
    places = np.vstack(list(found.values()))
    apart = np.linalg.norm(places[:, None] - places[None], axis=2) + 1e9 * np.eye(len(places))
    sizes = [line.get_markersize() for line in axes.lines if line.get_marker() != "None"]
    assert apart.min() >= max(sizes) * figure.dpi / 72.0
    assert axes.get_xscale() == "log" and axes.get_ylabel() == "impact parameter (b)"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == list(KINDS)


@pytest.mark.slow
@pytest.mark.parametrize("what", ["kind", "growth_efficiency"])
@pytest.mark.parametrize("shape", [(6, (500, 4000), 3), (6, (500,), 1), (1, (500, 4000), 12), (1, (500,), 5)])
def test_the_legend_covers_no_panel(what, shape):
    """It is inside the figure, beside all axes, for maps and shares in one or several panels, and for lines."""
    figure = sweep_figure(table(*shape), KEYS, what)
    figure.draw_without_rendering()
    for legend in figure.legends:
        box = legend.get_window_extent()
        assert figure.bbox.x1 >= box.x1 and box.y0 >= figure.bbox.y0
        assert all(axes.get_tightbbox().x1 <= box.x0 for axes in figure.axes)
    assert figure.legends or (what != "kind" and shape[:2] == (1, (500,)))


@pytest.mark.slow
def test_shares_of_the_words():
    """Over one key, the bars of each value are the shares of the words: heights add up to 1, as counted by hand."""
    runs = table(1, seeds=5)
    figure = sweep_figure(runs, KEYS, "kind")
    (axes,) = figure.axes
    heights = np.array([[bar.get_height() for bar in bars] for bars in axes.containers])
    assert heights.shape == (8, 10) and heights.sum(axis=0) == pytest.approx(1.0, abs=1e-12)
    first = runs["kind"][runs["impact.speed"] == SPEEDS[0]].tolist()
    assert heights[:, 0] == pytest.approx([first.count(kind) / 5 for kind in KINDS], abs=1e-12)
    runs = table(1, (500, 4000))
    kept = (runs["impact.speed"] != SPEEDS[0]) | (runs["projectile.grains"] > 500)  # no run of 500 at the first speed
    panels = sweep_figure({name: column[kept] for name, column in runs.items()}, KEYS, "kind")
    for axes, number in zip(panels.axes, (10, 9), strict=True):
        heights = np.array([[bar.get_height() for bar in bars] for bars in axes.containers])
        assert heights.sum(axis=0) == pytest.approx([number - 9.0] + [1.0] * 9, abs=1e-12)


@pytest.mark.slow
def test_lines_and_panels_that_are_left_out():
    """More combinations than lines or panels: the title says how many are drawn."""
    many = table(12, tuple(range(100, 1700, 100)), 1)
    for what, number in (("growth_efficiency", "14 of 120"), ("kind", "9 of 10")):
        figure = sweep_figure(many, KEYS, what)
        assert figure.get_suptitle() == f"the first {number} combinations of the other keys"
    assert sweep_figure(table(), KEYS, "kind").get_suptitle() == ""


@pytest.mark.slow
def test_axes_and_titles_are_in_words_with_units():
    """Keys have the units of the case, results those of their description; the title has runs and seeds."""
    case = {
        "target": {"kind": "grain", "radius": "0.1 um"},
        "projectile": {"kind": "grain", "radius": "0.1 um"},
        "impact": {"speed": "2 m/s"},
        "sweep": {"vary": {}},
    }
    columns = ["impact.speed", "impact.impact_parameter", "target.radius", "target.grains", "seed"]
    results = ["impact_energy", "lost_rolling", "rebound", "time", "growth_efficiency", "kind", "impact_parameter"]
    units = units_of(case, [*columns, *results])
    assert units == {"impact.speed": "m/s", "target.radius": "m", "impact_energy": "J", "lost_rolling": "J"} | {
        "rebound": "m/s", "time": "s", "impact_parameter": "m",
    }  # fmt: skip
    assert units_of({"run": {}, "grains": {}}, ["grains.temperature", "forces.field.flux_density"]) == {
        "grains.temperature": "K", "forces.field.flux_density": "T",
    }  # fmt: skip
    of_runs = units_of({"run": {}, "grains": {}}, ["temperature_translation", "dissipated", "cpu_seconds", "drift"])
    assert of_runs == {"temperature_translation": "K", "dissipated": "J", "cpu_seconds": "s"}
    assert label("impact.impact_parameter", units) == "impact parameter"
    assert label("forces.field.flux_density", {}) == "field flux density"
    assert label("lost_rolling", units) == "lost rolling (J)"
    runs = table(offsets=1, grains=(1,)) | {"target.radius": np.array([1e-7, 2e-7] * 15)}
    figure = sweep_figure(runs, ["impact.speed", "target.radius"], "growth_efficiency", units, "speeds")
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("impact speed (m/s)", "growth efficiency")
    assert figure.get_suptitle() == "speeds: 30 runs, 3 seeds"
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["target radius = 100 nm", "target radius = 200 nm"]
