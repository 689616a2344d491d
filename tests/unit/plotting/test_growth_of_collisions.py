"""The figure of growth efficiencies: points, average over impact parameters, and kinds of outcomes."""

import numpy as np
import pytest

from sand.analysis.impact_average import impact_parameters
from sand.plotting.collisions import _average, growth_figure


def collisions(speeds, seeds=(1, 2, 3)):
    """f = 1 − v/10 − b²/reach²; the outer radii differ between seeds, as those of random aggregates do."""
    return [
        {
            "speed": v,
            "impact_parameter": b * (1e-6 + 1e-7 * seed),
            "reach": 1e-6 + 1e-7 * seed,
            "growth_efficiency": 1.0 - 0.1 * v - b**2,
            "kind": "sticking" if v < 3 else "erosion",
            "seed": seed,
        }
        for v in speeds
        for seed in seeds
        for b in impact_parameters(4)
    ]


@pytest.mark.slow
def test_points_and_average():
    """The line is ∫ f 2b db = ½ − v/10, exact by the midpoint rule; each kind has its points in both panels."""
    rows = collisions([1.0, 2.0, 5.0])
    figure = growth_figure(rows, "36 collisions")
    left, right = figure.axes
    line = next(one for one in left.lines if len(one.get_xdata()) == 3 and one.get_color() != "none")
    assert line.get_ydata() == pytest.approx([0.4, 0.3, 0.0], abs=1e-12)
    points = {one.get_label(): one for one in right.lines}
    assert len(points["sticking"].get_xdata()) == 24 and len(points["erosion"].get_xdata()) == 12
    assert np.unique(np.round(points["erosion"].get_ydata(), 9)) == pytest.approx(impact_parameters(4), abs=1e-9)
    growth_figure(rows[:1], "one")


def test_lengths_of_bodies_that_differ():
    """One length has other shares for other seeds: the third of each seed counts as the third impact parameter."""
    share = np.array([0.1, 0.5, 0.9, 0.12, 0.55, 0.95])
    found = _average(np.array([1.0, 0.5, 0.0, 0.9, 0.6, 0.1]), share, np.repeat([1, 2], 3))
    assert np.isfinite(found.error) and found.collisions == 6
