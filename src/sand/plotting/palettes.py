"""Maps from shares to colours, and colours of kinds: one table for pictures and for the page of a run."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.colors import Colormap, LinearSegmentedColormap

from .style import BLUE, GREEN, LARGEST_COLOURS, ORANGE, OTHER_COLOURS, PURPLE, RED, SINGLE_COLOUR, SKY

STEPS = 64
"""Colours of a map that the page gets."""
# The places make the lightness L* of CIELAB rise in proportion to the share.
SEQUENTIAL: Colormap = LinearSegmentedColormap.from_list(
    "deep", [(0.0, "#35469C"), (0.32, "#2C7FB8"), (0.59, "#2DB5A3"), (0.79, "#8FD368"), (1.0, "#F6E45A")], 256
)
"""From deep to bright."""
DIVERGING: Colormap = LinearSegmentedColormap.from_list(
    "diverging", ["#08519C", "#5FA2D4", "#E9E8E4", "#E48248", "#983100"], 256
)
"""Cold and warm, as dark on both sides."""
STANDARD_MAPS = ("cividis", "viridis")
"""Of matplotlib, for who prefers them."""
MATERIAL_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, RED)
"""Of materials, in turn."""
WITHIN_LIMITS_COLOUR, MODE_COLOURS = SINGLE_COLOUR, (RED, BLUE, GREEN, PURPLE)
"""Of contacts within their limits, and at the limit of a mode: stretch, slide, roll, twist."""


def palettes() -> dict[str, list[list[int]]]:
    """64 × (red, green, blue) from 0 to 255, by name; the first is the usual one, `diverging` is about zero."""
    maps = [SEQUENTIAL, *(matplotlib.colormaps[name] for name in STANDARD_MAPS), DIVERGING]
    places = np.linspace(0.0, 1.0, STEPS)
    return {each.name: np.rint(255.0 * each(places)[:, :3]).astype(int).tolist() for each in maps}


def colours() -> dict[str, list[str] | str]:
    """Of clusters (the largest, all others in turn, single grains), of modes at their limit, and of materials."""
    return {
        "big": list(LARGEST_COLOURS),
        "small": list(OTHER_COLOURS),
        "single": SINGLE_COLOUR,
        "modes": list(MODE_COLOURS),
        "within": WITHIN_LIMITS_COLOUR,
        "materials": list(MATERIAL_COLOURS),
    }
