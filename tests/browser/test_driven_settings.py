"""Every setting by its form control and by its key: what changes on the page is what the setting says."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from .conftest import page_of
from .driving import Driven, differ, served
from .small_runs import GRAINS, SIDE, SmallRun


@pytest.fixture(scope="module")
def tab(browser, bundle, tmp_path_factory) -> Iterator[Driven]:
    """One page for all of these tests."""
    folder = SmallRun(tmp_path_factory.mktemp("runs") / "small").folder
    with served(folder) as server:
        pages = page_of(browser)
        page = next(pages)
        page.set_viewport_size({"width": 800, "height": 560})
        yield Driven(page, server.url)
        next(pages, None)


@pytest.fixture
def view(tab) -> Driven:
    """The page as at first."""
    tab.fresh()
    return tab


def colours(view: Driven) -> list[list[int]]:
    """Of all grains, as drawn."""
    return view.run("Array.from({ length: 12 }, (_, i) => [...app.picture.painted.colour.slice(4 * i, 4 * i + 4)])")


def legend(view: Driven) -> str:
    return view.text(".gv-legend")


def colour(view: Driven) -> object:
    return legend(view).split("\n")[0].split(" (")[0], colours(view)


def colour_control(view: Driven) -> None:
    view.control("colour").select_option("speed")


def scaled(view: Driven) -> object:
    """Colours, and the three numbers under their bar."""
    return colours(view), view.tab.locator(".gv-legend .gv-ends").first.inner_text()


def arrows(view: Driven) -> object:
    return view.run("app.world.arrows.mesh.visible")


def shown(view: Driven) -> object:
    return view.run("app.world.shown && [...app.world.shown]")


def bonds(view: Driven) -> object:
    pieces = view.run("app.world.pieces && [...app.world.pieces.colour]")
    return view.run("app.world.bonds.mesh.visible"), pieces, "limit" in legend(view), "normal force" in legend(view)


def theme(view: Driven) -> object:
    return view.picture()[0, -1].tolist(), view.run("getComputedStyle(app.page.root).backgroundColor")


def plot(view: Driven) -> object:
    return view.run("[app.plot.chart.axes[1].label.split(' (')[0], app.plot.chart.series.length]")


def seen(name: str) -> Callable[[Driven], object]:
    """Says what an expression is on the page."""
    return lambda view: view.run(name)


def followed(view: Driven) -> object:
    """Where the camera looks at, once the chosen cluster has moved."""
    view.run("app.go(3)")
    view.settle()
    target = view.look()["target"]
    middle = view.run("app.choosing.middle()")
    return bool(np.allclose(target, middle, atol=1e-3))


def measuring(view: Driven) -> object:
    """What a click on a grain does."""
    view.tab.mouse.click(*view.place_of(10))
    view.settle()
    return view.get("ends"), view.get("grain")


def played(view: Driven) -> object:
    """Frames gone on in a second."""
    view.run("app.go(0)")
    view.settle()
    view.run("app.player.toggle()")
    view.tab.wait_for_timeout(500)
    view.run("app.player.stop()")
    return view.get("frame") > 2


def around(view: Driven) -> object:
    """Whether it plays on behind the last frame."""
    view.run("app.go(6)")
    view.put(speed=30)
    view.settle()
    view.run("app.player.toggle()")
    view.tab.wait_for_timeout(400)
    going = view.run("app.player.playing")
    view.run("app.player.stop()")
    return going


# how each is set up; what is looked at; whether pixels of the canvas change with it
EFFECTS: dict[str, tuple[dict, Callable[[Driven], object], bool]] = {
    "colour": ({}, colour, True),
    "palette": ({"colour": "speed"}, scaled, True),
    "log": ({"colour": "speed"}, scaled, True),
    "low": ({"colour": "speed"}, scaled, True),
    "high": ({"colour": "speed"}, scaled, True),
    "theme": ({}, theme, True),
    "size": ({}, seen("app.world.uniforms.uSize.value"), True),
    "arrows": ({}, arrows, True),
    "box": ({}, seen("app.world.box.lines.visible"), True),
    "field": ({}, seen("document.querySelectorAll('.gv-axis').length"), False),
    "whole": ({}, seen("app.picture.place[0] > 0 === app.picture.place[9] > 0"), True),
    "isolate": ({"grain": 5}, shown, True),
    "trails": ({"frame": 5}, seen("[app.world.trails.lines.visible, app.state.get('trails')]"), True),
    "shade": ({}, seen("app.world.uniforms.uHaze.value"), True),
    "bonds": ({}, bonds, True),
    "bar": ({"size": 0.5}, seen("app.world.bar"), True),
    "ortho": ({}, seen("app.stage.camera.isOrthographicCamera ?? false"), True),
    "follow": ({"grain": 5}, followed, False),
    "measure": ({}, measuring, False),
    "speed": ({"speed": 20}, played, False),
    "loop": ({}, around, False),
    "live": ({}, seen("app.state.get('live')"), False),  # its effect: test_driven_live
    "plot": ({}, plot, False),
}
VALUES = {"colour": "speed", "theme": "dark", "bonds": "load", "plot": "contacts", "low": "5", "high": "9"}
RANGES = {"size": "0.4", "trails": "3", "shade": "0", "bar": "0.8", "speed": "1"}
KEYS = {"theme": ["d", "d"], "speed": ["-"] * 19, "trails": ["t"] * 4}  # the first d: light, as most systems are
KEYS |= {"size": ["["] * 6, "shade": ["H"] * 5, "bar": ["}"] * 5}
HIDDEN = {"frame", "grain", "contact", "ends", "look"}  # set by actions, by mouse and by the address


def by_control(view: Driven, setting: str) -> None:
    """As with the mouse, in the panel."""
    control = view.control(setting)
    if setting == "palette":
        control.select_option(index=1)
    elif control.get_attribute("type") == "checkbox":
        control.click()
    elif control.get_attribute("type") == "range":
        control.fill(RANGES[setting])
    elif control.get_attribute("type") == "text":
        control.fill(VALUES[setting])
        control.press("Enter")
    else:
        control.select_option(VALUES[setting])


def by_key(view: Driven, setting: str) -> None:
    """With nothing in focus."""
    view.tab.evaluate("() => document.activeElement.blur()")
    view.press(*KEYS.get(setting, [view.run(f"app.state.setting({setting!r}).key")]))


CASES = [(name, by_control) for name in EFFECTS]
CASES += [(name, by_key) for name in EFFECTS if name not in ("palette", "low", "high")]  # these have no keys


@pytest.mark.parametrize(("setting", "way"), CASES, ids=[f"{name}-{way.__name__[3:]}" for name, way in CASES])
def test_a_setting_does_what_it_says(view, setting, way):
    """Before and after differ in what the setting is about; the control shows the value."""
    setup, effect, drawn = EFFECTS[setting]
    view.put(**setup)
    before, old, value = effect(view), view.picture(), view.get(setting)
    if not drawn:  # looking at it has changed what is shown
        view.fresh()
        view.put(**setup)
    way(view, setting)
    view.settle()
    assert view.get(setting) != value
    assert effect(view) != before
    if drawn:
        assert differ(old, view.picture()) > 20
    shown_value = view.control(setting).evaluate("(e) => e.type === 'checkbox' ? e.checked : e.value")
    assert str(view.get(setting)).lower() in (str(shown_value).lower(), f"{shown_value}.0")


def test_no_setting_is_left_out(view):
    """A new one without a test fails here."""
    told = view.run("app.state.settings.map((s) => [s.id, s.kind, s.key ?? ''])")
    assert {name for name, _, _ in told} == set(EFFECTS) | HIDDEN
    assert {name for name, kind, _ in told if kind == "hidden"} == HIDDEN
    keyless = {name for name, kind, key in told if kind != "hidden" and not key}
    assert keyless == set(EFFECTS) - {name for name, way in CASES if way is by_key}


def test_keys_mean_one_thing(view):
    """No two settings or actions share a key."""
    keys = view.run(
        "[...app.actions.flatMap((a) => a.keys), ...app.state.settings.flatMap((s) => [s.key, s.down].filter(Boolean))]"
    )
    assert sorted(keys) == sorted(set(keys))


def test_one_cluster_alone(view):
    """Only its four grains are drawn, whole, and the contacts between them."""
    view.put(grain=1, isolate=True)
    assert shown(view) == [1] * 4 + [0] * (GRAINS - 4)
    x = np.array(view.run("[0, 1, 2, 3].map((i) => app.picture.place[3 * i])"))
    unit = view.run("app.manifest.unit") / 10e-9
    assert np.allclose(np.diff(x) * unit, 1.99, atol=1e-4)
    chosen = view.run("[...new Set(app.world.pieces.contact)].sort()")
    assert [view.run("[...app.picture.frame.pair.slice(2 * told[0], 2 * told[0] + 2)]", c) for c in chosen] == [
        [0, 1],
        [1, 2],
        [2, 3],
    ]


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
    assert {"cluster", "speed", "material", "alignment", "field"} <= {name for name, _ in names}
    pictures = []
    for name, label in names:
        view.control("colour").select_option(name)
        view.settle()
        first = legend(view).split("\n")[0]
        assert first.startswith("clusters" if name == "cluster" else label), name
        pictures.append(str(colours(view)))
    assert len(set(pictures)) == len(names)


def test_numbers_of_the_legend(view):
    """They are the ends of the range, in the unit that is named; From and To are in SI."""
    view.put(colour="spin")
    view.control("low").fill("1e8")
    view.control("low").press("Enter")
    view.control("high").fill("4e8")
    view.control("high").press("Enter")
    view.settle()
    assert "spin (Mrad/s)" in legend(view)
    assert view.tab.locator(".gv-ends span").all_inner_texts() == ["100", "250", "400"]
    view.control("log").click()
    view.settle()
    assert view.tab.locator(".gv-ends span").all_inner_texts() == ["100", "200", "400"]


def test_no_number_is_taken_back(view):
    """Words in a field of numbers go away; nothing changes."""
    view.put(colour="speed")
    before = colours(view)
    view.control("low").fill("much")
    view.control("low").press("Enter")
    assert view.control("low").input_value() == ""
    assert view.get("low") is None and colours(view) == before


def test_letters_in_a_field_are_not_keys(view):
    """Typing m in From leaves the arrows."""
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


def test_trails_end_where_grains_are(view):
    """Segments join the places of one frame to those of the next, and none crosses the box."""
    view.put(frame=3, trails=2)
    view.tab.wait_for_timeout(100)
    ends = np.array(view.run("[...app.world.trails.lines.geometry.attributes.position.array]")).reshape(-1, 2, 3)
    unit = view.run("app.manifest.unit") / 10e-9
    assert len(ends) == 2 * GRAINS
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max() * unit < SIDE / 2
    place = np.array(view.run("[...app.picture.frame.position]")).reshape(-1, 3)
    assert np.allclose(ends[GRAINS:, 1], place, atol=1e-5)
