"""Boxes: nearest images and wrapping."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sand.basics.box import Box, as_box
from sand.basics.errors import BadInput

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


TILTED = Box.periodic(3.0, 2.6, 2.8, tilt=1.1)


@given(triple)
def test_the_nearest_image_in_a_tilted_box(v):
    """Brute force over images: equal to the shortest where that is unique, and each component within half a side."""
    found, sides = TILTED.nearest(np.array(v)), np.array(TILTED.lengths)
    turns = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 3, indexing="ij"), -1).reshape(-1, 3)
    shortest = np.linalg.norm(found + TILTED.shift(turns), axis=1).min()
    assert (np.abs(found) <= 0.5 * sides + 1e-12).all()
    if shortest < 0.5 * sides.min() - 1e-9:
        assert np.linalg.norm(found) == pytest.approx(shortest, rel=0.0, abs=1e-12)
    image = TILTED.image(np.array(v))
    assert found + TILTED.shift(image) == pytest.approx(np.array(v), rel=0.0, abs=1e-12)


def test_close_pairs_in_a_tilted_box(monkeypatch):
    """Brute force over images, all pairs, and the search by a tree, also across the tilted faces."""
    points = TILTED.wrap(np.random.default_rng(4).uniform(-4, 4, (150, 3)))
    i, j = np.triu_indices(150, 1)
    turns = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 3, indexing="ij"), -1).reshape(-1, 1, 3)
    apart = np.linalg.norm(points[i] - points[j] + TILTED.shift(turns), axis=2).min(axis=0)
    expected = np.stack([i, j], axis=1)[apart <= 0.6]
    across = np.abs(points[expected[:, 0], 2] - points[expected[:, 1], 2]) > 1.0
    assert across.sum() > 10
    for most in (200, 0):
        monkeypatch.setattr("sand.basics.box.ALL_PAIRS_UP_TO", most)
        assert (TILTED.close_pairs(points, 0.6) == expected).all()


def test_tilts():
    """A tilt is brought within half a side, which is the same lattice; open axes and infinite tilts are refused."""
    assert Box.periodic(3.0, 2.6, 2.8, tilt=4.1).tilt == pytest.approx(1.1, rel=1e-15, abs=0.0)
    assert Box.periodic("1 um", tilt="0.25 um") == Box((1e-6, 1e-6, 1e-6), 0.25e-6) != Box.periodic("1 um")
    assert repr(Box.periodic("1 um", tilt="0.25 um")) == "Box.periodic('1 um', tilt='250 nm')"
    assert Box.periodic("1 um", tilt="0.25 um").describe() == "periodic 1 um x 1 um x 1 um, tilted by 250 nm along x"
    assert Box.periodic("1 um", tilt="-0.25 um").volume == Box.periodic("1 um").volume
    for box in ({"x": "1 um", "y": None}, {"x": "1 um", "tilt": float("inf")}):
        with pytest.raises(BadInput, match="tilt"):
            Box.periodic(**({"tilt": "0.1 um"} | box))
