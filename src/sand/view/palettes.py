"""Palettes of the page: 64 colours each, as even as they look, and safe for the colour-blind."""

from __future__ import annotations

import matplotlib
import numpy as np

from .style import BIG, SINGLE, SMALL

STEPS = 64
SEQUENTIAL = ("cividis", "viridis")
"""Of matplotlib."""
DIVERGING = ("#12436D", "#2F78B5", "#8DB6DA", "#E6E6E6", "#E8B48A", "#C8702A", "#7A3A0C")
"""Blue, light grey, orange: as dark on both sides."""


def palettes() -> dict[str, list[list[int]]]:
    """64 × (red, green, blue) from 0 to 255, by name."""
    ways = {name: matplotlib.colormaps[name] for name in SEQUENTIAL}
    ways["diverging"] = matplotlib.colors.LinearSegmentedColormap.from_list("diverging", DIVERGING)
    places = np.linspace(0.0, 1.0, STEPS)
    return {name: np.rint(255.0 * way(places)[:, :3]).astype(int).tolist() for name, way in ways.items()}


def colours() -> dict[str, list[str] | str]:
    """Of the largest clusters, of all others in turn, and of single grains."""
    return {"big": list(BIG), "small": list(SMALL), "single": SINGLE}
