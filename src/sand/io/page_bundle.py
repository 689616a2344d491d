"""The bundle of the viewer page, which is missing if it could not be built, and temporary pages."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from ..basics.errors import BadInput, FilesFailed

PAGE = Path(__file__).parents[1] / "viewer" / "page"
"""Folder in which `hatch_build.py` puts the bundle, or `missing.txt` with the reason why there is none."""


def read_bundle(folder: Path | None = None) -> tuple[str, str]:
    """Read script and style sheet of the page.

    Parameters
    ----------
    folder : Path or None, optional
        Folder of the bundle; PAGE by default.

    Raises
    ------
    BadInput
        If they are missing; the message says why, and what to do.
    """
    folder = PAGE if folder is None else folder
    try:
        script, sheet = ((folder / name).read_text("utf-8") for name in ("grainview.js", "grainview.css"))
    except (OSError, UnicodeDecodeError):
        raise BadInput(f"the page is not part of this installation. {_why(folder)} {_remedy(folder)}") from None
    return script, sheet


def _why(folder: Path) -> str:
    try:
        return (folder / "missing.txt").read_text("utf-8").strip()
    except (OSError, UnicodeDecodeError):
        return "It was not built when SAND was installed."


def _remedy(folder: Path) -> str:
    """How to build the page; a clone of the repository has its sources."""
    clone = PAGE.parents[3]
    if (clone / "grainview" / "package.json").is_file():
        return f"With node: cd {clone / 'grainview'} && npm ci && npm run build; without: pip install -e {clone}"
    return "Install SAND again with access to the network, with pip's --force-reinstall --no-deps --no-cache-dir"


def private_page(text: str) -> Path:
    """Write a new temporary page that only this user can read; the caller removes it.

    Raises
    ------
    FilesFailed
        If it cannot be written.
    """
    try:
        handle, name = tempfile.mkstemp(prefix="sand-", suffix=".html")  # of mode 0600
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise FilesFailed(f"cannot write a temporary page: {error.strerror}") from error
    return Path(name)
