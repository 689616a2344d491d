"""Drag and Brownian motion of spheres in a rarefied gas (free-molecular regime).

The mean free path of the molecules, of mass m_g, is much larger than the radius of a sphere, and their speed much
larger than that of the sphere.  A fraction α of the molecules is reflected diffusely, with a Maxwellian at the
temperature of the gas (which is also that of the grain); the others are reflected specularly.  The formulas accept
arrays as well as numbers.
"""

import math

from ..compiler.jit import formula
from ..numerics.vec import axpy, sub

ATOMIC_MASS = 1.66053906660e-27
"""u [kg], CODATA 2018"""

NEBULA_MOLECULE = 2.34
"""Mean molecular mass of the solar nebula, H2 and He [u]."""


@formula
def mean_speed(temperature_energy, molecule_mass):
    """Mean speed v̄ = √(8 k_B T/(π m_g)) [m/s] of the molecules; k_B T in J."""
    return math.sqrt(8.0 * temperature_energy / (math.pi * molecule_mass))


@formula
def density_of(pressure, temperature_energy, molecule_mass):
    """Density ρ_g = p m_g/(k_B T) [kg/m³] of an ideal gas of pressure p [Pa]."""
    return pressure * molecule_mass / temperature_energy


@formula
def mean_free_path(density, molecule_mass, cross_section):
    """Mean free path λ = m_g/(√2 ρ_g σ) [m] of molecules with collision cross-section σ [m²]."""
    return molecule_mass / (math.sqrt(2.0) * density * cross_section)


@formula
def translation_friction(radius, density, speed, accommodation):
    """Coefficient of drag f_t = (4π/3) r² ρ_g v̄ (1 + (π/8) α) [kg/s], F = −f_t v (Epstein 1924).

    To first order in v, specular reflection contributes 1.  Diffuse reflection contributes 1/2 for the normal and 1/2
    for the tangential momentum of the incoming molecules, and π/8 because more molecules leave on the side facing the
    flow.
    """
    return 4.0 / 3.0 * math.pi * radius**2 * density * speed * (1.0 + math.pi / 8.0 * accommodation)


@formula
def rotation_friction(radius, density, speed, accommodation):
    """Coefficient of rotational drag f_r = (2π/3) α ρ_g v̄ r⁴ [N m s], M = −f_r ω.

    Diffusely reflected molecules, of mass flux α ρ_g v̄/4, leave with the velocity of the surface, ω×r:
    M = −α ρ_g (v̄/4) ∮ r×(ω×r) dA.  This is exact in ω, since spin does not change the flux of incoming molecules.
    Specular reflection exerts no torque.
    """
    return 2.0 / 3.0 * math.pi * accommodation * density * speed * radius**4


@formula
def decayed_fraction(rate, elapsed):
    """Fraction 1 − e^(−t/τ) of a velocity relative to the gas that decays within t [s], at the rate 1/τ [1/s]."""
    return -math.expm1(-rate * elapsed)


@formula
def thermal_spread(decayed, temperature_energy, mass):
    """Standard deviation √((1 − e^(−2t/τ)) k_B T/m) of each velocity component after t.

    `decayed` is 1 − e^(−t/τ).

    For a spin, `mass` is the moment of inertia.
    """
    return math.sqrt(decayed * (2.0 - decayed) * temperature_energy / mass)


@formula
def ornstein_uhlenbeck(v, rest, decayed, spread, noise):
    """One step of the Ornstein–Uhlenbeck process, v' = u + (v − u) e^(−t/τ) + spread ξ; exact for any time t.

    Parameters
    ----------
    v, rest : tuple
        Velocity of the grain and of the gas, u [m/s]; or spin and (0, 0, 0) [rad/s].
    decayed : float
        1 − e^(−t/τ), from `decayed_fraction`.
    spread : float
        From `thermal_spread`.
    noise : tuple
        ξ, three standard normal deviates.
    """
    return axpy(decayed, sub(rest, v), axpy(spread, noise, v))
