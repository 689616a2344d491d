"""At phone width, in a narrow cell, for screen readers, in the dark, and for those who want nothing to move."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from .conftest import page_of
from .driving import Driven, differ, served
from .small_runs import SmallRun

PHONE = {"width": 390, "height": 780}
NAMELESS = """() => [...document.querySelectorAll("button, input, select, canvas, dialog, section, aside, nav, output")]
  .filter((e) => !e.closest("[aria-hidden=true], [hidden], [role=img][aria-label]") && e.checkVisibility())
  .filter((e) => !(e.getAttribute("aria-label") || e.textContent.trim() || e.labels?.length
                   || document.querySelector(`label[for="${e.id}"]`)))
  .map((e) => e.outerHTML)"""
OUTSIDE = """() => [...document.querySelectorAll("button, input, select, canvas.gv-canvas, .gv-time, .gv-status")]
  .filter((e) => e.checkVisibility())
  .map((e) => [e.getBoundingClientRect(), e.outerHTML])
  .filter(([box]) => box.left < -1 || box.right > innerWidth + 1 || box.width < 1)"""


@pytest.fixture(scope="module")
def address(bundle, tmp_path_factory) -> Iterator[str]:
    """Of the page of a small run."""
    with served(SmallRun(tmp_path_factory.mktemp("runs") / "small").folder) as server:
        yield server.url


@pytest.fixture
def phone(page, address) -> Driven:
    page.set_viewport_size(PHONE)
    return Driven(page, address)


def wide(view: Driven) -> int:
    """Pixels that could be scrolled to the side."""
    return view.tab.evaluate("() => document.scrollingElement.scrollWidth - innerWidth")


def test_nothing_is_out_of_reach_on_a_phone(phone):
    """No scrolling to the side; the panel is away at first, comes by its button, and all of it can be scrolled to."""
    assert wide(phone) <= 0 and phone.tab.evaluate(OUTSIDE) == []
    button = phone.tab.get_by_role("button", name="Settings")
    assert not phone.tab.locator(".gv-panel").is_visible() and button.get_attribute("aria-expanded") == "false"
    assert phone.tab.locator("canvas.gv-canvas").bounding_box()["height"] > 300
    button.click()
    phone.settle()
    assert button.get_attribute("aria-expanded") == "true"
    for control in phone.tab.locator(".gv-panel :is(input, select)").all():
        control.scroll_into_view_if_needed()
        box = control.bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= PHONE["width"]
        assert box["y"] >= 0 and box["y"] + box["height"] <= PHONE["height"]
    assert wide(phone) <= 0 and phone.tab.evaluate(OUTSIDE) == []
    assert phone.tab.locator("canvas.gv-canvas").bounding_box()["height"] >= 120


@pytest.mark.parametrize("key", ["?", "s"])
def test_windows_fit_a_phone(phone, key):
    """Within the screen; what is longer scrolls down in it, to its last control."""
    phone.press(key)
    box = phone.tab.locator("dialog").bounding_box()
    assert box["x"] >= 0 and box["x"] + box["width"] <= PHONE["width"] and box["height"] <= PHONE["height"]
    assert phone.tab.locator("dialog").evaluate("(e) => e.scrollWidth - e.clientWidth") <= 0
    assert phone.tab.evaluate(OUTSIDE) == []
    last = phone.tab.locator("dialog :is(button, kbd)").last
    last.scroll_into_view_if_needed()
    assert last.bounding_box()["y"] + last.bounding_box()["height"] <= box["y"] + box["height"]
    phone.press("Escape")


def test_numbers_leave_room_on_a_phone(phone):
    """The numbers are below the picture, which stays 200 pixels high, and can be closed with a finger."""
    phone.put(grain=2)
    view, box = (phone.tab.locator(name).bounding_box() for name in (".gv-view", ".gv-inspector"))
    assert view["height"] >= 200 and box["y"] >= view["y"] + view["height"] and box["x"] >= 0
    phone.tab.get_by_role("button", name="Clear selection").click()
    phone.settle()
    assert not phone.tab.locator(".gv-inspector").is_visible()


def test_fingers(browser, address):
    """A tap chooses, one finger turns, and the page does not scroll away under it."""
    context = browser.new_context(viewport=PHONE, has_touch=True, is_mobile=True)
    view = Driven(context.new_page(), address)
    view.tab.touchscreen.tap(*view.pixel_of(11))
    view.settle()
    assert view.get("grain") == 11
    assert view.tab.locator("canvas.gv-canvas").evaluate("(e) => getComputedStyle(e).touchAction") == "none"
    assert view.tab.evaluate("() => [scrollX, scrollY, visualViewport.scale]") == [0, 0, 1]
    context.close()


def test_screen_readers(page, address):
    """All that can be used has a name, in every state; the picture says what it shows; notes are read aloud."""
    view = Driven(page, address)
    assert page.evaluate(NAMELESS) == []
    label = page.locator("canvas.gv-canvas").get_attribute("aria-label")
    assert "12 grains" in label and "7 contacts" in label and "cluster" in label
    view.put(grain=2, ends="1-2", colour="speed")
    assert "speed" in page.locator("canvas.gv-canvas").get_attribute("aria-label")
    assert page.evaluate(NAMELESS) == []
    for key, title in (("?", "Keys and help"), ("s", "Picture or movie")):
        view.press(key)
        assert page.get_by_role("dialog", name=title).is_visible()
        assert page.evaluate(NAMELESS) == []
        view.press("Escape")
    assert page.locator("html").get_attribute("lang") == "en"
    assert page.get_by_role("heading", level=1).inner_text() == "small"
    assert page.get_by_role("region", name="Selection").locator("th").first.get_attribute("scope") == "row"
    for name in ("Time line", "Time", "Colour", "Show"):
        assert page.get_by_role("group", name=name, exact=True).count() == 1


def test_the_focus_goes_through_the_page(page, address):
    """From the header by the picture and the settings to the time line, and in a window it stays there."""
    view = Driven(page, address)
    order = []
    for _ in range(60):
        page.keyboard.press("Tab")
        told = page.evaluate("() => document.activeElement.getAttribute('aria-label') ?? document.activeElement.id")
        if told and told not in order:
            order.append(told)
    picture = next(one for one in order if "12 grains" in one)
    places = [order.index(one) for one in ("Centre", picture, "gv-colour", "gv-plot", "First frame", "Frame")]
    assert places == sorted(places)
    page.get_by_role("button", name="Keys and help").focus()
    view.press("Enter")
    page.keyboard.press("Tab")
    assert page.evaluate("() => document.activeElement.closest('dialog, body').tagName") in ("DIALOG", "BODY")
    view.press("Escape")
    assert page.evaluate("() => document.activeElement.getAttribute('aria-label')") == "Keys and help"


def test_the_focus_is_not_lost(page, address):
    """A button that makes the page show something else keeps it."""
    view = Driven(page, address)
    for selector in (".gv-legend button", ".gv-inspector button"):
        view.put(grain=2)
        page.locator(selector).first.focus()
        view.press("ArrowRight")
        assert page.evaluate("(s) => document.activeElement.matches(s)", selector), selector


@pytest.mark.parametrize(("scheme", "corner"), [("light", [251, 250, 247, 255]), ("dark", [16, 19, 26, 255])])
def test_light_and_dark_as_the_system(browser, address, scheme, corner):
    """Also when the system changes its mind while the page is open; a choice of one's own stays."""
    pages = page_of(browser)
    tab = next(pages)
    tab.emulate_media(color_scheme=scheme)
    view = Driven(tab, address)
    assert view.picture()[0, -1].tolist() == corner
    other = {"light": "dark", "dark": "light"}[scheme]
    tab.emulate_media(color_scheme=other)
    assert view.picture()[0, -1].tolist() != corner
    view.put(theme=scheme)
    assert view.picture()[0, -1].tolist() == corner
    next(pages, None)


def test_nothing_moves_by_itself(page, address):
    """With reduced motion wished for: the page stands still until somebody plays it, and nothing glides."""
    page.emulate_media(reduced_motion="reduce")
    view = Driven(page, address)
    before = view.picture()
    page.wait_for_timeout(400)
    assert view.get("frame") == 0 and differ(before, view.picture()) == 0
    assert page.evaluate("() => document.getAnimations().length") == 0
