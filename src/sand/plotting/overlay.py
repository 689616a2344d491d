"""Figures of several runs in one: a colour for each run, a line style for each quantity."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ..analysis.clusters import cluster_labels, cluster_sizes
from ..analysis.frame_statistics import mass_spectrum
from ..analysis.quantities import category_names, measured, quantity
from ..basics.errors import BadInput
from ..io.ledger_table import TEMPERATURES
from ..simulation.ledger import KINETIC
from .panels import DECADES, ELASTIC, LOSS_CHANNELS, TEMPERATURE_LINES, column, log_ticks, peak, scale_values
from .plots import bin_edges, dark_figure, one_panel
from .style import BLUE, GREEN, LARGEST_COLOURS, MUTED, ORANGE, PURPLE, RED, legend_above, plot_style, si_prefix

COLOURS = (BLUE, RED, GREEN, ORANGE, PURPLE, *LARGEST_COLOURS[5:])
"""Colours of runs."""
STYLES = ("-", "--", ":", "-.")
"""Styles of the lines of quantities."""
Values = Callable[[Any], np.ndarray]


class Overlaid(NamedTuple):
    """One of several runs in a figure.

    Attributes
    ----------
    label : str
        Its name in the legend.
    ledger : LedgerColumns or None
        Its ledger.
    frame : Frame or None
        A frame.
    field : ndarray or None
        (3,) external flux density at the time of the frame [T].
    """

    label: str
    ledger: Any = None
    frame: Any = None
    field: np.ndarray | None = None


class _Lines(NamedTuple):
    """What a figure over time shows: its axis, its unit ("" if it is a number), its scale, and its quantities."""

    label: str
    unit: str
    scale: str
    values: dict[str, Values]


def _sum_of(*names: str) -> Values:
    return lambda ledger: column(ledger, *names)


_LOSSES = tuple(name for names in LOSS_CHANNELS.values() for name in names)
_LINES = {
    "size": _Lines(
        "size (grains)",
        "",
        "log",
        {"mean size $S$": _sum_of("mean_cluster_size"), "largest": _sum_of("largest_cluster")},
    ),
    "energies": _Lines(
        "energy",
        "J",
        "linear",
        {"kinetic": _sum_of(*KINETIC), "contacts": _sum_of(*ELASTIC), "magnetic": _sum_of("magnetic")},
    ),
    "losses": _Lines("all losses", "J", "log", {"": _sum_of(*_LOSSES)}),
    "contacts": _Lines(
        "number of contacts",
        "",
        "linear",
        {"contacts": _sum_of("contacts"), "formed so far": _sum_of("made"), "broken so far": _sum_of("broken")},
    ),
    "balance": _Lines(
        "change of the total energy, losses included",
        "J",
        "linear",
        {"": lambda ledger: column(ledger, "total") - column(ledger, "total")[0]},
    ),
    "temperatures": _Lines(
        "temperature of bodies",
        "K",
        "log",
        {label: _sum_of(name) for name, (label, _) in zip(TEMPERATURES, TEMPERATURE_LINES, strict=True)},
    ),
}


def overlaid_history(runs: Sequence[Overlaid], name: str, dark: bool = False) -> Figure:
    """Figure of one quantity of several runs over time; energies in joules.

    Parameters
    ----------
    runs : Sequence[Overlaid]
        Runs with their ledgers.
    name : str
        A name of `plots.HISTORY`. Of the losses the sum of all is drawn.
    dark : bool, optional
        Dark background.

    Raises
    ------
    BadInput
        If a ledger has no row, or lacks a column.
    """
    lines = _LINES[name]
    if empty := [run.label for run in runs if not run.ledger.rows]:
        raise BadInput(f"the ledger of {empty[0]} has no row yet, so there is nothing to plot over time")
    try:
        values = [{label: of(run.ledger) for label, of in lines.values.items()} for run in runs]
    except KeyError as error:
        raise BadInput(f"a ledger was written by another version of SAND: {error.args[0]}") from None
    shown = [label for label in lines.values if any(peak(one[label]) for one in values)] or list(lines.values)[:1]
    unit = max(peak(one[label]) for one in values for label in shown)
    size, prefixed = si_prefix(unit, lines.unit) if lines.unit == "J" else (1.0, lines.unit)
    time, second = si_prefix(max(peak(run.ledger["time"]) for run in runs), "s")
    with plot_style():
        figure, axes = one_panel()
        for run, one, colour in zip(runs, values, cycle(COLOURS), strict=False):
            for label, style in zip(shown, cycle(STYLES), strict=False):
                kept = np.where(one[label] > 0.0, one[label], np.nan) if lines.scale == "log" else one[label]
                axes.plot(run.ledger["time"] / time, kept / size, style, color=colour)
        axes.set(xlabel=f"time ({second})", ylabel=f"{lines.label} ({prefixed})" if prefixed else lines.label)
        if lines.scale == "log":
            drawn_lines = [one[label] for one in values for label in shown]
            top = max(map(peak, drawn_lines)) / size
            lowest = min(float(np.min(line, where=line > 0.0, initial=top * size)) for line in drawn_lines) / size
            axes.set(yscale="log", ylim=(max(lowest / 1.3, top * 10.0**-DECADES) or 0.5, 1.3 * top or 1.0))
            log_ticks(axes, plain=True)
        else:
            scale_values(
                axes, [one[label] / size for one in values for label in shown if peak(one[label])] or [np.ones(1)]
            )
        _legend(axes, runs, shown)
        dark_figure(figure, dark)
    return figure


def overlaid_grains(runs: Sequence[Overlaid], name: str, dark: bool = False) -> Figure:
    """Histograms of a quantity over the grains of a frame of each run, as shares of its grains.

    Parameters
    ----------
    runs : Sequence[Overlaid]
        Runs with their frames.
    name : str
        A quantity of grains; `cluster`: shares of the clusters by their number of grains.
    dark : bool, optional
        Dark background.

    Raises
    ------
    BadInput
        If a frame does not have the quantity.
    """
    what = quantity(name, frame=runs[0].frame)
    if name == "cluster":
        values = [np.asarray(_sizes(run.frame), float) for run in runs]
    else:
        found = [measured(run.frame, name, run.field) for run in runs]
        values = [one[np.isfinite(one)] for one in found]
    if empty := [run.label for run, one in zip(runs, values, strict=True) if not one.size]:
        raise BadInput(f"{name}: no grain of {empty[0]} has a finite value")
    with plot_style():
        figure, axes = one_panel()
        if name != "cluster" and what.kind == "categorical":
            names = list(dict.fromkeys(word for run in runs for word in category_names(name, run.frame)))
            for k, (run, one, colour) in enumerate(zip(runs, values, cycle(COLOURS), strict=False)):
                own = category_names(name, run.frame)
                count = np.array([np.count_nonzero(one == own.index(w)) if w in own else 0 for w in names])
                width = 0.8 / len(runs)
                axes.bar(
                    np.arange(len(names)) + (k - 0.5 * (len(runs) - 1)) * width, count / len(one), width, color=colour
                )
            axes.set_xticks(range(len(names)), names)
            axes.set(xlabel=what.meaning, ylabel="share of grains")
        else:
            whole = np.concatenate(values)
            meaning, unit = ("grains per cluster", "1") if name == "cluster" else (what.meaning, what.unit)
            size, prefixed = (1.0, "") if unit == "1" else si_prefix(float(np.abs(whole).max()), unit)
            edges, is_log = bin_edges(whole / size, unit)
            for one, colour in zip(values, cycle(COLOURS), strict=False):
                axes.stairs(np.histogram(one / size, edges)[0] / len(one), edges, color=colour, linewidth=1.3)
            axes.set_xscale("log" if is_log else "linear")
            axes.set(xlabel=f"{meaning} ({prefixed})" if prefixed else meaning)
            axes.set(ylabel="share of clusters" if name == "cluster" else "share of grains")
        _legend(axes, runs, [])
        dark_figure(figure, dark)
    return figure


def spectrum_figure(runs: Sequence[Overlaid], dark: bool = False) -> Figure:
    """Figure of s² n_s over the size s, see `analysis.frame_statistics.mass_spectrum`, of a frame of each run."""
    with plot_style():
        figure, axes = one_panel()
        for run, colour, marker in zip(runs, cycle(COLOURS), cycle("os^Dv"), strict=False):
            draw_spectrum(axes, _sizes(run.frame), colour, marker)
        _legend(axes, runs if len(runs) > 1 or runs[0].label else [], [])
        dark_figure(figure, dark)
    return figure


def draw_spectrum(axes: Axes, sizes: np.ndarray, colour: str, marker: str = "o", label: str | None = None) -> None:
    """Draw s² n_s of clusters of these sizes, with the standard errors of independent clusters."""
    s, value, error = mass_spectrum(sizes)
    axes.errorbar(
        s,
        value,
        value * np.minimum(error, 0.9),
        fmt=f"{marker}-",
        color=colour,
        markersize=3.5,
        linewidth=1.0,
        elinewidth=0.7,
        label=label,
    )
    axes.set(xscale="log", yscale="log", xlabel="grains per cluster $s$", ylabel="$s^2\\,n_s$ (per grain)")


def _sizes(frame: Any) -> np.ndarray:
    """Grains of each cluster of a frame."""
    return cluster_sizes(cluster_labels(len(frame.radius), frame.pair))


def _legend(axes: Axes, runs: Sequence[Overlaid], quantities: Sequence[str]) -> None:
    """The colours of runs, and the line styles of quantities if there are several."""
    handles = [Line2D([], [], color=c, label=run.label) for run, c in zip(runs, cycle(COLOURS), strict=False)]
    if len(quantities) > 1:
        styles = zip(quantities, cycle(STYLES), strict=False)
        handles += [Line2D([], [], color=MUTED, linestyle=style, label=label) for label, style in styles]
    if handles:
        legend_above(axes, handles)
    if axes.get_yscale() == "linear" and axes.get_ylabel().startswith("number"):
        axes.yaxis.set_major_locator(MaxNLocator(6, integer=True))
