"""The page's address contains the view: it can be shared, edited, and malformed."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from .conftest import page_of
from .driving import Driven, differ, served
from .small_runs import FRAMES, SmallRun

SHARED = [
    {"frame": 3, "colour": "speed", "palette": "viridis", "low": 1e-3, "high": 8.5, "log": True, "theme": "dark"}
    | {"contact": "1-2", "bonds": "load", "size": 0.3, "box": False, "field": False, "speed": 7, "loop": True},
    {"frame": 5, "size": 0.45, "arrows": False, "bonds": "mode", "bar": 0.3, "ortho": True, "whole": False, "grain": 2}
    | {"measure": True, "ends": "10-11", "live": False},
    {"frame": 6, "grain": 6, "isolate": True, "follow": True, "trails": 4, "shade": 1, "plot": "losses"},
]


@pytest.fixture(scope="module")
def address(bundle, tmp_path_factory) -> Iterator[str]:
    """Of the page of a small run."""
    folder = SmallRun(tmp_path_factory.mktemp("runs") / "small").folder
    with served(folder) as server:
        yield server.url


@pytest.fixture(scope="module")
def tabs(browser) -> Iterator[list[Driven]]:
    """Two windows, as of two users."""
    pages = [page_of(browser) for _ in range(2)]
    tabs = [Driven(next(page)) for page in pages]
    for one in tabs:
        one.tab.set_viewport_size({"width": 800, "height": 560})
    yield tabs
    for page in pages:
        next(page, None)


def everything(view: Driven) -> dict:
    """All settings; the camera to five digits."""
    told = view.run("Object.fromEntries(app.state.settings.map((s) => [s.id, String(app.state.get(s.id))]))")
    look = [round(float(v), 4) for v in told.pop("look").split(",")]
    return told | {"look": look}


@pytest.mark.parametrize("settings", SHARED, ids=lambda s: next(iter(s)))
def test_a_shared_address_shows_the_same(tabs, address, settings):
    """Settings, camera, every pixel of the picture, and the numbers beside it."""
    mine, theirs = tabs
    mine.open(address)
    mine.put(**settings)
    mine.press("Control+ArrowLeft", "PageUp")
    mine.tab.wait_for_timeout(300)
    shared = mine.tab.evaluate("() => location.href")
    theirs.open(shared)
    assert everything(theirs) == everything(mine)
    # the address has six digits of the camera: a pixel at an edge may fall to the other side
    assert differ(mine.picture(), theirs.picture(), by=8) <= 60
    for part in (".gv-legend", ".gv-time"):
        assert theirs.text(part) == mine.text(part)
    # what an address says is the same whoever opens it, and as often as it is opened
    mine.open(shared)
    assert differ(mine.picture(), theirs.picture()) == 0
    assert mine.tab.evaluate("() => location.href") == shared


def test_all_settings_are_shared():
    """A new setting without a test fails here; so do the settings of the mouse."""
    from .test_driven_settings import EFFECTS, HIDDEN

    assert {name for one in SHARED for name in one} | {"look"} == set(EFFECTS) | HIDDEN


def test_an_address_is_edited_in_place(tabs, address):
    """Its settings apply without reloading; those it does not name are reset."""
    view, other = tabs
    view.open(address)
    view.run("window.stillHere = true")
    view.put(bonds="off", grain=4)
    view.tab.evaluate("() => { location.hash = 'frame=4&colour=radius&look=1,2,3,1,0,0,0,0,1,30'; }")
    view.tab.wait_for_timeout(50)
    view.settle()
    assert (view.get("frame"), view.get("colour")) == (4, "radius")
    assert (view.get("bonds"), view.get("grain")) == ("plain", -1)
    assert view.control("colour").input_value() == "radius"
    assert view.look()["target"] == pytest.approx([1, 2, 3], rel=1e-6, abs=0.0) and view.look()[
        "height"
    ] == pytest.approx(30, rel=1e-6, abs=0.0)
    view.tab.evaluate("() => { location.hash = 'frame=4'; }")
    view.tab.wait_for_timeout(50)
    view.settle()
    assert view.tab.evaluate("() => window.stillHere")
    other.open(address + "#frame=4")
    assert view.look() == other.look()
    assert differ(view.picture(), other.picture()) == 0


def test_a_followed_cluster_stays_where_the_address_has_it(tabs, address):
    """Also if it is not in the centre of the picture."""
    view, other = tabs
    view.open(address)
    view.put(grain=5, follow=True)
    view.press("Control+Shift+ArrowLeft", "ArrowRight", "ArrowRight")
    view.tab.wait_for_timeout(300)
    other.open(view.tab.evaluate("() => location.href"))
    assert other.look()["target"] == pytest.approx(view.look()["target"], abs=1e-3)
    for one in tabs:
        one.press("ArrowRight")
    assert other.look()["target"] == pytest.approx(view.look()["target"], abs=1e-3)


NONSENSE = [
    "nothing=1&constructor=2&__proto__=3&frame=NaN&size=NaN&grain=NaN&low=NaN&trails=NaN&look=1,2,3",
    "frame=1e300&look=NaN,0,0,0,0,0,0,0,0,0",
    "frame=Infinity&speed=Infinity&size=-Infinity&low=Infinity&high=-Infinity&colour=speed",
    "frame=-5&grain=-7",
    "frame=2.4&trails=2.5&speed=7.7",
    "grain=999999&follow=1&isolate=1&look=0,0,0,0,0,0,0,0,1,10",
    "contact=3-999999&follow=1&look=0,0,0,0,0,1,0,0,1,10",
    "contact=%3Cscript%3Ealert(1)%3C/script%3E&look=%3Cimg%20src=x%20onerror=alert(1)%3E",
    "ends=1-2-3-4-99999999999999999999&look=0,0,0,1,0,0,0,0,1,1e300",
    "colour=%3Cscript%3E&palette=nothing&theme=pink&plot=x&bonds=y&look=1e300,0,0,1,0,0,0,0,1,10",
    "colour=speed&low=9&high=1&log=1",
    "colour=speed&low=-5&high=-1&log=1",
    "&&==&%%%E0%A4%A&" + "x" * 5000,
]


@pytest.mark.parametrize("text", NONSENSE, ids=range(len(NONSENSE)))
def test_malformed_addresses_are_ignored(tabs, address, text):
    """The page has a picture that is not blank, and works; nothing of the address is run as code."""
    view = tabs[0]
    view.tab.on("dialog", lambda dialog: pytest.fail("a script was run"))
    view.open(f"{address}#{text}")
    for _ in range(2):
        assert view.run("app.stage.look.height") > 0
        assert len({tuple(v) for v in view.picture()[::4, ::4].reshape(-1, 4)}) > 8
        frame = view.get("frame")
        assert frame in range(FRAMES)
        assert view.get("grain") in range(-1, 12)
        view.press("ArrowLeft")
        assert view.get("frame") == max(frame - 1, 0) == view.run("app.picture.frame.frame")
        assert not view.tab.locator(".gv-note").is_visible()
        # and once more, written into the address of a page that is open already
        view.run("app.navigation.go(3)")
        view.settle()
        view.tab.evaluate("(text) => { location.hash = ''; location.hash = text; }", text)
        view.tab.wait_for_timeout(30)
        view.settle()
