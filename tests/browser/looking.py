"""The page in a tab, read as pixels and as numbers."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sand.io.trajectory import read_frames
from sand.viewer.dataset import run_dataset
from sand.viewer.external_field import FieldDescription
from sand.viewer.html import write_page
from sand.viewer.server import Server

from . import runs
from .eye import Eye

if TYPE_CHECKING:
    from playwright.sync_api import Page

SOURCES = ("server", "file")
"""Where the page has its data from: with all digits, and in half precision."""
CLOSE = 1e-3
"""Of numbers read from the page: what is shown has four digits, halves have eleven bits (5e-4)."""
PREFIXES = {"y": -24, "z": -21, "a": -18, "f": -15, "p": -12, "n": -9, "µ": -6, "m": -3, "": 0, "k": 3, "M": 6, "G": 9}
RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
UNITS = ("m/s", "rad/s", "A m²", "kg", "m", "s", "J", "N", "C", "Pa")
NO_COVERS = """() => { for (const name of ["gv-legend", "gv-inspector", "gv-overlay"])
  document.querySelector("." + name).style.pointerEvents = "none"; }"""
PIXELS = """() => sandView.page.canvas.toDataURL("image/png").split(",")[1]"""
ROWS = """() => [...document.querySelectorAll(".gv-inspector table")].map((t) => [t.caption.textContent,
  [...t.querySelectorAll("tr")].map((r) => [r.children[0].textContent, r.children[1].textContent])])"""


@dataclass
class Shown:
    """A run open in the browser: frames as in the file, addresses of the server and of a single-file page."""

    frames: list[Any]
    url: dict[str, str]

    @property
    def unit(self) -> float:
        """The page's unit of length [m]."""
        return float(self.frames[0].radius.mean())


class Shows:
    """Runs by kind, each written and served on first use."""

    def __init__(self, place: Path):
        self.place, self._known, self._servers = place, dict[str, Shown](), list[Server]()

    def __call__(self, kind: str) -> Shown:
        if kind not in self._known:
            folder = runs.KINDS[kind](self.place / kind)
            server = Server(run_dataset(folder, _field()))
            server.start()
            self._servers.append(server)
            target = self.place / f"{kind}.html"
            write_page(run_dataset(folder, _field()), target)
            url = {"server": server.url, "file": target.as_uri()}
            self._known[kind] = Shown(read_frames(folder / "trajectory.gsd"), url)
        return self._known[kind]

    def close(self) -> None:
        """Stop the servers."""
        for server in self._servers:
            server.stop()


def _field() -> FieldDescription:
    return FieldDescription("5 mT, constant", lambda time: (3e-3, 0.0, 4e-3))


class View:
    """A tab that shows a run.

    Args:
        page: the tab.
        shown: the run.
        source: of SOURCES.
        settings: of the page, as its address has them; `look` as ten numbers.  Unless `whole` says otherwise, clusters
            are cut by the faces of the box, as the positions of the file are.
    """

    def __init__(self, page: Page, shown: Shown, source: str = "server", **settings: Any):
        self.page, self.shown, self.ortho = page, shown, bool(settings.get("ortho"))
        self.frame = shown.frames[settings.get("frame", 0)]
        settings.setdefault("whole", 0)
        if "look" in settings:
            settings["look"] = ",".join(f"{v:.5g}" for v in settings["look"])
        page.goto(shown.url[source] + "#" + "&".join(f"{name}={value}" for name, value in settings.items()))
        page.wait_for_selector("#grainview[data-ready]")
        assert page.get_attribute("#grainview", "data-ready") == "yes", page.inner_text("body")
        page.evaluate(NO_COVERS)
        self.corner = page.evaluate(
            "() => { const b = sandView.page.canvas.getBoundingClientRect(); return [b.left, b.top]; }"
        )

    def go(self, k: int) -> Any:
        """Show frame k; returns the frame as in the file."""
        self.page.evaluate("(k) => sandView.navigation.go(k)", k)
        self.frame = self.shown.frames[k]
        return self.frame

    def set(self, **settings: Any) -> None:
        """Change settings."""
        self.page.evaluate("(all) => { for (const [k, v] of Object.entries(all)) sandView.state.set(k, v); }", settings)

    def look(self, *numbers: float) -> Eye:
        """Look so: target, from, up, height."""
        told = dict(zip(("target", "from", "up"), np.reshape(numbers[:9], (3, 3)).tolist(), strict=True))
        self.page.evaluate("(look) => { sandView.stage.look = look; }", told | {"height": float(numbers[9])})
        return self.eye()

    def eye(self) -> Eye:
        """The camera as the page's address would tell it."""
        text = self.page.evaluate("() => sandView.state.get('look')")
        wide, high = self.page.evaluate("() => [sandView.stage.canvas.width, sandView.stage.canvas.height]")
        return Eye(tuple(map(float, text.split(","))), wide, high, self.ortho)

    @property
    def positions(self) -> np.ndarray:
        """Positions of the grains (N, 3), in the page's unit."""
        return self.frame.position / self.shown.unit

    @property
    def radii(self) -> np.ndarray:
        """Radii (N,) in the page's unit."""
        return self.frame.radius / self.shown.unit

    def image(self) -> np.ndarray:
        """Pixels of the canvas, (high, wide, 3)."""
        from PIL import Image

        self.page.evaluate("() => sandView.stage.draw()")
        png = base64.b64decode(self.page.evaluate(PIXELS))
        return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)

    def click(self, x: float, y: float) -> dict[str, dict[str, str]]:
        """Click at a pixel of the canvas; returns the tables shown, by title."""
        self.page.mouse.click(self.corner[0] + float(x), self.corner[1] + float(y))
        return self.rows()

    def rows(self) -> dict[str, dict[str, str]]:
        """Tables of numbers, by title."""
        return {title: dict(rows) for title, rows in self.page.evaluate(ROWS)}

    def painted(self) -> np.ndarray:
        """Colours (N, 3) of the grains before shading."""
        colours = self.page.evaluate("() => [...sandView.picture.painted.colour]")
        return np.array(colours).reshape(-1, 4)[:, :3]


def numbers(text: str) -> np.ndarray:
    """Numbers of a row in SI: of "−1.2, 3 nm" −1.2e-9 and 3e-9.  In front of "(" and of the second line."""
    text = text.split("\n")[-1].split(" (")[0].replace("−", "-")
    text = re.sub(r"×10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)", lambda found: "e" + found[1].translate(RAISED), text)
    found = re.fullmatch(r"([-\d.e, ]+?)(?: ([^\d\s-].*))?", text)
    assert found, text
    unit = found[2] or ""
    plain = next((u for u in UNITS if unit == u or (unit.endswith(u) and unit[: -len(u)] in PREFIXES)), "")
    assert plain or not unit, text
    return np.array([float(part) for part in found[1].split(",")]) * 10.0 ** PREFIXES[unit[: len(unit) - len(plain)]]


def agree(text: str, values: Any, close: float = CLOSE) -> None:
    """Whether the text shows this value or vector; for a vector the tolerance is relative to its largest component."""
    wanted = np.atleast_1d(np.asarray(values, float))
    off = np.abs(numbers(text) - wanted).max()
    assert off <= close * np.abs(wanted).max(), f"{text!r} is not {wanted}"


def size(text: str, value: float) -> None:
    """The first line of a row says how long its vector is."""
    agree(text.split("\n")[0], value)
