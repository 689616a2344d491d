"""Central forces of inverse-square type: Coulomb forces between charges, Newtonian attraction between masses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...arguments import checked
from ...box import Box
from ...constants import COULOMB, GRAVITATION
from ...grains import Grains
from .cutoff import CutoffForce, cutoff_for
from .inverse_square_loops import ALL_PAIRS, LISTED_PAIRS, InverseSquareParameters
from .loops import LongRangeSums


@checked
@dataclass(frozen=True)
class Charges(CutoffForce):
    """Coulomb forces between the charges of the grains, U = q1 q2/(4πε₀ r).

    Charges are located at the centres; the polarisation of neighbouring grains is neglected.

    Parameters
    ----------
    cutoff : float, str or None, optional
        "auto", None (no cut-off: all pairs in an open box, nearest images in a periodic one), or a length [m]. "auto"
        is None in an open box and (L/2)/1.35 in a periodic one; there the cut-off models screening, not an infinite
        plasma.
    cut : str, optional
        "smooth": the interaction is switched off over the outer fifth of the cut-off radius, which conserves energy;
        or "sharp".

    Raises
    ------
    BadInput
        If a parameter is invalid; later, if the cut-off exceeds half the box.
    """

    name: ClassVar[str] = "charges"
    no_effect: ClassVar[str] = "charges are switched on but no grain is charged"
    column: ClassVar[str] = "coulomb"
    references: ClassVar[str] = "Jackson 1975; Dominik & Nübold 2002, A.4"
    constant: ClassVar[float] = COULOMB
    by_mass: ClassVar[bool] = False

    def strengths(self, grains: Grains) -> np.ndarray:
        """The charges [C], or the masses [kg], (N,)."""
        return grains.mass if self.by_mass else grains.charge

    def sums(self, box: Box, listed: bool) -> LongRangeSums:
        """The loops over the pairs of the Verlet list if `listed`, else over all pairs."""
        return LISTED_PAIRS if listed else ALL_PAIRS

    def numbers(self, grains: Grains, box: Box) -> InverseSquareParameters:
        """Parameters of the loops."""
        radius = self.choose(grains, box).radius
        return InverseSquareParameters(self.constant, cutoff_for(radius, self.cut), self.by_mass)

    def acts_on(self, grains: Grains) -> bool:
        """Whether any grain is subject to the force."""
        return bool(self.strengths(grains).any())

    def energy_scale(self, grains: Grains) -> float:
        """Largest |k| q²/(2r) [J] of a grain in contact with an equal one."""
        return float(abs(self.constant) * np.max(self.strengths(grains) ** 2 / (2.0 * grains.radius)))


@checked
@dataclass(frozen=True)
class Attraction(Charges):
    """Newtonian attraction between the grains, U = −G m1 m2/r; rarely relevant below kilometres.

    Parameters
    ----------
    cutoff : float, str or None, optional
        "auto", None (no cut-off: all pairs in an open box, nearest images in a periodic one), or a length [m]. "auto"
        is None in an open box and (L/2)/1.35 in a periodic one.
    cut : str, optional
        "smooth": the interaction is switched off over the outer fifth of the cut-off radius, which conserves energy;
        or "sharp".

    Raises
    ------
    BadInput
        If a parameter is invalid; later, if the cut-off exceeds half the box.
    """

    name: ClassVar[str] = "attraction"
    column: ClassVar[str] = "gravitation"
    references: ClassVar[str] = "Newton 1687"
    constant: ClassVar[float] = -GRAVITATION
    by_mass: ClassVar[bool] = True
