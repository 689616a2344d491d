"""A thin gas around the grains: friction of a sphere in the free-molecular regime, and the Brownian motion it keeps up.

Molecules of mass m_g hit a sphere one by one, unaware of each other (mean free path ≫ radius), far faster than the
sphere moves.  A part α of them leaves diffusely, with a Maxwellian of the gas's own temperature (the grain is as warm
as the gas); the others are reflected as by a mirror.  All formulas take arrays as well as numbers.
"""

import math

from ...compiler.jit import formula
from ...numerics.vec import axpy, sub

ATOMIC_MASS = 1.66053906660e-27
"""u [kg], CODATA 2018"""

NEBULA = 2.34
"""Mean molecular mass of the solar nebula, H2 and He [u]."""


@formula
def mean_speed(temperature_energy, molecule_mass):
    """v̄ = √(8 k_B T/(π m_g)) [m/s] of the molecules; k_B T in J."""
    return math.sqrt(8.0 * temperature_energy / (math.pi * molecule_mass))


@formula
def density_of(pressure, temperature_energy, molecule_mass):
    """ρ_g = p m_g/(k_B T) [kg/m³] of an ideal gas of pressure p [Pa]."""
    return pressure * molecule_mass / temperature_energy


@formula
def mean_free_path(density, molecule_mass, cross_section):
    """λ = m_g/(√2 ρ_g σ) [m] between collisions of two molecules, of cross-section σ [m²]."""
    return molecule_mass / (math.sqrt(2.0) * density * cross_section)


@formula
def translation_friction(radius, density, speed, accommodation):
    """f_t = (4π/3) r² ρ_g v̄ (1 + (π/8) α) [kg/s]; F = −f_t v (Epstein 1924).

    To first order in v the mirrored molecules give 1; the diffuse ones give 1/2 for the normal and 1/2 for the
    tangential momentum they bring, and π/8 because more of them leave from the side that meets the gas.
    """
    return 4.0 / 3.0 * math.pi * radius**2 * density * speed * (1.0 + math.pi / 8.0 * accommodation)


@formula
def rotation_friction(radius, density, speed, accommodation):
    """f_r = (2π/3) α ρ_g v̄ r⁴ [N m s]; M = −f_r ω, and mirrors exert no torque.

    A flux ρ_g v̄/4 leaves behind the tangential momentum that it lacks to move with the surface, at ω×r:
    M = −α ρ_g (v̄/4) ∮ r×(ω×r) dA.  It is exact in ω: a spin does not change how many molecules arrive.
    """
    return 2.0 / 3.0 * math.pi * accommodation * density * speed * radius**4


@formula
def decayed_fraction(rate, elapsed):
    """1 − e^(−t/τ): the part of a motion through the gas that is lost after t [s] at the rate 1/τ [1/s]."""
    return -math.expm1(-rate * elapsed)


@formula
def thermal_spread(lost, temperature_energy, mass):
    """√((1 − e^(−2t/τ)) k_B T/m), the spread of each component after t; `lost` = 1 − e^(−t/τ).

    For a spin, `mass` is the moment of inertia.
    """
    return math.sqrt(lost * (2.0 - lost) * temperature_energy / mass)


@formula
def ornstein_uhlenbeck(v, rest, lost, spread, noise):
    """v' = u + (v − u) e^(−t/τ) + spread ξ: the Ornstein–Uhlenbeck process after any time t, exact in law.

    Parameters
    ----------
    v, rest
        velocity, and that of the gas u [m/s]; or spin, and (0, 0, 0) [rad/s].
    lost
        1 − e^(−t/τ), from `decayed_fraction`.
    spread
        from `thermal_spread`.
    noise
        ξ, three standard normal deviates.
    """
    return axpy(lost, sub(rest, v), axpy(spread, noise, v))
