"""The viewer page in Chromium without a window, which draws pictures of frames for a film; needs Playwright."""

from __future__ import annotations

import base64
import io
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from PIL import Image

from ..basics.errors import BadInput
from ..io.page_bundle import read_bundle
from .dataset import RunDataset
from .server import Server

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    # WebGL 2 by SwiftShader on the CPU: the same picture on every machine, with or without a GPU
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",  # /dev/shm is small in containers
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",  # the page must need no network
)
PATIENCE = 300_000
"""Longest time to wait for the first picture [ms]; software draws slowly on a busy machine."""
BEGIN = "([settings, width, height, count]) => sandView.film.begin({ settings, width, height, count })"
PICTURE = "(k) => sandView.film.picture(k)"


def find_chromium() -> str | None:
    """Path of the system's Chromium or Chrome, or of one that Playwright installed; None if there is none.

    Raises
    ------
    ImportError
        If Playwright is not installed.
    """
    from playwright.sync_api import sync_playwright

    for name in NAMES:
        if path := shutil.which(name):
            return path
    with sync_playwright() as playwright:
        path = playwright.chromium.executable_path
    return path if Path(path).is_file() else None


def why_no_page() -> str | None:
    """The reason why the page cannot be drawn here, with what to do; None if it can."""
    try:
        read_bundle()
        if find_chromium() is None:
            return "there is no Chromium or Chrome: install one, or `playwright install chromium`"
    except BadInput as error:
        return str(error)
    except ImportError:
        return "Playwright is not installed: pip install playwright"
    return None


@contextmanager
def page_pictures(
    dataset: RunDataset, size: tuple[int, int], settings: str = ""
) -> Iterator[Callable[[int], Image.Image]]:
    """Open the page of a run without a window; the block gets a function that draws the k-th selected frame.

    Parameters
    ----------
    dataset : RunDataset
        Data of the run.
    size : tuple of int
        Width and height of the pictures [pixels].
    settings : str, optional
        Settings of the page as its address has them, such as `"colour=speed&theme=dark"`. Without `look` among them the
        camera sees the grains of all frames.

    Raises
    ------
    BadInput
        If a setting is unknown, or a frame cannot be shown.
    """
    from playwright.sync_api import Error, sync_playwright

    server = Server(dataset)
    server.start()
    try:
        with sync_playwright() as playwright:
            # Playwright's default is no sandbox, which root and most containers need; only our own page is opened
            browser = playwright.chromium.launch(executable_path=find_chromium(), headless=True, args=list(FLAGS))
            try:
                page = browser.new_page(viewport={"width": 960, "height": 640}, color_scheme="light")
                page.set_default_timeout(PATIENCE)
                page.goto(server.url)
                page.wait_for_selector("#grainview[data-ready]")
                if page.get_attribute("#grainview", "data-ready") != "yes":
                    raise BadInput(f"the page cannot be drawn: {page.inner_text('.gv-failure p')}")
                if wrong := page.evaluate(BEGIN, [settings, *size, len(dataset)]):
                    raise BadInput(wrong)
                yield lambda k: _picture(page, k)
            finally:
                browser.close()
    except Error as error:
        raise BadInput(_first_line(error)) from None
    finally:
        server.stop()


def _picture(page: Any, k: int) -> Image.Image:
    return Image.open(io.BytesIO(base64.b64decode(page.evaluate(PICTURE, k)))).convert("RGB")


def _first_line(error: Exception) -> str:
    """The message of an exception in the page, or of the browser, without what Playwright puts before it."""
    return str(error).splitlines()[0].removeprefix("Page.evaluate: ").removeprefix("Error: ")
