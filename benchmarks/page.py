"""What the page of a run costs in a browser that draws by software: opening, changing frames, memory, size."""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

from tests.browser.chromium import FLAGS, find
from tests.browser.runs import many

from sand.io.page_bundle import read_bundle
from sand.viewer.dataset import RunDataset, run_dataset
from sand.viewer.html import write_page
from sand.viewer.server import Server

PATIENCE = 300_000
"""ms to wait for anything."""
DRAWN = """() => {
  const gl = sandView.stage.renderer.getContext(), pixel = new Uint8Array(4);
  sandView.stage.draw();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  return performance.now();
}"""
"""Draws and waits for the pixels; ms since the page was asked for."""
CHANGES = """async ([from, count]) => {
  const gl = sandView.stage.renderer.getContext(), pixel = new Uint8Array(4), spent = [];
  for (let k = from; k < from + count; k++) {
    await sandView.frames.get(k);
    await new Promise((on) => setTimeout(on, 600));
    const begun = performance.now();
    await sandView.navigation.go(k);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    spent.push(performance.now() - begun);
  }
  return spent;
}"""
"""Changes to frames that are there already, as they are when a run is played: ms each."""
ALL_LOOKED_AT = """async () => {
  for (let k = 0; k < sandView.manifest.times.length; k++) await sandView.navigation.go(k);
  return sandView.manifest.bytes;
}"""
FEWER = 7
"""Changes of a frame that the median is of."""
OPENED = 3
"""Times that a page is opened; the quickest counts, as whatever else goes on only adds."""


def row(name: str, ours: float, unit: str, target: float) -> dict[str, Any]:
    """One line, as `rows.row` has them; this module compiles nothing and imports nothing that does."""
    return {"name": name, "ours": ours, "unit": unit, "target": target, "met": bool(ours <= target)}


def all_rows(quick: bool) -> list[dict[str, Any]]:
    """Measure everything: 10 000 grains in 200 frames (`quick`: 20), 100 000 in 10, contacts and arrows shown."""
    from playwright.sync_api import sync_playwright

    read_bundle()
    with tempfile.TemporaryDirectory() as place, sync_playwright() as playwright:
        top = Path(place)
        flags = [*FLAGS, "--js-flags=--expose-gc"]
        browser = playwright.chromium.launch(executable_path=find(), headless=True, args=flags)
        frames = 20 if quick else 200
        small = run_dataset(many(top / "1e4", 5, 2000, frames))
        rows = _served(browser, small, frames, memory=True)
        size = write_page(small, top / "one.html")
        rows.append(row(f"single file, {frames} frames", size / 1e6, "MB", 0.75 * _bytes(small) / 1e6))
        rows += _file(browser, top / "one.html", _bytes(small), frames)
        if not quick:
            large = run_dataset(many(top / "1e5", 10, 10_000, FEWER + 3))
            rows += _served(browser, large, FEWER + 3, memory=False)
        browser.close()
    return rows


def _bytes(story: RunDataset) -> int:
    """Of all frames in single precision."""
    story.compact = False
    return story.size


def _served(browser: Any, story: RunDataset, frames: int, memory: bool) -> list[dict[str, Any]]:
    """Rows of a page that a server hands out."""
    grains = f"{story.grains_count} grains"
    server = Server(story)
    server.start()
    try:
        opened, page = _opened(browser, server.url)
        spent = page.evaluate(CHANGES, [1, FEWER])
        rows = [
            row(f"opening, {grains}, {frames} frames", opened, "s", 2.0 if story.grains_count <= 10_000 else 10.0),
            row(f"frame change, {grains}", statistics.median(spent), "ms", 150.0 if memory else 500.0),
        ]
        if memory:
            rows.append(_memory(browser, page, f"memory over data, {frames} frames, server", _bytes(story)))
        else:
            page.close()
        return rows
    finally:
        server.stop()


def _file(browser: Any, file: Path, data: int, frames: int) -> list[dict[str, Any]]:
    """Rows of a single file."""
    opened, page = _opened(browser, file.as_uri())
    rows = [row(f"opening, single file, {frames} frames", opened, "s", 2.0)]
    rows.append(_memory(browser, page, f"memory over data, {frames} frames, file", data))
    return rows


def _opened(browser: Any, url: str) -> tuple[float, Any]:
    """Least seconds until the first picture is drawn and its pixels are back; the last page, which stays open."""
    spent, page = [], None
    for _ in range(OPENED):
        if page is not None:
            page.close()
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(PATIENCE)
        begun = time.perf_counter()
        page.goto(url)
        page.wait_for_selector("#grainview[data-ready=yes]")
        page.evaluate(DRAWN)
        spent.append(time.perf_counter() - begun)
    return min(spent), page


def _memory(browser: Any, page: Any, name: str, data: int) -> dict[str, Any]:
    """What the processes of pages hold of this machine's memory after all frames were looked at, less an empty page's.

    Text of a single file and arrays are in it, but not what the card's stand-in holds, which does not grow with frames.
    """
    page.evaluate(ALL_LOOKED_AT)
    for _ in range(3):
        page.evaluate("async () => { gc(); await new Promise((on) => setTimeout(on, 200)); }")
    used = _resident(browser)
    page.goto("about:blank")
    page.wait_for_timeout(500)
    blank = browser.new_page()
    page.close()
    blank.wait_for_timeout(1000)
    used -= _resident(browser)
    blank.close()
    return row(name, used / data, f"({used / 1e6:.0f} MB)", 3.0)


def _resident(browser: Any) -> int:
    """Bytes in memory of all processes that show pages; Linux."""
    told = browser.new_browser_cdp_session().send("SystemInfo.getProcessInfo")["processInfo"]
    pids = [one["id"] for one in told if one["type"] == "renderer"]
    pages = [int(Path(f"/proc/{pid}/statm").read_text("utf-8").split()[1]) for pid in pids]
    return sum(pages) * os.sysconf("SC_PAGE_SIZE")


def tell(rows: list[dict[str, Any]]) -> None:
    """Print them."""
    print(f"{'what':44} {'ours':>9} {'target':>8}  unit")
    for one in rows:
        mark = "" if one["met"] else "  MISSED"
        print(f"{one['name']:44} {one['ours']:9.3g} {one['target']:8.3g}  {one['unit']}{mark}")
