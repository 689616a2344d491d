"""Forces with ramps: when their parameters change, and to what."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..basics.grains import Grains
from ..basics.ramps import Ramp, force_at, ramps_of
from ..forces.base import Force


@dataclass(frozen=True)
class RampedForces:
    """The forces of a simulation, some of which have ramps.

    Attributes
    ----------
    forces : Sequence[Force]
        All forces.
    parameters : callable
        `(forces, grains)` → the fields of `StepParameters` that depend on parameters of forces.
    """

    forces: Sequence[Force]
    parameters: Callable[[Sequence[Force], Grains], dict[str, Any]]

    @property
    def names(self) -> set[str]:
        """Names of the forces with ramps."""
        return {force.name for force in self.forces if ramps_of(force)}

    def _ramps(self) -> list[Ramp]:
        return [ramp for force in self.forces for ramp in ramps_of(force).values()]

    def intervals(self, time: float) -> list[tuple[int, int]]:
        """Interval of each ramp at a time [s]; parameters change where these do."""
        return [ramp.interval(time) for ramp in self._ramps()]

    def next_change(self, time: float) -> float:
        """Next time [s] at which a parameter changes, or infinity."""
        return min(ramp.next_change(time) for ramp in self._ramps())

    def at(self, time: float) -> list[Force]:
        """All forces at a time [s]."""
        return [force_at(force, time) for force in self.forces]
