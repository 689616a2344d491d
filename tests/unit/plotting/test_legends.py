"""Legends of all figures, also of the examples: beside the axes, so that they cover no data, and inside the figure."""

import importlib.util
import io
from functools import cache
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import sand
from sand.basics.state import LOST
from sand.experiments.growth import all_aggregates, growth_of
from sand.io.ledger_table import TEMPERATURES
from sand.plotting.chain_map import Map, Picture, chain_figure
from sand.plotting.collisions import collision_figure
from sand.plotting.growth import growth_figure
from sand.plotting.panels import LOSS_CHANNELS
from sand.plotting.plots import HISTORY, history_figure
from sand.plotting.run_figure import figure_bytes, run_figure
from sand.plotting.scattering import sigma_figure, trajectories_figure
from sand.plotting.style import legend_above

from ..experiments.test_growth import synthetic_box
from .test_figure import ledger_of, run_of

EXAMPLES = Path(__file__).parents[3] / "examples"


def example(name):
    """An example as a module."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rows_with_all_losses():
    """Rows of a ledger in which all energies and all channels of losses occur."""
    names = {column for columns in LOSS_CHANNELS.values() for column in columns}
    base = {"translation": 1e-18, "normal": -1e-18, "magnetic": -2e-19, "field": -1e-19, "gravity": 1e-19}
    return [
        {
            "time": k * 1e-8,
            "clusters": 8 - k // 5,
            "mean_cluster_size": 1.0 + k,
            "largest_cluster": 1 + k,
            "contacts": k,
            **dict.fromkeys(TEMPERATURES, 100.0 + k),
        }
        | {key: value * (1 + k) for key, value in base.items()}
        | dict.fromkeys(names, 1e-18 * k)
        for k in range(11)
    ]


def run_with_all_losses():
    rows = rows_with_all_losses()
    return run_figure(run_of([[0, 0, 0], [3e-8, 0, 0]], rows=rows, temperature=100.0, outside=("field", "gravity")))


def history(name):
    return history_figure(ledger_of(rows_with_all_losses(), ("field", "gravity")), name, 8, 100.0)


@cache
def ensembles_of_growth():
    ensembles = []
    for name, z in (("magnetic, with a long name", 3.2), ("plain", 2.0)):
        boxes = [synthetic_box(z, 0.63, 1.4, seed) for seed in range(4)]
        units = {"unit_moment": boxes[0].moment, "unit_radius": boxes[0].radius}
        temperatures = np.column_stack([np.linspace(1e-6, 1e-5, 5), np.full((5, 3), 100.0)])
        rows = all_aggregates(boxes) | units | {"temperatures": temperatures, "sizes": np.array([1, 1, 2, 5, 9])}
        ensembles.append((name, growth_of(boxes, (2.0, 100.0)), rows))
    return ensembles


def growth(guides=True):
    return growth_figure(ensembles_of_growth(), guides)


def sections():
    found = [
        SimpleNamespace(
            speed=v, sigma=1e-14 / v, sigma_error=1e-16, analytic=1.1e-14 / v, geometric=1e-15, c=0.9, c_error=0.01
        )
        for v in (0.5, 1.0, 2.0)
    ]
    return sigma_figure(found, "two grains")


def trajectories():
    def one(b):
        time = np.linspace(0.0, 1.0, 100)
        path = np.column_stack([np.linspace(-3.0, 3.0, 100), np.full(100, b), np.zeros(100)]) * 1e-8
        return SimpleNamespace(
            time=time,
            impact_parameter=b * 1e-8,
            end="hit" if b < 1.0 else "escaped",
            projectile=path,
            target=-path,
            at=lambda t: [np.array([np.interp(t, time, c) for c in way.T]).T for way in (path, -path)],
        )

    group = [one(b) for b in (0.1, 0.5, 0.9, 0.99, 1.0, 1.01, 1.2, 2.4)]
    return trajectories_figure(
        [group, group], ["none", "kT/2"], SimpleNamespace(capture=1e-8, touch=1e-8), "two grains"
    )


def collisions():
    lost = {name: 1e-16 * (1 + k) for k, name in enumerate(LOST)}
    ends = ("stick", "bounce", "fragment", "miss")
    return collision_figure(
        [{"outcome": end, "largest_remnant": 0.5, "lost": lost, "impact_energy": 1e-14, "speed": 1.0} for end in ends],
        "4 collisions",
    )


def chains():
    names = np.array([["T", "bent"], ["ring", "broken"]])
    picture = Picture("before", np.eye(3) * 1e-7, 1e-8)
    return chain_figure([picture, picture], [Map("silica", [1.0, 2.0], [0.0, 1.0], names)])


def selective():
    module, time = example("selective_coagulation"), np.linspace(0.0, 3e-6, 20)
    mean = module.Sample(*(20.0 * time / 3e-6 for _ in module.Sample._fields))
    return module.figure(time, mean, module.Sample(*(0.1 * one for one in mean)), 18.0 * time / 3e-6)


def sweeping():
    time = np.linspace(0.0, 1e-6, 20)
    samples = np.array([np.outer(np.arange(20.0) + k, np.ones(5)) for k in range(3)])
    return example("sweeping_nets").figure(time, samples, sand.setup.chain(8, radius="10 nm", material="iron"))


def particle():
    module, size = example("particle_cluster"), np.array([2, 4, 8, 16])
    body = sand.setup.chain(8, radius="10 nm", material="iron")
    values = np.array([size * 1e-8, size * 1.1e-8])
    found = {(w, m): module.Ensemble(size, values, values, None, body) for w in module.WAYS for m in module.MOMENTS}
    return module.figure(found, 1e-8)


FIGURES = {
    "run": run_with_all_losses,
    **{name: lambda name=name: history(name) for name in HISTORY if name != "balance"},
    "growth": growth,
    "cross-sections": sections,
    "trajectories": trajectories,
    "collisions": collisions,
    "chains": chains,
    "selective coagulation": selective,
    "sweeping nets": sweeping,
    "particle-cluster": particle,
}


def legends(figure):
    """Legends of a figure and of its parts, visible ones."""
    parts = [figure, *figure.subfigs]
    parts += [part for each in figure.subfigs for part in each.subfigs]
    own = [axes.get_legend() for axes in figure.axes]
    return [one for one in [*own, *(legend for part in parts for legend in part.legends)] if one is not None]


def overlap(one, two):
    """Whether two boxes on the screen overlap by more than a pixel in both directions."""
    return min(one.x1, two.x1) - max(one.x0, two.x0) > 1.0 and min(one.y1, two.y1) - max(one.y0, two.y0) > 1.0


def check(figure):
    """No legend covers axes, another legend or a text, or leaves the figure; returns their number."""
    figure.draw_without_rendering()
    found = legends(figure)
    boxes = [one.get_window_extent() for one in found]
    texts = [text for axes in figure.axes for text in (*axes.texts, axes.title, axes._left_title) if text.get_text()]
    texts += [text for part in [figure, *figure.subfigs] for text in [*part.texts, part._suptitle] if text is not None]
    for k, box in enumerate(boxes):
        assert box.x0 >= -1 and box.y0 >= -1 and box.x1 <= figure.bbox.x1 + 1 and box.y1 <= figure.bbox.y1 + 1
        for axes in figure.axes:
            assert not overlap(box, axes.get_window_extent()), f"legend {k} covers data"
        for text in texts:
            assert not overlap(box, text.get_window_extent()), f"legend {k} covers {text.get_text()!r}"
    assert not any(overlap(a, b) for a, b in combinations(boxes, 2))
    return len(found)


@pytest.mark.parametrize("name", list(FIGURES))
def test_legends_cover_nothing(name):
    """Of each figure, with as many entries as it can have."""
    figure = FIGURES[name]()
    assert check(figure) >= 1


def test_the_check_sees_a_legend_on_a_curve():
    """A legend within the axes, and one beyond the edge of the figure, fail it."""
    for place in ({"loc": "upper left"}, {"loc": "center", "bbox_to_anchor": (0.5, 1.6)}):
        figure = Figure()
        axes = figure.subplots()
        axes.plot([0, 1], [0, 1], label="curve")
        axes.legend(**place)
        with pytest.raises(AssertionError):
            check(figure)


def test_long_legends_have_several_rows():
    """As many columns as fit; entries that read and look the same are listed once."""
    axes = Figure(figsize=(3.0, 3.0)).subplots()
    for k in range(7):
        axes.plot([0, 1], [0, k], label=f"label {k}")
        axes.plot([0, 1], [1, k], label="the same", color="red")
    legend_above(axes)
    legend = axes.get_legend()
    assert [text.get_text() for text in legend.get_texts()].count("the same") == 1
    assert len(legend.get_texts()) == 8 and 1 < legend._ncols < 8
    assert legend.get_window_extent().width <= axes.get_window_extent().width


@pytest.mark.parametrize("guides", [False, True])
def test_lines_of_the_paper_are_an_option(guides):
    """Without it neither lines nor labels of power laws other than the fits are drawn."""
    figure = growth(guides)
    labels = [line.get_label() for axes in figure.axes for line in axes.get_lines()]
    assert any("the paper" in label for label in labels) is guides
    assert any("t^" in text.get_text() for text in figure.axes[0].texts) is guides


@pytest.mark.parametrize(("dpi", "form"), [(160, "png"), (600, "png")])
def test_pixels_per_inch(dpi, form):
    """A figure keeps its printed size: pixels = inches times dpi, which a PNG states per metre."""
    figure = history("size")
    picture = Image.open(io.BytesIO(figure_bytes(figure, form, dpi=dpi)))
    assert picture.size == tuple(round(length * dpi) for length in figure.get_size_inches())
    assert picture.info["dpi"] == pytest.approx((dpi, dpi), rel=0.0, abs=0.02)  # whole pixels per metre
