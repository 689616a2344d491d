"""Colour maps and categorical colours, shared by figures and the viewer page."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.colors import Colormap, LinearSegmentedColormap

from .style import BLUE, GREEN, LARGEST_COLOURS, ORANGE, OTHER_COLOURS, PURPLE, RED, SINGLE_COLOUR, SKY

STEPS = 64
"""Number of colours of each map sent to the viewer page."""
# The positions of the colours make the lightness L* of CIELAB a linear function of the value.
SEQUENTIAL: Colormap = LinearSegmentedColormap.from_list(
    "deep", [(0.0, "#35469C"), (0.32, "#2C7FB8"), (0.59, "#2DB5A3"), (0.79, "#8FD368"), (1.0, "#F6E45A")], 256
)
"""Dark blue to bright yellow."""
DIVERGING: Colormap = LinearSegmentedColormap.from_list(
    "diverging", ["#08519C", "#5FA2D4", "#E9E8E4", "#E48248", "#983100"], 256
)
"""Blue to orange, symmetric in lightness."""
STANDARD_MAPS = ("cividis", "viridis")
"""Alternative sequential maps of matplotlib."""
MATERIAL_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, RED)
"""Colours of materials, used cyclically."""
REST_COLOURS = (RED, "#A9B4C0")
"""Colours of grains of awake clusters, and of clusters at rest."""
WITHIN_LIMITS_COLOUR, MODE_COLOURS = SINGLE_COLOUR, (RED, BLUE, GREEN, PURPLE)
"""Colours of contacts within their limits, and at the limit of stretching, sliding, rolling or twisting."""


def palettes() -> dict[str, list[list[int]]]:
    """Colour maps by name as STEPS × (red, green, blue) from 0 to 255; the first is the default."""
    maps = [SEQUENTIAL, *(matplotlib.colormaps[name] for name in STANDARD_MAPS), DIVERGING]
    values = np.linspace(0.0, 1.0, STEPS)
    return {each.name: np.rint(255.0 * each(values)[:, :3]).astype(int).tolist() for each in maps}


def colours() -> dict[str, list[str] | str]:
    """Colours of clusters, contact modes, materials and rest for the viewer page (keys: grainview/README.md)."""
    return {
        "big": list(LARGEST_COLOURS),
        "small": list(OTHER_COLOURS),
        "single": SINGLE_COLOUR,
        "modes": list(MODE_COLOURS),
        "within": WITHIN_LIMITS_COLOUR,
        "materials": list(MATERIAL_COLOURS),
        "rest": list(REST_COLOURS),
    }
