"""Operations on the page in a tab: open, press keys, click, read."""

from __future__ import annotations

import base64
import io
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from sand.viewer.dataset import run_dataset
from sand.viewer.server import Server

from .small_runs import FIELD

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from playwright.sync_api import Locator, Page

SIZE = {"width": 800, "height": 560}
"""Of the window: software draws a large one slowly."""
SETTLED = """async () => {
  const app = window.sandView;
  for (let before = null; app && before !== app.navigation.showing; ) { before = app.navigation.showing; await before; }
  while (app?.frames.pending.size) await Promise.allSettled([...app.frames.pending.values()]);
  await new Promise((on) => setTimeout(on, 0));
  await new Promise((on) => requestAnimationFrame(() => requestAnimationFrame(on)));
}"""
CANVAS = """() => document.querySelector("canvas.gv-canvas").toDataURL("image/png")"""


@contextmanager
def served(folder: Path, field: Any = FIELD, frames: slice = slice(None)) -> Iterator[Server]:
    """A server of the run, or of some of its frames."""
    dataset = run_dataset(folder, field)
    dataset.select(frames)
    server = Server(dataset)
    server.start()
    try:
        yield server
    finally:
        server.stop()


def image(png: bytes) -> np.ndarray:
    """(H, W, 4) u1."""
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))


def differ(a: np.ndarray, b: np.ndarray, by: int = 0) -> int:
    """Number of pixels that differ by more than this of 255."""
    if a.shape != b.shape:
        return max(a.size, b.size)
    return int(np.any(np.abs(a.astype(int) - b) > by, axis=-1).sum())


class Driven:
    """A page of a run in a tab.

    Args:
        tab: a tab of the browser.
        address: of the page; None: the tab has it open already.
        bare: open the address as it is; otherwise one without settings opens at the first frame.
    """

    def __init__(self, tab: Page, address: str | None = None, *, bare: bool = False):
        self.tab = tab
        if address is not None:
            self.open(address, bare=bare)

    def open(self, address: str, ready: str = "yes", *, bare: bool = False) -> None:
        """Open the address and wait for the first picture (`ready`: "no" for an error sentence instead)."""
        self.tab.goto("about:blank")
        self.tab.goto(address if bare or "#" in address else f"{address}#frame=0")
        self.tab.wait_for_selector(f"#grainview[data-ready={ready}]")
        self.settle()

    def settle(self) -> None:
        """Wait until everything requested is drawn."""
        self.tab.evaluate(SETTLED)

    def run(self, script: str, *told: Any) -> Any:
        """The value of an expression about `app`."""
        return self.tab.evaluate(f"(told) => {{ const app = window.sandView; return {script}; }}", list(told))

    def get(self, setting: str) -> Any:
        """A setting's value; None for one that is not a number."""
        value = self.run(f"app.state.get({setting!r})")
        return None if value != value else value

    def put(self, **settings: Any) -> None:
        """Settings, set without a control."""
        for name, value in settings.items():
            self.run("app.state.set(told[0], told[1])", name, value)
        self.settle()

    def fresh(self) -> None:
        """Reset all settings and the camera, close dialogs, remove the focus."""
        self.run("app.player.stop()")
        self.tab.evaluate("() => { document.querySelector('dialog')?.close(); document.activeElement?.blur(); }")
        self.run("app.state.fromAddress('')")
        self.settle()
        self.run("app.camera.reset()")
        self.settle()

    def press(self, *keys: str) -> None:
        """Press keys, one after another."""
        for key in keys:
            self.tab.keyboard.press(key)
        self.settle()

    def control(self, setting: str) -> Locator:
        """The form element of a setting; its group is unfolded."""
        self.tab.evaluate(
            "() => document.querySelectorAll('.gv-panel details').forEach((part) => { part.open = true; })"
        )
        return self.tab.locator(f"#gv-{setting}")

    def look(self) -> dict[str, Any]:
        """Position of the camera."""
        return self.run("app.stage.look")

    def picture(self) -> np.ndarray:
        """Pixels of the canvas, (H, W, 4)."""
        self.settle()
        return image(base64.b64decode(self.tab.evaluate(CANVAS).split(",")[1]))

    def plotted(self) -> np.ndarray:
        """Values of the lines of the plot (L, K), from their places on its linear axis."""
        low, high = self.run("[app.plot.axis.low, app.plot.axis.high]")
        return low + (high - low) * np.array(self.run("app.plot.chart.data.slice(1)"), dtype=float)

    def text(self, selector: str) -> str:
        """Visible text of an element."""
        return self.tab.locator(selector).inner_text()

    def pixel_of(self, grain: int) -> tuple[float, float]:
        """Pixel coordinates of a grain in the window."""
        x, y, _ = self.run("app.stage.screenOf(app.picture.positions.slice(3 * told[0], 3 * told[0] + 3))", grain)
        box = self.tab.locator("canvas.gv-canvas").bounding_box()
        return box["x"] + x, box["y"] + y
