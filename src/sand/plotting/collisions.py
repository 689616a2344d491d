"""Figures of collisions: largest remnants, energy losses by channel, growth efficiency, and kinds of outcomes."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..analysis.collision_kinds import UNDECIDED
from ..analysis.impact_average import impact_average
from .panels import CHANNEL_LABELS, LOSS_CHANNELS
from .run_figure import figure_with_panels
from .style import MUTED, TEXT_COLOUR, figure_title, legend_above, log_axis, looks_of, no_line, plot_style

ASIDE, WIDEST = 0.045, 0.12
"""Shift of the marks of a seed from those of the seed before, and the largest shift, as fractions of the speed."""
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
        figure, (left, right) = figure_with_panels(2, (4.5, 3.6))
        outcomes = np.array([r["outcome"] for r in results])
        masses = np.array([r["largest_remnant"] for r in results])
        order = np.argsort(-masses, kind="stable")
        for name, (colour, marker) in looks_of(outcomes).items():
            selected = outcomes[order] == name
            rank = np.flatnonzero(selected) + 1
            left.plot(rank, masses[order][selected], **no_line(marker, colour), markersize=4, label=name)
        left.set(xlim=(0.5, len(results) + 0.5), ylim=(0.0, 1.05))
        left.set(xlabel="collisions, sorted by largest remnant", ylabel="mass of the largest remnant / total mass")
        left.xaxis.set_major_locator(MaxNLocator(integer=True))
        legend_above(left)
        _draw_shares(right, results)
        figure_title(figure, title, 9.0, weight="bold")
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


def growth_figure(collisions: list[dict[str, Any]], title: str) -> Figure:
    """Figure of collisions at several speeds: growth efficiency (left), kinds of outcomes against speed and b (right).

    The line is the average over impact parameters at each speed, with its 95 % interval over seeds where there is one;
    without different impact parameters, the mean over seeds. Undecided collisions are not part of it.

    Parameters
    ----------
    collisions : list[dict[str, Any]]
        Of each collision `speed` [m/s], `impact_parameter` and `reach` [m], `growth_efficiency`, `kind` and `seed`.
    title : str
        Title.
    """
    speed, growth, share = (
        np.array([row["speed"] for row in collisions], float),
        np.array([row["growth_efficiency"] for row in collisions], float),
        np.array([row["impact_parameter"] / row["reach"] for row in collisions], float),
    )
    kinds, seeds = np.array([row["kind"] for row in collisions]), np.array([row["seed"] or 0 for row in collisions])
    number = np.unique(seeds, return_inverse=True)[1]
    beside = speed * (1.0 + min(ASIDE, WIDEST / max(number.max(), 1)) * (number - 0.5 * number.max()))
    with plot_style():
        figure, (left, right) = figure_with_panels(2, (4.5, 3.8))
        left.axhline(0.0, color=MUTED, linewidth=0.7)
        for name, (colour, marker) in looks_of(kinds).items():
            of = kinds == name
            for axes, x, y in ((left, speed, growth), (right, beside, share)):
                axes.plot(x[of], y[of], **no_line(marker, colour), markersize=4, alpha=0.8, label=name)
        decided = kinds != UNDECIDED
        speeds = np.unique(speed[decided])
        averages = [_average(*(each[decided & (speed == v)] for each in (growth, share, seeds))) for v in speeds]
        mean, low, high = (np.array([getattr(one, name) for one in averages]) for name in ("mean", "low", "high"))
        left.plot(speeds, mean, color=TEXT_COLOUR, linewidth=1.2)
        known = np.isfinite(low)  # without equally many impact parameters for each seed there is no interval
        limits = np.array([mean - low, high - mean])[:, known]
        left.errorbar(speeds[known], mean[known], limits, color=TEXT_COLOUR, fmt="none", capsize=2)
        left.set(xlabel="speed [m/s]", ylabel="growth efficiency $f$; line: average over $b$", ylim=(None, 1.1))
        right.set(
            xlabel="speed [m/s]",
            ylabel="impact parameter / sum of outer radii",
            ylim=(-0.05, max(share.max() + 0.05, 0.2)),
        )
        for axes in (left, right) if speed.max() > 3.0 * speed.min() else ():
            log_axis(axes, "x")
        legend_above(right)
        figure_title(figure, title, 9.0, weight="bold")
    return figure


def _average(growth: np.ndarray, share: np.ndarray, seeds: np.ndarray) -> Any:
    """Average of the growth efficiency at one speed.

    Outer radii differ between seeds, so that one length is another share of them for each seed. If all seeds have
    equally many shares, these are numbered in increasing order, and each is replaced by the mean over seeds of those
    with its number. The last share gets as much of b² beyond it as before it, up to the sum of the outer radii.
    """
    order = np.lexsort((share, seeds))
    numbers = np.unique(seeds, return_counts=True)[1]
    if len(set(numbers.tolist())) == 1:
        means = share[order].reshape(len(numbers), -1).mean(axis=0)
        if (np.diff(means) > 0.0).all():
            share = np.empty_like(share)
            share[order] = np.tile(means, len(numbers))
    squares = np.unique(share**2)
    beyond = 0.5 * float(squares[-1] - squares[-2]) if len(squares) > 1 else 0.0
    return impact_average(growth, share, seeds, max(min(squares[-1] + beyond, 1.0), squares[-1]) ** 0.5 or 1.0)
