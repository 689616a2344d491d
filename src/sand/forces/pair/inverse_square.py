"""Forces along the line of centres: charges repel or attract, masses attract."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...arguments import checked
from ...box import Box
from ...constants import COULOMB, GRAVITATION
from ...grains import Grains
from .cutoff import WithCutoff, cutoff_for
from .inverse_square_loops import ALL_PAIRS, LISTED_PAIRS, InverseSquareParameters
from .loops import LongRangeSums


@checked
@dataclass(frozen=True)
class Charges(WithCutoff):
    """Coulomb forces between the charges of the grains, U = q1 q2/(4πε₀ r).

    Charges sit at the centres; what they induce in their neighbours is left out.

    Parameters
    ----------
    cutoff
        "auto", None (no cut: all pairs in an open box, nearest images in a periodic one), or a length
        [m]. "auto" is None in an open box and (L/2)/1.35 in a periodic one: a cut Coulomb force is a model of
        screening, not of an infinite plasma.
    cut
        "smooth", over the outer fifth of the radius, so that it costs no energy; or "sharp".

    Raises
    ------
    BadInput
        a cut-off that is neither; later, one beyond half the box.
    """

    name: ClassVar[str] = "charges"
    idle: ClassVar[str] = "charges are switched on but no grain is charged"
    column: ClassVar[str] = "coulomb"
    references: ClassVar[str] = "Jackson 1975; Dominik & Nübold 2002, A.4"
    constant: ClassVar[float] = COULOMB
    massive: ClassVar[bool] = False

    def strengths(self, grains: Grains) -> np.ndarray:
        """What attracts or repels, (N,): charges [C], or masses [kg]."""
        return grains.mass if self.massive else grains.charge

    def sums(self, box: Box, listed: bool) -> LongRangeSums:
        """The loops that sum it: over listed pairs, or over all."""
        return LISTED_PAIRS if listed else ALL_PAIRS

    def numbers(self, grains: Grains, box: Box) -> InverseSquareParameters:
        """What the loops get."""
        radius = self.choose(grains, box).radius
        return InverseSquareParameters(self.constant, cutoff_for(radius, self.cut), self.massive)

    def acts_on(self, grains: Grains) -> bool:
        """False if no grain feels it."""
        return bool(self.strengths(grains).any())

    def energy_scale(self, grains: Grains) -> float:
        """k q²/(2r) [J] of the strongest grain with its like at touch."""
        return float(abs(self.constant) * np.max(self.strengths(grains) ** 2 / (2.0 * grains.radius)))


@checked
@dataclass(frozen=True)
class Attraction(Charges):
    """Newtonian attraction between the grains, U = −G m1 m2/r; rarely matters below kilometres.

    Parameters
    ----------
    cutoff
        "auto", None (no cut: all pairs in an open box, nearest images in a periodic one), or a length
        [m]. "auto" is None in an open box and (L/2)/1.35 in a periodic one.
    cut
        "smooth", over the outer fifth of the radius, so that it costs no energy; or "sharp".

    Raises
    ------
    BadInput
        a cut-off that is neither; later, one beyond half the box.
    """

    name: ClassVar[str] = "attraction"
    column: ClassVar[str] = "gravitation"
    references: ClassVar[str] = "Newton 1687"
    constant: ClassVar[float] = -GRAVITATION
    massive: ClassVar[bool] = True
