"""Figure 4: classification of shapes, and the T that hit-and-stick does not produce."""

import numpy as np
import pytest

import sand
from sand.experiments import chain_impact
from sand.plotting.chain_map import Map, Picture, chain_figure


def links(*pairs):
    return np.array(pairs)


LINE = np.array([[k, 0.0, 0.0] for k in range(4)])
CHAIN = [[0, 1], [1, 2], [2, 3]]


@pytest.mark.parametrize(
    ("end", "projectile", "more", "name"),
    [
        ([2, 1, 0], [2, -1, 0], [[2, 4]], "T"),
        ([2.5, 0.87, 0], [2.5, -0.87, 0], [[2, 4]], "T"),
        ([3, 0, 0], [2, 1, 0], [[2, 4]], "branched"),
        ([3, 0, 0], [4, 0, 0], [[3, 4]], "straight"),
        ([3, 0, 0], [3, 1, 0], [[3, 4]], "straight"),
        ([2, 1, 0], [2, 2, 0], [[3, 4]], "bent"),
        ([3, 0, 0], [2.5, 0.87, 0], [[2, 4], [3, 4]], "ring"),
        ([3, 0, 0], [9, 9, 0], [], "gone"),
    ],
)
def test_shapes(end, projectile, more, name):
    """By hand: a chain of four, its end grain moved, and the projectile at several positions."""
    position = np.vstack([LINE[:3], [end], [projectile]])
    assert chain_impact.shape(position, links(*CHAIN, *more), 4).name == name


def test_a_broken_chain():
    """A missing contact."""
    position = np.vstack([LINE, [[9, 9, 9]]])
    assert chain_impact.shape(position, links([0, 1], [1, 2], [3, 4]), 4).name == "broken"


@pytest.mark.filterwarnings("ignore:grains overlap too deeply", "ignore:impacts are too fast for elastic grains")
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("place", [-0.65, -0.6, -0.55])
def test_the_papers_figure_4(place):
    """20 nm iron, slip="reset", 240 m/s: a T, crossbar within 30° of perpendicular, end grain rolled.

    Hit-and-stick gives a chain with one more grain; slip="clamp" (twice the friction) gives no T there.
    """
    hit = chain_impact.strike(sand.IRON, "10 nm", speed=240.0, place=place, contact=sand.Contact(slip="reset"))
    shape = chain_impact.shape_of(hit)
    assert shape.name == "T"
    assert shape.crossbar > 60.0
    assert shape.rolled > 30.0
    assert chain_impact.stick_at_first_touch(sand.IRON, 1e-8, place).name == "straight"
    clamped = chain_impact.strike(sand.IRON, "10 nm", speed=240.0, place=place)
    assert chain_impact.shape_of(clamped).name != "T"


@pytest.mark.compiled("contacts")
def test_a_slow_grain_leaves_the_chain_straight():
    """20 m/s on the end grain: it sticks without much rolling."""
    hit = chain_impact.strike(sand.IRON, "10 nm", speed=20.0, place=0.3)
    assert chain_impact.shape_of(hit).name == "straight"


def test_the_figure():
    """The map has the colours of the shapes; pictures show every grain."""
    names = np.array([["T", "bent"], ["broken", "straight"]])
    picture = Picture("before", np.vstack([LINE, [[9, 9, 0]]]) * 1e-8, 1e-8)
    figure = chain_figure([picture], [Map("iron", [1, 2], [0.0, 1.0], names)])
    axes = [a for sub in figure.subfigs for a in sub.axes]
    assert len(axes[0].patches) == 5
    assert axes[1].collections[0].get_array().reshape(2, 2).tolist() == [[0, 2], [5, 3]]
