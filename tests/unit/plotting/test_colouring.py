"""Colours of grains in still pictures, and the colour bar that maps them back to values."""

import numpy as np
import pytest

from sand.plotting.palettes import SEQUENTIAL
from sand.plotting.render.still import still_picture
from sand.plotting.style import LARGEST_COLOURS, SINGLE_COLOUR, rgb

from ..synthetic_frames import R, at_pixel, frame_of, pixels_of_hue


@pytest.mark.slow
def test_colours_of_clusters():
    """The centre of each grain has its cluster's hue, the largest first; single grains are grey."""
    position = np.array([[0, 0, 0], [2, 0, 0], [4, 0, 0], [0, 0, 5], [2, 0, 5], [6, 0, 5]]) * R
    picture = still_picture(frame_of(position, [(0, 1), (1, 2), (3, 4)]), view="front", size=(500, 400))
    for k, colour in enumerate([LARGEST_COLOURS[0]] * 3 + [LARGEST_COLOURS[1]] * 2 + [SINGLE_COLOUR]):
        x, y = at_pixel(picture, position[k])
        patch = picture.grains_only[int(y) - 3 : int(y) + 3, int(x) - 3 : int(x) + 3]
        if colour == SINGLE_COLOUR:
            assert np.ptp(patch[..., :3], axis=2).max() < 0.08
        else:
            assert pixels_of_hue(patch, rgb(colour)).all()


def test_colours_follow_the_colour_bar():
    """Colours of speeds are ordered as on the bar, whose ends are the minimum and maximum; no arrows."""
    frame = frame_of(np.arange(5)[:, None] * [3 * R, 0, 0], velocity=np.arange(1, 6)[:, None] * [0.0, 0.0, 2.0])
    picture = still_picture(frame, colour="speed", view="front", size=(500, 300))
    bar = next(axes for axes in picture.axes if axes.get_label() == "bar")
    assert bar.get_ylim() == pytest.approx((2.0, 10.0), rel=1e-6, abs=0.0)
    expected = SEQUENTIAL(np.linspace(0.0, 1.0, 5))[:, :3]
    for k in range(5):
        x, y = at_pixel(picture, frame.position[k])
        assert pixels_of_hue(picture.grains_only[int(y) : int(y) + 2, int(x) : int(x) + 2], expected[k]).all()
