"""Base class of the pair forces that consist of a formula and its energy; the loops are in `generic_loops`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from ...box import Box
from ...grains import Grains
from .cutoff import CutoffForce, cutoff_for
from .generic_loops import PairGrain, PairParameters, pair_sums
from .loops import LongRangeSums


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
        return pair_sums(type(self).formula, type(self).rate, self.torques, listed)

    def numbers(self, grains: Grains, box: Box) -> Any:
        """Parameters of the loops."""
        return PairParameters(self.constants(), cutoff_for(self.choose(grains, box).radius, self.cut))

    def acts_on(self, grains: Grains) -> bool:
        """Whether any grain is subject to the force."""
        return bool(getattr(grains, self.source).any())

    def energy_scale(self, grains: Grains) -> float:
        """Largest |U| [J] of a grain in contact with an equal one, among those with extreme quantities."""
        return contact_energy(type(self).formula, self.constants(), grains)


def contact_energy(pair_formula: Callable, constants: Any, grains: Grains) -> float:
    """Largest |U| [J] of equal grains in contact: those with largest moment, charge, mass, and with smallest radius.

    Two directions, along the moment and across it.
    """
    moment = np.linalg.norm(grains.body_moment, axis=1)
    extreme = {int(np.argmax(q)) for q in (moment, np.abs(grains.charge), grains.mass, -grains.radius)}
    found = 0.0
    for i in sorted(extreme):
        own = PairGrain(
            (0.0, 0.0, float(moment[i])), *(float(q[i]) for q in (grains.charge, grains.mass, grains.radius))
        )
        for direction in (0, 2):
            apart = tuple(2.0 * own.radius if axis == direction else 0.0 for axis in range(3))
            found = max(found, abs(pair_formula(apart, own, own, constants)[-1]))
    return found
