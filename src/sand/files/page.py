"""The bundle of the page that shows a run: made when SAND is built, so it may be missing where node was."""

from __future__ import annotations

from pathlib import Path

from ..core.errors import BadInput

PAGE = Path(__file__).parents[1] / "view" / "page"
"""Where `hatch_build.py` puts the bundle, or `missing.txt` with the reason why there is none."""


def read_bundle(folder: Path = PAGE) -> tuple[str, str]:
    """Script and style sheet of the page, as text.

    Args:
        folder: where they lie.

    Raises:
        BadInput: they are not there; says why, and what to do.
    """
    try:
        script, sheet = ((folder / name).read_text("utf-8") for name in ("grainview.js", "grainview.css"))
    except (OSError, UnicodeDecodeError):
        raise BadInput(f"the page is not part of this installation. {_why(folder)} {_remedy(folder)}") from None
    return script, sheet


def _why(folder: Path) -> str:
    try:
        return (folder / "missing.txt").read_text("utf-8").strip()
    except (OSError, UnicodeDecodeError):
        return "It was not made when SAND was built."


def _remedy(folder: Path) -> str:
    """A clone has the sources of the page beside `src`."""
    clone = PAGE.parents[3]
    if (clone / "grainview" / "package.json").is_file():
        return f"With node: cd {clone / 'grainview'} && npm ci && npm run build; without: pip install -e {clone}"
    return "Install SAND again with access to the network, with pip's --force-reinstall --no-deps --no-cache-dir"
