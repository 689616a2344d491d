"""What happened over time, as the page of a run draws it: thinned, SI, colours for light and dark."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..analysis.clusters import cluster_labels, cluster_sizes, mean_cluster_size
from ..analysis.ledger_columns import LedgerColumns
from ..errors import BadInput
from ..io.run_folder import plain
from ..plotting.panels import COUNTS, column, energies_drawn, losses_drawn, peak
from ..plotting.style import BLUE, FAINT, INK, ON_DARK, SKY

MOST = 2000
"""Points of a line at most."""
LOOKED_AT = 20_000_000
"""Grains, all frames together, whose clusters are counted where there is no ledger."""


def thinned(count: int, most: int = MOST) -> np.ndarray:
    """Numbers of at most so many of `count` rows, evenly spread, first and last among them."""
    if count <= most:
        return np.arange(count)
    return np.rint(np.linspace(0, count - 1, most)).astype(int)


def of_ledger(whole: LedgerColumns) -> dict[str, Any]:
    """Plots and events of a ledger; a plot whose columns a ledger lacks is left out."""
    books = whole.select(thinned(len(whole)))
    plots = []
    for plot in (_clusters, _energies, _losses, _contacts, _balance):
        try:
            plots.append(plot(books))
        except (KeyError, ValueError):  # a ledger of other columns
            continue
    return {"time": _numbers(books["time"], 10), "plots": [p for p in plots if p["lines"]], "events": _events(whole)}


def of_frames(frames: Any, grains: int) -> dict[str, Any]:
    """The same where there are frames of so many grains alone: contacts, and clusters of as many as take little time.

    Frames that cannot be read have no clusters.
    """
    chosen = thinned(len(frames), max(min(MOST, LOOKED_AT // max(grains, 1)), 2))
    table: dict[str, list[float]] = {"mean_cluster_size": [], "largest_cluster": [], "clusters": []}
    for number in chosen:
        try:
            labels = cluster_labels(grains, frames.pairs(int(number)))
        except (BadInput, ValueError):  # not whole, or of other grains
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
    return {"time": _numbers(frames.times[chosen], 10), "plots": plots, "events": events}


def _clusters(books: Any) -> dict[str, Any]:
    lines = [
        _line("mean size S", BLUE, books["mean_cluster_size"]),
        _line("largest", SKY, books["largest_cluster"]),
        _line("number of clusters", FAINT, books["clusters"]),
    ]
    return _plot("clusters", "Clusters", lines, log=True)


def _energies(books: LedgerColumns) -> dict[str, Any]:
    lines = [_line(name, colour, values) for name, (values, colour) in energies_drawn(books).items()]
    return _plot("energies", "Energies", lines, "J")


def _losses(books: LedgerColumns) -> dict[str, Any]:
    lines = [_line(name, colour, size) for name, (size, colour) in losses_drawn(books).items() if peak(size)]
    return _plot("losses", "Losses", lines, "J", log=True)


def _contacts(books: LedgerColumns) -> dict[str, Any]:
    lines = [_line(label, colour, books[name]) for name, (label, colour) in COUNTS.items()]
    return _plot("contacts", "Contacts", lines)


def _balance(books: LedgerColumns) -> dict[str, Any]:
    total = column(books, "total")
    return _plot("balance", "Balance", [_line("total − start", INK, total - total[0])], "J")


def _events(books: LedgerColumns) -> dict[str, Any]:
    """When contacts were made or broken, and how many since the row before."""
    if not {"made", "broken"} <= set(books.columns):
        return {"time": [], "made": [], "broken": []}

    def grown(some: LedgerColumns) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        made, broken = (np.maximum(np.diff(some[name]), 0.0) for name in ("made", "broken"))
        return np.flatnonzero((made > 0.0) | (broken > 0.0)), made, broken

    rows, made, broken = grown(books)
    if len(rows) > MOST:
        books = books.select(thinned(len(books)))
        rows, made, broken = grown(books)
    return {
        "time": _numbers(books["time"][1:][rows], 10),
        "made": made[rows].astype(int).tolist(),
        "broken": broken[rows].astype(int).tolist(),
    }


def _plot(key: str, title: str, lines: list[dict[str, Any]], unit: str = "", log: bool = False) -> dict[str, Any]:
    return {"id": key, "title": title, "unit": unit, "log": log, "lines": lines}


def _line(label: str, colour: str, values: np.ndarray) -> dict[str, Any]:
    return {"label": label, "light": colour, "dark": ON_DARK[colour], "values": _numbers(values)}


def _numbers(values: np.ndarray, digits: int = 7) -> list[float | None]:
    """As JSON has them, with as many digits as can be seen."""
    return list(plain([float(f"{value:.{digits}g}") for value in np.asarray(values, float).tolist()]))
