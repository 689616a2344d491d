"""Which grains are awake or at rest, on the page: colours on the screen, legend and numbers."""

import numpy as np
import pytest

from sand.plotting.palettes import REST_COLOURS
from sand.plotting.style import rgb

from .looking import SOURCES, View
from .runs import FRAMES, MEETING
from .test_seen_grains import BARE, LOOKS, RESIDUAL, alone, off_colour

COLOURS = np.rint(255.0 * np.array([rgb(colour) for colour in REST_COLOURS]))


@pytest.mark.parametrize("source", SOURCES)
def test_grains_have_the_colour_of_their_cluster(page, shows, source):
    """At the middle of each grain that nothing hides; awake grains are orange, grains at rest nearly grey."""
    view = View(page, shows("resting"), source, look=LOOKS["hundred"], colour="at_rest", **BARE)
    for k in (0, MEETING, FRAMES - 1):
        rest = view.go(k).at_rest
        assert (view.painted() == COLOURS[rest.astype(int)]).all()
        eye, image = view.eye(), view.image()
        free = alone(eye, view.positions, view.radii)
        x, y = eye.pixels(view.positions)[0][free].astype(int).T
        pixels = image[y, x]
        assert off_colour(pixels, COLOURS[rest[free].astype(int)]).max() <= RESIDUAL
        if k == MEETING:
            assert (~rest[free]).sum() > 3 and rest[free].sum() > 10
            strength = np.ptp(pixels, axis=1)
            assert strength[~rest[free]].min() > 2 * strength[rest[free]].max()


@pytest.mark.parametrize("source", SOURCES)
def test_legend_and_numbers(page, shows, source):
    """Legend and time line count the awake grains of the frame; the row of the selected grain says what it does."""
    view = View(page, shows("resting"), source, colour="at_rest")
    for k in range(FRAMES):
        frame = view.go(k)
        awake = int((~frame.at_rest).sum())
        told = page.inner_text(".gv-legend").split("\n")
        assert told == [
            "grains of clusters that are",
            f"{awake} awake (contact steps)",
            f"{len(frame) - awake} at rest (rigid)",
        ]
        assert f"frame {k} of {FRAMES - 1} · {awake} awake" in " ".join(page.inner_text(".gv-time").split())
    view.go(MEETING)
    for grain, words in ((0, "awake, by contact steps"), (99, "at rest, as a rigid body")):
        view.set(grain=grain)
        assert view.rows()[f"grain {grain}"]["moves"] == words


def test_other_runs_do_not_offer_it(page, shows):
    """Without rigid clusters: no such colour, no number on the time line, no row of a grain."""
    view = View(page, shows("hundred"), colour="at_rest", grain=0)
    assert page.evaluate("() => sandView.picture.quantity.id") == "cluster"
    assert "at_rest" not in dict(page.evaluate("() => sandView.state.setting('colour').options"))
    assert "awake" not in page.inner_text(".gv-time") and "moves" not in view.rows()["grain 0"]
