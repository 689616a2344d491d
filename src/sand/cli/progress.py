"""The progress bar of a run."""

from __future__ import annotations

import sys
from typing import IO, Any

from ..core.units import spoken
from ..run.observers import Observer

FORMAT = "{percentage:3.0f}%|{bar}| {desc} [{elapsed}<{remaining}{postfix}]"


class Progress(Observer):
    """A bar over physical time: rate, time left, clusters, S and energy drift.

    Args:
        end: of the run [s].
        file: a terminal.
    """

    def __init__(self, end: float, file: IO[str] | None = None):
        self._end = end
        self._file = file or sys.stderr
        self._bar: Any = None
        self._numbers = ""

    def see(self, simulation: Any, row: dict[str, float]) -> None:
        """New numbers at every frame."""
        clusters, size = int(row["clusters"]), row["mean_cluster_size"]
        self._numbers = f"{clusters} clusters, S = {size:.3g}, drift {simulation.ledger.drift:.0e}"
        self.tick(simulation)

    def tick(self, simulation: Any) -> None:
        """The bar moves; tqdm itself sees to it that it is not drawn too often."""
        if self._bar is None:
            self._bar = self._open(simulation.time)
        bar = self._bar
        rate = bar.format_dict["rate"]
        bar.set_description_str(f"{spoken(simulation.time, 's')} of {spoken(self._end, 's')}", refresh=False)
        speed = f"{spoken(rate, 's')} per s" if rate else ""
        bar.set_postfix_str(", ".join(part for part in (speed, self._numbers) if part), refresh=False)
        bar.update(min(simulation.time, self._end) - bar.n)

    def _open(self, time: float) -> Any:
        from tqdm import tqdm

        tqdm.monitor_interval = 0  # no thread of its own: ticks come often enough
        return tqdm(
            total=self._end,
            initial=time,
            bar_format=FORMAT,
            dynamic_ncols=True,
            miniters=0,
            leave=False,
            file=self._file,
        )

    def finish(self) -> None:
        """Take the bar away, however the run ended."""
        if self._bar is not None:
            self._bar.close()
