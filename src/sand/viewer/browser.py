"""Pages opened in the user's browser, where there is one."""

from __future__ import annotations

import atexit
import contextlib
import html
import os
import sys
from pathlib import Path

from ..io.page_bundle import private_page

NONE = "SAND_NO_BROWSER"
"""Environment variable: if it is set, no browser is opened."""


_PAGES: list[Path] = []
"""That lead to addresses, and are to be removed."""


def has_window() -> bool:
    """Whether a page can be opened in a window of its own; a browser in the terminal would block it."""
    if os.environ.get(NONE):
        return False
    shown = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))
    return shown or sys.platform in ("darwin", "win32")


def open_page(url: str) -> bool:
    """Open an address; False if there is no browser, or it cannot be opened.

    One of the server goes through a page of the user's own: the browser's command line, which other users of the
    machine can read, then does not tell its token.
    """
    if not has_window():
        return False
    import webbrowser

    try:
        return webbrowser.open(_way_to(url) if url.startswith("http:") else url)
    except Exception:  # whatever the user's browser does
        return False


def _way_to(url: str) -> str:
    """A page that leads to an address, until `remove_redirects` or the end of the program."""
    where = html.escape(url, quote=True)
    page = private_page(
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="referrer" content="no-referrer">\n'
        f'<meta http-equiv="refresh" content="0; url={where}">\n<title>SAND</title>\n</head>\n'
        f'<body><p><a href="{where}" rel="noreferrer">The grains of the run</a></p></body>\n</html>\n'
    )
    if not _PAGES:
        atexit.register(remove_redirects)
    _PAGES.append(page)
    return page.as_uri()


def remove_redirects() -> None:
    """Remove pages that lead to addresses."""
    while _PAGES:
        with contextlib.suppress(OSError):
            _PAGES.pop().unlink(missing_ok=True)
