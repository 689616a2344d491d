"""Figure of a sweep: a result over the key with the most values, a line for each combination of the other keys."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from .run_figure import DPI, RunFigure
from .style import LARGEST_COLOURS, OTHER_COLOURS, legend_above, plot_style

MOST_LINES = 14
"""Largest number of lines: of more combinations of the other keys, the first ones are drawn."""
LOG_FROM = 15.0
"""Ratio of the largest to the smallest value from which on the axis is logarithmic."""
_NUMBER = re.compile(r"([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(.*)")


def sweep_figure(table: Mapping[str, np.ndarray], keys: Sequence[str], what: str) -> Figure:
    """Figure of a column of the table of a sweep.

    Points are means over all runs with the same values of the keys, bars the standard errors of these means. Of a
    column of text, such as `outcome`, the share of each word is drawn.

    Parameters
    ----------
    table : mapping
        Columns by name, of runs that are done.
    keys : sequence of str
        Columns of keys that change.
    what : str
        The column.
    """
    distinct = {key: len(set(table[key].tolist())) for key in keys}
    x_key = max(keys, key=lambda key: distinct[key], default="seed")
    x, unit = _numbers(table[x_key])
    others = [key for key in keys if key != x_key and distinct[key] > 1]
    short = {key: [f"{v:.4g}" if isinstance(v, float) else str(v) for v in table[key].tolist()] for key in others}
    groups = [", ".join(f"{key.rpartition('.')[2]} = {short[key][k]}" for key in others) for k in range(len(x))]
    column = table[what]
    words = sorted(set(column.tolist())) if column.dtype.kind in "Ub" else [""]
    with plot_style():
        figure = RunFigure(figsize=(6.0, 4.0), dpi=DPI, layout="constrained")
        axes = figure.subplots()
        lines = [(group, word) for group in dict.fromkeys(groups) for word in words][:MOST_LINES]
        for (group, word), colour in zip(lines, cycle((*LARGEST_COLOURS, *OTHER_COLOURS)), strict=False):
            chosen = np.array([one == group for one in groups]) & np.isfinite(x)
            y = (column == word if words != [""] else column)[chosen].astype(float)
            label = ", ".join(text for text in (group, str(word)) if text)
            axes.errorbar(*_means(x[chosen], y), fmt="o-", color=colour, markersize=3.5, elinewidth=0.8, label=label)
        positive = x[x > 0.0]
        if len(positive) == len(x) and positive.max(initial=0.0) > LOG_FROM * positive.min(initial=np.inf):
            axes.set_xscale("log")
        axes.set(xlabel=f"{x_key} [{unit}]" if unit else x_key, ylabel=what if words == [""] else f"share of {what}")
        if words != [""]:
            axes.set_ylim(-0.03, 1.03)
        if len(lines) > 1 or lines[0] != ("", ""):
            legend_above(axes)
    return figure


def _means(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distinct x, the mean of y at each, and the standard error of this mean (0 for a single value)."""
    places, index, number = np.unique(x, return_inverse=True, return_counts=True)
    mean = np.bincount(index, y) / number
    spread = np.bincount(index, (y - mean[index]) ** 2)
    return places, mean, np.sqrt(spread / np.maximum(number - 1, 1) / number)


def _numbers(column: np.ndarray) -> tuple[np.ndarray, str]:
    """A column as numbers, and their unit: those of text, such as '0.5 b', or the number of each word."""
    if column.dtype.kind not in "U":
        return column.astype(float), ""
    found = [_NUMBER.fullmatch(text) for text in column.tolist()]
    units = {match[2] for match in found if match}
    if None not in found and len(units) == 1:
        return np.array([float(match[1]) for match in found if match]), units.pop()
    return np.unique(column, return_inverse=True)[1].astype(float), ""
