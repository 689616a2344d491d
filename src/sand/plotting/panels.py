"""What happened over time: clusters, energies, losses, and whether the books balance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, SymmetricalLogLocator

from ..analysis.ledger_columns import LOSSES
from ..constants import BOLTZMANN
from ..state.state import LOST
from .style import (
    BLUE,
    GREEN,
    MUTED,
    ORANGE,
    PURPLE,
    RED,
    SKY,
    TEXT_COLOUR,
    YELLOW,
    format_number,
    legend_above,
    si_prefix,
)

KINETIC = ("translation", "rotation")
ELASTIC = ("normal", "sliding", "rolling", "twisting")
LOSS_COLOURS = (RED, SKY, BLUE, GREEN, PURPLE, ORANGE, YELLOW, TEXT_COLOUR, MUTED)
EXTERNAL_COLOURS = (ORANGE, PURPLE, SKY, YELLOW)
ENERGY_COLOURS = {"kinetic": BLUE, "contacts": RED, "magnetic": GREEN}
COUNTS = {"contacts": ("contacts", BLUE), "made": ("made so far", GREEN), "broken": ("broken so far", RED)}
"""Of contacts: columns, what they are called, colours."""

DECADES = 6
"""Shown of a quantity that spans many."""
FLAT = 1e-3
"""The balance is shown at least within this share of the energy turned over."""


@dataclass(frozen=True)
class Unit:
    """What an axis counts in: `size` in SI units, `name` for its label."""

    size: float
    name: str


def column(ledger: Any, *names: str) -> np.ndarray:
    """The sum of columns over time; not a number where a run that failed left one that is not finite."""
    total = np.sum([ledger[name] for name in names], axis=0, dtype=np.float64)
    return np.where(np.isfinite(total), total, np.nan)


def peak(values: np.ndarray) -> float:
    """The largest size among finite values; 0 if there is none."""
    return float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))


def time_unit(ledger: Any) -> Unit:
    """Seconds with the prefix that suits the length of the run."""
    return Unit(*si_prefix(peak(ledger["time"]), "s"))


def energy_unit(ledger: Any, temperature: float, grains: int) -> Unit:
    """N k_B T of the start, or joules with a prefix where the grains were at rest."""
    if temperature > 0.0:
        name = r"$N k_\mathrm{B}T_0$" if grains > 1 else r"$k_\mathrm{B}T_0$"
        return Unit(grains * BOLTZMANN * temperature, name)
    return Unit(*si_prefix(max(map(peak, (*energies(ledger).values(), *losses(ledger).values()))), "J"))


def energies(ledger: Any) -> dict[str, np.ndarray]:
    """Energies over time [J] as they are drawn: kinetic, of all contacts, magnetic, of each outside force."""
    columns = list(ledger.columns)
    outside = columns[columns.index("magnetic") + 1 : columns.index(LOSSES[0])]
    drawn = {"kinetic": KINETIC, "contacts": ELASTIC, "magnetic": ("magnetic",)}
    return {name: column(ledger, *parts) for name, parts in (drawn | {k: (k,) for k in outside}).items()}


def losses(ledger: Any) -> dict[str, np.ndarray]:
    """Energy lost so far by channel [J]."""
    return {name: column(ledger, f"lost_{name}") for name in LOST}


def energies_drawn(ledger: Any) -> dict[str, tuple[np.ndarray, str]]:
    """Energies [J] that ever differ from zero, and their colours."""
    drawn = {name: values for name, values in energies(ledger).items() if peak(values)}
    outside = [name for name in drawn if name not in ENERGY_COLOURS]
    colour = ENERGY_COLOURS | {name: EXTERNAL_COLOURS[k % len(EXTERNAL_COLOURS)] for k, name in enumerate(outside)}
    return {name: (values, colour[name]) for name, values in drawn.items()}


def losses_drawn(ledger: Any) -> dict[str, tuple[np.ndarray, str]]:
    """Sizes of all losses [J] for an axis of powers of ten, NaN for 0, and their colours.

    What following stiffnesses, a gas and outside forces take may be negative; its size is drawn.
    """
    sizes = {name: np.abs(values) for name, values in losses(ledger).items()}
    colour = dict(zip(LOST, LOSS_COLOURS, strict=True))
    return {name: (np.where(size > 0.0, size, np.nan), colour[name]) for name, size in sizes.items()}


def draw_clusters(axes: Axes, ledger: Any, time: Unit) -> None:
    """S (Eq. 17), the largest cluster and the number of clusters; all are numbers from 1 to N."""
    t = ledger["time"] / time.size
    style = _marks(t)
    axes.plot(t, ledger["clusters"], color=MUTED, linewidth=1.0, label="number of clusters", **style)
    axes.plot(t, ledger["largest_cluster"], color=SKY, label="largest (grains)", **style)
    axes.plot(t, ledger["mean_cluster_size"], color=BLUE, linewidth=1.9, label="mean size $S$ (grains)", **style)
    top = max(float(ledger[name].max()) for name in ("clusters", "largest_cluster", "mean_cluster_size"))
    axes.set_yscale("log")
    axes.set_ylim(0.85, max(1.25 * top, 4.0))
    _log_ticks(axes, plain=True)
    axes.set_ylabel("number")
    legend_above(axes)


def draw_energies(axes: Axes, ledger: Any, time: Unit, unit: Unit) -> None:
    """Energies; those that never differ from zero are left out."""
    t = ledger["time"] / time.size
    drawn = {name: (values / unit.size, colour) for name, (values, colour) in energies_drawn(ledger).items()}
    crowded = len(set(drawn) - set(ENERGY_COLOURS)) > 1
    longer = {} if crowded else {"contacts": "contacts (elastic, adhesion)"}
    axes.axhline(0.0, color=MUTED, linewidth=0.5, zorder=0)
    for name, (values, colour) in drawn.items():
        axes.plot(t, values, color=colour, label=longer.get(name, name), **_marks(t))
    if drawn:
        _scale(axes, [values for values, _ in drawn.values()])
        legend_above(axes)
    else:
        _nothing(axes, "no energy at any time")
    axes.set_ylabel(f"energy ({unit.name})")


def draw_losses(axes: Axes, ledger: Any, time: Unit, unit: Unit) -> None:
    """Losses by channel; channels too small for the frame, or without any loss, are named only."""
    t = ledger["time"] / time.size
    channels = {name: (size / unit.size, colour) for name, (size, colour) in losses_drawn(ledger).items()}
    axes.set_ylabel(f"lost ({unit.name})")
    top = max(peak(size) for size, _ in channels.values())
    if top == 0.0:
        _nothing(axes, "nothing lost")
        return
    drawn = {name: v for name, v in channels.items() if peak(v[0]) > top * 10.0**-DECADES}
    for name, (size, colour) in drawn.items():
        axes.plot(t, size, color=colour, label=name, **_marks(t))
    least = min(float(np.nanmin(size)) for size, _ in drawn.values())
    axes.set_yscale("log")
    axes.set_ylim(max(least / 2.0, top * 10.0**-DECADES), top * 2.5)
    _log_ticks(axes)
    legend_above(axes)
    options = ("damping", "stiffness", "gas", "outside")  # off by default: not worth a word
    none = ", ".join(name for name, (size, _) in channels.items() if not peak(size) and name not in options)
    tiny = ", ".join(name for name, (size, _) in channels.items() if name not in drawn and peak(size))
    note = "; ".join(f"{what}: {which}" for what, which in (("none", none), ("tiny", tiny)) if which)
    axes.text(0.995, 0.03, note, transform=axes.transAxes, ha="right", va="bottom", size=7, color=MUTED)


def draw_contacts(axes: Axes, ledger: Any, time: Unit) -> None:
    """Contacts of the moment, and how many were made and broken since the start."""
    t = ledger["time"] / time.size
    style = _marks(t)
    for name, (label, colour) in COUNTS.items():
        axes.plot(t, ledger[name], color=colour, label=label, linewidth=1.9 if name == "contacts" else 1.2, **style)
    axes.set_ylim(0.0, max(1.08 * max(float(ledger[name].max()) for name in COUNTS), 4.0))
    axes.yaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.set_ylabel("number")
    legend_above(axes)


def draw_balance(axes: Axes, ledger: Any, time: Unit, unit: Unit) -> None:
    """The total, losses included, minus its start: a flat line if the books balance."""
    t = ledger["time"] / time.size
    total = column(ledger, "total")
    change = (total - total[0]) / unit.size
    turned_over = (sum(map(peak, losses(ledger).values())) + peak(column(ledger, *KINETIC))) / unit.size
    axes.axhline(0.0, color=MUTED, linewidth=0.5, zorder=0)
    axes.plot(t, change, color=TEXT_COLOUR, linewidth=1.0, **_marks(t))
    half = max(1.3 * peak(change), FLAT * turned_over) or 1.0
    axes.set_ylim(-half, half)
    axes.yaxis.set_major_locator(MaxNLocator(3, symmetric=True))
    axes.yaxis.set_major_formatter(FuncFormatter(_short))
    axes.set_ylabel(f"Δ ({unit.name})")
    drift = f"drift {format_number(ledger.drift)} of the energy turned over"
    text = f"total − start: {drift if np.isfinite(ledger.drift) else 'not a number at the end'}"
    axes.text(1.0, 1.03, text, transform=axes.transAxes, ha="right", va="bottom", size=7.5)


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
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", size=7, color=MUTED)
    axes.set_yticks([])


def _scale(axes: Axes, curves: list[np.ndarray]) -> None:
    """Linear if one glance holds all curves, otherwise logarithmic on both sides of zero."""
    peaks = [peak(values) for values in curves]
    top = max(peaks)
    if min(peaks) > top / 30.0:
        axes.margins(y=0.08)
        axes.yaxis.set_major_locator(MaxNLocator(5))
        axes.yaxis.set_major_formatter(FuncFormatter(_short))
        return
    # Below the smallest peak, or ever so far below the largest, the axis is linear.
    linear = 10.0 ** np.floor(np.log10(max(min(peaks), top * 10.0**-DECADES)))
    high = max(2.5 * max(peak(np.maximum(values, 0.0)) for values in curves), 0.3 * linear)
    low = max(2.5 * max(peak(np.minimum(values, 0.0)) for values in curves), 0.3 * linear)
    decades = sum(np.log10(max(side / linear, 1.0)) for side in (high, low))
    axes.set_yscale("symlog", linthresh=linear, linscale=max(0.6, 0.12 * decades))
    axes.set_ylim(-low, high)
    locator = SymmetricalLogLocator(base=10.0, linthresh=linear)
    locator.set_params(numticks=6)
    axes.yaxis.set_major_locator(locator)


def _log_ticks(axes: Axes, plain: bool = False) -> None:
    """Powers of ten; 1, 2 and 5 where there are few; `plain` writes 1000 and not 10³."""
    low, high = axes.get_ylim()
    few = high < 250.0 * low
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)) if few else LogLocator(numticks=5))
    if plain or few:
        axes.yaxis.set_major_formatter(FuncFormatter(_short))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _short(value: float, _: int) -> str:
    return f"{value:.4g}".replace("-", "−") if value == 0.0 or 1e-3 <= abs(value) < 1e5 else f"{value:.1e}"
