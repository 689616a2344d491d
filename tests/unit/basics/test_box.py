"""Boxes: nearest images and wrapping."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sand.basics.box import Box, as_box

coordinate = st.floats(-30, 30)
triple = st.tuples(coordinate, coordinate, coordinate)


@given(triple)
def test_nearest_image_is_the_shortest(v):
    """Brute force over the images in 27 neighbouring cells; the open axis is unchanged."""
    box = Box.periodic(7.0, None, 5.0)
    found = box.nearest(np.array(v))
    assert found[1] == v[1]
    for axis, length in ((0, 7.0), (2, 5.0)):
        images = v[axis] + length * np.arange(-10, 11)
        assert abs(found[axis]) == pytest.approx(np.abs(images).min(), abs=1e-12)
        turns = (found[axis] - v[axis]) / length
        assert turns == pytest.approx(round(turns), abs=1e-12)


def test_an_open_box_changes_nothing():
    """To the bit."""
    v = np.array([1e300, -3.3, 1e-300])
    assert (Box.open().nearest(v) == v).all()


@pytest.mark.parametrize("box", [Box.open(), Box.periodic(1.0, None, 1.0), Box.periodic(1.0)])
def test_close_pairs_by_both_searches(box, monkeypatch):
    """The search over all pairs and SciPy's tree find the same pairs in the same order."""
    points = np.random.default_rng(4).uniform(-0.7, 0.7, (150, 3))
    few = box.close_pairs(points, 0.2)
    monkeypatch.setattr("sand.basics.box.ALL_PAIRS_UP_TO", 0)
    many = box.close_pairs(points, 0.2)
    assert len(few) > 100
    assert (few == many).all()
    assert few.dtype == many.dtype


def test_box_arguments():
    """One length is a cube; None or no length is an open axis."""
    assert as_box("1 um") == Box.periodic(1e-6) == Box((1e-6, 1e-6, 1e-6))
    assert as_box(None).is_open
    assert Box.periodic("1 um", None, "2 um").lengths == (1e-6, None, 2e-6)
    assert Box.periodic("1 um", None, "2 um").shortest == 1e-6
    assert Box.open().describe() == "open"
    assert Box.periodic("1.2 um").volume == pytest.approx(1.728e-18, rel=1e-6, abs=0.0)
