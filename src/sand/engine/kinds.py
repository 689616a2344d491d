"""Kinds of engines: what an integrator changes at the assembly of an engine besides its settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

from ..basics.box import Box
from ..basics.grains import Grains
from ..forces.base import Force
from ..neighbours.search import Neighbours
from .engine import Engine
from .step_parameters import ForceDependent, ForcesByType

Build = Callable[[Sequence[Force], Neighbours], Engine]
"""Builds an engine of the same grains with other forces, whose grains take contact steps."""


class Kind:
    """What the assembly of an engine does for an integrator; this one: for engines of grains.

    Attributes
    ----------
    integrator : str
        Name of the integrator that needs a kind of its own.
    holds : bool
        Whether a component may hold grains (`Component.holds`).
    """

    integrator: ClassVar[str] = ""
    keeps_order = False
    """Whether grains keep the order in which they were given."""

    def __init__(self, *, holds: bool):
        self.holds = holds

    def check(self, forces: Sequence[Force], neighbours: Neighbours) -> list[str]:
        """Refuse what such an engine cannot do, all problems at once (BadInput); returns warnings."""
        return []

    def pair_gap(self, grains: Grains, box: Box) -> float:
        """Largest gap [m] of pairs whose approach limits the step."""
        return float(grains.radius.min())

    def limiting_forces(self, forces: ForcesByType) -> ForcesByType:
        """The forces that limit the step."""
        return forces

    def flight_limits(self, parameters: ForceDependent, forces: ForcesByType, grains: Grains) -> Any:
        """The run-time numbers of the integrator, also the ones that depend on forces and grains."""
        return parameters.flight_limits

    def complete(self, engine: Engine, forces: Sequence[Force], build: Build) -> None:
        """Give an engine what such engines need besides those of grains."""
