"""Two magnetic grains: energies, distances and cross-sections of section 3.1 of the paper (Eqs. 1–14, 27).

Arguments are SI numbers or texts with a unit.  Misprints of the paper are corrected and stated.
"""

from __future__ import annotations

import math
from typing import Any

from ..basics.arguments import checked
from ..basics.constants import BOLTZMANN, MAGNETIC
from ..basics.errors import BadInput
from ..basics.units import si
from ..basics.vectors import three
from ..forces.pair import dipole_formulas as dipole


@checked
def reduced_mass(mass: Any, other: Any = None) -> float:
    """Reduced mass m̄ = m1 m2/(m1 + m2) [kg], m/2 for equal masses (below Eq. 8).

    Parameters
    ----------
    mass, other : float or str
        m1, m2 [kg] > 0; equal by default.

    Raises
    ------
    BadInput
        If a mass is not above 0.
    """
    m1 = si(mass, "kg", "mass", above=0.0)
    m2 = m1 if other is None else si(other, "kg", "other", above=0.0)
    return m1 * m2 / (m1 + m2)


@checked
def thermal_speed(mass: Any, temperature: Any) -> float:
    """Thermal speed v_th = √(k_B T/m) [m/s] (section 4.1), the standard deviation of one velocity component.

    Parameters
    ----------
    mass : float or str
        m [kg] > 0.
    temperature : float or str
        T [K] ≥ 0.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    heat = BOLTZMANN * si(temperature, "K", "temperature", least=0.0)
    return math.sqrt(heat / si(mass, "kg", "mass", above=0.0))


@checked
def coupling(moment: Any, distance: Any, temperature: Any) -> float:
    """Coupling parameter λ = μ²μ₀/(4π d³ k_B T) (Eq. 1), the ratio of magnetic to thermal energy.

    Parameters
    ----------
    moment : float or str
        μ [A m²] ≥ 0.
    distance : float or str
        d [m] > 0, the sum of the radii.
    temperature : float or str
        T [K] > 0.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    return dipole.coupling(*_thermal(moment, distance, temperature), MAGNETIC, BOLTZMANN)


@checked
def interaction_radius(moment: Any, distance: Any, temperature: Any) -> float:
    """Interaction radius R_m = (2μ₀μ²/(π k_B T))^(1/3) = 2 d λ^(1/3) [m] (Eq. 2).

    Independent of d; parameters and exceptions as for `coupling`.
    """
    return dipole.interaction_radius(*_thermal(moment, distance, temperature), MAGNETIC, BOLTZMANN)


@checked
def geometric_cross_section(radius: Any, other: Any = None) -> float:
    """Geometric cross-section σ = π (R_i + R_j)² [m²] of two spheres (Eq. 4, printed with a factor 4; cf. Eq. 26).

    Eq. 3, πR² of one grain, is `geometric_cross_section(radius, 0.0)`.

    Parameters
    ----------
    radius, other : float or str
        R_i, R_j [m] ≥ 0; equal by default.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    r1 = si(radius, "m", "radius", least=0.0)
    r2 = r1 if other is None else si(other, "m", "other", least=0.0)
    return math.pi * (r1 + r2) ** 2


@checked
def dipole_energy(moment1: Any, moment2: Any, apart: Any) -> float:
    """Energy of two dipoles, U = k [μ·μ′/r³ − 3 (μ·r)(μ′·r)/r⁵] [J], k = μ₀/4π (Eq. 6).

    The last r′ of Eq. 6 is a misprint of r.

    Parameters
    ----------
    moment1, moment2 : sequence
        μ, μ′ (3,) [A m²].
    apart : sequence
        Separation r (3,) [m], not 0.

    Raises
    ------
    BadInput
        If a vector does not have three finite components, or the separation is 0.
    """
    a, b = three(moment1, "A m^2", "moment1"), three(moment2, "A m^2", "moment2")
    r = three(apart, "m", "apart")
    if not any(r):
        raise BadInput("apart = 0: the energy of two dipoles at the same position is not finite")
    return dipole.pair_load(r, a, b, MAGNETIC)[3]


@checked
def potential_parameter(moment1: Any, moment2: Any = None) -> float:
    """Parameter of the attractive potential, α = 2kμμ′ [J m³] (Eq. 7): U_min = −α/d³.

    Parameters
    ----------
    moment1, moment2 : float or str
        μ, μ′ [A m²] ≥ 0; equal by default.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    first, second = _moments(moment1, moment2)
    return dipole.contact_energy(first, second, 1.0, MAGNETIC)


