"""Limits of permanent moments that are fixed in the grains: domains, thermal flips, fields of neighbours."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..arguments import checked
from ..constants import BOLTZMANN, MAGNETIC
from ..errors import BadInput
from ..material import Material, as_material
from ..units import si

ATTEMPT_TIME = 1e-9
"""τ₀ [s] of Néel relaxation, between 1e-11 and 1e-9 s in the literature."""
MAGNETIC_CONSTANT = 4.0 * math.pi * MAGNETIC
"""μ₀ [T m/A]."""
LARGEST_EXPONENT = 700.0
"""Largest KV/k_BT for which the relaxation time is a finite number."""


@dataclass(frozen=True)
class MagneticLimits:
    """Where a grain keeps one moment fixed in it; computed by `magnetic_limits`.

    Attributes
    ----------
    magnetisation : float
        M_s [A/m], the specific moment times the density.
    single_domain_radius : float
        36 √(AK)/(μ₀M_s²) [m]: larger grains have several domains.
    blocking_radius : float
        (3 k_B T ln(t/τ₀)/4πK)^(1/3) [m], where KV = k_B T ln(t/τ₀): the moments of smaller grains flip within the time
        t (superparamagnetism).
    blocking_temperature : float
        K V/(k_B ln(t/τ₀)) [K] of a grain of this radius, above which its moment flips within the time t.
    relaxation_time : float
        Néel's τ = τ₀ exp(KV/k_BT) [s] of a grain of this radius; infinite above exp(700).
    anisotropy_field : float
        2K/M_s [T], the field that turns the moment inside the grain.
    contact_field : float
        μ₀M_s/12 [T], field of an equal grain in contact, on its axis: 2kμ/(2r)³ with μ = M_s V.
    """

    magnetisation: float
    single_domain_radius: float
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

    The anisotropy is taken as uniaxial, with the energy barrier KV.  The barrier of a cubic crystal is KV/4 (K > 0,
    iron) or KV/12 (K < 0, magnetite), that of an elongated grain is larger: give the material its effective K.

    Parameters
    ----------
    material : Material or str
        Material with `specific_moment`, `anisotropy` and `exchange_stiffness`, or name of a preset.
    radius : float or str
        r [m] > 0.
    temperature : float or str, optional
        T [K] > 0.
    time : float or str, optional
        Time t [s] for which the moment shall stay, > 1e-9 s; KV = 25.3 k_BT for 100 s.

    Raises
    ------
    BadInput
        If the material lacks a constant, or a number is out of range.

    References
    ----------
    Néel 1949 (relaxation); Kittel 1949 (domains).
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
    k, magnetisation = found.anisotropy, found.specific_moment * found.density
    barrier = k * 4.0 / 3.0 * math.pi * r**3
    exponent = barrier / thermal
    return MagneticLimits(
        magnetisation=magnetisation,
        single_domain_radius=36.0 * math.sqrt(found.exchange_stiffness * k) / (MAGNETIC_CONSTANT * magnetisation**2),
        blocking_radius=(3.0 * barriers * thermal / (4.0 * math.pi * k)) ** (1.0 / 3.0),
        blocking_temperature=barrier / (BOLTZMANN * barriers),
        relaxation_time=ATTEMPT_TIME * math.exp(exponent) if exponent < LARGEST_EXPONENT else math.inf,
        anisotropy_field=2.0 * k / magnetisation,
        contact_field=contact_field(magnetisation),
    )


def contact_field(magnetisation: float) -> float:
    """Flux density μ₀M/12 [T] of a sphere of magnetisation M [A/m] on its axis, at the centre of an equal sphere."""
    return MAGNETIC_CONSTANT * magnetisation / 12.0
