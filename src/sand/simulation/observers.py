"""Observers of a run and the schedule of its frames."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from .outcome import Result

Simulation = Any
"""`sand.Simulation`, which imports this module."""


class Observer:
    """Base class of objects that are called during a run; pass instances as `Simulation(observers=[…])`.

    Observers read the simulation and must not change it.

    Attributes
    ----------
    tick_reads_grains : bool
        False if `tick` reads neither grains nor contacts; in large simulations this saves restoring their order.
    """

    tick_reads_grains: bool = True

    def see(self, simulation: Simulation, row: dict[str, float]) -> None:
        """Process the new row of the ledger at every frame."""

    def tick(self, simulation: Simulation) -> None:
        """Run between two steps, about ten times a second of wall time."""

    def close(self, simulation: Simulation, result: Result) -> None:
        """Run at the end of each `run`."""


def call_ticks(observers: Iterable[Observer], simulation: Simulation) -> None:
    """Call every observer's `tick`; observers that read grains find them in the user's order."""
    for observer in observers:
        if type(observer).tick is not Observer.tick and getattr(observer, "tick_reads_grains", True):
            simulation._engine.restore_user_order()
        observer.tick(simulation)


NEAR = 1e-6
"""Times nearer to a multiple than this fraction of the interval count as the multiple, as both are rounded."""


class Schedule:
    """Times of frames: multiples of `every` [s] of simulated time, met exactly."""

    def __init__(self, every: float, time: float):
        self._every = every
        self._number = 0
        self._after = -math.inf
        self.advance(time)

    @property
    def due(self) -> float:
        """Time [s] of the next frame."""
        return max(self._number * self._every, self._after) if math.isfinite(self._every) else math.inf

    def next(self, end: float) -> float:
        """Time [s] of the next frame, or of the end of the run if that is not later."""
        return self.due if self.due < end - NEAR * self._every else end

    def advance(self, time: float) -> None:
        """Move to the first multiple after `time`."""
        if not math.isfinite(self._every):
            return
        late = time + NEAR * self._every
        self._number = max(self._number, math.floor(late / self._every))
        # rounding may put the first or the second multiple tried before `late`
        for _ in range(2):
            if self._number * self._every <= late:
                self._number += 1
        # where the spacing of doubles exceeds `every`, frames follow at that spacing
        self._after = math.nextafter(time, math.inf)
