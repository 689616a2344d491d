"""What every force can tell about itself, and what the driver asks of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

from ..box import Box
from ..grains import Grains
from .external.formulas import nothing, together
from .pair.cutoff import Choice
from .pair.loops import NO_LONG_RANGE_FORCE, LongRangeSums, combined_sums


@runtime_checkable
class Force(Protocol):
    """Anything in `Simulation(forces=[…])`.

    Attributes
    ----------
    name : str
        its key in case files, ledger and summary.
    references : str
        where its equations come from.
    """

    name: str
    references: str

    def parameters(self) -> dict[str, Any]:
        """Its settings in SI, as a case file would give them."""

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warnings for these grains; raises BadInput for what cannot work."""


@runtime_checkable
class ExternalForce(Force, Protocol):
    """A force that acts on one grain at a time (forces/external/formulas.py has the formulas).

    Four more members are looked for; without them a force has neither a clock nor a place, nor a step of its own:

    `time_dependent`  True if the energy depends on time explicitly: what its source does is then booked as work.
    `position_dependent`  True if the energy depends on the position: crossing a periodic boundary is then booked as work.
    `flux_density_at(time)`  the flux density it brings [T], for `Simulation.at_grains`.
    `longest_step()`  longest step [s] that resolves how the force itself varies in time; `math.inf` if it does not.

    Attributes
    ----------
    formula : Callable
        `formula(time, grain, parameters)` → force [N], torque [N m], energy [J], made by
        `sand.compiler.jit.formula`.  The energy is one of place, moment and time, not of velocity or spin.
    """

    formula: Callable

    def numbers(self) -> Any:
        """What the formula gets as `parameters`: a NamedTuple of floats, none for a single grain."""

    def flux_density_size(self) -> float:
        """Largest size over all times of the magnetic flux density it brings [T]; limits the step."""


@runtime_checkable
class LongRangeForce(Force, Protocol):
    """A force between all grains, near and far (forces/pair/dipole_loops.py and forces/pair/inverse_square_loops.py
    have the loops).

    Attributes
    ----------
    column : str
        the name of its energy in the ledger.
    """

    column: str

    def choose(self, grains: Grains, box: Box) -> Choice:
        """Its cut-off, with the reason."""

    def sums(self, box: Box, listed: bool) -> LongRangeSums:
        """The loops that sum it: over listed pairs, or over all."""

    def numbers(self, grains: Grains, box: Box) -> Any:
        """What the loops get: a NamedTuple, without anything for each grain: those have other numbers in the loops."""

    def acts_on(self, grains: Grains) -> bool:
        """False if no grain feels it."""

    def energy_scale(self, grains: Grains) -> float:
        """What two grains in touch may have at stake [J]; limits the step."""


def compose(forces: Sequence[ExternalForce]) -> tuple[Callable, Any]:
    """One formula and one nested tuple of parameters for a list of per-grain forces, in order."""
    formula, numbers = nothing, ()
    for force in reversed(forces):
        formula = _pair(force.formula, formula)
        numbers = (force.numbers(), numbers)  # type: ignore[assignment]
    return formula, numbers


def compose_long_range(sums: Sequence[LongRangeSums], numbers: Sequence[Any]) -> tuple[LongRangeSums, Any]:
    """One set of loops and one nested tuple of numbers for a list of long-range forces, in order."""
    whole, nested = NO_LONG_RANGE_FORCE, ()
    for each, own in zip(reversed(sums), reversed(numbers), strict=True):
        whole = combined_sums(each, whole)
        nested = (own, nested)  # type: ignore[assignment]
    return whole, nested


_PAIRS: dict[tuple[Callable, Callable], Callable] = {}


def _pair(first: Callable, rest: Callable) -> Callable:
    """`together`, the same object for the same formulas, so that nothing is compiled twice."""
    return _PAIRS.setdefault((first, rest), together(first, rest))
