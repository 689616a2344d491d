"""A rarefied gas: drag and Brownian motion."""

from __future__ import annotations

from collections.abc import Iterator, Set
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from ..basics.arguments import checked
from ..basics.box import Box
from ..basics.constants import BOLTZMANN, LIGHT
from ..basics.grains import Grains
from ..basics.ramps import rampable
from ..basics.settings import RAMP, Flag, Number, Settings, Vector
from ..basics.units import MELTED, format_quantity
from . import gas_drag as law
from .gas_loops import GasParameters, shortest_stopping_time

MIN_KNUDSEN = 10.0
"""Least mean free path in radii for free molecular flow."""
HYDROGEN = 2e-19
"""Collision cross-section of two H2 molecules [m²] (recalled); those of other gases but helium are larger."""
LARGEST_SPEED = 0.5
"""Speed relative to the gas, in mean molecular speeds, up to which Epstein's linear law is accurate: at this speed it
underestimates drag by 6 % (specular reflection) or 4 % (diffuse reflection)."""


@checked
@rampable
@dataclass(frozen=True)
class Gas(Settings):
    """A rarefied gas: drag (Epstein) and Brownian motion of every grain.

    Grains do not influence the gas around other grains. Valid for radii much smaller than the mean free path of the
    molecules and speeds much smaller than theirs. Then F = −f_t (v − u) and M = −f_r ω with
    f_t = (4π/3) r² ρ_g v̄ (1 + (π/8) α) and f_r = (2π/3) α ρ_g v̄ r⁴. The energy transferred to the gas is logged as
    `lost_gas`, negative if the gas heats the grains. Random kicks are determined by the seed of the simulation.

    Parameters
    ----------
    temperature : float or str
        T [K] > 0 of the gas and of the surfaces of the grains. This and density, pressure, accommodation and wind may
        be a `Ramp`.
    density : float or str, optional
        ρ_g [kg/m^3] > 0; either this or the pressure.
    pressure : float or str, optional
        p [Pa] > 0; either this or the density.
    molecule_mass : float or str, optional
        Mean mass m_g of a molecule [kg] > 0, or "28.97 u"; 2.34 u (H2 with He) by default.
    accommodation : float, optional
        α, 0 … 1, the fraction of molecules reflected diffusely, at the temperature T; the others are reflected
        specularly.
    brownian : bool, optional
        True: random kicks that bring the grains to the temperature T; False: drag alone.
    wind : sequence, optional
        u, three components of the velocity of the gas [m/s]; at rest by default.
    cross_section : float or str, optional
        Collision cross-section of two molecules [m^2] > 0, about "2e-19 m^2" for H2. If given, a mean free path below
        ten radii is reported; without it, a path below one radius that follows from the value of H2.

    Raises
    ------
    BadInput
        If a parameter is out of range, or both or neither of density and pressure are given; one line each.
    """

    temperature: Annotated[Any, Number("K", above=0.0), RAMP]
    density: Annotated[Any, Number("kg/m^3", above=0.0), RAMP] = None
    pressure: Annotated[Any, Number("Pa", above=0.0), RAMP] = None
    molecule_mass: Annotated[Any, Number("kg", above=0.0)] = law.NEBULA_MOLECULE * law.ATOMIC_MASS
    accommodation: Annotated[Any, Number(least=0.0, most=1.0), RAMP] = 1.0
    brownian: Annotated[bool, Flag()] = True
    wind: Annotated[Any, Vector("m/s"), RAMP] = (0.0, 0.0, 0.0)
    cross_section: Annotated[Any, Number("m^2", above=0.0)] = None

    name = "gas"
    references = "Epstein 1924; Uhlenbeck & Ornstein 1930; Salmon et al. 2011"

    def contradictions(self, wrong: Set[str]) -> Iterator[str]:
        """Density and pressure, of which one is given; molecules faster than light."""
        if (self.density is None) == (self.pressure is None):
            which = "neither" if self.density is None else "both"
            yield f"give either the density in kg/m^3 or the pressure in Pa; {which} is given"
        elif not wrong and law.mean_speed(BOLTZMANN * self.temperature, self.molecule_mass) >= LIGHT:
            yield (f"temperature = {self.temperature:g} K: the mean speed of its molecules would exceed that of light")

    def numbers(self) -> GasParameters:
        """Run-time parameters of the kernels."""
        energy = BOLTZMANN * self.temperature
        density = self.density or law.density_of(self.pressure, energy, self.molecule_mass)
        speed = law.mean_speed(energy, self.molecule_mass)
        return GasParameters(True, density, speed, energy if self.brownian else 0.0, self.accommodation, *self.wind)

    def shortest_time(self, grains: Grains) -> float:
        """Shortest stopping time [s]: velocity relative to the gas, or spin, of a grain decays to 1/e."""
        return shortest_stopping_time(grains.arrays, self.numbers())

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warnings: gas too hot for solids; grains too fast for the linear law or too large for free molecular flow."""
        numbers, warnings = self.numbers(), []
        if self.temperature > MELTED:
            warnings.append(f"gas: temperature = {self.temperature:g} K: no material is solid above {MELTED:g} K")
        speed = np.linalg.norm(grains.velocity - np.array(self.wind), axis=1)
        fastest = int(np.argmax(speed))
        if speed[fastest] > LARGEST_SPEED * numbers.mean_speed:
            warnings.append(
                f"gas: grain {fastest} moves at {format_quantity(speed[fastest], 'm/s')}, the mean molecular speed is "
                f"{format_quantity(numbers.mean_speed, 'm/s')}; Epstein's law holds for much smaller speeds "
                "and underestimates the drag"
            )
        # without a cross-section the path is known to a factor of a few: only a path below one radius is reported
        given = self.cross_section is not None
        path = law.mean_free_path(numbers.density, self.molecule_mass, self.cross_section if given else HYDROGEN)
        largest = float(grains.radius.max())
        if path < (MIN_KNUDSEN if given else 1.0) * largest:
            estimate = "" if given else f" (for a cross_section of {HYDROGEN:g} m^2, that of H2; give that of the gas)"
            warnings.append(
                f"gas: the mean free path is {format_quantity(path, 'm')}{estimate}, the largest radius "
                f"{format_quantity(largest, 'm')}; Epstein's law holds above {MIN_KNUDSEN:g} radii "
                "and overestimates the drag; use a thinner gas or smaller grains"
            )
        return warnings
