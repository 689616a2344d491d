"""Panels over time: clusters, contacts, energies, losses, and the balance of the total energy."""

from __future__ import annotations

import textwrap
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, SymmetricalLogLocator

from ..analysis.ledger_columns import AWAKE, LOSS_TEXTS, LOSSES
from ..basics.constants import BOLTZMANN
from ..basics.state import DAMPING, LOST
from ..io.ledger_table import TEMPERATURES
from ..simulation.ledger import KINETIC
from .style import (
    BLUE,
    BROWN,
    GREEN,
    INDIGO,
    MUTED,
    ORANGE,
    PLUM,
    PURPLE,
    RED,
    SKY,
    TEXT_COLOUR,
    YELLOW,
    format_number,
    format_si,
    legend_above,
    points,
    si_prefix,
)

ELASTIC = ("normal", "sliding", "rolling", "twisting")
LOSS_CHANNELS = {name: (f"lost_{name}",) for name in LOST if name not in (*DAMPING, "quieting")} | {
    "settling": ("lost_settling", "lost_quieting"),
    "damping": tuple(f"lost_{name}" for name in DAMPING),
}
"""Ledger columns of each loss channel of the figures; damping of the four modes of a contact is drawn together, and so
is motion within clusters that is removed."""
LOSS_COLOURS = (RED, SKY, BLUE, GREEN, PURPLE, PLUM, BROWN, TEXT_COLOUR, MUTED, INDIGO, ORANGE)
EXTERNAL_COLOURS = (ORANGE, PURPLE, SKY, YELLOW)
ENERGY_COLOURS = {"kinetic": BLUE, "contacts": RED, "magnetic": GREEN}
CLUSTERS = {
    "clusters": ("clusters", MUTED, 1.0),
    "largest_cluster": ("largest size", SKY, 1.5),
    "mean_cluster_size": ("mean size S = Σs²/Σs", BLUE, 1.9),
}
"""Ledger columns of clusters, each of s grains, with label, colour and width of the line."""
COUNTS = {"contacts": ("contacts", BLUE), "made": ("formed so far", GREEN), "broken": ("broken so far", RED)}
"""Ledger columns of contact numbers, with label and colour."""
CHANNEL_LABELS = {
    "forming": "contact formation",
    "breaking": "contact breaking",
    "damping": "contact damping",
    "settling": "settling of clusters",
    "outside": "external",
    "cutoff_changed": "cut-off",
}
"""Labels of loss channels that differ from the name of the ledger column."""
OPTIONAL_CHANNELS = ("damping", "stiffness", "settling", "gas", "outside", "cutoff_changed")
"""Loss channels of forces and options that are off by default; not listed as zero in the figure."""

TEMPERATURE_LINES = (("translation of bodies", BLUE), ("rotation, mean", ORANGE), ("rotation, median", PURPLE))
"""Label and colour of each column of TEMPERATURES."""
PRESSURES = {"pressure": ("instant", MUTED)} | {
    f"mean_pressure_{axis}": (f"mean, {axis}", colour)
    for axis, colour in zip("xyz", (BLUE, ORANGE, GREEN), strict=True)
}
"""Label and colour of the columns of the pressure; of runs with stress."""
LEAST_BODIES = 10
"""Bodies at the start of a run from which its figure shows their temperatures."""

DECADES = 6
"""Decades shown of a quantity that spans many."""
NOTE_SHARE = 0.138
"""Height of a line of a note below the curves, relative to that of the panel."""
MIN_BALANCE_RANGE = 1e-3
"""Minimum half range of the balance axis, relative to all losses and the largest kinetic energy."""


WIDE_ENOUGH = 3.3
"""Width of a panel [inches] from which on the error of the energy is stated in full."""
FEW = 2
"""Bodies at the start up to which their motion is a flight, not a thermal motion, and energies are in units of it."""


class AxisUnit(NamedTuple):
    """Unit of an axis: its size in SI units, its name for the label, and its value in words, "" if the name says it."""

    size: float
    name: str
    value: str = ""


