"""Those who look on.  They may look, never change."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from .outcome import Result

Simulation = Any
"""`sand.Simulation`, which imports this module."""


class Observer:
    """Derive from this and put an instance into `Simulation(observers=[…])`.

    Attributes
    ----------
    looks_in_ticks : bool
        False where `tick` leaves grains and contacts alone; that spares large simulations some time.
    """

    looks_in_ticks: bool = True

    def see(self, simulation: Simulation, row: dict[str, float]) -> None:
        """Called at every frame with the new row of the ledger."""

    def tick(self, simulation: Simulation) -> None:
        """Called about ten times a second of wall time, between two steps."""

    def close(self, simulation: Simulation, result: Result) -> None:
        """Called at the end of each `run`."""


def tick_all(observers: Iterable[Observer], simulation: Simulation) -> None:
    """Every observer's `tick`, grains having the numbers that all but the drivers know."""
    for observer in observers:
        if type(observer).tick is not Observer.tick and getattr(observer, "looks_in_ticks", True):
            simulation._engine.restore_user_order()
        observer.tick(simulation)


class Schedule:
    """When the next frame is due: at multiples of `every` [s] of simulated time, seen from time 0.

    A frame is the first step at or after its time; steps are never bent towards it.
    """

    def __init__(self, every: float, time: float):
        self._every = every
        self._number = 0
        self._after = -math.inf
        self.pass_by(time)

    @property
    def due(self) -> float:
        return max(self._number * self._every, self._after) if math.isfinite(self._every) else math.inf

    def pass_by(self, time: float) -> None:
        """Move on to the first due time after `time`."""
        if not math.isfinite(self._every):
            return
        self._number = max(self._number, math.floor(time / self._every))
        # rounding may put the first multiple tried, or the second, before `time`
        for _ in range(2):
            if self._number * self._every <= time:
                self._number += 1
        # multiples that double precision no longer tells from `time`: every step is a frame then
        self._after = math.nextafter(time, math.inf)
