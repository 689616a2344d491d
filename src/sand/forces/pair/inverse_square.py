"""Central forces of inverse-square type: Coulomb forces between charges, Newtonian attraction between masses."""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from ...basics.arguments import checked
from ...basics.box import Box
from ...basics.constants import COULOMB, GRAVITATION
from ...basics.grains import Grains, net_charge
from ...basics.ramps import rampable
from ...basics.settings import Word
from ...basics.units import format_quantity
from ...compiler.jit import formula
from ...numerics.vec import axpy, dot, scale
from .cutoff import Cut, CutoffRadius
from .ewald import degree_for, ewald_parameters, mean_field
from .ewald_charges import ewald_charge_sums
from .ewald_fit import CHARGES, Sources
from .ewald_force import DEFAULT_ACCURACY, PERIODIC, Accuracy, Boundary, EwaldForce, Reciprocal
from .long_range_loops import LongRangeSums
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


class InverseSquare(PairForce):
    """Base class of the forces of this module."""

    constant: ClassVar[float]

    def constants(self) -> InverseSquareConstants:
        """Parameters of the formula."""
        return InverseSquareConstants(self.constant)

    def energy_scale(self, grains: Grains) -> float:
        """Largest |k| q²/(2r) [J] of a grain in contact with an equal one."""
        return float(abs(self.constant) * np.max(getattr(grains, self.source) ** 2 / (2.0 * grains.radius)))