def column(ledger: Any, *names: str) -> np.ndarray:
    """Sum of ledger columns over time; values that are not finite, as after a failed run, become NaN."""
    total = np.sum([ledger[name] for name in names], axis=0, dtype=np.float64)
    return np.where(np.isfinite(total), total, np.nan)


def peak(values: np.ndarray) -> float:
    """Largest magnitude among the finite values; 0 if there is none."""
    return float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))


def time_unit(ledger: Any) -> AxisUnit:
    """Seconds, with the SI prefix that suits the length of the run."""
    return AxisUnit(*si_prefix(peak(ledger["time"]), "s"))


def has_few_bodies(ledger: Any) -> bool:
    """Whether there were one or two bodies at the start, as in a collision, so that their motion has no temperature."""
    return float(ledger["clusters"][0]) <= FEW


def energy_unit(ledger: Any, temperature: float, grains: int) -> AxisUnit:
    """N k_B T₀ with the initial temperature [K]; for one or two bodies their kinetic energy at the start, E₀.

    Joules with an SI prefix if the grains were initially at rest.
    """
    start = float(column(ledger, *KINETIC)[0])
    if has_few_bodies(ledger) and start > 0.0:
        return AxisUnit(start, "$E_0$", f"$E_0$ = {format_si(start, 'J')}, the kinetic energy at the start")
    if temperature > 0.0:
        name = r"$N k_\mathrm{B}T_0$" if grains > 1 else r"$k_\mathrm{B}T_0$"
        value = f"$T_0$ = {format_number(temperature)} K, the kinetic temperature at the start"
        return AxisUnit(grains * BOLTZMANN * temperature, name, value)
    return AxisUnit(*si_prefix(max(map(peak, (*energies(ledger).values(), *losses(ledger).values()))), "J"))


def energies(ledger: Any) -> dict[str, np.ndarray]:
    """Energies over time [J]: kinetic, elastic and adhesive (contacts), magnetic, and of each external force."""
    columns = list(ledger.columns)
    external = columns[columns.index("magnetic") + 1 : columns.index(LOSSES[0])]
    parts = {"kinetic": KINETIC, "contacts": ELASTIC, "magnetic": ("magnetic",)} | {name: (name,) for name in external}
    return {name: column(ledger, *names) for name, names in parts.items()}


def losses(ledger: Any) -> dict[str, np.ndarray]:
    """Cumulative energy loss of each channel [J]."""
    return {name: column(ledger, *names) for name, names in LOSS_CHANNELS.items()}


def energies_drawn(ledger: Any) -> dict[str, tuple[np.ndarray, str]]:
    """Energies [J] that are not always zero, with their colours."""
    drawn = {name: values for name, values in energies(ledger).items() if peak(values)}
    external = [name for name in drawn if name not in ENERGY_COLOURS]
    colour = ENERGY_COLOURS | {name: EXTERNAL_COLOURS[k % len(EXTERNAL_COLOURS)] for k, name in enumerate(external)}
    return {name: (values, colour[name]) for name, values in drawn.items()}


def loss_text(channel: str) -> str:
    """What a loss channel is, in words: the meanings of its ledger columns."""
    return "; ".join(dict.fromkeys(LOSS_TEXTS[name.removeprefix("lost_")] for name in LOSS_CHANNELS[channel]))


def losses_drawn(ledger: Any) -> dict[str, tuple[np.ndarray, str]]:
    """Magnitudes of all losses [J] for a logarithmic axis, NaN for 0, with their colours.

    The channels stiffness, gas and external may be negative; their magnitude is drawn.
    """
    sizes = {name: np.abs(values) for name, values in losses(ledger).items()}
    colour = dict(zip(LOSS_CHANNELS, LOSS_COLOURS, strict=True))
    return {name: (np.where(size > 0.0, size, np.nan), colour[name]) for name, size in sizes.items()}


