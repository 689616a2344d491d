"""What every force can tell about itself, and what the driver asks of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

from ..core.box import Box
from ..core.grains import Grains
from ..physics.surroundings import nothing, together


@runtime_checkable
class Force(Protocol):
    """Anything in `Simulation(forces=[…])`.

    Attributes:
        name: its key in case files, ledger and summary.
        references: where its equations come from.
    """

    name: str
    references: str

    def parameters(self) -> dict[str, Any]:
        """Its settings in SI, as a case file would give them."""

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warnings for these grains; raises BadInput for what cannot work."""


@runtime_checkable
class GrainForce(Force, Protocol):
    """A force that acts on one grain at a time (physics/surroundings.py has the formulas)."""

    formula: Callable

    def numbers(self) -> Any:
        """What the formula gets as `parameters`: a NamedTuple of floats."""

    def flux_density_size(self) -> float:
        """Size of the magnetic flux density it brings [T]; limits the step."""


def compose(forces: Sequence[GrainForce]) -> tuple[Callable, Any]:
    """One formula and one nested tuple of parameters for a list of per-grain forces, in order."""
    formula, numbers = nothing, ()
    for force in reversed(forces):
        formula = _pair(force.formula, formula)
        numbers = (force.numbers(), numbers)  # type: ignore[assignment]
    return formula, numbers


_PAIRS: dict[tuple[Callable, Callable], Callable] = {}


def _pair(first: Callable, rest: Callable) -> Callable:
    """`together`, the same object for the same formulas, so that nothing is compiled twice."""
    return _PAIRS.setdefault((first, rest), together(first, rest))
