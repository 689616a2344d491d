"""Opening pages in the user's web browser, if there is one."""

from __future__ import annotations

import atexit
import contextlib
import html
import os
import sys
from pathlib import Path

from ..io.page_bundle import private_page

NO_BROWSER = "SAND_NO_BROWSER"
"""Environment variable that keeps SAND from opening a browser."""

_REDIRECTS: list[Path] = []
"""Temporary redirect pages to remove at exit."""


def has_display() -> bool:
    """Whether a browser window can be opened; a browser in the terminal would block the terminal."""
    if os.environ.get(NO_BROWSER):
        return False
    display = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))
    return display or sys.platform in ("darwin", "win32")


def open_page(url: str) -> bool:
    """Open an address in the browser.

    The address of the server is opened through a redirect page that only this user can read, because other users of the
    machine can read the command line of the browser, and the address contains the access token.

    Returns
    -------
    bool
        False if there is no browser, or it could not be started.
    """
    if not has_display():
        return False
    import webbrowser

    try:
        return webbrowser.open(_redirect_page(url) if url.startswith("http:") else url)
    except Exception:  # any failure of the user's browser: the address is printed instead
        return False


def _redirect_page(url: str) -> str:
    """Write a temporary page that redirects to `url`; `remove_redirects` or the end of the program removes it."""
    target = html.escape(url, quote=True)
    page = private_page(
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="referrer" content="no-referrer">\n'
        f'<meta http-equiv="refresh" content="0; url={target}">\n<title>SAND</title>\n</head>\n'
        f'<body><p><a href="{target}" rel="noreferrer">Open the viewer</a></p></body>\n</html>\n'
    )
    if not _REDIRECTS:
        atexit.register(remove_redirects)
    _REDIRECTS.append(page)
    return page.as_uri()


def remove_redirects() -> None:
    """Remove the temporary redirect pages."""
    while _REDIRECTS:
        with contextlib.suppress(OSError):
            _REDIRECTS.pop().unlink(missing_ok=True)
