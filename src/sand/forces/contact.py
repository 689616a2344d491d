"""Contacts: sticking, sliding, rolling, twisting."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.box import Box
from ..core.errors import FORBID_EXTRA, BadInput, did_you_mean
from ..core.grains import Grains
from ..core.material import Material
from ..physics.adhesion import rest_radius
from ..physics.contact import Pairing

BEYOND = ("clamp", "release")
JKR_LIMIT = 0.3
"""a0/R above which JKR is at the edge of its validity."""


def pairing(a: Material, b: Material) -> Pairing:
    """What two materials make together.

    γ_eff = √(γ1 γ2), 1/E* = Σ(1−ν²)/E, 1/G* = Σ(2−ν)/G, 1/G′ = Σ 1/G, the smaller ξ_c.
    """
    return Pairing(
        surface_energy=math.sqrt(a.surface_energy * b.surface_energy),
        modulus=1.0 / sum((1.0 - m.poisson_ratio**2) / m.young_modulus for m in (a, b)),
        shear=1.0 / sum((2.0 - m.poisson_ratio) / m.shear_modulus for m in (a, b)),
        twist_shear=1.0 / sum(1.0 / m.shear_modulus for m in (a, b)),
        roll_limit=min(a.rolling_limit, b.rolling_limit),
    )


@dataclass(frozen=True)
class Contact:
    """Grains that touch stick: JKR with sliding, rolling and twisting springs.

    Args:
        beyond: what happens to a tangential displacement beyond its limit. "clamp" leaves it at the limit;
            "release" sets it to 0, the literal SAND (A.6), which halves the friction of rolling.

    Raises:
        BadInput: an unknown word.
    """

    beyond: str = "clamp"

    __pydantic_config__ = FORBID_EXTRA
    name = "contact"
    references = "Johnson, Kendall & Roberts 1971; Dominik & Tielens 1997; Dominik & Nübold 2002, A.5–A.6"

    def __post_init__(self) -> None:
        if self.beyond not in BEYOND:
            raise BadInput(f"contact: beyond = {self.beyond!r}; {did_you_mean(str(self.beyond), BEYOND)}")

    def parameters(self) -> dict[str, Any]:
        return {"beyond": self.beyond}

    def pairings(self, materials: Sequence[Material]) -> np.ndarray:
        """The (5, M, M) table of `Pairing` for every two materials."""
        table = [[pairing(a, b) for b in materials] for a in materials]
        return np.ascontiguousarray(np.moveaxis(np.array(table, dtype=np.float64), -1, 0))

    def check(self, grains: Grains, box: Box) -> list[str]:
        """A warning for each material whose contacts are too wide for JKR."""
        problems = [
            f"material '{m.name}' has no surface energy above 0, so its grains cannot stick; give one: "
            f'{m.name} with surface_energy = "… J/m^2"'
            for m in grains.materials
            if not (m.surface_energy or 0.0) > 0.0
        ]
        if problems:
            raise BadInput(problems)
        warnings = []
        for number, m in enumerate(grains.materials):
            smallest = float(grains.radius[grains.material == number].min())
            reduced = 0.5 * smallest
            same = pairing(m, m)
            ratio = rest_radius(same.surface_energy, reduced, same.modulus) / reduced
            if ratio > JKR_LIMIT:
                warnings.append(
                    f"contacts of {m.name} grains of radius {smallest:.3g} m have a0/R = {ratio:.2f}; "
                    f"JKR assumes a0/R below {JKR_LIMIT}: take forces and energies as estimates"
                )
        return warnings
