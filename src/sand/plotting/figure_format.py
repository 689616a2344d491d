"""Width and style of figures, as a journal wants them."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..basics.errors import BadInput, shown

WIDTH, STYLE = "SAND_FIGURE_WIDTH", "SAND_FIGURE_STYLE"
"""Environment variables with the width and the style of all figures, which worker processes inherit."""
INCHES = {"in": 1.0, "cm": 1.0 / 2.54, "mm": 1.0 / 25.4, "pt": 1.0 / 72.27}
"""Units of widths; pt is the point of TeX, in which `\\the\\columnwidth` is printed."""
LEAST_WIDTH, MOST_WIDTH = 2.0, 20.0
"""Allowed widths [inches]."""
LEAST_PANEL = 2.9
"""Least width of a panel [inches] beside others; narrower figures have fewer panels in a row."""
FONT_SIZE = 8.0
"""Font size of the figures [points], to which all others are relative."""


def width_in_inches(text: Any, name: str = "width") -> float:
    """Width of a figure [inches], of a text with a unit such as '3.4in', '86 mm' or '246pt'.

    Raises
    ------
    BadInput
        If it has no such unit, or is not from 2 to 20 inches.
    """
    number, unit = str(text).strip()[:-2].strip(), str(text).strip()[-2:]
    try:
        width = float(number) * INCHES[unit]
    except (ValueError, KeyError):
        raise BadInput(f"{name} = {shown(text)} must be a width with its unit, such as 3.4in, 8.6cm or 246pt") from None
    if not (math.isfinite(width) and LEAST_WIDTH <= width <= MOST_WIDTH):
        raise BadInput(f"{name} = {shown(text)} must be from {LEAST_WIDTH:g}in to {MOST_WIDTH:g}in")
    return width


def style_settings(style: Any, name: str = "style") -> dict[str, Any]:
    """Settings of matplotlib of a style file (.mplstyle), or of a style that matplotlib knows by name.

    Settings of windows are left out.

    Raises
    ------
    BadInput
        If there is no such file or style, or lines of it are no settings of matplotlib; one line for each.
    """
    import matplotlib
    from matplotlib.style import library as named_styles

    text = str(style)
    if text in named_styles:
        found: Mapping[str, Any] = named_styles[text]
    elif not Path(text).is_file():
        raise BadInput(f"{name} = {shown(text)}: there is no such style file, nor a style of this name in matplotlib")
    else:
        with _warnings_of("matplotlib") as problems:
            try:
                found = matplotlib.rc_params_from_file(text, use_default_template=False)
            except (OSError, UnicodeDecodeError) as error:
                problems.append(str(error))
        if problems:
            raise BadInput(f"{name} = {shown(text)}: {' '.join(one.split())}" for one in problems)
    return {key: found[key] for key in found if not key.startswith(("backend", "interactive", "toolbar", "webagg"))}


@contextmanager
def _warnings_of(library: str) -> Iterator[list[str]]:
    """Messages that a library logs in the block, in place of writing them."""
    found: list[str] = []
    handler, logger = logging.Handler(logging.WARNING), logging.getLogger(library)
    handler.emit = lambda record: found.append(record.getMessage())  # type: ignore[method-assign]
    before = logger.propagate
    logger.addHandler(handler)
    logger.propagate = False
    try:
        yield found
    finally:
        logger.removeHandler(handler)
        logger.propagate = before


@contextmanager
def figure_format(width: Any = None, style: Any = None) -> Iterator[None]:
    """Context manager that sets the width and the style of all figures drawn in the block, also by its processes.

    Parameters
    ----------
    width : str or None, optional
        Width with its unit, such as "3.4in"; None: as before. Panels side by side that would be narrower than 2.9
        inches are placed below each other, and the ratio of width to height of a panel is kept.
    style : str or Path or None, optional
        Style file of matplotlib (.mplstyle), or name of a style; None: as before. Colours that mean something, such as
        those of energies, are kept. Font sizes follow `font.size`. If it sets `figure.figsize` and there is no other
        width, that is the width.

    Raises
    ------
    BadInput
        For another width or style; all problems at once.
    """
    problems: list[str] = []
    given: dict[str, str] = {}
    for key, value, read in ((WIDTH, width, width_in_inches), (STYLE, style, style_settings)):
        if value is not None:
            try:
                read(value)
            except BadInput as error:
                problems += error.problems
            given[key] = str(value) if key == WIDTH or not Path(value).is_file() else str(Path(value).absolute())
    if problems:
        raise BadInput(problems)
    before = {key: os.environ.get(key) for key in given}
    os.environ.update(given)
    try:
        yield
    finally:
        for key, old in before.items():
            os.environ.pop(key)
            if old is not None:
                os.environ[key] = old


def settings_of_style() -> dict[str, Any]:
    """Settings of the style that is set; none by default.  Raises BadInput."""
    style = os.environ.get(STYLE)
    return style_settings(style, STYLE) if style else {}


def format_width() -> float | None:
    """The width that is set [inches], or that of the style; None by default.  Raises BadInput."""
    if text := os.environ.get(WIDTH):
        return width_in_inches(text, WIDTH)
    size = settings_of_style().get("figure.figsize")
    return None if size is None else float(size[0])


def figure_size(width: float, height: float) -> tuple[float, float]:
    """Width and height [inches] of a figure of one panel, in the width that is set, with the same ratio."""
    wanted = format_width()
    return (width, height) if wanted is None else (wanted, wanted * height / width)


def panel_grid(
    number: int, panel: tuple[float, float], columns: int, more: tuple[float, float] = (0.0, 0.0)
) -> tuple[int, int, tuple[float, float]]:
    """Rows, columns, and width and height [inches] of a figure of equal panels.

    Parameters
    ----------
    number : int
        Number of panels.
    panel : tuple of float
        Width and height of a panel [inches], if no width is set.
    columns : int
        Largest number of panels in a row.
    more : tuple of float, optional
        Width and height beside the panels [inches], such as that of a legend.
    """
    columns, wanted = min(number, columns), format_width()
    if wanted is not None:
        columns = min(columns, max(int((wanted - more[0]) / LEAST_PANEL), 1))
        each = (wanted - more[0]) / columns
        panel = each, each * panel[1] / panel[0]
    rows = math.ceil(number / columns)
    return rows, columns, (columns * panel[0] + more[0], rows * panel[1] + more[1])
