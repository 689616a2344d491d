"""Time series for the plots of the viewer page, thinned, in SI, and ranges of quantities for its colour scales."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..analysis.clusters import cluster_labels, cluster_sizes, mean_cluster_size
from ..analysis.ledger_columns import AWAKE, LedgerColumns
from ..analysis.quantities import measured
from ..basics.errors import BadInput
from ..io.ledger_table import TEMPERATURES
from ..io.run_folder import plain
from ..plotting.panels import (
    CHANNEL_LABELS,
    CLUSTERS,
    COUNTS,
    TEMPERATURE_LINES,
    column,
    energies_drawn,
    has_temperatures,
    linear_below,
    log_bottom,
    loss_text,
    losses,
    losses_drawn,
    peak,
)
from ..plotting.style import BLUE, ON_DARK, RED, SKY, TEXT_COLOUR

MAX_POINTS = 2000
"""Maximum number of points of a line."""
MAX_COUNTED = 20_000_000
"""Grains × frames whose clusters are counted if there is no ledger."""
SAMPLED_FRAMES = 12
"""Number of frames, spread evenly over the run, from which ranges are computed."""
PERCENTILES = ("speed", "spin", "kinetic_energy", "pressure", "load")
"""Quantities whose range leaves out outliers: PERCENTILE_LIMITS of all values that are not 0."""
EXTREMES = ("size", "radius", "coordination", "moment")
"""Quantities whose range goes from the smallest to the largest value; of `moment`, the magnitude."""
PERCENTILE_LIMITS = (2.0, 98.0)
"""A touch gives some contacts and grains a hundred times the usual load."""


def evenly_spaced(count: int, most: int = MAX_POINTS) -> np.ndarray:
    """At most `most` indices below `count`, evenly spaced, including the first and the last."""
    if count <= most:
        return np.arange(count)
    return np.rint(np.linspace(0, count - 1, most)).astype(int)


def series_from_ledger(ledger: LedgerColumns) -> dict[str, Any]:
    """Plots and contact events from a ledger; a plot whose columns are missing is left out."""
    thinned = ledger.select(evenly_spaced(len(ledger)))
    plots = []
    for plot in (_clusters, _energies, _losses, _contacts, _balance, _temperatures, _awake, _pressures):
        try:
            plots.append(plot(thinned))
        except (KeyError, ValueError):  # a ledger of another version
            continue
    time = _json_numbers(thinned["time"], 10)
    return {"time": time, "plots": [p for p in plots if p["lines"]], "events": _events(ledger)}


def series_from_frames(frames: Any, grains: int) -> dict[str, Any]:
    """Numbers of clusters and contacts from frames of `grains` grains, for runs without a ledger.

    The number of frames is limited by MAX_COUNTED. Damaged frames have no cluster numbers.
    """
    chosen = evenly_spaced(len(frames), max(min(MAX_POINTS, MAX_COUNTED // max(grains, 1)), 2))
    table: dict[str, list[float]] = {"mean_cluster_size": [], "largest_cluster": [], "clusters": []}
    for number in chosen:
        try:
            labels = cluster_labels(grains, frames.pairs(int(number)))
        except (BadInput, ValueError):  # damaged, or another number of grains
            for values in table.values():
                values.append(np.nan)
            continue
        table["mean_cluster_size"].append(mean_cluster_size(labels))
        table["largest_cluster"].append(float(cluster_sizes(labels).max()))
        table["clusters"].append(float(labels.max() + 1))
    lines = [_line(*COUNTS["contacts"], frames.contacts[chosen].astype(float))]
    plots = [
        _clusters({name: np.array(values) for name, values in table.items()}),
        _plot("contacts", "Contacts", lines),
    ]
    events: dict[str, list[float]] = {"time": [], "made": [], "broken": []}
    return {"time": _json_numbers(frames.times[chosen], 10), "plots": plots, "events": events}


def _clusters(ledger: Any) -> dict[str, Any]:
    lines = [_line(label, colour, ledger[name]) for name, (label, colour, _) in CLUSTERS.items()]
    return _plot("clusters", "Clusters", lines, axis="log")


def _awake(ledger: LedgerColumns) -> dict[str, Any]:
    label = "grains of awake clusters (contact steps)"
    return _plot("awake", "Awake grains", [_line(label, RED, column(ledger, AWAKE))])


def _temperatures(ledger: LedgerColumns) -> dict[str, Any]:
    drawn = zip(TEMPERATURES, TEMPERATURE_LINES, strict=True) if has_temperatures(ledger) else ()
    lines = [_line(label, colour, column(ledger, name)) for name, (label, colour) in drawn]
    return _plot("temperatures", "Temperatures", lines, "K", "log")


def _pressures(ledger: LedgerColumns) -> dict[str, Any]:
    """Of runs with `stress`."""
    named = {"pressure": TEXT_COLOUR, "pressure_xx": BLUE, "pressure_yy": SKY, "pressure_zz": RED}
    lines = [_line(name.replace("_", " "), colour, ledger[name]) for name, colour in named.items()]
    return _plot("pressure", "Pressure", lines, "Pa", "symlog")


def _energies(ledger: LedgerColumns) -> dict[str, Any]:
    lines = [_line(name, colour, values) for name, (values, colour) in energies_drawn(ledger).items()]
    return _plot("energies", "Energies", lines, "J", "symlog")


def _losses(ledger: LedgerColumns) -> dict[str, Any]:
    signed = losses(ledger)  # the page draws magnitudes, and tells losses from gains
    lines = [
        _line(CHANNEL_LABELS.get(name, name), colour, np.copysign(size, signed[name]), loss_text(name))
        for name, (size, colour) in losses_drawn(ledger).items()
        if peak(size)
    ]
    return _plot("losses", "Losses", lines, "J", "log")


def _contacts(ledger: LedgerColumns) -> dict[str, Any]:
    lines = [_line(label, colour, ledger[name]) for name, (label, colour) in COUNTS.items()]
    return _plot("contacts", "Contacts", lines)


def _balance(ledger: LedgerColumns) -> dict[str, Any]:
    total = column(ledger, "total")
    return _plot("balance", "Balance", [_line("change of the total energy", TEXT_COLOUR, total - total[0])], "J")


def _events(ledger: LedgerColumns) -> dict[str, Any]:
    """Times of rows in which contacts formed or broke, and their numbers since the row before."""
    if not {"made", "broken"} <= set(ledger.columns):
        return {"time": [], "made": [], "broken": []}

    for rows in (ledger, ledger.select(evenly_spaced(len(ledger)))):
        made, broken = (np.maximum(np.diff(rows[name]), 0.0) for name in ("made", "broken"))
        events = np.flatnonzero((made > 0.0) | (broken > 0.0))
        if len(events) <= MAX_POINTS:
            break
    return {
        "time": _json_numbers(rows["time"][1:][events], 10),
        "made": made[events].astype(int).tolist(),
        "broken": broken[events].astype(int).tolist(),
    }


def _plot(key: str, title: str, lines: list[dict[str, Any]], unit: str = "", axis: str = "linear") -> dict[str, Any]:
    """A plot; `axis` is "linear", "log" (of magnitudes), or "symlog" if `linear_below` says so, as in figures."""
    drawn = [np.abs(np.array(line["values"], float)) for line in lines]
    least = {"log": log_bottom, "symlog": linear_below}[axis](drawn) if axis != "linear" else None
    scale = {"axis": "linear" if least is None else axis, "least": least}
    return {"id": key, "title": title, "unit": unit, **scale, "lines": lines}


def _line(label: str, colour: str, values: np.ndarray, hint: str = "") -> dict[str, Any]:
    return {"label": label, "hint": hint, "light": colour, "dark": ON_DARK[colour], "values": _json_numbers(values)}


def _json_numbers(values: np.ndarray, digits: int = 7) -> list[float | None]:
    """Numbers for JSON, rounded to `digits` significant digits; None for NaN and infinity."""
    return list(plain([float(f"{value:.{digits}g}") for value in np.asarray(values, float).tolist()]))


def quantity_ranges(frames: Any) -> dict[str, list[float]]:
    """Ranges [low, high] of the magnitudes of all quantities in PERCENTILES and EXTREMES, and of own quantities, SI.

    Parameters
    ----------
    frames : LiveTrajectory or Snapshot
        Frames of a run, of which SAMPLED_FRAMES are read; damaged frames are skipped.
    """
    samples: dict[str, list[np.ndarray]] = {name: [] for name in (*PERCENTILES, *EXTREMES)}
    for number in evenly_spaced(len(frames), SAMPLED_FRAMES):
        try:
            frame = frames[int(number)]
        except BadInput:
            continue
        for name in (*PERCENTILES, *EXTREMES, *frame.own):
            samples.setdefault(name, []).append(_magnitudes(frame, name))
    return {name: _range(np.concatenate([*parts, np.zeros(0)]), name) for name, parts in samples.items()}


def _magnitudes(frame: Any, name: str) -> np.ndarray:
    """Finite magnitudes of a quantity in a frame; empty if the frame does not have it."""
    try:
        values = np.linalg.norm(frame.moment, axis=1) if name == "moment" else measured(frame, name)
    except BadInput:
        return np.zeros(0)
    found = np.asarray(values[np.isfinite(values)], dtype=np.float64)
    return found if name in frame.own else np.abs(found)


def _range(values: np.ndarray, name: str) -> list[float]:
    low, high = PERCENTILE_LIMITS if name in PERCENTILES else (0.0, 100.0)
    values = values[values != 0.0] if name in PERCENTILES else values  # grains without contacts have no pressure
    if not values.size:
        return [0.0, 0.0]
    return [float(np.percentile(values, low, method="lower")), float(np.percentile(values, high, method="higher"))]
