"""The books: every joule of a run."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..analysis.clusters import cluster_labels, cluster_sizes, mean_cluster_size
from ..analysis.ledger_columns import LOSSES, LedgerColumns, dissipated_in
from ..constants import BOLTZMANN
from ..contact.measure import ENERGIES, measure_energies
from ..errors import BadInput
from ..grains import Grains
from ..state.state import BROKEN, CONTACTS, MADE, SLIPPED, State

MAGNETIC = "magnetic"
"""A column that every ledger has, with dipoles or without."""
RUNAWAY = 0.5
"""Change of the total over all energies of the moment and all dissipated, at which a run is stopped."""
MOMENTA = tuple(f"{kind}_{axis}" for kind in ("momentum", "angular_momentum") for axis in "xyz")
NUMBERS = ("contacts", "made", "moved", "broken", "clusters", "mean_cluster_size", "largest_cluster")
WHOLE = {"step", *NUMBERS} - {"mean_cluster_size"}
"""Columns of whole numbers."""


def log_row(state: State, rules: Any, forces: dict[str, float]) -> dict[str, float]:
    """One row of the ledger: all energies [J], losses [J], momenta (SI), numbers of contacts and clusters.

    Parameters
    ----------
    rules
        of the run, as the driver takes them.
    forces : dict[str, float]
        energy [J] of each long-range and per-grain force by column.
    """
    energies = np.empty(len(ENERGIES))
    grains = state.grains.arrays
    measure_energies(grains, state.contacts, state.count, state.box.span, rules.contact.follow, energies)
    contacts = int(state.count[CONTACTS])
    labels = cluster_labels(len(state.grains), state.contacts.pair[:, :contacts].T)
    row: dict[str, float] = {"step": state.steps, "time": state.time}
    row |= dict(zip(ENERGIES, energies.tolist(), strict=True)) | {MAGNETIC: 0.0} | forces
    row |= dict(zip(LOSSES, state.lost.tolist(), strict=True))
    row["total"] = math.fsum([*energies.tolist(), *forces.values(), *state.lost.tolist()])
    row |= dict(zip(MOMENTA, momenta(state.grains), strict=True))
    row |= {
        "contacts": contacts,
        "made": int(state.count[MADE]),
        "moved": int(state.count[SLIPPED]),
        "broken": int(state.count[BROKEN]),
        "clusters": int(labels.max()) + 1,
        "mean_cluster_size": mean_cluster_size(labels),
        "largest_cluster": int(cluster_sizes(labels).max()),
    }
    return row


def kinetic_energies(grains: Grains) -> np.ndarray:
    """½mv² + ½Iω² of each grain (N,) [J]."""
    moving = grains.mass * (grains.velocity**2).sum(axis=1)
    return 0.5 * (moving + grains.inertia * (grains.spin**2).sum(axis=1))


def momenta(grains: Grains) -> list[float]:
    """Momentum [kg m/s] and angular momentum about the origin [J s], spin included: six numbers."""
    p = grains.mass[:, None] * grains.velocity
    angular = np.cross(grains.position, p) + grains.inertia[:, None] * grains.spin
    return [*p.sum(axis=0).tolist(), *angular.sum(axis=0).tolist()]


class Ledger(LedgerColumns):
    """The rows written so far, oldest first.

    Parameters
    ----------
    forces : Sequence[str], optional
        columns of the long-range and per-grain forces, one energy each.
    """

    def __init__(self, forces: Sequence[str] = ()):
        others = [name for name in forces if name != MAGNETIC]
        super().__init__(("step", "time", *ENERGIES, MAGNETIC, *others, *LOSSES, "total", *MOMENTA, *NUMBERS))

    def add(self, row: dict[str, float]) -> bool:
        """Append a row; False if this step is in the books already."""
        if self.rows and row["step"] <= self.rows[-1]["step"]:
            return False
        self.rows.append(row)
        return True

    def with_row(self, row: dict[str, float]) -> Ledger:
        """The ledger with one more row; the rows themselves if this step is the last one logged.

        Used for the summary of an interrupted run: the ledger of the run itself must not depend on interruptions.
        """
        more = copy.copy(self)
        more.rows = list(self.rows)
        more.add(row)
        return more

    def to_array(self) -> np.ndarray:
        """All rows (K, columns), for a checkpoint; whole numbers below 2⁵³ are exact in it."""
        return np.array([[row[name] for name in self.columns] for row in self.rows], dtype=np.float64)

    def from_array(self, table: np.ndarray, columns: Sequence[str]) -> None:
        """Take over the rows of `to_array`, whose columns had these names.  Raises BadInput if they are others."""
        if table.ndim != 2 or table.shape[1] != len(columns) or set(columns) != set(self.columns):
            raise BadInput(
                f"the ledger in the checkpoint has columns {', '.join(columns)}, not {', '.join(self.columns)}"
            )
        kinds = [int if name in WHOLE else float for name in columns]
        self.columns = tuple(columns)
        self.rows = [
            {name: kind(v) for name, kind, v in zip(columns, kinds, row, strict=True)} for row in table.tolist()
        ]

    def runs_away(self, row: dict[str, float]) -> bool:
        """True if more than half of all energy that this row has, or dissipated, came from nowhere.

        It looks at this row and the first alone, so that it does not depend on how often rows are written.
        """
        if not self.rows:
            return False
        held = {"total", "step", "time", *LOSSES, *MOMENTA, *NUMBERS}
        there = math.fsum(abs(row[name]) for name in self.columns if name not in held)
        change = abs(row["total"] - self.rows[0]["total"])
        # written so that what is not a number runs away, too
        return not change <= RUNAWAY * (there + dissipated_in(row))

    def drift_per_kT(self, temperature: float, grains: int) -> float:
        """The same change over N k_B T; not a number for T = 0."""
        return self._change() / (grains * BOLTZMANN * temperature) if temperature > 0.0 else math.nan
