"""Screened Coulomb forces (Yukawa, Debye–Hückel) between charged grains in a plasma or electrolyte.

    U = q1 q2/(4πε₀ r) exp(−r/λ)

λ is the screening length of the surrounding charges (Shukla & Eliasson 2009, Rev. Mod. Phys. 81, 25).  The formula
holds for linear screening: |q φ| < kT of the screening charges at the surface of a grain, and radii far below λ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

from ...basics.arguments import checked
from ...basics.box import Box
from ...basics.constants import COULOMB
from ...basics.grains import Grains
from ...basics.ramps import forces_at_points, rampable
from ...basics.settings import RAMP, Number
from ...basics.units import format_quantity
from ...compiler.jit import formula
from ...numerics.vec import dot, scale
from .cutoff import HALF_BOX_RATIO, Cut, CutoffChoice, CutoffRadius
from .pair_force import PairForce

CUTOFF_LENGTHS = 10.0
"""Automatic cut-off in screening lengths, beyond which U is below exp(−10) = 5e-5 of the Coulomb energy.

The switching range begins at 8 screening lengths, where U is 3e-4 of the Coulomb energy.
"""
LARGEST_RADIUS = 0.1
"""Radius of a grain in screening lengths above which a warning says that the formula underestimates the energy.

Around a sphere of radius a the linear potential is larger by the factor exp(a/λ)/(1 + a/λ): 0.5 % for a = 0.1 λ.
"""


class ScreenedConstants(NamedTuple):
    """Parameters of the formula."""

    k: float  # 1/(4πε₀) [N m²/C²]
    inverse_length: float  # 1/λ [1/m]


@formula
def screened_coulomb(apart, a, b, constants):
    """Force k q1 q2 (1 + r/λ) exp(−r/λ) r/r³ [N] and energy k q1 q2 exp(−r/λ)/r [J]."""
    square = dot(apart, apart)
    distance = math.sqrt(square)
    lengths = distance * constants.inverse_length
    energy = constants.k * a.charge * b.charge * math.exp(-lengths) / distance
    return scale(energy * (1.0 + lengths) / square, apart), energy


@checked
@rampable
@dataclass(frozen=True)
class ScreenedCharges(PairForce):
    """Screened Coulomb forces between the charges of the grains, U = q1 q2/(4πε₀ r) exp(−r/λ).

    For dust in a plasma (Yukawa, Debye–Hückel).  Instead of `Charges`, not together with it.

    Parameters
    ----------
    screening_length : float or str
        λ [m] > 0, in a plasma its Debye length. Or a `Ramp`, with the cut-off of the largest λ.
    cutoff : float, str or None, optional
        "auto", None (no cut-off: all pairs in an open box, nearest images in a periodic one), or a length [m]. "auto"
        is 10 λ, where the interaction is below 5e-5 of the Coulomb energy, in a periodic box at most (L/2)/1.35, and
        always at least two diameters of the largest grain.
    cut : str, optional
        "smooth": the interaction is switched off over the outer fifth of the cut-off radius, which conserves energy;
        or "sharp".

    Raises
    ------
    BadInput
        If a parameter is missing or invalid; later, if the cut-off exceeds half the box.
    """

    screening_length: Annotated[Any, Number("m", above=0.0), RAMP]
    cutoff: CutoffRadius = "auto"
    cut: Cut = "smooth"

    name: ClassVar[str] = "screened_charges"
    no_effect: ClassVar[str] = "screened charges are switched on but no grain is charged"
    column: ClassVar[str] = "yukawa"
    references: ClassVar[str] = "Shukla & Eliasson 2009, Rev. Mod. Phys. 81, 25"
    formula = staticmethod(screened_coulomb)

    def automatic(self, grains: Grains, largest: float) -> CutoffChoice:
        """Ten screening lengths, at least two grain diameters, at most `largest`."""
        longest = max(one.screening_length for one in forces_at_points(self))
        full, shortest = CUTOFF_LENGTHS * longest, 4.0 * float(grains.radius.max())
        if max(full, shortest) >= largest:
            less = f"less than {CUTOFF_LENGTHS:g} screening lengths, {format_quantity(full, 'm')}"
            return CutoffChoice(largest, f"{self.cut}, half the box / {HALF_BOX_RATIO}, {less}")
        if full < shortest:
            return CutoffChoice(shortest, f"{self.cut}, two grain diameters, more than {CUTOFF_LENGTHS:g} λ")
        return CutoffChoice(full, f"{self.cut}, {CUTOFF_LENGTHS:g} screening lengths")

    def constants(self) -> ScreenedConstants:
        """Parameters of the formula."""
        return ScreenedConstants(COULOMB, 1.0 / self.screening_length)

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warnings: as for all cut-offs; grains that are not small compared with the screening length."""
        warnings, largest = super().check(grains, box), float(grains.radius.max())
        if largest > LARGEST_RADIUS * self.screening_length:
            factor = math.exp(min(largest / self.screening_length, 700.0)) / (1.0 + largest / self.screening_length)
            warnings.append(
                f"{self.name}: the largest radius, {format_quantity(largest, 'm')}, is not small compared with "
                f"screening_length = {format_quantity(self.screening_length, 'm')}: the potential around such a grain "
                f"is larger by a factor {factor:.3g} than that of a point charge"
            )
        return warnings
