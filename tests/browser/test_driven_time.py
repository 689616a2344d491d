"""The time line, the plot below it, and the mouse on the picture."""

from __future__ import annotations

import base64

import numpy as np
import pytest

from .driving import Driven, differ, image, served
from .small_runs import FRAMES, GRAINS, MERGED, PARTED, STEP, SmallRun


def drag(view: Driven, start: tuple[float, float], by: tuple[float, float], button: str = "left") -> None:
    mouse = view.tab.mouse
    mouse.move(*start)
    mouse.down(button=button)
    mouse.move(start[0] + by[0] / 2, start[1] + by[1] / 2)
    mouse.move(start[0] + by[0], start[1] + by[1])
    mouse.up(button=button)
    view.settle()


def empty_place(view: Driven) -> tuple[float, float]:
    """Beside all grains, in the picture."""
    box = view.tab.locator("canvas.gv-canvas").bounding_box()
    return box["x"] + box["width"] / 3, box["y"] + box["height"] - 8


def test_scrubbing_with_the_mouse(view):
    """The slider is dragged; the picture is that of the frame it stands at."""
    box = view.tab.locator(".gv-slider").bounding_box()
    first, y = view.picture(), box["y"] + box["height"] / 2
    drag(view, (box["x"] + 8, y), ((box["width"] - 16) * 5 / (FRAMES - 1), 0))
    assert view.get("frame") == 5 == view.run("app.picture.frame.frame")
    assert view.text(".gv-time").startswith("t = 5 ns")
    assert view.tab.locator(".gv-slider").get_attribute("aria-valuetext") == "frame 5, 5 ns"
    assert differ(first, view.picture()) > 100
    drag(view, (box["x"] + 8 + (box["width"] - 16) * 5 / (FRAMES - 1), y), (-box["width"], 0))
    assert view.get("frame") == 0 and differ(first, view.picture()) == 0


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_ticks_are_where_events_are(view, theme):
    """Of the frames that show them first, and nowhere else; made above, broken below, in the theme's colours."""
    view.put(theme=theme)
    url = view.tab.locator("canvas.gv-ticks").evaluate("(c) => c.toDataURL()")
    ticks = image(base64.b64decode(url.split(",")[1]))
    (half, wide), upper = (ticks.shape[0] // 2, ticks.shape[1]), ticks[: ticks.shape[0] // 2]
    for rows, frame, name in ((upper, MERGED, "made"), (ticks[half + 1 :], PARTED, "broken")):
        marked = np.flatnonzero(rows[..., 3].max(axis=0) > 128)
        assert abs(marked.mean() + 0.5 - (8 + frame / (FRAMES - 1) * (wide - 16))) < 1.0, name
        assert len(marked) <= 3
        wanted = view.run("getComputedStyle(app.timeline.ticks).getPropertyValue('--gv-' + told[0])", name)
        seen = rows[..., marked[np.argmax(rows[0, marked, 3])], :3][0]
        assert np.abs(seen - [int(wanted[k : k + 2], 16) for k in (1, 3, 5)]).max() < 12
    view.put(frame=MERGED)
    assert view.text(".gv-time").endswith("contacts: 1 formed")
    view.put(frame=PARTED)
    assert view.text(".gv-time").endswith("1 broken")


@pytest.mark.parametrize(
    ("frames", "words"),
    [(MERGED, []), (MERGED + 1, ["contacts formed"]), (FRAMES, ["contacts formed", "contacts broken"])],
)
def test_the_key_of_the_ticks(page, bundle, tmp_path, frames, words):
    """Says what the ticks are, of the kinds that there are, each beside its colour."""
    with served(SmallRun(tmp_path / "small", frames).folder) as server:
        view = Driven(page, server.url)
        assert view.tab.locator(".gv-ticks-key span").all_inner_texts() == words
        for kind in ("made", "broken")[: len(words)]:
            colour = "(e) => getComputedStyle(e, '::before').backgroundColor"
            shown = view.tab.locator(f".gv-ticks-key .gv-{kind}").evaluate(colour)
            wanted = view.run("getComputedStyle(app.timeline.ticks).getPropertyValue('--gv-' + told[0])", kind)
            assert shown == f"rgb({', '.join(str(int(wanted[k : k + 2], 16)) for k in (1, 3, 5))})"


def test_the_cursor_of_the_plot_is_the_time(view):
    """In the middle of its line is the place of the frame's time on the axis, at any width of the page."""
    for width, frames in ((900, (0, 3, FRAMES - 1)), (800, (2,))):
        view.tab.set_viewport_size({"width": width, "height": 560})
        view.tab.wait_for_timeout(50)
        for frame in frames:
            view.put(frame=frame)
            line = view.tab.locator(".gv-cursor").bounding_box()
            over = view.tab.locator(".gv-plot .u-over").bounding_box()
            at = view.run("app.plot.chart.valToPos(told[0], 'x')", frame * STEP / 1e-9)
            assert line["x"] + line["width"] / 2 == pytest.approx(over["x"] + at, abs=1.0)
            assert line["y"] == pytest.approx(over["y"], abs=1.0)
            assert line["height"] == pytest.approx(over["height"], abs=2.0)


def test_clicking_in_the_plot_goes_to_the_nearest_frame(view):
    """And dragging there scrubs."""
    over = view.tab.locator(".gv-plot .u-over").bounding_box()
    y = over["y"] + over["height"] / 2
    places = {t: over["x"] + view.run("app.plot.chart.valToPos(told[0], 'x')", t) for t in (1.6, 2.4, 5.1)}
    view.tab.mouse.click(places[1.6], y)
    view.settle()
    assert view.get("frame") == 2
    view.tab.mouse.click(places[5.1], y)
    view.settle()
    assert view.get("frame") == 5
    drag(view, (places[5.1], y), (places[2.4] - places[5.1], 0))
    assert view.get("frame") == 2


def test_the_plots_have_what_the_ledger_has(view):
    """Each of those offered: its title, its lines by name, its numbers of the last row, at their places on the axis."""
    names = view.run("app.state.setting('plot').options")
    assert [name for name, _ in names] == ["clusters", "energies", "losses", "contacts", "balance"]
    for name, title in names:
        view.control("plot").select_option(name)
        view.settle()
        assert view.text(".gv-plot-title").startswith(title)
        assert view.text(".gv-plot .u-legend").count("\n") + 1 >= 1
    view.put(plot="contacts")
    assert view.plotted()[:, -1] == pytest.approx([7, 8, 1], rel=1e-6, abs=0.0)
    assert view.run("app.plot.chart.data[0].at(-1)") == pytest.approx(FRAMES - 1, rel=1e-6, abs=0.0)
    assert "time (ns)" in view.run("app.plot.chart.axes[0].label")


def test_dragging_turns(view):
    """The eye goes around the target at the same distance; nothing is chosen by it."""
    before = view.look()
    drag(view, view.pixel_of(11), (80, 30))
    after = view.look()
    assert np.linalg.norm(np.subtract(after["from"], before["from"])) > 0.1
    assert np.allclose(after["target"], before["target"]) and after["height"] == pytest.approx(
        before["height"], rel=1e-6, abs=0.0
    )
    assert view.get("grain") == -1


def test_dragging_with_the_right_button_moves(view):
    """The picture goes along with the mouse."""
    before, (x, y) = view.look(), view.pixel_of(0)
    drag(view, empty_place(view), (-40, -25), "right")
    after = view.look()
    assert np.allclose(after["from"], before["from"], atol=1e-4)
    assert np.linalg.norm(np.subtract(after["target"], before["target"])) > 0.01 * before["height"]
    assert np.allclose(np.subtract(view.pixel_of(0), (x, y)), (-40, -25), atol=8)


def test_the_wheel_goes_nearer(view):
    """Towards what is under the mouse: it stays there."""
    for ortho in (False, True):
        view.fresh()
        view.put(ortho=ortho)
        before, place = view.look(), view.pixel_of(5)
        view.tab.mouse.move(*place)
        view.tab.mouse.wheel(0, -300)
        view.tab.wait_for_timeout(50)
        view.settle()
        assert view.look()["height"] < 0.9 * before["height"]
        assert np.allclose(view.look()["from"], before["from"], atol=1e-3)
        assert np.linalg.norm(np.subtract(view.pixel_of(5), place)) < 12
        view.tab.mouse.wheel(0, 300)
        view.tab.wait_for_timeout(50)
        view.settle()
        assert view.look()["height"] == pytest.approx(before["height"], rel=0.1, abs=0.0)


def test_a_click_chooses_what_is_under_it(view):
    """Every grain that is not behind another; a click beside all chooses nothing."""
    view.press("3")
    view.put(arrows=False, bonds="off")
    for grain in range(GRAINS):
        view.tab.mouse.click(*view.pixel_of(grain))
        view.settle()
        assert view.get("grain") == grain
        assert f"grain {grain}" in view.text(".gv-inspector")
        view.press("Escape")
    view.tab.mouse.click(*view.pixel_of(4))
    view.tab.mouse.click(*empty_place(view))
    view.settle()
    assert view.get("grain") == -1 and not view.tab.locator(".gv-inspector").is_visible()


def test_a_click_chooses_a_contact(view):
    """Between two small grains, where its bar is."""
    view.press("3")
    view.put(size=0.3, bar=0.5, arrows=False)
    (x, y), (u, v) = view.pixel_of(5), view.pixel_of(6)
    view.tab.mouse.click((x + u) / 2, (y + v) / 2)
    view.settle()
    assert view.get("contact") == "5-6" and view.get("grain") == -1
    rows = view.text(".gv-inspector")
    assert "contact 5–6" in rows and "overlap\t0.5 nm" in rows.replace("500 pm", "0.5 nm")
    view.put(frame=3)
    assert "contact 5–6" in view.text(".gv-inspector")


def test_a_chosen_grain_is_marked(view):
    """Its rim differs from before, and nothing far from it."""
    view.put(arrows=False)
    before = view.picture()
    view.put(grain=11)
    after = view.picture()
    box = view.tab.locator("canvas.gv-canvas").bounding_box()
    x, y = np.subtract(view.pixel_of(11), (box["x"], box["y"]))
    rows, columns = np.nonzero(np.any(before != after, axis=-1))
    assert len(rows) > 10
    assert np.hypot(columns - x, rows - y).max() < 30


def test_the_canvas_suits_the_window(view):
    """After a change of size the picture fills its place, and a grain is clicked where it is seen."""
    for size in ((700, 620), (800, 560)):
        view.tab.set_viewport_size({"width": size[0], "height": size[1]})
        view.tab.wait_for_timeout(100)
        view.settle()
        box = view.tab.locator("canvas.gv-canvas").bounding_box()
        assert view.picture().shape[:2] == (round(box["height"]), round(box["width"]))
        view.tab.mouse.click(*view.pixel_of(11))
        view.settle()
        assert view.get("grain") == 11
        view.press("Escape")
