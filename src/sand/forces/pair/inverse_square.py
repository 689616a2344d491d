"""Central forces of inverse-square type: Coulomb forces between charges, Newtonian attraction between masses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...arguments import checked
from ...compiler.jit import formula
from ...constants import COULOMB, GRAVITATION
from ...grains import Grains
from ...numerics.vec import axpy, dot, scale
from .pair_force import PairForce


class InverseSquareConstants(NamedTuple):
    """Parameters of the formulas."""

    k: float  # 1/(4πε₀) [N m²/C²], or −G [N m²/kg²]


@formula
def inverse_square(apart, product):
    """Force product r/r³ [N] and energy product/r [J]; `product` = k q1 q2 [N m²]."""
    inverse = 1.0 / math.sqrt(dot(apart, apart))
    energy = product * inverse
    return scale(energy * inverse * inverse, apart), energy


@formula
def inverse_square_rate(apart, moving, product):
    """Rate of the force product r/r³ for ṙ = `moving`: product (ṙ − 3 (r·ṙ) r/r²)/r³ [N/s]."""
    inverse = 1.0 / math.sqrt(dot(apart, apart))
    inverse2 = inverse * inverse
    return scale(product * inverse2 * inverse, axpy(-3.0 * dot(apart, moving) * inverse2, apart, moving))


@formula
def coulomb(apart, a, b, constants):
    """Force and energy k q1 q2/r of two charges."""
    return inverse_square(apart, constants.k * a.charge * b.charge)


@formula
def coulomb_rate(apart, moving, a, b, constants):
    """Rate of `coulomb`."""
    return inverse_square_rate(apart, moving, constants.k * a.charge * b.charge)


@formula
def newton(apart, a, b, constants):
    """Force and energy −G m1 m2/r of two masses."""
    return inverse_square(apart, constants.k * a.mass * b.mass)


@formula
def newton_rate(apart, moving, a, b, constants):
    """Rate of `newton`."""
    return inverse_square_rate(apart, moving, constants.k * a.mass * b.mass)


@checked
@dataclass(frozen=True)
class Charges(PairForce):
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

    cutoff: Any = "auto"
    cut: str = "smooth"

    name: ClassVar[str] = "charges"
    no_effect: ClassVar[str] = "charges are switched on but no grain is charged"
    column: ClassVar[str] = "coulomb"
    references: ClassVar[str] = "Jackson 1975; Dominik & Nübold 2002, A.4"
    formula = staticmethod(coulomb)
    rate = staticmethod(coulomb_rate)
    source: ClassVar[str] = "charge"
    constant: ClassVar[float] = COULOMB

    def constants(self) -> InverseSquareConstants:
        """Parameters of the formula."""
        return InverseSquareConstants(self.constant)

    def energy_scale(self, grains: Grains) -> float:
        """Largest |k| q²/(2r) [J] of a grain in contact with an equal one."""
        return float(abs(self.constant) * np.max(getattr(grains, self.source) ** 2 / (2.0 * grains.radius)))


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
    formula = staticmethod(newton)
    rate = staticmethod(newton_rate)
    source: ClassVar[str] = "mass"
    constant: ClassVar[float] = -GRAVITATION
