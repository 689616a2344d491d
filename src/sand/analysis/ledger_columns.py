"""The rows of a ledger, of a run that goes on or of one that is read: columns over time, what they add up to."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ..errors import NoSuchKey, did_you_mean, shown
from ..state.state import LOST

LOSSES = tuple(f"lost_{name}" for name in LOST)
ROUNDING = 4.0 * np.finfo(float).eps
"""Change of the total, in itself, that is none: its last digits; of bodies at rest, up to 64,000 grains, one."""


def dissipated_in(row: Mapping[str, float]) -> float:
    """Energy dissipated up to a row [J], forming included.

    What stiffnesses make or destroy and what the sources of outside forces give is not; a gas counts if it took more
    than it gave.
    """
    channels = [name for name in LOSSES if name not in ("lost_stiffness", "lost_gas", "lost_outside")]
    return math.fsum([*(row[name] for name in channels), max(row["lost_gas"], 0.0)])


class LedgerColumns:
    """Rows, oldest first, and their columns by name.

    Parameters
    ----------
    columns : Sequence[str]
        names, in the order of the file.
    rows : Iterable[dict[str, float]], optional
        each a number for every column.
    """

    def __init__(self, columns: Sequence[str], rows: Iterable[dict[str, float]] = ()):
        self.columns = tuple(columns)
        self.rows: list[dict[str, float]] = list(rows)

    @classmethod
    def from_rows(cls, rows: Sequence[dict[str, float]]) -> LedgerColumns:
        """Of the rows of a ledger file; no columns where there is no row."""
        return LedgerColumns(tuple(rows[0]) if rows else (), rows)

    def __len__(self) -> int:
        return len(self.rows)

    def select(self, numbers: Iterable[int]) -> LedgerColumns:
        """LedgerColumns of some of the rows."""
        return LedgerColumns(self.columns, (self.rows[k] for k in numbers))

    def __getitem__(self, column: str) -> np.ndarray:
        """One column over time.  Raises BadInput for a name that is no column."""
        if column not in self.columns:
            raise NoSuchKey(f"there is no column {shown(column)}; {did_you_mean(str(column), self.columns)}")
        return np.array([row[column] for row in self.rows])

    def _change(self) -> float:
        """|change of the total| [J]; 0 where it is rounding."""
        if not self.rows:
            return 0.0
        first, last = self.rows[0]["total"], self.rows[-1]["total"]
        change = abs(last - first)
        return 0.0 if change <= ROUNDING * max(abs(first), abs(last)) else change

    @property
    def dissipated(self) -> float:
        """Energy dissipated so far [J], forming included, see `dissipated_in`; 0 without a row."""
        return dissipated_in(self.rows[-1]) if self.rows else 0.0

    @property
    def drift(self) -> float:
        """|change of the total| / (energy dissipated, forming included, + largest kinetic energy of any row).

        0 where the change is within the rounding of the total, as in a body at rest.
        """
        largest = max((row["translation"] + row["rotation"] for row in self.rows), default=0.0)
        scale = self.dissipated + largest
        return self._change() / scale if scale > 0.0 else 0.0
