"""Figure of a series of collisions: largest remnants, and energy losses by channel."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from .panels import CHANNEL_LABELS, LOSS_CHANNELS
from .run_figure import DPI, RunFigure
from .style import legend_above, plot_style

COLOURS = {"stick": "#0072B2", "bounce": "#E69F00", "fragment": "#D55E00", "miss": "#999999"}
NEGLIGIBLE = 1e-3
"""Mean share of the impact energy below which a loss is only named."""


def collision_figure(results: list[dict[str, Any]], title: str) -> Figure:
    """Figure of the largest remnant of each collision (left) and the losses by channel over the impact energy (right).

    Parameters
    ----------
    results : list[dict[str, Any]]
        Results of collisions as dictionaries, see `experiments.collision.Collision`.
    title : str
        Title, see `experiments.collision_outcome.collision_title`.
    """
    with plot_style():
        figure = RunFigure(figsize=(9.0, 3.6), dpi=DPI, layout="constrained")
        left, right = figure.subplots(1, 2)
        outcomes = np.array([r["outcome"] for r in results])
        masses = np.array([r["largest_remnant"] for r in results])
        order = np.argsort(-masses, kind="stable")
        for name, colour in COLOURS.items():
            selected = outcomes[order] == name
            if selected.any():
                rank = np.flatnonzero(selected) + 1
                left.plot(rank, masses[order][selected], "o", color=colour, markersize=4, label=name)
        left.set(xlim=(0.5, len(results) + 0.5), ylim=(0.0, 1.05))
        left.set(xlabel="collisions, sorted by largest remnant", ylabel="mass of the largest remnant / total mass")
        left.xaxis.set_major_locator(MaxNLocator(integer=True))
        legend_above(left)
        _draw_shares(right, results)
        figure.suptitle(title, x=0.01, ha="left", fontsize=9.0, weight="bold")
    return figure


def _draw_shares(axes: Axes, results: list[dict[str, Any]]) -> None:
    """Draw the losses by channel over the impact energy; those below NEGLIGIBLE are named."""
    lost = {
        name: np.array([sum(r["lost"].get(column.removeprefix("lost_"), 0.0) for column in columns) for r in results])
        for name, columns in LOSS_CHANNELS.items()
    }
    energy = np.array([r["impact_energy"] for r in results])
    share = {CHANNEL_LABELS.get(name, name): values / energy for name, values in lost.items()}
    drawn = {name: values for name, values in share.items() if np.abs(values).mean() >= NEGLIGIBLE}
    small = [name for name, values in share.items() if name not in drawn and values.any()]
    if drawn:
        spread = [values.std() for values in drawn.values()]
        axes.barh(list(drawn), [v.mean() for v in drawn.values()], xerr=spread, color="#56B4E9", ecolor="#555555")
    axes.invert_yaxis()
    below = f"\nbelow {NEGLIGIBLE:.1%}: {', '.join(small)}" if small else ""
    axes.set_xlabel(f"energy loss / impact energy (mean and standard deviation){below}")
