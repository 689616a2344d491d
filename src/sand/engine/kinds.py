"""Kinds of engines: what an integrator changes at the assembly of an engine besides its settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple

from ..basics.box import Box
from ..basics.grains import Grains
from ..contact.model import Contact
from ..forces.base import ExternalForce, Force, LongRangeForce
from ..forces.gas import Gas
from ..integrate.parts import ContactParameters, GasSettings
from ..integrate.step_control import StepCriteria
from ..neighbours.search import Neighbours
from .engine import Engine

Build = Callable[[Sequence[Force], Neighbours], Engine]
"""Builds an engine of the same grains with other forces, whose grains take contact steps."""


class ForcesByType(NamedTuple):
    """The forces of a simulation by type."""

    contact: Contact | None
    long_range: list[LongRangeForce]  # the forces that act on at least one grain
    external: list[ExternalForce]
    gas: list[Gas]  # at most one


class ForceDependent(NamedTuple):
    """The fields of `StepParameters` that follow from values of parameters of the forces, which ramps change."""

    settings: ContactParameters
    gas: GasSettings
    criteria: StepCriteria
    flight_limits: Any


def forces_by_type(forces: Sequence[Force], grains: Grains) -> ForcesByType:
    """The forces of a simulation of these grains by type."""
    return ForcesByType(
        next((f for f in forces if isinstance(f, Contact)), None),
        [f for f in forces if isinstance(f, LongRangeForce) and f.acts_on(grains)],
        [f for f in forces if isinstance(f, ExternalForce)],
        [f for f in forces if isinstance(f, Gas)],
    )


class Kind:
    """An engine of grains.

    Attributes
    ----------
    integrator : str
        Name of the integrator that needs a kind of its own.
    """

    integrator: ClassVar[str] = ""
    keeps_order = False
    """Whether grains keep the order in which they were given."""

    def check(self, forces: Sequence[Force], others: Sequence[str], neighbours: Neighbours) -> list[str]:
        """Refuse what such an engine cannot do, all problems at once (BadInput); returns warnings.

        `others` are the nouns of the components, such as "walls".
        """
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
