"""From numbers to colours, and the key that takes one back from a colour to its number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.colors import Colormap

from ...analysis.clusters import cluster_sizes
from ...analysis.quantities import MODES, Quantity, material_names
from ..palettes import DIVERGING, MATERIAL_COLOURS, MODE_COLOURS, SEQUENTIAL, WITHIN_LIMITS_COLOUR
from ..style import LARGEST_COLOURS, SINGLE_COLOUR, format_si, rgb, si_prefix
from .scene import cluster_colours

FEW = 9
"""Whole numbers up to this many are shown one by one."""
DECADES = 100.0
"""Numbers above 0 whose largest is more than this many times the smallest are shown by their logarithm."""


@dataclass(frozen=True)
class ColourKey:
    """What colours mean.

    Attributes
    ----------
    title : str
        what is shown, with its unit.
    swatches : tuple[tuple[str, ndarray], ...]
        (text, colour (3,)) one by one; empty if there is a bar.
    map : Colormap or None
        colours of the bar, from `low` to `high` in units of the title; `log`: by logarithm.
    """

    title: str
    swatches: tuple[tuple[str, np.ndarray], ...] = ()
    map: Colormap | None = None
    low: float = 0.0
    high: float = 1.0
    log: bool = False

    def shades(self, values: np.ndarray) -> np.ndarray:
        """(N, 3) colours of numbers in the title's unit; grey for what is none."""
        low, high = (np.log(self.low), np.log(self.high)) if self.log else (self.low, self.high)
        with np.errstate(invalid="ignore", divide="ignore"):
            share = ((np.log(values) if self.log else values) - low) / (high - low)
        known = np.isfinite(share)
        return np.where(
            known[:, None], (self.map or SEQUENTIAL)(np.where(known, share, 0.0))[:, :3], rgb(SINGLE_COLOUR)
        )


def coloured(values: np.ndarray, what: Quantity, frame: Any, label: np.ndarray) -> tuple[np.ndarray, ColourKey]:
    """Colours (K, 3) of numbers, and their key.

    Parameters
    ----------
    values : ndarray
        (K,) SI.
    frame
        that they are from, for the names of materials.
    label : ndarray
        cluster of each grain that is shown, for the quantity `cluster`.
    """
    if what.name == "cluster":  # by rank, not by name as on the page: one picture has no history
        return cluster_colours(label), ColourKey(what.name, _cluster_swatches(label))
    if what.kind == "categorical":
        kinds = {
            "mode": (MODES, (WITHIN_LIMITS_COLOUR, *MODE_COLOURS)),
            "material": (material_names(frame), MATERIAL_COLOURS),
        }
        names, colours = kinds[what.name]
        table = np.array([rgb(colours[k % len(colours)]) for k in range(len(names))])
        there = np.unique(values[np.isfinite(values)]).astype(int)
        shown = table[np.where(np.isfinite(values), values, 0.0).astype(int)]
        return shown, ColourKey(what.meaning, tuple((names[k], table[k]) for k in there))
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    one, unit = (1.0, "") if what.unit == "1" else si_prefix(max(abs(low), abs(high)), what.unit)
    title = f"{what.meaning} ({unit})" if unit else what.meaning
    if what.kind == "diverging":
        reach = 1.0 if what.unit == "1" else max(abs(low), abs(high)) / one or 1.0
        key = ColourKey(title, map=DIVERGING, low=-reach, high=reach)
        return key.shades(values / one), key
    levels = np.unique(finite)
    if len(levels) < 2 or high - low < 1e-6 * abs(high):
        key = ColourKey(title, low=low / one - 1.0, high=high / one + 1.0)
        text = format_si(high, what.unit) if unit else f"{high:g}"
        return key.shades(values / one), ColourKey(what.meaning, ((text, key.shades(np.array([high / one]))[0]),))
    log = low > 0.0 and high > DECADES * low
    key = ColourKey(title, low=low / one, high=high / one, log=log)
    if what.unit == "1" and len(levels) <= FEW and np.all(levels == np.round(levels)):
        shades = key.shades(levels)
        key = ColourKey(title, tuple((f"{v:g}", shade) for v, shade in zip(levels, shades, strict=True)))
        return shades[np.searchsorted(levels, np.where(np.isfinite(values), values, low))], key
    return key.shades(values / one), key


def _cluster_swatches(label: np.ndarray) -> tuple[tuple[str, np.ndarray], ...]:
    sizes = cluster_sizes(label)
    order = np.argsort(-sizes, kind="stable")
    big = [k for k in order if sizes[k] > 1]
    colour = cluster_colours(label)
    found = [(f"{sizes[k]} grains", colour[np.argmax(label == k)]) for k in big[: len(LARGEST_COLOURS)]]
    more = len(big) - len(LARGEST_COLOURS)
    if more > 0:
        found.append((f"{more} more cluster{'s' if more > 1 else ''}", np.full(3, np.nan)))
    singles = int((sizes == 1).sum())
    if singles:
        found.append((f"{singles} single grain{'s' if singles > 1 else ''}", rgb(SINGLE_COLOUR)))
    return tuple(found)
