"""Pages opened in the user's browser, where there is one."""

from __future__ import annotations

import os
import sys

NONE = "SAND_NO_BROWSER"
"""Environment variable: if it is set, no browser is opened."""


def has_window() -> bool:
    """Whether a page can be opened in a window of its own; a browser in the terminal would block it."""
    if os.environ.get(NONE):
        return False
    shown = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))
    return shown or sys.platform in ("darwin", "win32")


def open_page(url: str) -> bool:
    """Open an address; False if there is no browser, or it cannot be opened."""
    if not has_window():
        return False
    import webbrowser

    try:
        return webbrowser.open(url)
    except Exception:  # whatever the user's browser does
        return False
