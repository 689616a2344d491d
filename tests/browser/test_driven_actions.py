"""Every action by its keys and by its button: the effect is checked."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from .driving import Driven
from .small_runs import FRAMES, GRAINS, MERGED, PARTED

Check = Callable[[Driven], None]


def shows_frame(frame: int) -> Check:
    """A frame is shown: by the state, by the text beside the time line, by the grains on the canvas."""

    def check(view: Driven) -> None:
        assert view.get("frame") == frame == view.run("app.picture.frame.frame")
        assert f"frame {frame} of {FRAMES - 1}" in view.text(".gv-time")
        assert view.run("app.timeline.slider.valueAsNumber") == frame

    return check


def has(**settings: object) -> Check:
    """Settings have these values."""

    def check(view: Driven) -> None:
        assert {name: view.get(name) for name in settings} == settings

    return check


def captions(*words: str) -> Check:
    """What the box of numbers tells of."""

    def check(view: Driven) -> None:
        assert view.tab.locator(".gv-inspector caption").all_inner_texts() == list(words)
        assert view.tab.locator(".gv-inspector").is_visible() == bool(words)

    return check


def looks_along(axis: list[float]) -> Check:
    def check(view: Driven) -> None:
        assert np.allclose(view.look()["from"], axis, atol=1e-4)

    return check


def camera_changed(part: str, test: Callable[[np.ndarray, np.ndarray, dict], bool]) -> Check:
    """Only this part of the camera has changed from the first view, as `test` says."""

    def check(view: Driven) -> None:
        now = view.look()
        view.press("r")
        first = view.look()
        assert test(np.array(now[part]), np.array(first[part]), first)
        same = {"target", "from", "up", "height"} - {part}
        assert all(np.allclose(now[name], first[name], atol=1e-4) for name in same)

    return check


def target_shifted(right: float, upwards: float) -> Check:
    """The target has moved by this much, in heights of the picture."""

    def test(now: np.ndarray, first: np.ndarray, look: dict) -> bool:
        side = np.cross(look["up"], look["from"])
        side /= np.linalg.norm(side)
        up = np.cross(look["from"], side)
        return np.allclose((now - first) / look["height"] @ np.array([side, up]).T, [right, upwards], atol=1e-3)

    return camera_changed("target", test)


def camera_rotated(sideways: int, upwards: int) -> Check:
    """The camera has rotated about the target by π/24."""

    def test(now: np.ndarray, first: np.ndarray, look: dict) -> bool:
        angle = np.arctan2(now[1], now[0]) - np.arctan2(first[1], first[0])
        rise = np.arcsin(now[2]) - np.arcsin(first[2])
        return np.allclose([angle, rise], [sideways * np.pi / 24, upwards * np.pi / 24], atol=2e-3)

    return camera_changed("from", test)


def dialog(title: str) -> Check:
    """A dialog of this name is open, and Esc closes it and does nothing else."""

    def check(view: Driven) -> None:
        assert view.tab.get_by_role("dialog", name=title).is_visible()
        chosen = view.get("grain")
        view.press("Escape")
        assert view.tab.locator("dialog").count() == 0
        assert view.get("grain") == chosen

    return check


def kind_asked(kind: str) -> Check:
    def check(view: Driven) -> None:
        assert view.tab.locator("#gv-cap-kind").input_value() == kind
        dialog("Picture or movie")(view)

    return check


def playing(view: Driven) -> None:
    """The same key pauses it."""
    assert view.run("app.player.playing")
    assert view.tab.get_by_role("button", name="Pause").is_visible()
    view.press("Space")
    assert not view.run("app.player.playing")
    assert view.tab.get_by_role("button", name="Play").is_visible()


def centred(view: Driven) -> None:
    assert np.allclose(view.look()["target"], view.run("app.selection.centre()"), atol=1e-4)


def sees_largest(view: Driven) -> None:
    """The eye aims at the middle of the largest cluster, that of grain 0, and is not farther than for the whole box."""
    members = view.run("Array.from(app.selection.largestCluster())")
    assert members[0] == 1
    positions = np.reshape(view.run("Array.from(app.picture.positions)"), (-1, 3))[np.array(members) == 1]
    middle = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    assert np.allclose(view.look()["target"], middle, atol=1e-4)
    assert view.look()["height"] <= view.run("app.camera.overview().height")


def broadside(view: Driven) -> None:
    """Of the largest cluster: variances of positions along the eye, upwards and across are the eigenvalues, in order.

    Directions of equal variance, as across a straight chain, may be any.
    """
    sees_largest(view)
    members = np.array(view.run("Array.from(app.selection.largestCluster())")) == 1
    matrix = np.cov(np.reshape(view.run("Array.from(app.picture.positions)"), (-1, 3))[members].T)
    ways = np.array([view.look()["from"], view.look()["up"], np.cross(view.look()["up"], view.look()["from"])])
    found, wanted = np.diag(ways @ matrix @ ways.T), np.linalg.eigvalsh(matrix)
    assert found == pytest.approx(wanted, rel=1e-4, abs=1e-4 * wanted[2])


def is_reset(view: Driven) -> None:
    assert np.allclose(view.look()["from"], np.array([0.52, -0.74, 0.43]) / np.linalg.norm([0.52, -0.74, 0.43]))
    assert view.look()["height"] == pytest.approx(view.run("app.camera.overview().height"), rel=1e-6, abs=0.0)


def copied(view: Driven) -> None:
    """The address on the clipboard is that of this view, at once."""
    text = view.tab.evaluate("() => navigator.clipboard.readText()")
    assert text.startswith("http://127.0.0.1:") and "frame=2" in text
    assert "clipboard" in view.text(".gv-note")


def panel_hidden(view: Driven) -> None:
    """Without a selection nothing stays beside the picture, no line at its right edge either."""
    assert not view.tab.locator(".gv-panel").is_visible() and not view.tab.locator(".gv-side").is_visible()
    view.press("`")
    assert view.tab.locator(".gv-panel").is_visible()


# settings before; the check after each of its keys
ACTIONS: dict[str, tuple[dict, Check]] = {
    "help": ({"grain": 3}, dialog("Keys and help")),
    "play": ({"speed": 30, "loop": True}, playing),
    "next-frame": ({"frame": 2}, shows_frame(3)),
    "previous-frame": ({"frame": 2}, shows_frame(1)),
    "forward-10": ({"frame": 2}, shows_frame(FRAMES - 1)),
    "back-10": ({"frame": 5}, shows_frame(0)),
    "first-frame": ({"frame": 5}, shows_frame(0)),
    "last-frame": ({"frame": 2}, shows_frame(FRAMES - 1)),
    "next-event": ({"frame": MERGED}, shows_frame(PARTED)),
    "previous-event": ({"frame": PARTED}, shows_frame(MERGED)),
    "next-grain": ({"grain": GRAINS - 1}, captions("grain 0", "cluster")),
    "previous-grain": ({"grain": 0}, captions(f"grain {GRAINS - 1}")),
    "next-contact": ({"contact": "0-1"}, captions("contact 1–2")),
    "previous-contact": ({"contact": "1-2"}, captions("contact 0–1")),
    "largest": ({"frame": MERGED}, has(grain=0)),
    "measure-from": ({"grain": 10, "ends": "3"}, captions("grain 10", "distance")),
    "clear": ({"grain": 3, "isolate": True, "follow": True, "ends": "1-2"}, captions()),
    "centre": ({"grain": 5}, centred),
    "view-largest": ({"frame": MERGED}, sees_largest),
    "broadside": ({"frame": PARTED}, broadside),
    "reset": ({"look": "1,2,3,1,0,0,0,0,1,5"}, is_reset),
    "along-x": ({}, looks_along([1, 0, 0])),
    "along-y": ({}, looks_along([0, -1, 0])),
    "along-z": ({}, looks_along([0, 0, 1])),
    "turn-left": ({}, camera_rotated(-1, 0)),
    "turn-right": ({}, camera_rotated(1, 0)),
    "turn-up": ({}, camera_rotated(0, 1)),
    "turn-down": ({}, camera_rotated(0, -1)),
    "pan-left": ({}, target_shifted(-0.08, 0.0)),
    "pan-right": ({}, target_shifted(0.08, 0.0)),
    "pan-up": ({}, target_shifted(0.0, 0.08)),
    "pan-down": ({}, target_shifted(0.0, -0.08)),
    "zoom-in": ({}, camera_changed("height", lambda now, first, _: bool(np.isclose(1.2 * now, first)))),
    "zoom-out": ({}, camera_changed("height", lambda now, first, _: bool(np.isclose(now, 1.2 * first)))),
    "picture": ({}, kind_asked("png")),
    "movie": ({}, kind_asked("webm")),
    "link": ({"frame": 2}, copied),
    "panel": ({}, panel_hidden),
}
ELSEWHERE = {"save-now"}  # test_driven_captures
BUTTONS = {
    "help": "Keys and help",
    "play": "Play",
    "next-frame": "Next frame",
    "previous-frame": "Previous frame",
    "first-frame": "First frame",
    "last-frame": "Last frame",
    "next-event": "Next event",
    "previous-event": "Previous event",
    "clear": "Clear selection",
    "centre": "Centre",
    "view-largest": "Largest cluster",
    "reset": "Whole box",
    "picture": "Picture or movie",
    "link": "Copy the address of this view",
    "panel": "Settings",
}


def test_every_action_is_tested(view):
    """A new action without a test fails here."""
    assert set(view.run("app.actions.map((a) => a.id)")) == set(ACTIONS) | ELSEWHERE


@pytest.mark.parametrize("action", ACTIONS)
def test_an_action_by_each_of_its_keys(view, action):
    """With the focus on no element, as after opening."""
    setup, check = ACTIONS[action]
    for key in view.run(f"app.actions.find((a) => a.id === {action!r}).keys"):
        view.fresh()
        view.put(**setup)
        view.press({" ": "Space", "Ctrl+": "Control+"}.get(key, key.replace("Ctrl", "Control")))
        check(view)


@pytest.mark.parametrize("action", BUTTONS)
def test_an_action_by_its_button(view, action):
    """The button is named, and does the same as the key."""
    setup, check = ACTIONS[action]
    view.put(**setup)
    view.tab.get_by_role("button", name=BUTTONS[action], exact=True).click()
    view.settle()
    check(view)


@pytest.mark.parametrize("seed", range(3))
def test_any_cluster_broadside(view, seed):
    """Grains of the largest cluster at random places, farther apart along one direction than along another."""
    view.put(frame=MERGED)
    rng = np.random.default_rng(seed)
    places = rng.normal(size=(GRAINS, 3)) * [1.0, 2.0, 4.0] @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    view.run("app.picture.positions.set(told[0])", places.ravel().tolist())
    view.press("Z")
    broadside(view)


def test_help_lists_all_keys(view):
    """Every action and every setting with a key."""
    view.press("?")
    words = view.text("dialog .gv-keys")
    for label in view.run("[...app.actions, ...app.state.settings.filter((s) => s.key)].map((one) => one.label)"):
        assert label in words, label
    keys = set(view.tab.locator("dialog kbd").all_inner_texts())
    named = {" ": "space", "Escape": "Esc"}
    arrows = {"ArrowLeft": "←", "ArrowRight": "→", "ArrowUp": "↑", "ArrowDown": "↓"}
    for key in view.run(
        "[...app.actions.flatMap((a) => a.keys), ...app.state.settings.flatMap((s) => [s.key, s.down])].filter(Boolean)"
    ):
        for name, sign in arrows.items():
            key = key.replace(name, sign)
        assert named.get(key, key) in keys, key
    assert view.tab.evaluate("() => document.activeElement.closest('dialog') !== null")
    view.press("Escape")
