"""What settings mean for the picture, the legend and the panel, one by one."""

from __future__ import annotations

import numpy as np
import pytest

from .driving import Driven, differ
from .small_runs import GRAINS, SIDE
from .test_driven_settings import colours, legend, shown


def test_one_cluster_alone(view):
    """Only its four grains are drawn, whole, and the contacts between them."""
    look = view.look()
    view.put(grain=1, isolate=True, arrows=False)
    view.run("app.stage.look = told[0]", look)
    assert shown(view) == [1] * 4 + [0] * (GRAINS - 4)
    corner = view.tab.locator("canvas.gv-canvas").bounding_box()
    alone = view.picture()
    for grain, drawn in ((10, False), (8, False), (1, True)):
        column, line = (round(v) for v in np.subtract(view.pixel_of(grain), (corner["x"], corner["y"])))
        assert (alone[line, column].tolist() != alone[0, -1].tolist()) == drawn, grain
    x = np.array(view.run("[0, 1, 2, 3].map((i) => app.picture.positions[3 * i])"))
    unit = view.run("app.manifest.unit") / 10e-9
    assert np.allclose(np.diff(x) * unit, 1.99, atol=1e-4)
    chosen = view.run("[...new Set(app.world.pieces.contact)].sort()")
    assert [view.run("[...app.picture.frame.pair.slice(2 * told[0], 2 * told[0] + 2)]", c) for c in chosen] == [
        [0, 1],
        [1, 2],
        [2, 3],
    ]


def room(view: Driven, *grains: int) -> float:
    """How much of the canvas these grains take, wide or high, whichever is more; above 1 if one is not all within."""
    canvas = view.tab.locator("canvas.gv-canvas").bounding_box()
    size = np.array([canvas["width"], canvas["height"]])
    at = np.array([view.pixel_of(grain) for grain in grains]) - [canvas["x"], canvas["y"]] - size / 2
    radius = view.run("app.dataset.grains.radius[told[0]] * app.stage.pixelsPerLength", grains[0])
    return float((2 * (np.abs(at) + radius) / size).max())


CHOSEN = {"i": {"grain": 1}, "z": {"grain": 1}, "y": {"grain": 10, "isolate": True}}
LOOKS = (
    {"target": [0, 0, 0], "from": [0, -1, 0], "up": [0, 0, 1], "height": 200},
    {"target": [300, -40, 7], "from": [0.6, -0.8, 0], "up": [0, 0, 1], "height": 3},
)


@pytest.mark.parametrize("ortho", [False, True])
@pytest.mark.parametrize("key", CHOSEN)
def test_a_chosen_cluster_fits_the_picture(view, key, ortho):
    """Alone, centred, or alone in place of another: all of it is seen, and large, however the camera stood before.

    Fitted are middles and two radii around each, for arrows, and 8 %.  Of a chain of four along x, seen at 53° to it,
    grains are (2.4 + 1)/(2.4 + 2)/1.08 = 0.71 of the width, and less in perspective, which needs room for what is near.
    """
    for look in LOOKS:
        view.fresh()
        view.put(ortho=ortho, **CHOSEN[key])
        view.run("app.stage.look = told[0]", look)
        view.press(key)
        assert 0.6 < room(view, 0, 1, 2, 3) < 1.0
        assert np.allclose(view.look()["from"], look["from"], atol=1e-4)


def test_another_grain_of_the_cluster_that_stands_alone(view):
    """Choosing it leaves the camera where it is; so does centring a grain that touches none, but for the place."""
    view.put(grain=1, isolate=True)
    view.press("PageUp", "Control+ArrowLeft")
    look = view.look()
    view.press(".")
    assert view.get("grain") == 2 and view.look() == look
    view.fresh()
    view.put(grain=10)
    height = view.look()["height"]
    view.press("z")
    assert view.look()["height"] == pytest.approx(height, rel=1e-6, abs=0.0) and room(view, 10) < 0.2


@pytest.mark.parametrize(
    ("kind", "words"),
    [("off", []), ("plain", []), ("load", ["normal force"]), ("mode", ["stretch", "slide", "roll", "twist"])],
)
def test_kinds_of_contacts(view, kind, words):
    """Each is drawn in another way; the legend says how."""
    view.put(bonds=kind, size=0.4)
    now = view.picture()
    assert all(word in legend(view) for word in words)
    assert view.run("app.world.bonds.mesh.visible") == (kind != "off")
    for other in {"off", "plain", "load", "mode"} - {kind}:
        view.put(bonds=other)
        assert differ(now, view.picture()) > 10, other


def test_every_colouring_has_its_legend(view):
    """Each of those offered gives grains other colours than one before, and is named."""
    names = view.run("app.state.setting('colour').options")
    assert {"cluster", "speed", "material", "alignment", "field_alignment"} <= {name for name, _ in names}
    pictures = []
    for name, label in names:
        view.control("colour").select_option(name)
        view.settle()
        first = legend(view).split("\n")[0]
        assert first.startswith("clusters" if name == "cluster" else label), name
        pictures.append(str(colours(view)))
    assert len(set(pictures)) == len(names)


