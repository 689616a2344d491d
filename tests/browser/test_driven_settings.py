"""Every setting by its form control and by its key: what changes on the page is what the setting says."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from .driving import Driven, differ


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
    return view.text(".gv-plot-title").split(" (")[0], view.run("app.plot.chart.series.length")


def seen(name: str) -> Callable[[Driven], object]:
    """Says what an expression is on the page."""
    return lambda view: view.run(name)


def followed(view: Driven) -> object:
    """Where the camera looks at, once the chosen cluster has moved."""
    view.run("app.navigation.go(3)")
    view.settle()
    target = view.look()["target"]
    middle = view.run("app.selection.centre()")
    return bool(np.allclose(target, middle, atol=1e-3))


def measuring(view: Driven) -> object:
    """What a click on a grain does."""
    view.tab.mouse.click(*view.pixel_of(10))
    view.settle()
    return view.get("ends"), view.get("grain")


def played(view: Driven) -> object:
    """Frames gone on in a second."""
    view.run("app.navigation.go(0)")
    view.settle()
    view.run("app.player.toggle()")
    view.tab.wait_for_timeout(500)
    view.run("app.player.stop()")
    return view.get("frame") > 2


def around(view: Driven) -> object:
    """Whether it plays on behind the last frame."""
    view.run("app.navigation.go(6)")
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
    "whole": ({}, seen("app.picture.positions[0] > 0 === app.picture.positions[9] > 0"), True),
    "isolate": ({"grain": 5}, shown, True),
    "trails": ({"frame": 5}, seen("[app.world.trails.lines.visible, app.state.get('trails')]"), True),
    "shade": ({}, seen("app.world.uniforms.uHaze.value"), True),
    "bonds": ({"size": 0.5}, bonds, True),
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
