"""Protocols of the forces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

from ..basics.box import Box
from ..basics.grains import Grains
from .pair.cutoff import CutoffChoice
from .pair.long_range_loops import LongRangeSums


@runtime_checkable
class Force(Protocol):
    """An element of `Simulation(forces=[…])`.

    Attributes
    ----------
    name : str
        Its key in case files, ledger and summary.
    references : str
        Sources of its equations.
    """

    name: str
    references: str

    def parameters(self) -> dict[str, Any]:
        """Settings in SI units, as in a case file."""

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warnings for these grains and this box; raises BadInput if the force cannot be computed for them."""


@runtime_checkable
class ExternalForce(Force, Protocol):
    """A force on single grains; `forces/external_formulas.py` has the formulas.

    Attributes
    ----------
    formula : Callable
        `formula(time, grain, parameters)` → force [N], torque [N m], energy [J], decorated with
        `sand.compiler.jit.formula`. The energy depends on position, moment and time, not on velocity or spin.

    Notes
    -----
    Four more members are optional; without them the energy depends neither on time nor on position, there is no flux
    density, and the force does not limit the step:

    `time_dependent`  True if the energy depends explicitly on time: its change is logged as work of the source.
    `position_dependent`  True if the energy depends on position: its jump at a periodic boundary is logged as work.
    `flux_density_at(time)`  the flux density [T] of the force, for `Simulation.at_grains`.
    `longest_step()`  largest step [s] that resolves the variation of the force in time; `math.inf` if constant.
    """

    formula: Callable

    def numbers(self) -> Any:
        """The `parameters` of the formula: a NamedTuple of floats, without values of single grains."""

    def flux_density_size(self) -> float:
        """Largest magnitude over all times of the magnetic flux density [T]; limits the step."""


@runtime_checkable
class LongRangeForce(Force, Protocol):
    """A force between all pairs of grains.

    A force given by a formula is a `pair.pair_force.PairForce`, with the loops of `pair/generic_loops.py`; dipoles have
    loops of their own in `pair/dipole_loops.py`.

    Attributes
    ----------
    column : str
        Name of its energy in the ledger.
    """

    column: str

    def choose(self, grains: Grains, box: Box) -> CutoffChoice:
        """Its cut-off, with the reason."""

    def resolved(self, grains: Grains, box: Box) -> dict[str, Any]:
        """Settings as in `parameters`, with automatic ones as chosen for these grains: a resumed run uses the same."""

    def sums(self, box: Box, listed: bool, grains: Grains | None = None) -> LongRangeSums:
        """Its loops: over the pairs of the Verlet list if `listed`, else over all pairs.

        `grains` for a force whose loops depend on their number, as those of a tree and of an Ewald sum do.
        """

    def numbers(self, grains: Grains, box: Box) -> Any:
        """The `parameters` of its loops: a NamedTuple, without values of single grains, whose indices may change."""

    def acts_on(self, grains: Grains) -> bool:
        """Whether any grain is subject to the force."""

    def energy_scale(self, grains: Grains) -> float:
        """Largest energy of two grains in contact [J]; limits the step."""
