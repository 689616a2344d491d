"""Figures of `sand plot`: one quantity over time, or the distribution of a quantity over the grains of a frame."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..analysis.clusters import cluster_labels
from ..analysis.frame_statistics import size_distribution
from ..analysis.ledger_columns import LedgerColumns
from ..analysis.quantities import category_names, measured, quantity
from ..basics.errors import BadInput
from .figure_format import figure_size
from .panels import (
    AxisUnit,
    draw_balance,
    draw_clusters,
    draw_contacts,
    draw_energies,
    draw_losses,
    draw_temperatures,
    draw_time,
    energy_unit,
    time_unit,
)
from .render.colouring import LOG_RANGE
from .run_figure import DPI, RunFigure
from .style import (
    BLUE,
    DARK_BACKGROUND,
    MUTED_ON_DARK,
    TEXT_COLOUR,
    TEXT_ON_DARK,
    format_si,
    plot_style,
    points,
    si_prefix,
)

SIZE = (5.6, 3.5)
"""Width and height [inches]: one and a half journal columns wide."""
_DRAW: dict[str, Callable[[Axes, Any, AxisUnit, AxisUnit], None]] = {
    "size": lambda axes, ledger, time, _: draw_clusters(axes, ledger, time),
    "energies": draw_energies,
    "losses": draw_losses,
    "contacts": lambda axes, ledger, time, _: draw_contacts(axes, ledger, time),
    "balance": draw_balance,
    "temperatures": lambda axes, ledger, time, _: draw_temperatures(axes, ledger, time),
}
OF_ENERGY = ("energies", "losses", "balance")
"""Those of energies, in a unit that the ledger gives."""
NO_UNIT = AxisUnit(1.0, "", "")
HISTORY = tuple(_DRAW)
"""Names of the figures over time."""


def history_figure(ledger: LedgerColumns, name: str, grains: int, temperature: float, dark: bool = False) -> Figure:
    """Figure of one quantity over time.

    Parameters
    ----------
    ledger : LedgerColumns
        Rows of the ledger of a run.
    name : str
        One of HISTORY.
    grains : int
        Number of grains N.
    temperature : float
        Initial kinetic temperature [K]. Energies are in N k_B T; in joules if it is 0; for one or two bodies at the
        start in units of their kinetic energy then.
    dark : bool, optional
        Dark background.

    Raises
    ------
    BadInput
        If the ledger has no row, or lacks a column.
    """
    if not ledger.rows:
        raise BadInput("the ledger has no row yet, so there is nothing to plot over time")
    try:
        with plot_style():
            figure, axes = one_panel()
            time = time_unit(ledger)
            unit = energy_unit(ledger, temperature, grains) if name in OF_ENERGY else NO_UNIT
            _DRAW[name](axes, ledger, time, unit)
            draw_time([axes], time, ledger)
            if unit.value and unit.name in axes.get_ylabel():
                axes.set_xlabel(f"{axes.get_xlabel()}\n{unit.value}")
            dark_figure(figure, dark)
    except KeyError as error:
        raise BadInput(f"the ledger was written by another version of SAND: {error.args[0]}") from None
    return figure


def grains_figure(frame: Any, name: str, field: np.ndarray | None = None, dark: bool = False) -> Figure:
    """Histogram of a quantity over the grains of a frame; for `cluster`, the number of clusters of each size.

    Parameters
    ----------
    frame : Frame
        Frame of a trajectory.
    name : str
        Name of a quantity in `analysis.quantities.GRAINS`, or of an own quantity.
    field : ndarray, optional
        (3,) external flux density [T].
    dark : bool, optional
        Dark background.

    Raises
    ------
    BadInput
        If the frame does not have the quantity.
    """
    what = quantity(name, frame=frame)
    values = measured(frame, name, field)
    if not np.isfinite(values).any():
        raise BadInput(f"{name}: no grain has a finite value")
    with plot_style():
        figure, axes = one_panel()
        if name == "cluster":
            sizes, numbers = size_distribution(cluster_labels(len(values), frame.pair))
            _bars(axes, sizes, numbers)
            axes.set(xlabel="grains per cluster", ylabel="number of clusters")
        elif what.kind == "categorical":
            names = category_names(name, frame)
            axes.bar(names, np.bincount(values.astype(int), minlength=len(names)), width=0.6, color=BLUE)
            axes.set(xlabel=what.meaning, ylabel="number of grains")
        else:
            _histogram(axes, values[np.isfinite(values)], what.meaning, what.unit)
        axes.yaxis.set_major_locator(MaxNLocator(6, integer=True))
        note = f"{len(values)} grains, t = {format_si(frame.time, 's')}"
        axes.text(1.0, 1.02, note, transform=axes.transAxes, ha="right", va="bottom", size=points(7.5))
        dark_figure(figure, dark)
    return figure


def _histogram(axes: Axes, values: np.ndarray, meaning: str, unit: str) -> None:
    size, prefixed = (1.0, "") if unit == "1" else si_prefix(float(np.abs(values).max(initial=0.0)), unit)
    shown = values / size
    axes.set(xlabel=f"{meaning} ({prefixed})" if prefixed else meaning, ylabel="number of grains")
    if unit == "1" and _is_few_whole(shown):
        _bars(axes, *np.unique(shown, return_counts=True))
        return
    edges, is_log = bin_edges(shown, unit)
    if is_log:
        axes.set_xscale("log")
    axes.hist(shown, edges.tolist(), color=BLUE, edgecolor="white", linewidth=0.4)


def _is_few_whole(values: np.ndarray) -> bool:
    """Whether values are whole numbers, at most 40 different ones."""
    levels = np.unique(values)
    return len(levels) <= 40 and bool(np.all(levels == np.round(levels)))


def bin_edges(values: np.ndarray, unit: str) -> tuple[np.ndarray, bool]:
    """Edges of the bins of a histogram, and whether its axis is logarithmic; few whole numbers have a bin each."""
    low, high = float(values.min()), float(values.max())
    if unit == "1" and _is_few_whole(values) and high - low < 200.0:
        return np.arange(low - 0.5, high + 1.0), False
    if high - low <= 1e-6 * abs(high):  # also if all are 0
        half = 0.5 * abs(low) or 0.5
        low, high = low - half, high + half
    bins = int(np.clip(np.sqrt(len(values)) * 1.5, 5, 60))
    if low > 0.0 and high > LOG_RANGE * low:
        return np.geomspace(low, high, bins + 1), True
    return np.linspace(low, high, bins + 1), False


def _bars(axes: Axes, x: np.ndarray, numbers: np.ndarray) -> None:
    span = float(np.ptp(x)) if len(x) > 1 else 1.0
    axes.bar(x, numbers, width=max(0.7, span / 120.0), color=BLUE)
    axes.xaxis.set_major_locator(MaxNLocator(10, integer=True))


def one_panel() -> tuple[RunFigure, Axes]:
    """A figure of one panel in the width that is set."""
    figure = RunFigure(figsize=figure_size(*SIZE), dpi=DPI, layout="constrained")
    return figure, figure.subplots()


def dark_figure(figure: Figure, dark: bool) -> None:
    """Set a dark background with light text and axes."""
    if not dark:
        return
    figure.set_facecolor(DARK_BACKGROUND)
    for axes in figure.axes:
        axes.tick_params(colors=TEXT_ON_DARK, which="both")
        for spine in axes.spines.values():
            spine.set_color(MUTED_ON_DARK)
        legend = axes.get_legend()
        for text in (*axes.texts, axes.xaxis.label, axes.yaxis.label, *(legend.get_texts() if legend else ())):
            text.set_color(TEXT_ON_DARK)
        for line in axes.get_lines():
            if line.get_color() == TEXT_COLOUR:
                line.set_color(TEXT_ON_DARK)
