"""Colours of quantities, and the colour keys that explain them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.colors import Colormap

from ...analysis.clusters import cluster_sizes
from ...analysis.quantities import Quantity, category_names
from ..palettes import DIVERGING, MATERIAL_COLOURS, MODE_COLOURS, REST_COLOURS, SEQUENTIAL, WITHIN_LIMITS_COLOUR
from ..style import LARGEST_COLOURS, SINGLE_COLOUR, format_si, rgb, si_prefix
from .scene import cluster_colours, largest_clusters

MAX_SWATCHES = 9
"""Up to this many different integers are shown as separate swatches."""
LOG_RANGE = 100.0
"""Ratio of the largest to the smallest value above which positive values have a logarithmic scale."""


@dataclass(frozen=True)
class ColourKey:
    """Legend of a colour scale.

    Attributes
    ----------
    title : str
        Quantity and unit.
    swatches : tuple of (str, ndarray)
        Label and colour (3,) of each category; empty for a colour bar.
    map : Colormap, optional
        Colours of the bar.
    low, high : float
        Range of the bar in the unit of the title.
    log : bool
        Logarithmic scale.
    """

    title: str
    swatches: tuple[tuple[str, np.ndarray], ...] = ()
    map: Colormap | None = None
    low: float = 0.0
    high: float = 1.0
    log: bool = False

    def colours(self, values: np.ndarray) -> np.ndarray:
        """Colours (N, 3) of values in the unit of the title; grey for NaN."""
        low, high = (np.log(self.low), np.log(self.high)) if self.log else (self.low, self.high)
        with np.errstate(invalid="ignore", divide="ignore"):
            share = ((np.log(values) if self.log else values) - low) / (high - low)
        known = np.isfinite(share)
        return np.where(
            known[:, None], (self.map or SEQUENTIAL)(np.where(known, share, 0.0))[:, :3], rgb(SINGLE_COLOUR)
        )


def coloured(values: np.ndarray, what: Quantity, frame: Any, label: np.ndarray) -> tuple[np.ndarray, ColourKey]:
    """Colours of the values of a quantity.

    Parameters
    ----------
    values : ndarray
        (K,) values [SI]; NaN if unknown.
    what : Quantity
        The quantity.
    frame : Frame
        Frame that the values belong to, for the names of materials.
    label : ndarray
        Cluster of each grain shown, for the quantity `cluster`.

    Returns
    -------
    tuple of (ndarray, ColourKey)
        Colours (K, 3), and their key.
    """
    if what.name == "cluster":  # by rank, not by name as on the viewer page: an image has no history
        return cluster_colours(label), ColourKey(what.name, _cluster_swatches(label))
    if what.kind == "categorical":
        names = category_names(what.name, frame)
        colours = {
            "mode": (WITHIN_LIMITS_COLOUR, *MODE_COLOURS),
            "material": MATERIAL_COLOURS,
            "at_rest": REST_COLOURS,
        }[what.name]
        table = np.array([rgb(colours[k % len(colours)]) for k in range(len(names))])
        present = np.unique(values[np.isfinite(values)]).astype(int)
        shown = table[np.where(np.isfinite(values), values, 0.0).astype(int)]
        return shown, ColourKey(what.meaning, tuple((names[k], table[k]) for k in present))
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    size, unit = (1.0, "") if what.unit == "1" else si_prefix(max(abs(low), abs(high)), what.unit)
    title = f"{what.meaning} ({unit})" if unit else what.meaning
    if what.kind == "diverging":
        reach = 1.0 if what.unit == "1" else max(abs(low), abs(high)) / size or 1.0
        key = ColourKey(title, map=DIVERGING, low=-reach, high=reach)
        return key.colours(values / size), key
    levels = np.unique(finite)
    if len(levels) < 2 or high - low < 1e-6 * abs(high):
        key = ColourKey(title, low=low / size - 1.0, high=high / size + 1.0)
        text = format_si(high, what.unit) if unit else f"{high:g}"
        swatch = key.colours(np.array([high / size]))[0]
        return key.colours(values / size), ColourKey(what.meaning, ((text, swatch),))
    log = low > 0.0 and high > LOG_RANGE * low
    key = ColourKey(title, low=low / size, high=high / size, log=log)
    if what.unit == "1" and len(levels) <= MAX_SWATCHES and np.all(levels == np.round(levels)):
        swatches = key.colours(levels)
        key = ColourKey(title, tuple((f"{v:g}", swatch) for v, swatch in zip(levels, swatches, strict=True)))
        return swatches[np.searchsorted(levels, np.where(np.isfinite(values), values, low))], key
    return key.colours(values / size), key


def _cluster_swatches(label: np.ndarray) -> tuple[tuple[str, np.ndarray], ...]:
    sizes = cluster_sizes(label)
    clusters = largest_clusters(label)
    colour = cluster_colours(label)
    swatches = [(f"{sizes[k]} grains", colour[np.argmax(label == k)]) for k in clusters[: len(LARGEST_COLOURS)]]
    more = len(clusters) - len(LARGEST_COLOURS)
    if more > 0:
        swatches.append((f"{more} more cluster{'s' if more > 1 else ''}", np.full(3, np.nan)))
    singles = int((sizes == 1).sum())
    if singles:
        swatches.append((f"{singles} single grain{'s' if singles > 1 else ''}", rgb(SINGLE_COLOUR)))
    return tuple(swatches)