def draw_clusters(axes: Axes, ledger: Any, time: AxisUnit) -> None:
    """Draw the mean cluster size S (Eq. 17), the grains of the largest cluster and the number of clusters.

    With rigid clusters also the number of grains of awake clusters, whose contacts are integrated, as an area.
    """
    t = ledger["time"] / time.size
    style = _markers(t)
    awake = column(ledger, AWAKE) if AWAKE in ledger.columns else np.zeros(0)
    for name, (label, colour, width) in CLUSTERS.items():
        axes.plot(t, ledger[name], color=colour, linewidth=width, label=label, **style)
    top = max(*(float(ledger[name].max()) for name in CLUSTERS), peak(awake))
    axes.set(yscale="log", ylim=(0.85, max(1.25 * top, 4.0)), ylabel="number")
    log_ticks(axes, plain=True)
    if awake.size:
        low = np.full(len(t), axes.get_ylim()[0])
        looks: dict[str, Any] = {"color": ORANGE, "alpha": 0.5, "linewidth": 0.0, "zorder": 0}
        axes.fill_between(t, low, np.maximum(awake, low), step="mid", label="awake grains (contact steps)", **looks)
    legend_above(axes)


def draw_energies(axes: Axes, ledger: Any, time: AxisUnit, unit: AxisUnit) -> None:
    """Draw all energies that are not always zero."""
    t = ledger["time"] / time.size
    drawn = {name: (values / unit.size, colour) for name, (values, colour) in energies_drawn(ledger).items()}
    has_space = len(set(drawn) - set(ENERGY_COLOURS)) <= 1
    labels = {"contacts": "contacts (elastic, adhesion)"} if has_space else {}
    axes.axhline(0.0, color=MUTED, linewidth=0.5, zorder=0)
    for name, (values, colour) in drawn.items():
        axes.plot(t, values, color=colour, label=labels.get(name, name), **_markers(t))
    if drawn:
        scale_values(axes, [values for values, _ in drawn.values()])
        legend_above(axes)
    else:
        _no_data(axes, "all energies are zero")
    axes.set_ylabel(f"energy ({unit.name})")


def has_temperatures(ledger: Any) -> bool:
    """Whether a ledger has the temperatures of bodies, of enough bodies for a mean, and not all at rest."""
    if not set(TEMPERATURES) <= set(ledger.columns) or not len(ledger) or ledger["clusters"][0] < LEAST_BODIES:
        return False
    return any(peak(column(ledger, name)) > 0.0 for name in TEMPERATURES)


def draw_temperatures(axes: Axes, ledger: Any, time: AxisUnit) -> None:
    """Draw the temperatures of translation and rotation of the bodies, clusters and single grains alike."""
    t = ledger["time"] / time.size
    known = set(TEMPERATURES) <= set(ledger.columns)
    drawn = [column(ledger, name) for name in TEMPERATURES] if known else []
    top = max(map(peak, drawn), default=0.0)
    axes.set_ylabel("$T$ (K)")
    if top == 0.0:
        _no_data(axes, "all bodies are at rest" if known else "an earlier version of SAND wrote this ledger")
        return
    for values, (label, colour) in zip(drawn, TEMPERATURE_LINES, strict=True):
        axes.plot(t, np.where(values > 0.0, values, np.nan), color=colour, label=label, **_markers(t))
    axes.set(yscale="log", ylim=(log_bottom(drawn), 1.3 * top))
    log_ticks(axes, plain=True)
    legend_above(axes)


def draw_pressure(axes: Axes, ledger: Any, time: AxisUnit) -> None:
    """Draw the pressure of the instant and, in a box that is deformed, its means along the axes that change."""
    t, names = ledger["time"] / time.size, [name for name in PRESSURES if name in ledger.columns]
    unit = AxisUnit(*si_prefix(max(peak(column(ledger, name)) for name in names), "Pa"))
    drawn = [column(ledger, name) / unit.size for name in names]
    axes.axhline(0.0, color=MUTED, linewidth=0.5, zorder=0)
    for name, values in zip(names, drawn, strict=True):
        label, colour = PRESSURES[name]
        axes.plot(t, values, color=colour, label=label, **_markers(t))
    if any(map(peak, drawn)):
        scale_values(axes, [values for values in drawn if peak(values)])
    axes.set_ylabel(f"$P$ ({unit.name})")
    legend_above(axes)


