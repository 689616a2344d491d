"""Columns of a ledger over time, of a run in progress or from a file, with dissipated energy and drift."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..basics.errors import NoSuchKey, did_you_mean, import_optional, shown
from ..basics.state import DAMPING, LOST

LOSSES = tuple(f"lost_{name}" for name in LOST)
LOSS_TEXTS = {name: f"dissipated by {name} beyond the limit" for name in ("sliding", "rolling", "twisting")} | {
    **dict.fromkeys(DAMPING, "dissipated by the dashpots of the four modes of contacts"),
    "forming": "dissipated when contacts formed",
    "breaking": "dissipated when contacts broke, including the energy stored in their springs",
    "stiffness": "removed from the springs by stiffnesses that follow the contact radius; may be negative",
    "settling": "removed from the motion of grains relative to the rigid motion of their cluster",
    "gas": "transferred to the gas by drag and random kicks; negative if the gas heats or drives the grains",
    "outside": "work done on the sources of external forces, if fields change or grains cross periodic boundaries, "
    "and of the user, by ramps, changes and driven grains; negative if the sources supplied energy",
    "cutoff_changed": "energy removed by longer cut-offs of dipoles",
    "quieting": "removed from vibrations of clusters that came to rest",
}
"""What each loss of LOST is: the beginnings of the descriptions in docs/reference/ledger.md."""
DAMPED = tuple(f"lost_{name}" for name in DAMPING)
ALWAYS_LOST = (
    *("lost_forming", "lost_breaking", "lost_sliding", "lost_rolling", "lost_twisting"),
    *("lost_settling", "lost_quieting"),
)
AWAKE = "awake"
"""Column of the number of grains of awake clusters; only with rigid clusters."""
ROUNDING = 4.0 * np.finfo(float).eps
"""Relative change of the total energy that is attributed to rounding. Bodies at rest of up to 64,000 grains change by
one unit in the last place."""


def dissipated_in(row: Mapping[str, float]) -> float:
    """Energy dissipated up to a row of the ledger [J], contact formation included.

    Work of stiffness changes and of external fields is excluded; the gas and the bath of damping count if they took
    more energy than they gave.
    """
    damped = math.fsum(row[name] for name in DAMPED)
    return math.fsum([*(row[name] for name in ALWAYS_LOST), max(damped, 0.0), max(row["lost_gas"], 0.0)])


class LedgerColumns:
    """Rows of a ledger, oldest first, with access to columns by name.

    Parameters
    ----------
    columns : sequence of str
        Names, in the order of the file.
    rows : iterable of dict, optional
        One number for every column each.
    """

    def __init__(self, columns: Sequence[str], rows: Iterable[dict[str, float]] = ()):
        self.columns = tuple(columns)
        self.rows: list[dict[str, float]] = list(rows)

    @classmethod
    def from_rows(cls, rows: Sequence[dict[str, float]]) -> LedgerColumns:
        """Build from the rows of a ledger file; without rows there are no columns."""
        return LedgerColumns(tuple(rows[0]) if rows else (), rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        return f"<ledger of {len(self)} row{'' if len(self) == 1 else 's'}: {', '.join(self.columns)}>"

    def to_pandas(self) -> Any:
        """Convert to a pandas DataFrame; needs pandas."""
        return import_optional("pandas", "to_pandas").DataFrame({name: self[name] for name in self.columns})

    def select(self, numbers: Iterable[int]) -> LedgerColumns:
        """Copy with the rows of these indices."""
        return LedgerColumns(self.columns, (self.rows[k] for k in numbers))

    def __getitem__(self, column: str) -> np.ndarray:
        """Values of one column over time. Raises NoSuchKey if there is no such column."""
        if column not in self.columns:
            raise NoSuchKey(f"there is no column {shown(column)}; {did_you_mean(str(column), self.columns)}")
        return np.array([row[column] for row in self.rows])

    def _change(self) -> float:
        """Magnitude of the change of the total energy [J]; 0 within rounding."""
        if not self.rows:
            return 0.0
        first, last = self.rows[0]["total"], self.rows[-1]["total"]
        change = abs(last - first)
        return 0.0 if change <= ROUNDING * max(abs(first), abs(last)) else change

    @property
    def dissipated(self) -> float:
        """Energy dissipated so far [J], see `dissipated_in`; 0 without rows."""
        return dissipated_in(self.rows[-1]) if self.rows else 0.0

    @property
    def drift(self) -> float:
        """Relative energy error |ΔE_total| / (energy dissipated + largest kinetic energy of any row).

        Formation of contacts counts as dissipation. 0 if the change is within the rounding of the total, as in a body
        at rest.
        """
        largest = max((row["translation"] + row["rotation"] for row in self.rows), default=0.0)
        scale = self.dissipated + largest
        # written so that energies that are not numbers give no drift of 0
        return 0.0 if scale <= 0.0 else self._change() / scale
