"""Figure of a series of collisions: largest remnants, and energy losses by channel."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from .run_figure import DPI, RunFigure
from .style import plot_style

COLOURS = {"stick": "#0072B2", "bounce": "#E69F00", "fragment": "#D55E00", "miss": "#999999"}


def collision_figure(results: list[dict[str, Any]]) -> Figure:
    """Figure of the largest remnant of each collision (left) and the losses by channel over the impact energy (right).

    Parameters
    ----------
    results : list[dict[str, Any]]
        Results of collisions as dictionaries, see `experiments.collision.Collision`.
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
        left.legend(loc="lower left")
        channels = [c for c in results[0]["lost"] if any(r["lost"][c] for r in results)]
        share = np.array([[r["lost"][c] / r["impact_energy"] for c in channels] for r in results])
        if channels:
            right.barh(channels, share.mean(axis=0), xerr=share.std(axis=0), color="#56B4E9", ecolor="#555555")
        right.invert_yaxis()
        right.set_xlabel("energy loss / impact energy (mean and standard deviation)")
        count = f"{len(results)} collision{'s' if len(results) > 1 else ''}"
        figure.suptitle(f"{count} at {results[0]['speed']:g} m/s", x=0.01, ha="left")
    return figure
