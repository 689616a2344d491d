"""Progress of a run: a bar on a terminal, lines in a log."""

from __future__ import annotations

import math
import time
from typing import Any

from ..basics.units import format_quantity
from ..simulation.observers import Observer
from .report import LAYOUT, progress_bar

NUMBERS_EVERY = 1.0
"""Wall time [s] between two readings of clusters, S and drift."""
WITHOUT_END = "{desc} [{elapsed}{postfix}]"
"""Layout where the end is not known."""


class Progress(Observer):
    """Progress bar with simulation time, rate, remaining wall time, clusters, mean size S and energy drift.

    Parameters
    ----------
    end : float
        End of the run [s]; if infinite, the bar counts steps.
    last_step : float
        Last step of the run; infinite if the end is not known.
    """

    tick_reads_grains = False

    def __init__(self, end: float, last_step: float):
        self._end, self._last_step = end, last_step
        self._by_time = math.isfinite(end)
        self._bar: Any = None
        self._numbers, self._next = "", 0.0

    def see(self, simulation: Any, row: dict[str, float]) -> None:
        """Show the numbers of a new row, at most once a second: the drift takes longer, the more rows there are."""
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + NUMBERS_EVERY
            self._read_row(simulation, row)
        self.tick(simulation)

    def _read_row(self, simulation: Any, row: dict[str, float]) -> None:
        clusters, size = int(row["clusters"]), row["mean_cluster_size"]
        self._numbers = f"{clusters} clusters, S = {size:.3g}, drift {simulation.ledger.drift:.1g}"

    def tick(self, simulation: Any) -> None:
        """Advance the bar, which limits how often it is drawn."""
        position = simulation.time if self._by_time else simulation.steps
        total = self._end if self._by_time else self._last_step
        if self._bar is None:
            self._read_row(simulation, simulation.ledger.rows[-1])  # a resumed run begins between two frames
            known = math.isfinite(total)
            layout = LAYOUT if known else WITHOUT_END
            self._bar = progress_bar(total if known else None, False, initial=position, bar_format=layout)
        bar = self._bar
        bar.set_description_str(format_quantity(simulation.time, "s"), refresh=False)
        rate = bar.format_dict["rate"] or 0.0
        speed = f"{format_quantity(float(f'{rate:.2g}'), 's')}/s" if self._by_time else f"{rate:.2g} steps/s"
        bar.set_postfix_str(f"{speed}, {self._numbers}" if rate else self._numbers, refresh=False)
        bar.update(min(position, total) - bar.n)

    def finish(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.close()
