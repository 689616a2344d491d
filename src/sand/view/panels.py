"""What happened over time: clusters, energies, losses, and whether the books balance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, SymmetricalLogLocator

from ..core.constants import BOLTZMANN
from ..core.world import LOST
from .style import BLUE, FAINT, GREEN, INK, ORANGE, PURPLE, RED, SKY, YELLOW, legend_above, with_prefix

KINETIC = ("translation", "rotation")
ELASTIC = ("normal", "sliding", "rolling", "twisting")
LOSSES = tuple(f"lost_{name}" for name in LOST)
LOSS_COLOURS = (RED, SKY, BLUE, GREEN, PURPLE)
OUTSIDE_COLOURS = (ORANGE, PURPLE, SKY, YELLOW)

DECADES = 5
"""Shown of a quantity that spans many."""
FLAT = 1e-3
"""The balance is shown at least within this share of the energy turned over."""


@dataclass(frozen=True)
class Unit:
    """What an axis counts in: `size` in SI units, `name` for its label."""

    size: float
    name: str


def time_unit(ledger: Any) -> Unit:
    """Seconds with the prefix that suits the length of the run."""
    return Unit(*with_prefix(float(np.abs(ledger["time"]).max()), "s"))


def energy_unit(ledger: Any, temperature: float, grains: int) -> Unit:
    """N k_B T of the start, or joules with a prefix where the grains were at rest."""
    if temperature > 0.0:
        name = r"$N k_\mathrm{B}T_0$" if grains > 1 else r"$k_\mathrm{B}T_0$"
        return Unit(grains * BOLTZMANN * temperature, name)
    largest = max(float(np.abs(v).max()) for v in (*energies(ledger).values(), *losses(ledger).values()))
    return Unit(*with_prefix(largest, "J"))


def energies(ledger: Any) -> dict[str, np.ndarray]:
    """Energies over time [J] as they are drawn: kinetic, of all contacts, magnetic, of each outside force."""
    columns = list(ledger.columns)
    outside = columns[columns.index("magnetic") + 1 : columns.index(LOSSES[0])]
    drawn = {
        "kinetic": np.sum([ledger[name] for name in KINETIC], axis=0),
        "contacts": np.sum([ledger[name] for name in ELASTIC], axis=0),
        "magnetic": ledger["magnetic"],
    }
    return drawn | {name: ledger[name] for name in outside}


def losses(ledger: Any) -> dict[str, np.ndarray]:
    """Energy lost so far by channel [J]."""
    return {name: ledger[f"lost_{name}"] for name in LOST}


def draw_clusters(axes: Axes, ledger: Any, time: Unit) -> None:
    """S (Eq. 17), the largest cluster and the number of clusters; all are numbers from 1 to N."""
    t = ledger["time"] / time.size
    style = _marks(t)
    axes.plot(t, ledger["clusters"], color=FAINT, linewidth=1.0, label="number of clusters", **style)
    axes.plot(t, ledger["largest_cluster"], color=SKY, label="largest (grains)", **style)
    axes.plot(
        t, ledger["mean_cluster_size"], color=BLUE, linewidth=1.9, label="mean size $S$ (grains)", **style
    )
    top = max(float(ledger[name].max()) for name in ("clusters", "largest_cluster", "mean_cluster_size"))
    axes.set_yscale("log")
    axes.set_ylim(0.85, max(1.25 * top, 4.0))
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if top < 200 else (1.0,)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel("clusters")
    legend_above(axes, 3)


def draw_energies(axes: Axes, ledger: Any, time: Unit, unit: Unit) -> None:
    """Energies; those that never differ from zero are left out."""
    t = ledger["time"] / time.size
    drawn = {name: values / unit.size for name, values in energies(ledger).items() if values.any()}
    names = [name for name in drawn if name not in ("kinetic", "contacts", "magnetic")]
    colour = {"kinetic": BLUE, "contacts": RED, "magnetic": GREEN}
    colour |= {name: OUTSIDE_COLOURS[k % len(OUTSIDE_COLOURS)] for k, name in enumerate(names)}
    axes.axhline(0.0, color=FAINT, linewidth=0.5, zorder=0)
    for name, values in drawn.items():
        label = {"contacts": "contacts (elastic, adhesion)"}.get(name, name)
        axes.plot(t, values, color=colour[name], label=label, **_marks(t))
    if drawn:
        _scale(axes, list(drawn.values()))
        legend_above(axes, 4)
    else:
        _nothing(axes, "no energy at any time")
    axes.set_ylabel(f"energy ({unit.name})")


def draw_losses(axes: Axes, ledger: Any, time: Unit, unit: Unit) -> None:
    """Losses by channel; channels that never lost anything are named only."""
    t = ledger["time"] / time.size
    all_of_them = losses(ledger)
    never = [name for name, values in all_of_them.items() if not values.any()]
    for (name, values), colour in zip(all_of_them.items(), LOSS_COLOURS, strict=True):
        if name not in never:
            shown = np.where(values > 0.0, values / unit.size, np.nan)
            axes.plot(t, shown, color=colour, label=name, **_marks(t))
    axes.set_ylabel(f"lost ({unit.name})")
    if len(never) == len(all_of_them):
        _nothing(axes, "nothing lost")
        return
    top = max(float(v.max()) for v in all_of_them.values()) / unit.size
    least = min(float(v[v > 0.0].min()) for v in all_of_them.values() if v.any()) / unit.size
    axes.set_yscale("log")
    axes.set_ylim(max(least / 2.0, top * 10.0**-DECADES), top * 2.5)
    _few_decades(axes)
    legend_above(axes, 5)
    if never:
        text = f"none in {', '.join(never)}"
        axes.text(0.99, 0.05, text, transform=axes.transAxes, ha="right", size=6.5, color=FAINT)


def draw_balance(axes: Axes, ledger: Any, time: Unit, unit: Unit) -> None:
    """The total, losses included, minus its start: a flat line if the books balance."""
    t = ledger["time"] / time.size
    change = (ledger["total"] - ledger["total"][0]) / unit.size
    kinetic = np.sum([ledger[name] for name in KINETIC], axis=0)
    turned_over = (ledger.dissipated + float(kinetic.max())) / unit.size
    axes.axhline(0.0, color=FAINT, linewidth=0.5, zorder=0)
    axes.plot(t, change, color=INK, linewidth=1.0, **_marks(t))
    half = max(1.3 * float(np.abs(change).max()), FLAT * turned_over)
    axes.set_ylim(-half, half) if half > 0.0 else axes.set_ylim(-1.0, 1.0)
    axes.yaxis.set_major_locator(MaxNLocator(3, symmetric=True))
    axes.set_ylabel("Δ total")
    text = f"total − start: drift {ledger.drift:.1e} of the energy turned over"
    axes.text(1.0, 1.03, text, transform=axes.transAxes, ha="right", va="bottom", size=7)


def draw_time(panels: list[Axes], time: Unit, ledger: Any) -> None:
    """The common axis of time, with numbers under the lowest panel only."""
    first, last = ledger["time"][0] / time.size, ledger["time"][-1] / time.size
    margin = 0.0 if last > first else 0.5
    for axes in panels:
        axes.set_xlim(first - margin, last + margin)
        axes.tick_params(labelbottom=axes is panels[-1])
        axes.xaxis.set_major_locator(MaxNLocator(6))
    panels[-1].set_xlabel(f"time ({time.name})")


def _marks(t: np.ndarray) -> dict[str, Any]:
    """A line shows nothing of a single row."""
    return {"marker": "o", "markersize": 3.5} if t.size < 3 else {}


def _nothing(axes: Axes, text: str) -> None:
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", size=7, color=FAINT)
    axes.set_yticks([])


def _scale(axes: Axes, curves: list[np.ndarray]) -> None:
    """Linear if one glance holds all curves, otherwise logarithmic on both sides of zero."""
    peaks = [float(np.abs(values).max()) for values in curves]
    top = max(peaks)
    if min(peaks) > top / 30.0:
        axes.margins(y=0.08)
        axes.yaxis.set_major_locator(MaxNLocator(5))
        return
    # Below the smallest peak, or ever so far below the largest, the axis is linear.
    linear = 10.0 ** np.floor(np.log10(max(min(peaks), top * 10.0**-DECADES)))
    axes.set_yscale("symlog", linthresh=linear, linscale=0.6)
    high, low = max(float(v.max()) for v in curves), min(float(v.min()) for v in curves)
    axes.set_ylim(min(2.5 * low, -0.3 * linear), max(2.5 * high, 0.3 * linear))
    locator = SymmetricalLogLocator(base=10.0, linthresh=linear)
    locator.set_params(numticks=6)
    axes.yaxis.set_major_locator(locator)


def _few_decades(axes: Axes) -> None:
    axes.yaxis.set_major_locator(LogLocator(numticks=5))
    axes.yaxis.set_minor_formatter(NullFormatter())
