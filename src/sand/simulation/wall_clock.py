"""Wall time of the runs of a simulation, by what it was spent on."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from ..compiler.progress import compilation_seconds

PARTS = ("start", "stepping", "output", "compilation")
"""What wall time is spent on: files and first loads before the first step; steps; frames, rows, checkpoints, observers
and the shorter steps to their times; compiled code that is made or loaded. The rest is "other"."""


class WallClock:
    """Wall time [s] of all calls of `Simulation.run`, in parts.

    Parameters
    ----------
    total : float, optional
        Wall time of earlier processes [s].
    parts : Mapping[str, float], optional
        The parts of it, by name.
    """

    def __init__(self, total: float = 0.0, parts: Mapping[str, float] | None = None):
        self._before, self._began = total, -1.0
        self._seconds = {name: float((parts or {}).get(name, 0.0)) for name in PARTS}
        self._inside: list[
            list[float]
        ] = []  # of each part that is measured now: seconds and compilation of parts in it

    @property
    def runs(self) -> bool:
        """Whether a run is under way."""
        return self._began >= 0.0

    @property
    def total(self) -> float:
        """Wall time of all runs [s]."""
        return self._before + (time.monotonic() - self._began if self.runs else 0.0)

    @property
    def parts(self) -> dict[str, float]:
        """Wall time of each part [s]; they sum to the total."""
        return self._seconds | {"other": max(self.total - sum(self._seconds.values()), 0.0)}

    @contextmanager
    def run(self) -> Iterator[None]:
        """Measure a run."""
        self._began = time.monotonic()
        try:
            yield
        finally:
            self.end()

    def end(self) -> None:
        """End the measurement of a run; has no effect without one."""
        self._before, self._began, self._inside = self.total, -1.0, []

    @contextmanager
    def measure(self, part: str) -> Iterator[None]:
        """Count the time of the block for a part, compilation and parts measured in it excepted; only during a run."""
        if not self.runs:
            yield
            return
        began, compiled = time.monotonic(), compilation_seconds()
        self._inside.append([0.0, 0.0])
        try:
            yield
        finally:
            seconds, compilation = time.monotonic() - began, compilation_seconds() - compiled
            inner_seconds, inner_compilation = self._inside.pop()
            own = compilation - inner_compilation
            self._seconds["compilation"] += own
            self._seconds[part] += max(seconds - inner_seconds - own, 0.0)
            if self._inside:
                self._inside[-1][0] += seconds
                self._inside[-1][1] += compilation
