"""What the page shows when it is opened without settings, on a screen, a phone and a phone on its side."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from sand.basics.box import Box

from .driving import Driven, served
from .small_runs import R, SmallRun, grains, written

SCREENS = {"desktop": (1280, 800), "phone": (390, 844), "phone on its side": (844, 390)}
CORNERS = """[-1, 1].flatMap((x) => [-1, 1].flatMap((y) => [-1, 1].map((z) =>
  app.stage.screenOf([x, y, z].map((s, a) => s * app.picture.boxLengths[a] / 2)))))"""


@pytest.fixture(scope="module")
def address(bundle, tmp_path_factory) -> Iterator[str]:
    """Of the page of a small run."""
    with served(SmallRun(tmp_path_factory.mktemp("runs") / "small").folder) as server:
        yield server.url


@pytest.fixture(params=SCREENS)
def first(request, page, address) -> Driven:
    """The page without settings, on each screen."""
    width, height = SCREENS[request.param]
    page.set_viewport_size({"width": width, "height": height})
    return Driven(page, address, bare=True)


def test_the_last_frame_with_the_largest_cluster(first):
    """It shows the last frame; the middle of the largest cluster is that of the picture, and all of it is in view.

    The cluster spans at most half of the view, as the eye is twice as far away as it needs, or sees the whole box.
    """
    assert first.get("frame") == first.run("app.manifest.times.length") - 1
    members = first.run("Array.from(app.selection.largestCluster())")
    canvas = first.tab.locator("canvas.gv-canvas").bounding_box()
    pixels = np.array([first.pixel_of(i) for i in np.flatnonzero(members).tolist()]) - [canvas["x"], canvas["y"]]
    size = np.array([canvas["width"], canvas["height"]])
    assert (pixels > 0.0).all() and (pixels < size).all()
    assert ((pixels.max(axis=0) - pixels.min(axis=0)) <= 0.55 * size).all()


def test_the_box_fits_and_nothing_is_covered(first):
    """The whole box is within the canvas; legend, picture and other parts of the page do not overlap on a phone.

    On a large screen the legend is over the left edge of the picture.
    """
    first.tab.get_by_role("button", name="Whole box").click()
    first.settle()
    canvas = first.tab.locator("canvas.gv-canvas").bounding_box()
    corners = np.array(first.run(CORNERS))[:, :2]
    assert (corners >= 0.0).all() and (corners <= [canvas["width"], canvas["height"]]).all()
    parts = [".gv-legend", ".gv > header", ".gv-timeline"]
    boxes = [first.tab.locator(part).bounding_box() for part in parts]
    if first.tab.viewport_size["width"] > 1000:
        boxes[0] = canvas
    else:
        boxes.append(canvas)
        assert min(canvas["width"], canvas["height"]) > 200
    for k, a in enumerate(boxes):
        assert a["x"] >= 0 and a["x"] + a["width"] <= first.tab.viewport_size["width"] + 1
        for b in boxes[:k]:
            apart = [
                a["x"] >= b["x"] + b["width"] - 1,
                b["x"] >= a["x"] + a["width"] - 1,
                a["y"] >= b["y"] + b["height"] - 1,
                b["y"] >= a["y"] + a["height"] - 1,
            ]
            assert any(apart), (a, b)


@pytest.mark.parametrize(("side", "aims"), [(60.0, False), (1500.0, True)])
def test_the_largest_cluster_where_the_box_would_not_show_it(page, tmp_path, side, aims):
    """A row of four grains in a box of this many radii: the whole box, or the row if it had under 12 pixels there.

    Told by a note then; `r` shows the whole box, in which the row is that small.
    """
    row = np.column_stack([2.0 * np.arange(4) - 3.0, np.zeros(4), np.zeros(4)])
    pairs = np.column_stack([np.arange(3), np.arange(1, 4)])
    with served(written(tmp_path / "row", [(grains(row), pairs)], Box.periodic(side * R))) as server:
        view = Driven(page, server.url, bare=True)
        first, note = view.look(), view.tab.locator(".gv-note")
        assert note.is_visible() == aims
        view.press("r")
        whole = view.look()
        assert np.allclose(first["from"], whole["from"], atol=1e-4)
        assert (first["height"] == pytest.approx(whole["height"], rel=1e-3, abs=0.0)) == (not aims)
        ends = np.array([view.pixel_of(0), view.pixel_of(3)])
        assert (np.linalg.norm(ends[1] - ends[0]) < 12.0) == aims
        if aims:
            assert "Press r for the whole box" in note.inner_text()
            view.run("app.camera.showFirst(app.selection.largestCluster(), app.page.canvas.clientHeight)")
            view.settle()
            ends = np.array([view.pixel_of(0), view.pixel_of(3)])
            assert np.linalg.norm(ends[1] - ends[0]) > 100.0


def test_an_address_with_settings_is_not_changed(page, address):
    """A shared address opens at its frame, here the first one."""
    assert Driven(page, f"{address}#box=0", bare=True).get("frame") == 0
