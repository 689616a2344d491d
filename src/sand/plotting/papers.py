"""Figures of published campaigns: curves with intervals, and guide lines of what the paper gives."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .figure_format import format_width
from .run_figure import LETTERS, figure_with_panels
from .style import (
    LINE_COLOURS,
    MARKERS,
    MUTED,
    figure_title,
    legend_above,
    log_axis,
    panel_letter,
    plot_style,
)


class Curve(NamedTuple):
    """Points of one curve; with `low` and `high`, limits of their intervals; `weak` ones are open, and dotted."""

    label: str
    x: np.ndarray
    y: np.ndarray
    low: np.ndarray | None = None
    high: np.ndarray | None = None
    weak: np.ndarray | None = None
    look: int | None = None  # number of its colour and marker; by default its place among the curves


class Guide(NamedTuple):
    """A line that is no result of this campaign: a law y(x) if it has two points or more, a mark at x if it has one."""

    label: str
    x: np.ndarray
    y: np.ndarray


class Panel(NamedTuple):
    """One panel."""

    xlabel: str
    ylabel: str
    curves: Sequence[Curve]
    guides: Sequence[Guide] = ()
    log: str = "x"  # logarithmic axes: "", "x", "y" or "xy"
    zero: bool = False  # whether the line y = 0 is drawn
    legend: str = ""  # title of the legend


def panels_figure(panels: Sequence[Panel], title: str) -> Figure:
    """Figure of panels in a row, with a title."""
    with plot_style():
        figure, drawn = figure_with_panels(len(panels), (4.6, 3.9), more=(0.4 * (format_width() is None), 0.0))
        for axes, panel, letter in zip(drawn, panels, LETTERS, strict=False):
            _draw(axes, panel)
            panel_letter(axes, letter, -0.14)
        figure_title(figure, title)
    return figure


def _draw(axes: Axes, panel: Panel) -> None:
    for axis in panel.log:
        log_axis(axes, axis)
    if panel.zero:
        axes.axhline(0.0, color=MUTED, linewidth=0.8)
    for k, curve in enumerate(panel.curves):
        number = k if curve.look is None else curve.look
        colour, marker = LINE_COLOURS[number % len(LINE_COLOURS)], MARKERS[number % len(MARKERS)]
        weak = np.zeros(len(curve.x), bool) if curve.weak is None else curve.weak
        look: dict[str, Any] = {"marker": marker, "color": colour, "markersize": 4.0, "linewidth": 1.0}
        axes.plot(curve.x, np.where(weak, np.nan, curve.y), label=curve.label, **look)
        if weak.any():
            axes.plot(curve.x, np.where(weak, curve.y, np.nan), **look, linestyle=":", fillstyle="none")
        if curve.low is not None and curve.high is not None:
            axes.fill_between(curve.x, curve.low, curve.high, color=colour, alpha=0.18, linewidth=0.0)
    for guide, style in zip(panel.guides, cycle(("--", ":", "-.")), strict=False):
        if len(guide.x) > 1:
            axes.plot(guide.x, guide.y, linestyle=style, color=MUTED, label=guide.label)
        else:
            axes.axvline(float(guide.x[0]), linestyle=style, color=MUTED, label=guide.label)
    axes.set(xlabel=panel.xlabel, ylabel=panel.ylabel)
    legend_above(axes, title=panel.legend)
