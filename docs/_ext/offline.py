"""The built pages need no network: each is looked through for scripts, styles, fonts and pictures from other machines.

MathJax and its fonts come with the package sphinx-mathjax-offline, which copies them beside the pages.
"""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

LOADS = {
    "script": ("src",), "img": ("src", "srcset"), "source": ("src", "srcset"), "iframe": ("src",), "embed": ("src",),
    "audio": ("src",), "video": ("src", "poster"), "track": ("src",), "object": ("data",), "input": ("src",),
}  # fmt: skip
"""Attributes by which a browser loads something without being asked; a link that a reader follows is none."""
RELATIONS = {"stylesheet", "preload", "modulepreload", "prefetch", "preconnect", "dns-prefetch", "icon", "manifest"}
_REMOTE = re.compile(r"\s*(?:https?:)?//", re.IGNORECASE)
_IN_STYLE = re.compile(r"(?:url\(|@import)\s*[\"']?((?:https?:)?//[^\"')\s]+)", re.IGNORECASE)


class _Page(HTMLParser):
    """Collects what a page loads from elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self._style = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self._style = tag == "style"
        loads = [given.get(name, "") for name in LOADS.get(tag, ())]
        if tag == "link" and RELATIONS & set(given.get("rel", "").lower().split()):
            loads.append(given.get("href", ""))
        self.found += [f"<{tag}> {address}" for address in loads if _REMOTE.match(address)]
        self.found += [f"style {address}" for address in _IN_STYLE.findall(given.get("style", ""))]

    def handle_endtag(self, tag: str) -> None:
        self._style = False

    def handle_data(self, data: str) -> None:
        if self._style:
            self.found += [f"<style> {address}" for address in _IN_STYLE.findall(data)]


def loaded_from_elsewhere(text: str) -> list[str]:
    """What a page (HTML) loads from other machines as soon as it is opened: element and address."""
    page = _Page()
    page.feed(text)
    page.close()
    return page.found


def styles_from_elsewhere(text: str) -> list[str]:
    """Addresses of other machines that a style sheet loads."""
    return _IN_STYLE.findall(text)


def check(app: Any, error: Exception | None) -> None:
    """A warning, which `-W` makes an error, for each page that needs a network."""
    from sphinx.util import logging

    if error is not None or app.builder.format != "html":
        return
    log = logging.getLogger(__name__)
    for ending, look in (("html", loaded_from_elsewhere), ("css", styles_from_elsewhere)):
        for path in sorted(Path(app.outdir).rglob(f"*.{ending}")):
            for what in look(path.read_text(encoding="utf-8")):
                log.warning("%s needs the network: %s", path.relative_to(app.outdir), what)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("build-finished", check, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
