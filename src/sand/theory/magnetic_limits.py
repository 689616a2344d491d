"""Limits of permanent moments that are fixed in the grains: domains, thermal flips, fields of neighbours."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..basics.arguments import checked
from ..basics.constants import BOLTZMANN, MAGNETIC
from ..basics.errors import BadInput
from ..basics.material import Material, as_material
from ..basics.units import si

ATTEMPT_TIME = 1e-9
"""τ₀ [s] of Néel relaxation, between 1e-11 and 1e-9 s in the literature."""
MAGNETIC_CONSTANT = 4.0 * math.pi * MAGNETIC
"""μ₀ [T m/A]."""
EASY_EDGES, EASY_DIAGONALS = 1.0 / 4.0, 1.0 / 12.0
"""Barriers of a cubic crystal in |K₁|V: between the edges of the cube (K₁ > 0), and between its diagonals (K₁ < 0)."""
DIAGONAL_FIELD = 4.0 / 3.0
"""Anisotropy field of a cubic crystal with K₁ < 0 in |K₁|/M_s; all others have 2 K/M_s."""
QUOTED_SIZES = {
    "iron": "Dominik & Nübold 2002 quote 40 to 60 nm in diameter for one domain and above 80 nm for several, of iron "
    "condensates"
}
"""Sizes of one domain that the paper quotes, by material; read there, not in its sources."""
LARGEST_EXPONENT = 700.0
"""Largest ΔE/k_BT for which the relaxation time is a finite number."""


@dataclass(frozen=True)
class MagneticLimits:
    """Where a grain keeps one moment fixed in it; computed by `magnetic_limits`.

    Attributes
    ----------
    magnetisation : float
        M_s [A/m], the specific moment times the density.
    single_domain_radius : float
        36 √(A|K|)/(μ₀M_s²) [m]: larger spheres have several domains; an estimate to a factor of about two, see Notes of
        `magnetic_limits`.
    energy_barrier : float
        ΔE [J] between two easy directions of a grain of this radius: KV if uniaxial, K₁V/4 (K₁ > 0) or |K₁|V/12
        (K₁ < 0) if cubic.
    blocking_radius : float
        Radius [m] of a grain with ΔE = k_B T ln(t/τ₀): the moments of smaller grains flip within the time t
        (superparamagnetism).
    blocking_temperature : float
        ΔE/(k_B ln(t/τ₀)) [K] of a grain of this radius, above which its moment flips within the time t.
    relaxation_time : float
        Néel's τ = τ₀ exp(ΔE/k_BT) [s] of a grain of this radius; infinite above exp(700).
    anisotropy_field : float
        2K/M_s [T], or (4/3) |K₁|/M_s of a cubic crystal with K₁ < 0: the field that turns the moment inside the grain.
    contact_field : float
        μ₀M_s/12 [T], field of an equal grain in contact, on its axis: 2kμ/(2r)³ with μ = M_s V.
    """

    magnetisation: float
    single_domain_radius: float
    energy_barrier: float
    blocking_radius: float
    blocking_temperature: float
    relaxation_time: float
    anisotropy_field: float
    contact_field: float


@checked
def magnetic_limits(
    material: Material | str, radius: Any, temperature: Any = "300 K", time: Any = "100 s"
) -> MagneticLimits:
    """Limits within which a grain has one moment that is fixed in it, as the model assumes.

    The barrier ΔE and the anisotropy field are those of the material's `anisotropy_kind`: uniaxial, or cubic with the
    first constant K₁ alone, as the presets iron (K₁ > 0) and magnetite (K₁ < 0) are.  An elongated grain has a higher
    barrier: give its material the effective K and `anisotropy_kind="uniaxial"`.

    Parameters
    ----------
    material : Material or str
        Material with `specific_moment`, `anisotropy` and `exchange_stiffness`, or name of a preset.
    radius : float or str
        r [m] > 0.
    temperature : float or str, optional
        T [K] > 0.
    time : float or str, optional
        Time t [s] for which the moment shall stay, > 1e-9 s; ΔE = 25.3 k_BT for 100 s.

    Raises
    ------
    BadInput
        If the material lacks a constant, or a number is out of range.

    Notes
    -----
    The single-domain radius is that of a sphere with uniaxial walls of energy 4 √(A|K|).  For iron it is 11 nm, a
    diameter of 23 nm.  Dominik & Nübold 2002 (introduction) quote other diameters of iron condensates:
    superparamagnetic below 20 nm, one domain between 40 and 60 nm, several above 80 nm (after Nuth et al. 1994 and
    Withey & Nuth 1999, which were not read for this program).  The formula is not made to agree: shape, strain and
    surface of real grains are not in it.  Take the quoted sizes where your grains are like those.

    References
    ----------
    Néel 1949 (relaxation); Kittel 1949 (domains); Bean & Livingston 1959 (cubic barriers). Recalled, not read at the
    source.
    """
    found = as_material(material)
    r = si(radius, "m", "radius", above=0.0)
    thermal = BOLTZMANN * si(temperature, "K", "temperature", above=0.0)
    barriers = math.log(si(time, "s", "time", above=ATTEMPT_TIME) / ATTEMPT_TIME)
    if not (found.specific_moment > 0.0 and found.anisotropy and found.exchange_stiffness):
        raise BadInput(
            f"material '{found.name}' lacks specific_moment, anisotropy or exchange_stiffness for its magnetic limits; "
            f"give them, for example {found.name}.but(anisotropy='48 kJ/m^3', exchange_stiffness='2e-11 J/m')"
        )
    k, magnetisation = abs(found.anisotropy), found.specific_moment * found.density
    volume, per_volume = 4.0 / 3.0 * math.pi * r**3, barrier_density(found.anisotropy, found.anisotropy_kind)
    barrier = per_volume * volume
    exponent = barrier / thermal
    return MagneticLimits(
        magnetisation=magnetisation,
        single_domain_radius=36.0 * math.sqrt(found.exchange_stiffness * k) / (MAGNETIC_CONSTANT * magnetisation**2),
        energy_barrier=barrier,
        blocking_radius=(3.0 * barriers * thermal / (4.0 * math.pi * per_volume)) ** (1.0 / 3.0),
        blocking_temperature=barrier / (BOLTZMANN * barriers),
        relaxation_time=ATTEMPT_TIME * math.exp(exponent) if exponent < LARGEST_EXPONENT else math.inf,
        anisotropy_field=turning_field(found.anisotropy, found.anisotropy_kind) / magnetisation,
        contact_field=contact_field(magnetisation),
    )


def barrier_density(anisotropy: float, kind: str) -> float:
    """Energy barrier per volume [J/m³] between neighbouring easy directions.

    Uniaxial: K, across the equator.  Cubic, E = K₁ (α₁²α₂² + α₂²α₃² + α₃²α₁²): for K₁ > 0 from 0 at an edge of the cube
    over K₁/4 at the middle of two edges; for K₁ < 0 from −|K₁|/3 at a diagonal over −|K₁|/4 there.
    """
    if kind == "uniaxial":
        return anisotropy
    return abs(anisotropy) * (EASY_EDGES if anisotropy > 0.0 else EASY_DIAGONALS)


def turning_field(anisotropy: float, kind: str) -> float:
    """Curvature of the energy per volume [J/m³] about an easy direction; over M_s the anisotropy field."""
    return -DIAGONAL_FIELD * anisotropy if kind == "cubic" and anisotropy < 0.0 else 2.0 * anisotropy


def contact_field(magnetisation: float) -> float:
    """Flux density μ₀M/12 [T] of a sphere of magnetisation M [A/m] on its axis, at the centre of an equal sphere."""
    return MAGNETIC_CONSTANT * magnetisation / 12.0
