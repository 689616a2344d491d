"""One contact in numbers: sizes, forces, energies, limits, periods, speeds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..arguments import checked
from ..contact import jkr
from ..contact.law import Bond, bond_between
from ..contact.mixing import MIXING, pairing_between
from ..errors import BadInput, did_you_mean
from ..material import Material, as_material
from ..units import si


@dataclass(frozen=True)
class ContactNumbers:
    """Everything in closed form about the contact of two grains, SI; see `contact`.

    Attributes
    ----------
    reduced_radius : float
        R = r1 r2/(r1+r2) [m].
    rest_radius : float
        a0 = (9πγR²/E*)^(1/3) [m]; jkr_ratio: a0/R, below 0.3 where JKR holds.
    pull_off_force : float
        F_c = 3πγR [N].
    rest_overlap, pull_off_overlap : float
        δ0 = a0²/(3R), δ_c = a0²/(2·6^(1/3) R) [m].
    break_energy : float
        from rest to the break, 1.542585 F_cδ_c [J].
    cycle_energy : float
        form at δ = 0 and break at −δ_c, 0.935503 F_cδ_c [J].
    normal_stiffness, slide_stiffness, roll_stiffness : float
        k_n, k_s, k_r [N/m]; twist_stiffness: k_t [N m].
    slide_limit, roll_limit : float
        ζ_c, ξ_c [m]; twist_limit: φ_c [rad].
    slide_force : float
        critical sliding force k_s ζ_c [N]; roll_moment: k_r R ξ_c = 4F_cξ_c and twist_moment:
        k_t φ_c [N m].
    roll_energy_clamped, roll_energy_released : float
        to roll along πR, for equal spheres one by 90° round the other [J]:
        12π²γRξ_c and 6π²γRξ_c (the literature's E_roll = 6π²γRξ_c is the latter).
    normal_period, slide_period, roll_period, twist_period : float
        of the free pair [s].
    sticking_speed : float
        relative speed below which undamped grains stick head-on, m̄v²/2 = cycle_energy [m/s];
        for equal spheres 1.6394 (γ/R)^(5/6) E*^(−1/3) ρ^(−1/2).
    """

    reduced_radius: float
    rest_radius: float
    jkr_ratio: float
    pull_off_force: float
    rest_overlap: float
    pull_off_overlap: float
    break_energy: float
    cycle_energy: float
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
        """Relative speed [m/s] after a head-on impact without damping: √(v² − v_s²), 0 if the grains stick."""
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
    """The contact between two grains, without damping and with plain stiffnesses.

    Parameters
    ----------
    material : Material or str
        of grain 1, or the name of a preset.
    radius
        r1 [m] > 0.
    other, other_radius : optional
        of grain 2; the same as grain 1 by default.
    mixing : str, optional
        rule for γ_eff, see `contact.mixing.MIXING`.
    rolling_limit : optional
        ξ_c [m] instead of the materials' own.

    Raises
    ------
    BadInput
        wrong numbers, or a pair without adhesion, which has no such contact.
    """
    a = as_material(material)
    b = a if other is None else as_material(other, "other")
    r1 = si(radius, "m", "radius", above=0.0)
    r2 = r1 if other_radius is None else si(other_radius, "m", "other_radius", above=0.0)
    if mixing not in MIXING:
        raise BadInput(f"mixing = {mixing!r}; {did_you_mean(mixing, list(MIXING))}")
    for m in (a, b):
        if not (m.surface_energy or 0.0) > 0.0:
            raise BadInput(f"material '{m.name}' has no surface energy above 0, so its grains do not stick")
    limit = None if rolling_limit is None else si(rolling_limit, "m", "rolling_limit", above=0.0)
    pairing = pairing_between(a, b, mixing=mixing, rolling_limit=limit)
    m1, m2 = (m.density * 4.0 / 3.0 * math.pi * r**3 for m, r in ((a, r1), (b, r2)))
    return _numbers(bond_between(pairing, r1, r2, m1, m2), pairing.modulus, (r1, r2), (m1, m2))


def _numbers(bond: Bond, modulus: float, radii: tuple[float, float], masses: tuple[float, float]) -> ContactNumbers:
    """From the constants the program itself uses."""
    unit = bond.pull_off_force * bond.pull_off_overlap
    at = {y: jkr.energy_at(y, 1.0, 1.0) for y in (1.0, jkr.ROOT_AT_TOUCH, jkr.ROOT_AT_BREAK)}
    cycle = unit * (at[jkr.ROOT_AT_BREAK] - at[jkr.ROOT_AT_TOUCH])
    light = sum(1.0 / m for m in masses)
    turns = sum(2.5 / (m * r * r) for m, r in zip(masses, radii, strict=True))
    slides = light + sum(2.5 / m for m in masses)
    k_n = jkr.normal_stiffness(bond.rest_radius, modulus)
    rolled = bond.roll_stiffness * bond.roll_limit * math.pi * bond.reduced_radius
    periods = (k_n * light, bond.slide_stiffness * slides, bond.roll_stiffness * bond.reduced_radius**2 * turns)
    normal, slide, roll, twist = (2.0 * math.pi / math.sqrt(w) for w in (*periods, bond.twist_stiffness * turns))
    return ContactNumbers(
        reduced_radius=bond.reduced_radius,
        rest_radius=bond.rest_radius,
        jkr_ratio=bond.rest_radius / bond.reduced_radius,
        pull_off_force=bond.pull_off_force,
        rest_overlap=jkr.rest_overlap(bond.rest_radius, bond.reduced_radius),
        pull_off_overlap=bond.pull_off_overlap,
        break_energy=unit * (at[jkr.ROOT_AT_BREAK] - at[1.0]),
        cycle_energy=cycle,
        normal_stiffness=k_n,
        slide_stiffness=bond.slide_stiffness,
        roll_stiffness=bond.roll_stiffness,
        twist_stiffness=bond.twist_stiffness,
        slide_limit=bond.slide_limit,
        roll_limit=bond.roll_limit,
        twist_limit=bond.twist_limit,
        slide_force=bond.slide_stiffness * bond.slide_limit,
        roll_moment=bond.roll_stiffness * bond.reduced_radius * bond.roll_limit,
        twist_moment=bond.twist_stiffness * bond.twist_limit,
        roll_energy_clamped=rolled,
        roll_energy_released=0.5 * rolled,
        normal_period=normal,
        slide_period=slide,
        roll_period=roll,
        twist_period=twist,
        sticking_speed=math.sqrt(2.0 * cycle * light),
    )
