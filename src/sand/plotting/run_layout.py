"""Where the parts of the figure of a run are, in the width that is set."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import NamedTuple

from .figure_format import format_width
from .style import points

WIDTH, HEIGHT, DPI = 10.0, 6.25, 160
"""[inches], [inches], [pixels per inch]: 1600 × 1000 pixels."""
SIDE_BY_SIDE = 8.0
"""Width [inches] from which on the image of the grains is beside the panels over time, not below them."""
PANEL_HEIGHT = 1.35
"""Height of a panel above the image of the grains, with its legend, over its relative height [inches]."""
HEADER = (0.968, 0.931, 0.911, 0.019)
"""Heights of the lines of the header beside which there is space, and the distance of further ones, relative."""


class Layout(NamedTuple):
    """Where the parts of the figure of a run are, in units of its size.

    Attributes
    ----------
    size : tuple of float
        Width and height [inches].
    lines : tuple of float
        Heights of the lines of the header.
    history : tuple of float
        Left, right, bottom and top of the panels over time.
    gap : float
        Least distance of two of them.
    grains : tuple of float
        Left, right, bottom and height of the image of the grains.
    label, letter : float
        Positions of the labels of axes and of letters in widths of a panel, from its left.
    """

    size: tuple[float, float]
    lines: tuple[float, ...]
    history: tuple[float, float, float, float] = (0.080, 0.455, 0.075, 0.862)
    gap: float = 0.036
    grains: tuple[float, float, float, float] = (0.485, 0.992, 0.03, 0.85)
    label: float = -0.155
    letter: float = -0.185

    def pixels(self, height: float) -> tuple[int, int]:
        """Width and height in pixels of an image of the grains with this height relative to the figure."""
        left, right = self.grains[:2]
        return round((right - left) * self.size[0] * DPI), round(height * self.size[1] * DPI)


def layout_of(heights: Sequence[float], header: Sequence[tuple[str, float]]) -> tuple[Layout, list[tuple[str, float]]]:
    """Layout in the width that is set, and the header in lines that are not wider.

    In a narrow figure the image of the grains is below the panels, and texts keep their size.

    Parameters
    ----------
    heights : Sequence[float]
        Heights of the panels over time, relative to each other.
    header : Sequence[tuple[str, float]]
        Texts of the header and their sizes [points], see `style.points`.
    """
    width = format_width() or WIDTH
    if width >= SIDE_BY_SIDE:
        *first, distance = HEADER
        more = (first[-1] - distance * k for k in range(1, len(header)))
        return Layout((width, HEIGHT), (*first, *more)[: len(header)]), list(header)
    lines = [
        (line, size)
        for text, size in header
        for line in textwrap.wrap(text, int(72.0 * width / (0.55 * points(size))), break_long_words=False)
    ]
    line = points(10.5) * 1.25 / 72.0
    top, image, left, right = (len(lines) + 0.5) * line, 0.9 * width, 0.78, width - 0.42
    height = top + PANEL_HEIGHT * sum(heights) + 0.5 + image
    return Layout(
        (width, height),
        tuple(1.0 - (k + 0.8) * line / height for k in range(len(lines))),
        (left / width, right / width, (image + 0.5) / height, 1.0 - (top + 0.3) / height),
        0.22 / height,
        (0.02, 0.98, 0.03 / height, (image - 0.2) / height),
        -0.55 / (right - left),
        -0.75 / (right - left),
    ), lines