def draw_losses(axes: Axes, ledger: Any, time: AxisUnit, unit: AxisUnit) -> None:
    """Draw the losses by channel; channels that are zero or below the axis are listed in a note."""
    t = ledger["time"] / time.size
    channels = {name: (size / unit.size, colour) for name, (size, colour) in losses_drawn(ledger).items()}
    axes.set_ylabel(f"losses ({unit.name})")
    top = max(peak(size) for size, _ in channels.values())
    if top == 0.0:
        _no_data(axes, "no losses")
        return
    drawn = {name: v for name, v in channels.items() if peak(v[0]) > top * 10.0**-DECADES}
    for name, (size, colour) in drawn.items():
        axes.plot(t, size, color=colour, label=CHANNEL_LABELS.get(name, name), **_markers(t))
    axes.set(yscale="log", ylim=(log_bottom([size for size, _ in drawn.values()], 2.0), top * 2.5))
    zero = [name for name, (size, _) in channels.items() if not peak(size) and name not in OPTIONAL_CHANNELS]
    small = [name for name, (size, _) in channels.items() if name not in drawn and peak(size)]
    notes = [
        f"{text}: {', '.join(CHANNEL_LABELS.get(name, name) for name in names)}"
        for text, names in (("none", zero), ("negligible", small))
        if names
    ]
    if notes:  # below all curves
        low, high = axes.get_ylim()
        width = 72.0 * axes.get_window_extent().width / axes.figure.dpi
        lines = textwrap.wrap("; ".join(notes), int(width / points(3.8)))
        share = NOTE_SHARE * len(lines)
        axes.set_ylim(low * (low / high) ** (share / (1.0 - share)), high)
        look: dict[str, Any] = {"size": points(7.0), "color": MUTED, "ha": "right", "va": "bottom"}
        axes.text(0.995, 0.03, "\n".join(lines), transform=axes.transAxes, **look)
    log_ticks(axes)
    legend_above(axes)


def draw_contacts(axes: Axes, ledger: Any, time: AxisUnit) -> None:
    """Draw the number of contacts, and how many have formed and broken since the start."""
    t = ledger["time"] / time.size
    style = _markers(t)
    for name, (label, colour) in COUNTS.items():
        axes.plot(t, ledger[name], color=colour, label=label, linewidth=1.9 if name == "contacts" else 1.2, **style)
    axes.set(ylim=(0.0, max(1.08 * max(float(ledger[name].max()) for name in COUNTS), 4.0)), ylabel="number")
    axes.yaxis.set_major_locator(MaxNLocator(6, integer=True))
    legend_above(axes)


def draw_balance(axes: Axes, ledger: Any, time: AxisUnit, unit: AxisUnit) -> None:
    """Draw the change of the total energy, losses included, which is zero for exact integration."""
    t = ledger["time"] / time.size
    total = column(ledger, "total")
    change = (total - total[0]) / unit.size
    scale = (sum(map(peak, losses(ledger).values())) + peak(column(ledger, *KINETIC))) / unit.size
    axes.axhline(0.0, color=MUTED, linewidth=0.5, zorder=0)
    axes.plot(t, change, color=TEXT_COLOUR, linewidth=1.0, **_markers(t))
    half = max(1.3 * peak(change), MIN_BALANCE_RANGE * scale) or 1.0
    axes.set(ylim=(-half, half), ylabel=rf"$\Delta E$ ({unit.name})")
    axes.yaxis.set_major_locator(MaxNLocator(3, symmetric=True))
    axes.yaxis.set_major_formatter(_tick_label)
    of = " of the energy dissipated and kinetic"
    full = axes.get_window_extent().width > WIDE_ENOUGH * axes.figure.dpi
    drift = f"{format_number(ledger.drift)}{of if full else ''}"
    text = f"error of the total energy: {drift if np.isfinite(ledger.drift) else 'not finite at the end'}"
    axes.text(1.0, 1.03, text, transform=axes.transAxes, ha="right", va="bottom", size=points(7.5))


