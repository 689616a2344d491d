"""Characteristic values of one contact: lengths, forces, energies, critical displacements, periods, speeds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..basics.arguments import checked
from ..basics.errors import BadInput, did_you_mean
from ..basics.material import Material, as_material
from ..basics.units import si
from ..contact import jkr
from ..contact.dmt import tabor_parameter
from ..contact.law import contact_constants, contact_periods
from ..contact.mixing import MIXING, pairing_between


@dataclass(frozen=True)
class ContactNumbers:
    """Characteristic values of the contact of two grains in SI units; computed by `contact`.

    Attributes
    ----------
    reduced_radius : float
        R = r1 r2/(r1 + r2) [m].
    rest_radius : float
        Contact radius at equilibrium, a0 = (9πγR²/E*)^(1/3) [m].
    jkr_ratio : float
        a0/R; JKR theory is valid below about 0.3.
    tabor_parameter : float
        (R (2γ)²/(E*² z0³))^(1/3) with z0 = 0.16 nm; JKR is accurate above about 5, DMT below about 0.1.
    pull_off_force : float
        F_c = 3πγR [N].
    rest_overlap, pull_off_overlap : float
        Overlap at equilibrium, δ0 = a0²/(3R), and at pull-off, δ_c = a0²/(2·6^(1/3) R) [m].
    break_energy : float
        Energy to break a contact at equilibrium, 1.542585 F_c δ_c [J].
    cycle_energy : float
        Energy dissipated in forming at δ = 0 and breaking at −δ_c, 0.935503 F_c δ_c [J].
    ringing_energy : float
        Energy that a touch at zero speed leaves in the vibration of an undamped contact, 0.607082 F_c δ_c [J].
    normal_stiffness, slide_stiffness, roll_stiffness : float
        k_n, k_s, k_r [N/m].
    twist_stiffness : float
        k_t [N m].
    slide_limit, roll_limit : float
        Critical displacements ζ_c, ξ_c [m].
    twist_limit : float
        Critical angle φ_c [rad].
    slide_force : float
        Critical sliding force k_s ζ_c [N].
    roll_moment, twist_moment : float
        Critical moments k_r R ξ_c = 4F_c ξ_c and k_t φ_c [N m].
    roll_energy_clamped, roll_energy_released : float
        Energy to roll by πR (equal spheres: one rolls by 90° around the other) with clamped or reset displacements,
        12π²γRξ_c and 6π²γRξ_c [J]. The former is E_roll of Wada et al. (2007) and of models of porosity, 6π²γr₀ξ_c for
        equal grains of radius r₀ = 2R.
    normal_period, slide_period, roll_period, twist_period : float
        Oscillation periods of the free pair [s].
    sticking_speed : float
        Largest relative speed of a head-on impact without damping after which grains stick [m/s]:
        m̄v²/2 = cycle_energy, for equal spheres 1.6394 (γ/R)^(5/6) E*^(−1/3) ρ^(−1/2). Thornton & Ning (1998) have the
        same energy, 7.09 (Γ⁵R⁴/E*²)^(1/3) with Γ = 2γ; DT97 have the prefactor 1.07 instead of 1.6394.
    """

    reduced_radius: float
    rest_radius: float
    jkr_ratio: float
    tabor_parameter: float
    pull_off_force: float
    rest_overlap: float
    pull_off_overlap: float
    break_energy: float
    cycle_energy: float
    ringing_energy: float
    normal_stiffness: float
    slide_stiffness: float
    roll_stiffness: float
    twist_stiffness: float
    slide_limit: float
    roll_limit: float
    twist_limit: float
    slide_force: float
    roll_moment: float
    twist_moment: float
    roll_energy_clamped: float
    roll_energy_released: float
    normal_period: float
    slide_period: float
    roll_period: float
    twist_period: float
    sticking_speed: float

    def rebound_speed(self, speed: Any) -> float:
        """Relative speed [m/s] after a head-on impact without damping.

        √(v² − v_s²), v_s the sticking speed; 0 if the grains stick.

        Parameters
        ----------
        speed : float or str
            v ≥ 0 [m/s].
        """
        v = si(speed, "m/s", "speed", least=0.0)
        return math.sqrt(max(v * v - self.sticking_speed**2, 0.0))


@checked
def contact(
    material: Material | str,
    radius: Any,
    other: Material | str | None = None,
    other_radius: Any = None,
    *,
    mixing: str = "geometric",
    rolling_limit: Any = None,
) -> ContactNumbers:
    """Characteristic values of a JKR contact without damping, with the stiffnesses of the equilibrium contact radius.

    Parameters
    ----------
    material : Material or str
        Material of grain 1, or the name of a preset.
    radius : float or str
        r1 [m] > 0.
    other : Material or str, optional
        Material of grain 2; that of grain 1 by default.
    other_radius : float or str, optional
        r2 [m] > 0; r1 by default.
    mixing : str, optional
        Rule for γ_eff, see `contact.mixing.MIXING`.
    rolling_limit : float or str, optional
        ξ_c [m] > 0 in place of the value of the materials.

    Returns
    -------
    ContactNumbers
        In SI units.

    Raises
    ------
    BadInput
        If a parameter is out of range, or a material has no surface energy.
    """
    a = as_material(material)
    b = a if other is None else as_material(other, "other")
    r1 = si(radius, "m", "radius", above=0.0)
    r2 = r1 if other_radius is None else si(other_radius, "m", "other_radius", above=0.0)
    if mixing not in MIXING:
        raise BadInput(f"mixing = {mixing!r}; {did_you_mean(mixing, list(MIXING))}")
    for m in (a, b):
        if not (m.surface_energy or 0.0) > 0.0:
            raise BadInput(
                f"material '{m.name}' has no surface energy above 0, so its grains have no adhesive contacts"
            )
    limit = None if rolling_limit is None else si(rolling_limit, "m", "rolling_limit", above=0.0)
    pairing = pairing_between(a, b, mixing=mixing, rolling_limit=limit)
    m1, m2 = (m.density * 4.0 / 3.0 * math.pi * r**3 for m, r in ((a, r1), (b, r2)))
    c = contact_constants(jkr.LAW)(pairing, r1, r2, m1, m2)
    unit = c.normal.pull_off_force * c.normal.pull_off_overlap
    at = {y: jkr.energy_at(y, 1.0, 1.0) for y in (1.0, jkr.ROOT_AT_TOUCH, jkr.ROOT_AT_BREAK)}
    cycle = unit * (at[jkr.ROOT_AT_BREAK] - at[jkr.ROOT_AT_TOUCH])
    inverse_mass = 1.0 / m1 + 1.0 / m2
    k_n = jkr.normal_stiffness(c.rest_radius, pairing.modulus)
    rolled = c.roll_stiffness * c.roll_limit * math.pi * c.reduced_radius
    periods = contact_periods(jkr.LAW, pairing, r1, r2, m1, m2)
    constants = c._asdict() | c.normal._asdict()
    constants = {name: value for name, value in constants.items() if name in ContactNumbers.__dataclass_fields__}
    return ContactNumbers(
        **constants,
        jkr_ratio=c.rest_radius / c.reduced_radius,
        tabor_parameter=tabor_parameter(pairing.surface_energy, pairing.modulus, c.reduced_radius),
        rest_overlap=jkr.rest_overlap(c.rest_radius, c.reduced_radius),
        break_energy=unit * (at[jkr.ROOT_AT_BREAK] - at[1.0]),
        cycle_energy=cycle,
        ringing_energy=unit * (at[jkr.ROOT_AT_TOUCH] - at[1.0]),
        normal_stiffness=k_n,
        slide_force=c.slide_stiffness * c.slide_limit,
        roll_moment=c.roll_stiffness * c.reduced_radius * c.roll_limit,
        twist_moment=c.twist_stiffness * c.twist_limit,
        roll_energy_clamped=rolled,
        roll_energy_released=0.5 * rolled,
        normal_period=periods["normal"],
        slide_period=periods["sliding"],
        roll_period=periods["rolling"],
        twist_period=periods["twisting"],
        sticking_speed=math.sqrt(2.0 * cycle * inverse_mass),
    )
