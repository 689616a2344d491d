"""The books: every joule of a run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..analysis.clusters import cluster_labels, cluster_sizes, mean_cluster_size
from ..core.constants import BOLTZMANN
from ..core.grains import Grains
from ..core.world import BROKEN, CONTACTS, LOST, MADE, MOVED, World
from ..kernels.measure import ENERGIES, measure_energies

MAGNETIC = "magnetic"
"""A column that every ledger has, with dipoles or without."""
LOSSES = tuple(f"lost_{name}" for name in LOST)
RUNAWAY = 1.0
"""Change of the total over all energy so far at which a run is stopped."""
SOUND = 1e-3
"""Of the energies of the moment: what a sound run may have."""
MOMENTA = tuple(f"{kind}_{axis}" for kind in ("momentum", "angular_momentum") for axis in "xyz")
NUMBERS = ("contacts", "made", "moved", "broken", "clusters", "mean_cluster_size", "largest_cluster")


def take_stock(world: World, rules: Any, forces: dict[str, float]) -> dict[str, float]:
    """One row of the ledger: all energies [J], losses [J], momenta (SI), numbers of contacts and clusters.

    Args:
        rules: of the run, as the driver takes them.
        forces: energy [J] of each long-range and per-grain force by column.
    """
    energies = np.empty(len(ENERGIES))
    grains = world.grains.arrays
    measure_energies(grains, world.contacts, world.count, world.box.span, rules.contact.follow, energies)
    contacts = int(world.count[CONTACTS])
    labels = cluster_labels(len(world.grains), world.contacts.pair[:, :contacts].T)
    row: dict[str, float] = {"step": world.steps, "time": world.time}
    row |= dict(zip(ENERGIES, energies.tolist(), strict=True)) | {MAGNETIC: 0.0} | forces
    row |= dict(zip(LOSSES, world.lost.tolist(), strict=True))
    row["total"] = math.fsum([*energies.tolist(), *forces.values(), *world.lost.tolist()])
    row |= dict(zip(MOMENTA, momenta(world.grains), strict=True))
    row |= {
        "contacts": contacts,
        "made": int(world.count[MADE]),
        "moved": int(world.count[MOVED]),
        "broken": int(world.count[BROKEN]),
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


class Ledger:
    """The rows written so far, oldest first.

    Args:
        forces: columns of the long-range and per-grain forces, one energy each.
    """

    def __init__(self, forces: Sequence[str] = ()):
        others = [name for name in forces if name != MAGNETIC]
        self.columns = ("step", "time", *ENERGIES, MAGNETIC, *others, *LOSSES, "total", *MOMENTA, *NUMBERS)
        self.rows: list[dict[str, float]] = []

    def add(self, row: dict[str, float]) -> bool:
        """Append a row; False if this step is in the books already."""
        if self.rows and row["step"] <= self.rows[-1]["step"]:
            return False
        self.rows.append(row)
        return True

    def restore(self, rows: Iterable[dict[str, float]]) -> None:
        """Take over the rows of a checkpoint."""
        self.rows = list(rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, column: str) -> np.ndarray:
        """One column over time."""
        return np.array([row[column] for row in self.rows])

    def _change(self) -> float:
        return abs(self.rows[-1]["total"] - self.rows[0]["total"]) if self.rows else 0.0

    @property
    def dissipated(self) -> float:
        """Energy dissipated so far [J], forming included.

        What stiffnesses make or destroy and what the sources of outside forces give is not; a gas counts if it took
        more than it gave.
        """
        if not self.rows:
            return 0.0
        last = self.rows[-1]
        channels = [name for name in LOSSES if name not in ("lost_stiffness", "lost_gas", "lost_outside")]
        return math.fsum([*(last[name] for name in channels), max(last["lost_gas"], 0.0)])

    @property
    def drift(self) -> float:
        """|change of the total| / (energy dissipated, forming included, + largest kinetic energy of any row)."""
        largest = max((row["translation"] + row["rotation"] for row in self.rows), default=0.0)
        scale = self.dissipated + largest
        return self._change() / scale if scale > 0.0 else 0.0

    def runs_away(self, row: dict[str, float]) -> bool:
        """True if the total of this row is off by more than all energy that the books have had before it."""
        if not self.rows:
            return False
        held = {"total", "step", "time", *LOSSES, *MOMENTA, *NUMBERS}
        energies = [name for name in self.columns if name not in held]

        def size(one: dict[str, float]) -> float:
            return math.fsum(abs(one[name]) for name in energies)

        before = max(size(one) for one in self.rows[:: max(len(self.rows) // 8, 1)])
        change = abs(row["total"] - self.rows[0]["total"])
        # the last part is for runs that begin with no energy at all; what is not a number runs away, too
        return not change <= RUNAWAY * (before + self.dissipated) + SOUND * size(row)

    def drift_per_kT(self, temperature: float, grains: int) -> float:
        """The same change over N k_B T; not a number for T = 0."""
        return self._change() / (grains * BOLTZMANN * temperature) if temperature > 0.0 else math.nan
