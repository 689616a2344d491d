"""Observers of a run."""

from __future__ import annotations

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
        """Process each new row of the ledger; every frame has one."""

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