@checked
@rampable
@dataclass(frozen=True)
class Charges(EwaldForce, InverseSquare):
    """Coulomb forces between the charges of the grains, U = q1 q2/(4πε₀ r).

    Charges are located at the centres; the polarisation of neighbouring grains is neglected.

    Parameters
    ----------
    cutoff : float, str or None, optional
        "auto", None (no cut-off: all pairs in an open box, nearest images in a periodic one), or a length [m]. "auto"
        is None in an open box and with an Ewald sum, else (L/2)/1.35. A cut-off ends an interaction that has no
        range: at a start a warning says so if |U(r_c)| of the two largest charges exceeds 0.1 k_BT.
    cut : str, optional
        "smooth": the interaction is switched off over the outer fifth of the cut-off radius, which conserves energy;
        or "sharp".
    periodic : str, optional
        What acts in a periodic box. "nearest image": the nearest image of each grain within the cut-off. "ewald": all
        images of all grains, by an Ewald sum, in a box that is periodic along all axes; without `cutoff` and `cut`. A
        net charge Q of the box is neutralised by a uniform background, which exerts no force, with a warning; its
        constant energy, −πkQ²/(2Vα²), is included. "auto": "ewald" if the box is periodic along all axes, neither
        `cutoff` nor `cut` is given and the sum needs no more than a million wave vectors or 32 million nodes; else
        "nearest image".
    accuracy : float, optional
        Of the Ewald sum, 1e-8 … 0.1, a number without unit: largest rms error of the forces (in N) as a fraction of
        √3 k q²/a², and of the potentials (in V) as a fraction of k q/a; k = 1/4πε₀, q the rms charge, and a =
        (3V/4πn)^(1/3) for n charges in the volume V, at most 0.4 of the shortest side. These are the rms force and the
        potential in a gas of such charges. The parameters of the sum are the cheapest with this accuracy.
    boundary : str, optional
        What surrounds the images of the Ewald sum, at infinity: "tin-foil" (a conductor: no field of the polarisation).
        "vacuum" is refused: its energy depends on the total dipole moment of the charges in the box, which jumps when a
        charge crosses a wall.
    reciprocal : str, optional
        How the reciprocal part of the Ewald sum is computed: "direct", summed over wave vectors; "mesh", by Fourier
        transforms on a mesh; "auto", the cheaper of both (the mesh from one to three thousand charges on).

    Raises
    ------
    BadInput
        If a parameter is invalid; later, if the cut-off exceeds half the box, a box of an Ewald sum is open along an
        axis, or an Ewald sum would need too many wave vectors and nodes.
    """

    cutoff: CutoffRadius = "auto"
    cut: Cut = "smooth"
    periodic: Annotated[str, Word("auto", *PERIODIC)] = "auto"
    accuracy: Accuracy = DEFAULT_ACCURACY
    boundary: Boundary = "tin-foil"
    reciprocal: Reciprocal = "auto"

    name: ClassVar[str] = "charges"
    no_effect: ClassVar[str] = "charges are switched on but no grain is charged"
    column: ClassVar[str] = "coulomb"
    references: ClassVar[str] = (
        "Jackson 1975; Dominik & Nübold 2002, A.4; Ewald sum: Ewald 1921; Kolafa & Perram 1992; Essmann et al. 1995"
    )
    formula = staticmethod(coulomb)
    rate = staticmethod(coulomb_rate)
    source: ClassVar[str] = "charge"
    constant: ClassVar[float] = COULOMB
    sources: ClassVar[Sources] = CHARGES

    def contradictions(self, wrong: Set[str]) -> list[str]:
        """As for all Ewald sums; images in vacuum."""
        problems = super().contradictions(wrong)
        if not wrong & {"periodic", "boundary"} and self.periodic != "nearest image" and self.boundary == "vacuum":
            problems.append(
                "boundary = 'vacuum' is for dipoles only: its energy depends on the total dipole moment "
                "of the charges in the box, which jumps when a charge crosses a wall; use 'tin-foil'"
            )
        return problems

    def without_ewald(self, grains: Grains | None, box: Box) -> str:
        """Why there is no Ewald sum in this box; "" if there is one."""
        if self.periodic == "auto" and type(self).formula is not coulomb:
            return "the formula is not that of charges"
        return super().without_ewald(grains, box)

    def carriers(self, grains: Grains) -> int:
        """Number of charged grains."""
        return int(np.count_nonzero(grains.charge))

    def sums(self, box: Box, listed: bool, grains: Grains | None = None) -> LongRangeSums:
        """The loops over the pairs of the Verlet list if `listed`, else over all pairs."""
        if self.uses_ewald(grains, box):
            order = 0 if grains is None or box.is_open else self.ewald(grains, box).order
            return ewald_charge_sums(degree_for(self.accuracy), listed, type(self).formula, order)
        return super().sums(box, listed)

    def numbers(self, grains: Grains, box: Box) -> Any:
        """Parameters of the loops."""
        if self.uses_ewald(grains, box):
            choice, moves = self.ewald(grains, box), self.chosen is not None
            return ewald_parameters(choice, box, len(grains), False, CHARGES, follows_box=moves)
        return super().numbers(grains, box)

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warnings: as for all cut-offs; a net charge in an Ewald sum."""
        warnings, net = super().check(grains, box), net_charge(grains.charge)
        if net and self.uses_ewald(grains, box):
            energy = 0.5 * mean_field(self.ewald(grains, box).alpha, box.volume, False, CHARGES) * net**2
            warnings.append(
                f"{self.name}: the net charge of the box is {format_quantity(net, 'C')}; periodic = '{self.periodic}' "
                f"balances it by a uniform background of {format_quantity(-net, 'C')}, which exerts no force on grains "
                f"and adds the constant energy -pi k Q^2/(2 V alpha^2) = {format_quantity(energy, 'J')} to column "
                f"{self.column}"
            )
        return warnings


@checked
@rampable
@dataclass(frozen=True)
class Attraction(InverseSquare):
    """Newtonian attraction between the grains, U = −G m1 m2/r; rarely relevant below kilometres.

    There is no sum over all periodic images: it exists only with a uniform background of negative mass, which removes
    the mean attraction (the Jeans swindle).

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

    cutoff: CutoffRadius = "auto"
    cut: Cut = "smooth"

    name: ClassVar[str] = "attraction"
    no_effect: ClassVar[str] = "attraction is switched on but no grain has a mass"
    column: ClassVar[str] = "gravitation"
    references: ClassVar[str] = "Newton 1687"
    formula = staticmethod(newton)
    rate = staticmethod(newton_rate)
    source: ClassVar[str] = "mass"
    constant: ClassVar[float] = -GRAVITATION