@checked
def lowest_energy(moment1: Any, distance: Any, moment2: Any = None) -> float:
    """Lowest energy of two dipoles, head to tail at a distance d, U_min = −2kμμ′/d³ [J] (Eq. 7).

    Parameters
    ----------
    moment1, moment2 : float or str
        μ, μ′ [A m²] ≥ 0; equal by default.
    distance : float or str
        d [m] > 0.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    first, second = _moments(moment1, moment2)
    return -dipole.contact_energy(first, second, si(distance, "m", "distance", above=0.0), MAGNETIC)


@checked
def effective_potential(distance: Any, impact_parameter: Any, speed: Any, mass: Any, alpha: Any) -> float:
    """Effective potential U_eff = m̄ b² v∞²/(2r²) − α/r³ [J] of moments aligned with r (Eqs. 8–10).

    Parameters
    ----------
    distance : float or str
        r [m] > 0.
    impact_parameter : float or str
        b [m] ≥ 0.
    speed : float or str
        Relative speed v∞ [m/s] ≥ 0.
    mass : float or str
        Reduced mass m̄ [kg] > 0.
    alpha : float or str
        `potential_parameter` α [J m³] ≥ 0.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    r, b = si(distance, "m", "distance", above=0.0), si(impact_parameter, "m", "impact_parameter", least=0.0)
    v, m = si(speed, "m/s", "speed", least=0.0), si(mass, "kg", "mass", above=0.0)
    return 0.5 * m * (b * v / r) ** 2 - si(alpha, "J m^3", "alpha", least=0.0) / r**3


@checked
def barrier(impact_parameter: Any, speed: Any, mass: Any, alpha: Any) -> float:
    """Centrifugal barrier U_0 = (m̄ v∞² b²/3)³/(2α²) [J] (Eq. 11), at r = 3α/(m̄ b² v∞²).

    It is the maximum of `effective_potential`; parameters and exceptions as there, but α > 0: without attraction there
    is no barrier.
    """
    b, v = si(impact_parameter, "m", "impact_parameter", least=0.0), si(speed, "m/s", "speed", least=0.0)
    strength = si(alpha, "J m^3", "alpha", above=0.0)
    return (si(mass, "kg", "mass", above=0.0) * (v * b) ** 2 / 3.0) ** 3 / (2.0 * strength**2)


@checked
def capture_radius(moment1: Any, mass: Any, speed: Any, moment2: Any = None) -> float:
    """Largest impact parameter of capture, b_max = √3 (α/(m̄ v∞²))^(1/3) [m] (Eqs. 12, 13).

    Eq. 13 of the paper prints b_max².

    Parameters
    ----------
    moment1, moment2 : float or str
        μ, μ′ [A m²] ≥ 0; equal by default.
    mass : float or str
        Reduced mass m̄ [kg] > 0 (`reduced_mass`).
    speed : float or str
        Relative speed v∞ [m/s] > 0.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """
    first, second = _moments(moment1, moment2)
    m, v = si(mass, "kg", "mass", above=0.0), si(speed, "m/s", "speed", above=0.0)
    return dipole.capture_radius(first, second, m, v, MAGNETIC)


@checked
def capture_cross_section(moment1: Any, mass: Any, speed: Any, moment2: Any = None, c: Any = 1.0) -> float:
    """Cross-section of magnetic capture, σ_m = c 3π (α/(m̄ v∞²))^(2/3) [m²] (Eq. 14; Eq. 27 with c = 0.8–0.9).

    The value of c in the paper results from the distance at which its trajectories start; see the page on
    cross-sections of the documentation. Parameters and exceptions as for `capture_radius`, and c ≥ 0.
    """
    return si(c, "1", "c", least=0.0) * math.pi * capture_radius(moment1, mass, speed, moment2) ** 2


def _thermal(moment: Any, distance: Any, temperature: Any) -> tuple[float, float, float]:
    return (
        si(moment, "A m^2", "moment", least=0.0),
        si(distance, "m", "distance", above=0.0),
        si(temperature, "K", "temperature", above=0.0),
    )


def _moments(moment1: Any, moment2: Any) -> tuple[float, float]:
    first = si(moment1, "A m^2", "moment1", least=0.0)
    return first, first if moment2 is None else si(moment2, "A m^2", "moment2", least=0.0)
