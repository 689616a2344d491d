"""Static compression and tension of porous aggregates: curves of the literature, and how fast a box may move.

All curves use E_roll = 12π²γRξ_c, the energy to roll by πR with displacements clamped at their limit; R is the reduced
radius, so that E_roll = 6π²γr₀ξ_c for equal grains of radius r₀ (`ContactNumbers.roll_energy_clamped`).
The numbers of the papers are from memory, not compared with the papers.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, did_you_mean
from ..basics.material import Material, as_material
from ..basics.units import si, si_array
from .contact import contact

CLOSEST = 0.74
"""Filling factor of the closest packing of equal spheres, √2π/6."""
RATE_SHARE = 0.3
"""Largest speed of a face of the box over that of the plastic wave, with which P is that of slower runs within 20 %."""
GUETTLER = {"one axis": (0.15, 0.33, 5.6e3, 0.33), "all sides": (0.12, 0.58, 13e3, 0.58)}
"""φ₁, φ₂, p_m [Pa] and Δ of Güttler et al. (2009) for silica grains of radius 0.75 µm, by the kind of compression."""


class PackingScales(NamedTuple):
    """Scales of the compression of a packing of equal grains; computed by `packing_scales`."""

    roll_energy: float  # E_roll = 12π²γRξ_c [J]
    pressure: float  # E_roll/r³ [Pa]
    time: float  # t_c = √(m̄ δ_c/F_c) [s] with the reduced mass m̄ = m/2: the unit of rates of strain, C_v = rate × t_c
    critical_damping: float  # 2√(k_n m̄) [kg/s], of the normal motion of a contact
    wave_speed: float  # √(3 E_roll/(r³ρ)) [m/s]: times φ, the speed of a wave of plastic compression
    surface_energy: float  # γ [J/m²], with its factor

    def largest_rate(self, filling: Any, side: Any) -> float:
        """Largest rate of strain [1/s] with which the pressure is that of slower compressions.

        0.3 √(3 E_roll φ²/(r³ρ))/L: a wave of compression with P = (E_roll/r³) φ³ has the speed √(dP/d(ρφ)); the faces
        of the box, L apart, must be slow against it. The share 0.3 was measured, with 512 grains of ice.

        Parameters
        ----------
        filling : float
            φ > 0.
        side : float or str
            L [m] > 0.
        """
        phi, length = si(filling, "1", "filling", above=0.0), si(side, "m", "side", above=0.0)
        return RATE_SHARE * self.wave_speed * phi / length


@checked
def packing_scales(
    material: Material | str,
    radius: Any,
    *,
    roll_factor: Any = 1.0,
    rolling_limit: Any = None,
    surface_energy_factor: Any = 1.0,
) -> PackingScales:
    """Scales of the compression of a packing of equal grains.

    Parameters
    ----------
    material : Material or str
        Material of the grains, or the name of a preset.
    radius : float or str
        r [m] > 0.
    roll_factor : float, optional
        Factor > 0 of the rolling stiffness (`sand.Contact`), which multiplies E_roll.
    rolling_limit : float or str, optional
        ξ_c [m] > 0 in place of the value of the material.
    surface_energy_factor : float, optional
        Factor > 0 of γ (`sand.Contact`).

    Raises
    ------
    BadInput
        If an argument is out of range, or the material has no surface energy.
    """
    one, r = as_material(material), si(radius, "m", "radius", above=0.0)
    factor = si(surface_energy_factor, "1", "surface_energy_factor", above=0.0)
    if one.surface_energy is not None:
        one = dataclasses.replace(one, surface_energy=factor * one.surface_energy)
    numbers, mass = contact(one, r, rolling_limit=rolling_limit), 4.0 / 3.0 * math.pi * r**3 * one.density
    energy = si(roll_factor, "1", "roll_factor", above=0.0) * numbers.roll_energy_clamped
    return PackingScales(
        energy,
        energy / r**3,
        math.sqrt(0.5 * mass * numbers.pull_off_overlap / numbers.pull_off_force),
        math.sqrt(2.0 * mass * numbers.normal_stiffness),
        math.sqrt(3.0 * energy / (r**3 * one.density)),
        float(one.surface_energy),
    )


@checked
def kataoka_pressure(filling: Any, scale: Any) -> Any:
    """Pressure of a slow compression of fluffy aggregates, P = (E_roll/r³) φ³ [Pa].

    Kataoka, Tanaka, Okuzumi & Wada (2013), A&A 554, A4, of BCCA of ice in a periodic cube, φ below about 0.1; from
    memory.

    Parameters
    ----------
    filling : array_like
        φ.
    scale : float or str
        E_roll/r³ [Pa], `PackingScales.pressure`.
    """
    return si(scale, "Pa", "scale", above=0.0) * si_array(filling, "1", "filling") ** 3


@checked
def tatsuuma_pressure(filling: Any, scale: Any, closest: Any = CLOSEST) -> Any:
    """Pressure of a slow compression up to dense packings, P = (E_roll/r³) (1/φ − 1/φ_max)⁻³ [Pa].

    Tatsuuma, Kataoka, Okuzumi & Tanaka (2023), ApJ 953, 6; form and φ_max from memory.

    Parameters
    ----------
    filling : array_like
        0 < φ < φ_max.
    scale : float or str
        E_roll/r³ [Pa].
    closest : float, optional
        φ_max.
    """
    densest = si(closest, "1", "closest", above=0.0, most=1.0)
    return si(scale, "Pa", "scale", above=0.0) * (1.0 / si_array(filling, "1", "filling") - 1.0 / densest) ** -3


@checked
def arakawa_coordination(filling: Any) -> Any:
    """Mean coordination number of compressed aggregates, Z = 2 + 9.38 φ^1.62.

    Arakawa, Takemoto & Nakamoto (2019), PTEP 2019, 093E02; from memory.

    Parameters
    ----------
    filling : array_like
        φ.
    """
    return 2.0 + 9.38 * si_array(filling, "1", "filling") ** 1.62


@checked
def tatsuuma_strength(filling: Any, surface_energy: Any = 0.1, radius: Any = 1e-7) -> Any:
    """Tensile strength, 6e5 Pa (γ/0.1 J/m²)(r/0.1 µm)⁻¹ φ^1.8, φ the filling factor before the aggregate is stretched.

    Tatsuuma, Kataoka & Tanaka (2019), ApJ 874, 159; from memory.

    Parameters
    ----------
    filling : array_like
        φ.
    surface_energy : float or str, optional
        γ [J/m²].
    radius : float or str, optional
        r [m].
    """
    gamma = si(surface_energy, "J/m^2", "surface_energy", above=0.0)
    return (
        6e5 * (gamma / 0.1) * (1e-7 / si(radius, "m", "radius", above=0.0)) * si_array(filling, "1", "filling") ** 1.8
    )


@checked
def guettler_filling(pressure: Any, kind: str = "one axis") -> Any:
    """Filling factor of a cake of silica dust under a pressure, φ₂ − (φ₂ − φ₁)/(exp((lg P − lg p_m)/Δ) + 1).

    Güttler, Krause, Geretshauser, Speith & Blum (2009), ApJ 701, 130, measured; numbers from memory.

    Parameters
    ----------
    pressure : array_like
        P [Pa] > 0.
    kind : str, optional
        "one axis": by a piston, from φ = 0.15; "all sides": from 0.12.

    Raises
    ------
    BadInput
        If there is no such kind.
    """
    if kind not in GUETTLER:
        raise BadInput(f"kind = {kind!r}; {did_you_mean(kind, list(GUETTLER))}")
    low, high, middle, width = GUETTLER[kind]
    return high - (high - low) / (np.exp(np.log10(si_array(pressure, "Pa", "pressure") / middle) / width) + 1.0)
