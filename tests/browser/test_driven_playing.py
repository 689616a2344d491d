"""Playing, measuring, choosing: operations with several keys."""

from __future__ import annotations

from .small_runs import FRAMES, MERGED
from .test_driven_actions import shows_frame


def test_playing_stops_at_the_last_frame_and_begins_again(view):
    """Each frame is shown; from the last one it begins with the first."""
    view.put(speed=60)
    view.run("window.seenFrames = [], app.state.onChange((id) => id === 'frame' && seenFrames.push(app.state.get(id)))")
    view.press("Space")
    view.tab.wait_for_selector("button[aria-label=Play]")
    view.settle()
    assert view.tab.evaluate("() => seenFrames") == list(range(1, FRAMES))
    shows_frame(FRAMES - 1)(view)
    view.tab.evaluate("() => void (seenFrames.length = 0)")
    view.press("Space")
    view.tab.wait_for_selector("button[aria-label=Play]")
    assert view.tab.evaluate("() => seenFrames") == list(range(FRAMES))


def test_playing_twice_is_not_twice_as_fast(view):
    """Pausing and continuing within a frame leaves no second timer."""
    view.put(speed=5, loop=True)
    view.press("Space", "Space", "Space", "Space", "Space")
    before = view.get("frame")
    view.tab.wait_for_timeout(1000)
    gone = (view.get("frame") - before) % FRAMES
    view.press("Space")
    assert 3 <= gone <= 6


def test_a_held_key_does_not_flicker(view):
    """Space held down plays; it does not pause again."""
    for _ in range(4):
        view.tab.keyboard.down("Space")
    view.tab.keyboard.up("Space")
    assert view.run("app.player.playing")
    view.run("app.player.stop()")
    for _ in range(4):
        view.tab.keyboard.down("m")
    view.tab.keyboard.up("m")
    assert not view.get("arrows")


def test_measuring(view):
    """Two grains by e and by clicks; the distance is told, in the numbers and on the picture."""
    view.put(grain=8)
    view.press("e")
    view.put(grain=9)
    view.press("e")
    assert view.get("ends") == "8-9"
    assert "19.9 nm" in view.text(".gv-inspector") and "19.9 nm" in view.tab.locator(".gv-ruler-name").text_content()
    view.press("Escape")
    view.press("u")
    assert "select two grains" in view.text(".gv-inspector")
    for grain in (10, 11):
        view.tab.mouse.click(*view.pixel_of(grain))
    view.settle()
    assert view.get("ends") == "10-11" and view.get("grain") == -1


def test_a_cluster_is_chosen_in_the_legend(view):
    """Its numbers come; N is right."""
    view.tab.locator(".gv-legend button").nth(2).click()
    view.settle()
    assert view.get("grain") == 8
    rows = view.tab.locator(".gv-inspector table").nth(1).inner_text()
    assert "grains N\t2" in rows and "contacts\t1" in rows


def test_numbers_of_a_cluster_go_with_the_frame(view):
    """It grows to eight grains when the two chains touch."""
    view.put(grain=2)
    assert "grains N\t4" in view.text(".gv-inspector")
    view.press("n")
    shows_frame(MERGED)(view)
    assert "grains N\t8" in view.text(".gv-inspector")


def test_the_address_that_is_copied_is_that_of_now(view):
    """The bar of the browser lags behind by a quarter of a second."""
    view.run("app.state.set('frame', 5), app.keys.press('j')")
    view.tab.wait_for_timeout(100)
    assert "frame=5" in view.tab.evaluate("() => navigator.clipboard.readText()")