def draw_time(panels: list[Axes], time: AxisUnit, ledger: Any) -> None:
    """Set the common time axis, with tick labels below the lowest panel only."""
    first, last = ledger["time"][0] / time.size, ledger["time"][-1] / time.size
    margin = 0.0 if last > first else 0.5
    for axes in panels:
        axes.set_xlim(first - margin, last + margin)
        axes.tick_params(labelbottom=axes is panels[-1])
        axes.xaxis.set_major_locator(MaxNLocator(6))
    panels[-1].set_xlabel(f"time ({time.name})")


def _markers(t: np.ndarray) -> dict[str, Any]:
    """Markers for one or two rows, of which a line shows little or nothing."""
    return {"marker": "o", "markersize": 3.5} if t.size < 3 else {}


def _no_data(axes: Axes, text: str) -> None:
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", size=points(7.0), color=MUTED)
    axes.set_yticks([])


def linear_below(curves: list[np.ndarray]) -> float | None:
    """Magnitude below which a symmetric logarithmic axis of these curves is linear.

    A power of ten below the smallest peak, but at least below 10^-DECADES of the largest; None if the peaks of all
    curves but zeros are within a factor of 30, for which a linear axis does.
    """
    peaks = [size for size in map(peak, curves) if size] or [1.0]
    least, top = min(peaks), max(peaks)
    return None if least > top / 30.0 else float(10.0 ** np.floor(np.log10(max(least, top * 10.0**-DECADES))))


def log_bottom(curves: list[np.ndarray], margin: float = 1.3) -> float:
    """Lower end of a logarithmic axis, this factor below the smallest number above 0; at most DECADES are shown."""
    top = max(map(peak, curves), default=0.0)
    smallest = min((float(np.min(values, where=values > 0.0, initial=top)) for values in curves), default=top)
    return max(smallest / margin, top * 10.0**-DECADES)


def scale_values(axes: Axes, curves: list[np.ndarray]) -> None:
    """Scale the axis linearly or as symlog, see `linear_below`."""
    linear = linear_below(curves)
    if linear is None:
        axes.margins(y=0.08)
        axes.yaxis.set_major_locator(MaxNLocator(5))
        axes.yaxis.set_major_formatter(_tick_label)
        return
    high = max(2.5 * max(peak(np.maximum(values, 0.0)) for values in curves), 0.3 * linear)
    low = max(2.5 * max(peak(np.minimum(values, 0.0)) for values in curves), 0.3 * linear)
    decades = sum(np.log10(max(side / linear, 1.0)) for side in (high, low))
    axes.set_yscale("symlog", linthresh=linear, linscale=max(0.6, 0.12 * decades))
    axes.set_ylim(-low, high)
    locator = SymmetricalLogLocator(base=10.0, linthresh=linear)
    locator.set_params(numticks=6)
    axes.yaxis.set_major_locator(locator)


def log_ticks(axes: Axes, plain: bool = False) -> None:
    """Ticks at powers of ten, also at 2 and 5 on short axes; `plain` writes 1000 instead of 10³."""
    low, high = axes.get_ylim()
    short = high < 250.0 * low
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12) if short else LogLocator(numticks=5))
    if plain or short:
        axes.yaxis.set_major_formatter(_tick_label)
    axes.yaxis.set_minor_formatter(NullFormatter())


def _tick_label(value: float, _: float) -> str:
    return f"{value:.4g}".replace("-", "−") if value == 0.0 or 1e-3 <= abs(value) < 1e5 else f"{value:.1e}"