def test_numbers_of_the_legend(view):
    """Ends of the range in the unit that is named; Minimum and Maximum are in SI units; angles take no prefix."""
    view.put(colour="spin")
    view.control("low").fill("1e8")
    view.control("low").press("Enter")
    view.control("high").fill("4e8")
    view.control("high").press("Enter")
    view.settle()
    assert "spin (rad/s)" in legend(view)
    assert view.tab.locator(".gv-ends span").all_inner_texts() == ["1×10⁸", "2.5×10⁸", "4×10⁸"]
    view.control("log").click()
    view.settle()
    assert view.tab.locator(".gv-ends span").all_inner_texts() == ["1×10⁸", "2×10⁸", "4×10⁸"]
    view.put(colour="speed", low=1e3, high=4e3, log=False)
    assert "speed (km/s)" in legend(view)
    assert view.tab.locator(".gv-ends span").all_inner_texts() == ["1", "2.5", "4"]


def test_no_number_is_taken_back(view):
    """Words in a field of numbers go away; nothing changes."""
    view.put(colour="speed")
    before = colours(view)
    view.control("low").fill("much")
    view.control("low").press("Enter")
    assert view.control("low").input_value() == ""
    assert view.get("low") is None and colours(view) == before


def test_letters_in_a_field_are_not_keys(view):
    """Typing m in Minimum leaves the arrows."""
    view.put(colour="speed")
    view.control("low").focus()
    view.press("m", "b", "2")
    assert view.get("arrows") and view.get("bonds") == "plain"
    assert view.control("low").input_value() == "mb2"


def test_sliders_are_moved_by_arrow_keys(view):
    """When one has the focus, arrows and Home are its own."""
    view.put(frame=3)
    view.control("size").focus()
    view.press("ArrowLeft")
    assert (view.get("size"), view.get("frame")) == (0.95, 3)
    view.press("Home")
    assert (view.get("size"), view.get("frame")) == (0.1, 3)
    view.press("m")
    assert not view.get("arrows")


def test_shift_goes_back(view):
    """Through a list of choices, one by one."""
    view.press("b")
    assert view.get("bonds") == "load"
    view.press("B", "B")
    assert view.get("bonds") == "off"


def test_meaningless_controls_are_grey(view):
    """A scale of colours means nothing for names."""
    assert view.control("palette").is_disabled() and view.control("low").is_disabled()
    view.put(colour="speed")
    assert view.control("palette").is_enabled() and view.control("low").is_enabled()


@pytest.mark.parametrize("whole", [False, True])
def test_trails_end_where_grains_are(view, whole):
    """Segments join the places of one frame to those of the next, none crosses the box; whole clusters have theirs."""
    view.put(frame=3, trails=2, whole=whole)
    view.tab.wait_for_timeout(100)
    ends = np.array(view.run("[...app.world.trails.lines.geometry.attributes.position.array]")).reshape(-1, 2, 3)
    unit = view.run("app.manifest.unit") / 10e-9
    assert len(ends) == 2 * GRAINS
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max() * unit < SIDE / 2
    place = np.array(view.run("[...app.picture.positions]")).reshape(-1, 3)
    assert np.allclose(ends[GRAINS:, 1], place, atol=1e-5)


def test_parallel_rays_see_what_is_near(view):
    """Near by, what lies in front of the camera is not cut away: the same view, set anew, is the same picture."""
    view.put(ortho=True, shade=0)
    view.run("app.camera.zoom(1 / 1.2)")
    view.tab.mouse.move(*view.pixel_of(9))
    for _ in range(6):
        view.tab.mouse.wheel(0, -400)
    before = view.picture()
    view.run("app.stage.look = app.stage.look")
    assert differ(before, view.picture(), 8) < 20


def test_a_contact_of_a_cluster_that_stands_alone(view):
    """Choosing it leaves the cluster alone."""
    view.put(grain=1, isolate=True)
    shown = view.run("[...app.world.shown]")
    view.press("k")
    assert view.get("contact") and view.get("isolate")
    assert view.run("[...app.world.shown]") == shown


def test_the_middle_of_a_contact(view):
    """Centre puts it into the middle of the picture."""
    view.put(contact="8-9")
    view.press("z")
    at = np.array([view.pixel_of(8), view.pixel_of(9)])
    box = view.tab.locator("canvas.gv-canvas").bounding_box()
    middle = [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
    assert at.mean(axis=0) == pytest.approx(middle, abs=1.5)


def test_another_cluster_is_followed(view):
    """Choosing it turns the camera to it at once; the next frame does not make the camera jump."""
    view.put(frame=1, grain=10, follow=True)
    view.put(grain=11)
    target, place = view.look()["target"], view.run("[...app.picture.positions.slice(33, 36)]")
    assert np.allclose(target, place, atol=1e-4)
