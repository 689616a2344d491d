"""Rows of the table of a packing that is loaded, and which cluster percolates in them; see `laboratory`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.clusters import cluster_labels, percolation_axes
from ..analysis.ledger_columns import ALWAYS_LOST, DAMPED
from ..basics.box import Box
from ..io.trajectory import Frames
from ..simulation.observers import Observer

Plan = Any
"""`laboratory.Plan`, whose module imports this one."""
CHANNELS = ("rolling", "sliding", "twisting")
"""Losses whose share of what is dissipated the table states, as `share_rolling`, …"""


class Percolation(Observer):
    """Finds in each row which cluster percolates, and along which axes."""

    def __init__(self) -> None:
        self.found: dict[float, dict[str, Any]] = {}

    def see(self, simulation: Any, row: dict[str, float]) -> None:
        """Look at the contacts of a new row."""
        state = simulation.state
        self.found[row["time"]] = percolating(simulation.grains.position, simulation.contacts["pair"], state.box)

    def see_frames(self, path: Path, rows: Sequence[dict[str, float]]) -> None:
        """Look at the frames of rows before a run was resumed."""
        if any(row["time"] not in self.found for row in rows):
            for frame in Frames(path):
                self.found.setdefault(frame.time, percolating(frame.position, frame.pair, frame.box))


def percolating(position: np.ndarray, pairs: np.ndarray, box: Box) -> dict[str, Any]:
    """Number of clusters that percolate; of the largest one the lowest grain (−1: none), size, and axes as 0 or 1."""
    axes, labels = percolation_axes(position, pairs, box), cluster_labels(len(position), np.asarray(pairs))
    sizes = np.bincount(labels) * axes.any(axis=1)
    largest = int(sizes.argmax())
    along = axes[largest] if sizes[largest] else np.zeros(3, bool)
    return {
        "percolating": int(axes.any(axis=1).sum()),
        "percolating_grain": int(np.argmax(labels == largest)) if sizes[largest] else -1,
        "percolating_size": int(sizes[largest]),
        **{f"percolates_{name}": int(one) for name, one in zip("xyz", along, strict=True)},
    }


def shares(before: dict[str, float] | None, row: dict[str, float]) -> dict[str, float]:
    """Share of each of `CHANNELS` in what was dissipated between two rows of the ledger; 0 if nothing was."""
    start = before or row
    lost = {name: row[name] - start[name] for name in (*ALWAYS_LOST, *DAMPED) if name in row}
    total = math.fsum(lost.values())
    return {f"share_{name}": lost[f"lost_{name}"] / total if total > 0.0 else 0.0 for name in CHANNELS}


def table_of(planned: Plan, rows: Sequence[dict[str, float]], seen: Percolation) -> list[dict[str, Any]]:
    """Rows of the table: those of the ledger between which ln φ or the strain changes by `Loading.every`.

    With a given load all rows of the ledger.
    """
    kept, table = rows[0], [planned.row(None, rows[0]) | seen.found.get(rows[0]["time"], {})]
    compressed, least = planned.loading.kind == "compress", planned.loading.every * (1.0 - 1e-3)
    for row in rows[1:]:
        new, last = planned.row(kept, row), table[-1]
        change = math.log(new["filling"] / last["filling"]) if compressed else abs(new["strain"] - last["strain"])
        if change >= least or row is rows[-1] or planned.loading.load_is_given:
            table.append(new | seen.found.get(row["time"], {}))
            kept = row
    return table
