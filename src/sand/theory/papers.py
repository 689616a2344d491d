"""Presets of papers with the energies that they imply."""

from __future__ import annotations

from typing import NamedTuple

from ..basics.material import PAPERS
from .contact import contact


class PaperRow(NamedTuple):
    """A preset of a paper in SI units: its numbers, and the energies of a contact of two of its grains."""

    preset: str
    density: float  # ρ [kg/m³]
    surface_energy: float  # γ [J/m²]
    young_modulus: float  # E [Pa]
    poisson_ratio: float  # ν
    rolling_limit: float  # ξ_c [m]
    radius: float  # r₀ [m]
    contact: str  # settings of `sand.Contact` that are not the default
    roll_energy: float  # E_roll = roll_factor × 12π²γRξ_c [J] with R = r₀/2, thus roll_factor × 6π²γr₀ξ_c
    break_energy: float  # E_break = 1.5426 F_c δ_c [J], from rest
    source: str
    read: str  # what was read; other numbers are from memory


def paper_table() -> list[PaperRow]:
    """Presets of papers, with E_roll and E_break of two grains of the radius that the paper uses.

    E_roll is the energy to roll by πR, a quarter of a turn of equal grains around each other, with displacements
    clamped at the limit: 12π²γRξ_c with the reduced radius R = r₀/2. A factor of the rolling stiffness multiplies it,
    as the limit ξ_c stays. E_break is the energy to pull a contact at rest apart (JKR).
    """
    rows = []
    for paper in PAPERS:
        one = paper.material
        numbers = contact(one, paper.radius)
        rows.append(
            PaperRow(
                one.name,
                one.density,
                one.surface_energy,
                one.young_modulus,
                one.poisson_ratio,
                one.rolling_limit,
                paper.radius,
                ", ".join(f"{key} = {value}" for key, value in paper.contact.items()),
                paper.contact.get("roll_factor", 1.0) * numbers.roll_energy_clamped,
                numbers.break_energy,
                paper.source,
                paper.read,
            )
        )
    return rows
