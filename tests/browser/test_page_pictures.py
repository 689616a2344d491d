"""The whole page, light and dark, on a screen and on a phone, looks as it did when somebody last looked at it.

SAND_KEEP_PICTURES=1 makes the pictures anew; whoever does so looks at them before they are committed.

Letters are those of the font that matplotlib brings along, so that they are the same on all machines. Compared are
means of blocks of 10 × 10 pixels: other versions of the browser round edges of letters differently, and may draw boxes,
lists and sliders in their own way, which are a hundredth of the page. What is missing, in another place or of the other
theme changes more, as `test_a_change_is_detected` shows.
"""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from matplotlib.font_manager import findfont
from PIL import Image

from .conftest import page_of
from .driving import Driven, served
from .small_runs import SmallRun

if TYPE_CHECKING:
    from playwright.sync_api import Page

PICTURES = Path(__file__).parent / "pictures"
SCREENS = {"wide": (1280, 800), "phone": (400, 840)}
CASES = [(screen, theme) for screen in SCREENS for theme in ("light", "dark")]
BLOCK, MUCH, SHARE = 10, 24, 0.01
"""Pixels of a block; levels by which a block has changed, and the share of blocks that may have changed."""
LARGEST = 150_000
FONT = """async (font) => {
  const face = new FontFace("of the tests", `url(data:font/ttf;base64,${font})`);
  document.fonts.add(await face.load());
  document.querySelector(".gv").style.fontFamily = "'of the tests'";
}"""


@pytest.fixture(scope="module")
def address(bundle, tmp_path_factory) -> Iterator[str]:
    """Of a run with rigid clusters, moments, losses and a field."""
    with served(SmallRun(tmp_path_factory.mktemp("runs") / "small", rigid=True).folder) as server:
        yield server.url


@pytest.fixture
def page(browser) -> Iterator[Page]:
    """A tab that takes the font of the tests, which the page's own policy forbids."""
    yield from page_of(browser, bypass_csp=True)


def opened(page: Page, address: str, screen: str, theme: str) -> Driven:
    """The page of frame 5; the dark one with the values of a grain."""
    page.set_viewport_size(dict(zip(("width", "height"), SCREENS[screen], strict=True)))
    view = Driven(page, f"{address}#frame=5&theme={theme}&grain={2 if theme == 'dark' else -1}")
    font = base64.b64encode(Path(findfont("DejaVu Sans")).read_bytes()).decode()
    page.evaluate(FONT, font)
    view.run("app.camera.showCluster(app.selection.largestCluster())")
    view.run("app.showPlot()")
    view.settle()
    return view


def shot(view: Driven) -> Image.Image:
    view.settle()
    return Image.open(io.BytesIO(view.tab.screenshot())).convert("RGB")


def changed(one: Image.Image, other: Image.Image) -> float:
    """Share of blocks of which a colour differs by more than MUCH."""
    if one.size != other.size:
        return 1.0
    width, height = one.size
    shape = height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3
    first, second = (np.asarray(picture).reshape(shape).mean((1, 3)) for picture in (one, other))
    return float((np.abs(first - second).max(-1) > MUCH).mean())


def kept(screen: str, theme: str) -> Image.Image:
    return Image.open(PICTURES / f"page-{screen}-{theme}.png").convert("RGB")


@pytest.mark.parametrize(("screen", "theme"), CASES)
def test_the_page_equals_the_stored_picture(page, address, screen, theme):
    now, path = shot(opened(page, address, screen, theme)), PICTURES / f"page-{screen}-{theme}.png"
    if os.environ.get("SAND_KEEP_PICTURES"):
        now.save(path, optimize=True)
    assert path.stat().st_size < LARGEST
    assert changed(now, kept(screen, theme)) < SHARE


CHANGES = {
    "the other theme": "app.state.set('theme', 'dark')",
    "no picture": "app.page.canvas.style.visibility = 'hidden'",
    "values over the picture": "Object.assign(app.page.glance.style, { position: 'fixed', left: '30%', top: '30%' })",
    "no values of the frame": "app.page.glance.hidden = true",
    "no plot": "app.page.bottom.hidden = true",
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_is_detected(page, address, change):
    view = opened(page, address, "wide", "light")
    view.run(f"void ({CHANGES[change]})")
    assert changed(shot(view), kept("wide", "light")) > SHARE


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_letters_can_be_read(page, address, theme):
    """The contrast of all text that is told of the frame to the page is at least 4.5 : 1 (WCAG 2.1, level AA)."""
    view = opened(page, address, "wide", theme)
    parts = ".gv-glance-title, .gv-glance li, .gv-panel summary, .gv-inspector :is(th, td)"
    colours = view.tab.evaluate(
        """(parts) => [...document.querySelectorAll(parts)].map((e) => [
          getComputedStyle(e).color, getComputedStyle(document.querySelector(".gv")).backgroundColor])""",
        parts,
    )
    assert len(colours) > 15

    def luminance(colour: str) -> float:
        levels = np.array([float(part) for part in colour[colour.index("(") + 1 : -1].split(",")[:3]]) / 255
        linear = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    for text, back in {tuple(pair) for pair in colours}:
        high, low = sorted((luminance(text), luminance(back)), reverse=True)
        assert (high + 0.05) / (low + 0.05) >= 4.5, (text, back)
