"""The progress bar of a run."""

from __future__ import annotations

import math
import sys
from typing import IO, Any

from ..simulation.observers import Observer
from ..units import format_quantity

FORMAT = "{percentage:3.0f}%|{bar}| {desc} [{elapsed}<{remaining}{postfix}]"
"""Fits into 80 columns."""


class Progress(Observer):
    """A bar over physical time: rate, time left, clusters, S and energy drift.

    Parameters
    ----------
    end : float
        of the run [s]; infinite if it ends at a number of steps, over which the bar then goes.
    last_step : float
        that number.
    file : IO[str] or None, optional
        a terminal.
    """

    tick_reads_grains = False

    def __init__(self, end: float, last_step: float, file: IO[str] | None = None):
        self._end, self._last_step = end, last_step
        self._by_time = math.isfinite(end)
        self._file = file or sys.stderr
        self._bar: Any = None
        self._numbers = ""

    def see(self, simulation: Any, row: dict[str, float]) -> None:
        """New numbers at every frame."""
        self._take(simulation, row)
        self.tick(simulation)

    def _take(self, simulation: Any, row: dict[str, float]) -> None:
        clusters, size = int(row["clusters"]), row["mean_cluster_size"]
        self._numbers = f"{clusters} clusters, S = {size:.3g}, drift {simulation.ledger.drift:.1g}"

    def tick(self, simulation: Any) -> None:
        """The bar moves; tqdm itself sees to it that it is not drawn too often."""
        here = simulation.time if self._by_time else simulation.steps
        total = self._end if self._by_time else self._last_step
        if self._bar is None:
            self._take(simulation, simulation.ledger.rows[-1])  # a resumed run begins between two frames
            self._bar = self._open(here, total)
        bar = self._bar
        bar.set_description_str(format_quantity(simulation.time, "s"), refresh=False)
        rate = bar.format_dict["rate"] or 0.0
        speed = f"{format_quantity(float(f'{rate:.2g}'), 's')}/s" if self._by_time else f"{rate:.2g} steps/s"
        bar.set_postfix_str(f"{speed}, {self._numbers}" if rate else self._numbers, refresh=False)
        bar.update(min(here, total) - bar.n)

    def _open(self, here: float, total: float) -> Any:
        from tqdm import tqdm

        tqdm.monitor_interval = 0  # no thread of its own: ticks come often enough
        return tqdm(
            total=total,
            initial=here,
            bar_format=FORMAT,
            dynamic_ncols=True,
            miniters=0,
            delay=0.2,
            leave=False,
            file=self._file,
        )

    def finish(self) -> None:
        """Take the bar away, however the run ended."""
        if self._bar is not None:
            self._bar.close()
