"""Base class of the pair forces that consist of a formula and its energy; the loops are in `generic_loops`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from ...basics.box import Box
from ...basics.grains import Grains
from ...basics.ramps import forces_at_points
from .cutoff import CutoffForce, cutoff_for
from .generic_loops import PairGrain, PairParameters, pair_sums
from .long_range_loops import LongRangeSums


class PairForce(CutoffForce):
    """A force between all pairs of grains, given by a formula; subclasses are frozen dataclasses.

    Attributes
    ----------
    formula : callable
        The pair formula, see `generic_loops`.
    rate : callable or None
        Rate of the force, for `far="taylor"`; None: that scheme is refused with this force.
    torques : bool
        Whether the formula returns torques.
    source : str
        Quantity of `Grains` on which the force acts; without any such grain it is left out, with a warning.
    """

    formula: ClassVar[Callable]
    rate: ClassVar[Callable | None] = None
    torques: ClassVar[bool] = False
    source: ClassVar[str] = "charge"

    def constants(self) -> Any:
        """The `parameters` of the formula: a NamedTuple of floats."""
        raise NotImplementedError

    def sums(self, box: Box, listed: bool, grains: Grains | None = None) -> LongRangeSums:
        """The loops over the pairs of the Verlet list if `listed`, else over all pairs."""
        return pair_sums(self.formula, self.rate, self.torques, listed)

    def numbers(self, grains: Grains, box: Box) -> Any:
        """Parameters of the loops."""
        return PairParameters(self.constants(), cutoff_for(self.choose(grains, box).radius, self.cut))

    def acts_on(self, grains: Grains) -> bool:
        """Whether any grain is subject to the force."""
        return bool(getattr(grains, self.source).any())

    def largest_energy(self, grains: Grains, distance: float) -> float:
        """Largest |U| [J] of two grains at a distance [m], without the cut-off."""
        return max(energy_at(f.formula, f.constants(), grains, distance) for f in forces_at_points(self))

    def energy_scale(self, grains: Grains) -> float:
        """Largest |U| [J] of a grain in contact with an equal one, among those with extreme quantities."""
        return contact_energy(self.formula, self.constants(), grains)


def contact_energy(pair_formula: Callable, constants: Any, grains: Grains) -> float:
    """Largest |U| [J] of equal grains in contact: those with largest moment, charge, mass, and with smallest radius.

    Two directions, along the moment and across it.
    """
    moment = np.linalg.norm(grains.body_moment, axis=1)
    extreme = {int(np.argmax(q)) for q in (moment, np.abs(grains.charge), grains.mass, -grains.radius)}
    ones = [_extended(grains, i, moment[i]) for i in sorted(extreme)]
    return max(_size_of_energy(pair_formula, constants, one, one, 2.0 * one.radius) for one in ones)


def energy_at(pair_formula: Callable, constants: Any, grains: Grains, distance: float) -> float:
    """Largest |U| [J] of two grains at a distance [m]: of those with the largest moments, charges, or masses.

    Two directions, along the moments, which are parallel, and across them; 0 for a single grain.
    """
    if len(grains) < 2:
        return 0.0
    moment = np.linalg.norm(grains.body_moment, axis=1)
    found = 0.0
    for quantity in (moment, np.abs(grains.charge), grains.mass):
        a, b = (_extended(grains, int(i), moment[i]) for i in np.argpartition(-quantity, 1)[:2])
        found = max(found, _size_of_energy(pair_formula, constants, a, b, distance))
    return found


def _extended(grains: Grains, i: int, moment: float) -> PairGrain:
    """Grain i, with its moment along z."""
    return PairGrain((0.0, 0.0, float(moment)), *(float(q[i]) for q in (grains.charge, grains.mass, grains.radius)))


def _size_of_energy(pair_formula: Callable, constants: Any, a: PairGrain, b: PairGrain, distance: float) -> float:
    """|U| [J] along the moments or across them, the larger one."""
    directions = (distance, 0.0, 0.0), (0.0, 0.0, distance)
    return max(abs(float(pair_formula(apart, a, b, constants)[-1])) for apart in directions)
