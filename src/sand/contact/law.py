"""Contact laws: what a law consists of, the registry, and the constants of one contact.

A law gives the normal force of two elastic spheres, its energy, and where a contact breaks; it is one file with pure
functions, such as `jkr.py` and `dmt.py`.  Sliding, rolling, twisting and damping are the same for all laws
(`mechanics`).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

from ..basics.errors import BadInput
from ..compiler.jit import formula
from . import tangential


class NormalMode(NamedTuple):
    """What a law says of the normal mode of one contact, from γ_eff, E* and R."""

    rest_radius: float  # a₀ [m], contact radius at equilibrium; 0 without adhesion
    rest_overlap: float  # δ₀ [m], overlap at equilibrium
    break_overlap: float  # the contact breaks at δ = −break_overlap [m]
    stiff_radius: float  # contact radius [m] and stiffness dF/dδ [N/m] at which the time step must resolve the contact
    stiffness: float
    constants: Any  # `ContactLaw.constants_type`


class ContactLaw(NamedTuple):
    """A contact law.  Formulas are decorated with `sand.compiler.jit.formula`.

    The overlap δ [m] is positive in compression; a contact forms at δ = 0.  The argument `c` is the
    `ContactConstants` of the contact; the constants that only this law has are in `c.normal`.  y = √(a/a₀), with the
    contact radius a, is computed once per contact and step.
    """

    name: str  # of `sand.Contact(law=…)` and of case files
    references: str  # sources of the equations
    constants_type: type  # NamedTuple of the constants that only this law has, float each
    normal_mode: Callable  # (γ_eff [J/m²], E* [Pa], R [m]) → NormalMode
    radius_root: Callable  # (δ, c) → y at any overlap
    fast_radius_root: Callable  # (δ, c) → y, and whether it is valid; without branches, for the vectorised loop
    force: Callable  # (δ, y, c) → normal force [N], positive in compression
    energy: Callable  # (δ, y, c) → energy [J], 0 for separated surfaces; its derivative by δ is the force
    stiffness: Callable  # (δ, y, c) → dF/dδ [N/m]
    contact_radius: Callable  # (δ, y, c) → a [m]
    at_touch: Callable  # (c) → energy [J] at δ = 0, just after the contact has formed
    at_break: Callable  # (c) → energy [J] and force [N] at δ = −break_overlap, just before the contact breaks
    warning: Callable[[float, float, float], str]  # (γ_eff, E*, R) → why the law is inaccurate, or ""
    # for simulations in which all contacts adhere, γ_eff > 0; None: as for all contacts
    adhesive_force: Callable | None = None
    adhesive_radius: Callable | None = None


LAWS: dict[str, ContactLaw] = {}
"""Registered contact laws by name."""


def register(law: ContactLaw) -> ContactLaw:
    """Register a contact law, for `sand.Contact(law=…)`, case files and the tests of all laws.

    Raises
    ------
    BadInput
        If the name is taken by another law, or a member is missing.
    """
    if law.name in LAWS and LAWS[law.name] != law:
        raise BadInput(f"contact law '{law.name}' exists already; choose another name")
    missing = [field for field, member in law._asdict().items() if member is None and field not in law._field_defaults]
    if missing:
        raise BadInput(f"contact law '{law.name}' lacks {', '.join(missing)}")
    return LAWS.setdefault(law.name, law)


class Pairing(NamedTuple):
    """Parameters of a pair of materials under the settings of `sand.Contact`."""

    surface_energy: float  # γ_eff [J/m²]
    modulus: float  # E* [Pa]
    shear: float  # G* [Pa]
    twist_shear: float  # G′ [Pa]
    roll_limit: float  # ξ_c [m]
    slide_factor: float  # multipliers of k_s, k_r, k_t
    roll_factor: float
    twist_factor: float
    damping: float  # c [kg/s]
    damping_per_radius: float  # c/a [kg/(m s)]
    damping_ratio: float  # ζ, share of the critical damping of each mode


class Derived(NamedTuple):
    """Numbers that follow from the other constants, stored so that the loop over contacts need not compute them."""

    roll_torque_stiffness: float  # R² k_r [N m]
    squared_slide_limit: float  # ζ_c² [m²]
    squared_roll_limit: float  # ξ_c² [m²]
    inverse_break_overlap: float  # −1/δ where a contact breaks [1/m]; 1/R if it breaks at δ = 0
    radius1: float  # r1 [m]
    radius2: float  # r2 [m]; infinite at a wall
    inverse_radius1: float  # 1/r1 [1/m]
    inverse_radius2: float  # 1/r2 [1/m]
    inverse_smaller_radius: float  # 1/r of the smaller grain [1/m]
    inverse_sum: float  # 1/(r1 + r2) [1/m]


@formula
def derived_constants(reduced, roll_stiffness, slide_limit, roll_limit, break_overlap, r1, r2):
    """`Derived` of one contact, from R [m], k_r [N/m], limits [m], −δ where it breaks [m] and radii [m]."""
    reachable = min(roll_limit, 4.0 * reduced)  # |R (n1 + n2)| is at most 2R; the square of a huge limit would overflow
    return Derived(
        reduced * reduced * roll_stiffness,
        slide_limit * slide_limit,
        reachable * reachable,
        1.0 / (break_overlap if break_overlap > 0.0 else reduced),
        r1,
        r2,
        1.0 / r1,
        1.0 / r2,
        1.0 / min(r1, r2),
        1.0 / (r1 + r2),
    )


class ContactConstants(NamedTuple):
    """Constants of one contact, computed by `contact_constants` and stored as a column of `ContactArrays.constants`."""

    reduced_radius: float  # R [m]
    rest_radius: float  # a₀ [m]
    break_overlap: float  # the contact breaks at δ = −break_overlap [m]
    slide_stiffness: float  # k_s [N/m]
    roll_stiffness: float  # k_r [N/m]
    twist_stiffness: float  # k_t [N m]
    slide_limit: float  # ζ_c [m]
    roll_limit: float  # ξ_c [m]
    twist_limit: float  # φ_c [rad]
    damping: float  # c [kg/s] of the normal mode, independent of the contact radius
    damping_per_radius: float  # c/a [kg/(m s)] of the normal mode
    slide_damping: float  # c_s [kg/s]
    roll_damping: float  # C_r [N m s]
    twist_damping: float  # C_t [N m s]
    max_squared_frequency: float  # ω² of the fastest mode of the pair [1/s²]
    normal: Any  # `ContactLaw.constants_type`: constants that only this law has
    derived: Derived


PULLS = 200
"""Overlaps at which `largest_pull` looks for the largest force."""
DAMPING_FACTOR = 2.0
"""A dashpot counts as a mode of frequency 2 c/m̄: with 25 steps per period c dt/m̄ ≤ 1/8, and the damping of `damping` is
accurate to (c dt/m̄)².  Up to a quarter of critical damping the step is that of the undamped contact."""


@functools.cache
def contact_constants(law: ContactLaw) -> Callable:
    """The formula `(pairing, r1, r2, m1, m2)` → `ContactConstants` of a law, for two grains.

    Radii in m, masses in kg.
    """
    constants_of = reduced_constants(law)

    @formula
    def constants_of_pair(pairing, r1, r2, m1, m2):
        inverse_inertia = 2.5 * (1.0 / (m1 * r1 * r1) + 1.0 / (m2 * r2 * r2))
        return constants_of(pairing, r1 * r2 / (r1 + r2), (r1, r2), 1.0 / m1 + 1.0 / m2, inverse_inertia)

    return constants_of_pair


@functools.cache
def reduced_constants(law: ContactLaw) -> Callable:
    """The formula `(pairing, reduced, radii, inverse_mass, inverse_inertia)` → `ContactConstants` of a law.

    The arguments are R [m], (r1, r2) [m], 1/m1 + 1/m2 [1/kg] and 1/I1 + 1/I2 [1/(kg m²)].
    `max_squared_frequency` is that of the fastest of the four modes of the free pair, or of their damping.  A damping
    ratio ζ gives each mode of stiffness k and effective mass m the coefficient 2ζ√(k m): 1/m = 1/m1 + 1/m2 for the
    normal mode, 7/2 of it for sliding, 1/I1 + 1/I2 for rolling (stiffness k_r R²) and for twisting.
    """
    normal_mode = law.normal_mode

    @formula
    def constants_of(pairing, reduced, radii, inverse_mass, inverse_inertia):
        adhesive = pairing.surface_energy > 0.0
        normal = normal_mode(pairing.surface_energy, pairing.modulus, reduced)
        a0 = normal.rest_radius
        pull_off = 3.0 * math.pi * pairing.surface_energy * reduced  # of JKR, for which rolling was derived
        k_s = pairing.slide_factor * tangential.slide_stiffness(pairing.shear, a0)
        k_r = pairing.roll_factor * tangential.roll_stiffness(pull_off, reduced)
        k_t = pairing.twist_factor * tangential.twist_stiffness(pairing.twist_shear, a0)
        k_n = normal.stiffness
        # squared frequencies of the four modes of the free pair; I = (2/5) m r². Sliding: r²/I = 5/(2m) adds 5/2 to
        # each 1/m, hence 7/2; rolling (stiffness k_r R²) and twisting: 1/I1 + 1/I2
        squared_frequency = max(k_n * inverse_mass, 3.5 * k_s * inverse_mass)
        squared_frequency = max(squared_frequency, max(k_r * reduced * reduced, k_t) * inverse_inertia)
        share = 2.0 * pairing.damping_ratio
        c_n = pairing.damping + share * math.sqrt(k_n / inverse_mass)
        c_s = share * math.sqrt(k_s / (3.5 * inverse_mass))
        c_r = share * math.sqrt(k_r * reduced * reduced / inverse_inertia)
        c_t = share * math.sqrt(k_t / inverse_inertia)
        stiffest = c_n + pairing.damping_per_radius * normal.stiff_radius
        fastest_decay = max(max(stiffest, 3.5 * c_s) * inverse_mass, max(c_r, c_t) * inverse_inertia)
        # without springs no contact slides; a limit of 0 would be exceeded by rounding errors
        slide_limit = tangential.slide_limit(pairing.shear, pairing.twist_shear, a0) if adhesive else reduced
        return ContactConstants(
            reduced,
            a0,
            normal.break_overlap,
            k_s,
            k_r,
            k_t,
            slide_limit,
            pairing.roll_limit,
            tangential.TWIST_LIMIT,
            c_n,
            pairing.damping_per_radius,
            c_s,
            c_r,
            c_t,
            max(squared_frequency, (DAMPING_FACTOR * fastest_decay) ** 2),
            normal.constants,
            derived_constants(reduced, k_r, slide_limit, pairing.roll_limit, normal.break_overlap, *radii),
        )

    return constants_of


def rest_energy(law: ContactLaw, c: ContactConstants, pairing: Pairing) -> float:
    """Energy U(δ₀) [J] of a contact at equilibrium, from its constants and the parameters of its materials."""
    rest = law.normal_mode(pairing.surface_energy, pairing.modulus, c.reduced_radius).rest_overlap
    return float(law.energy(rest, law.radius_root(rest, c), c))


def ringing_energy(law: ContactLaw, pairing: Pairing, r1: float, r2: float) -> float:
    """Energy U(0) − U(δ₀) [J] that a touch at zero speed leaves in the vibration of an undamped contact.

    0.607082 F_c δ_c for JKR; radii [m].
    """
    c = contact_constants(law)(pairing, r1, r2, 1.0, 1.0)
    return float(law.at_touch(c)) - rest_energy(law, c, pairing)


class Strength(NamedTuple):
    """What it takes to break a contact at rest, and to roll or twist it beyond its limit."""

    rest: float  # energy U(δ₀) at equilibrium [J]
    breaking: float  # energy U(−δ_c) − U(δ₀) to break it [J], 1.542585 F_c δ_c for JKR
    rolling: float  # moment that rolls it, R k_r ξ_c, 4 F_c ξ_c for JKR [N m]
    turning: float  # the smaller of this and the one that twists it, k_t φ_c [N m]


@functools.cache
def contact_strength(law: ContactLaw, pairing: Pairing, r1: float, r2: float) -> Strength:
    """Strength of the contact of two grains; radii [m]."""
    c = contact_constants(law)(pairing, r1, r2, 1.0, 1.0)
    rest, roll = rest_energy(law, c, pairing), c.reduced_radius * c.roll_stiffness * c.roll_limit
    return Strength(rest, float(law.at_break(c)[0]) - rest, roll, min(roll, c.twist_stiffness * c.twist_limit))


def contact_periods(law: ContactLaw, pairing: Pairing, r1: float, r2: float, m1: float, m2: float) -> dict[str, float]:
    """Periods 2π/ω [s] of the four modes of a free pair at rest; infinite for a mode without stiffness.

    ω² is k_n/m̄, 7k_s/2m̄, k_r R²/Ī and k_t/Ī, with 1/m̄ = 1/m1 + 1/m2 and 1/Ī = 1/I1 + 1/I2.

    Parameters
    ----------
    r1, r2, m1, m2 : float
        Radii [m] and masses [kg].

    Returns
    -------
    dict of str to float
        By mode: normal, sliding, rolling, twisting.
    """
    c = contact_constants(law)(pairing, r1, r2, m1, m2)
    rest = law.normal_mode(pairing.surface_energy, pairing.modulus, c.reduced_radius).rest_overlap
    normal = float(law.stiffness(rest, law.radius_root(rest, c), c)) if c.rest_radius > 0.0 else 0.0
    inverse_mass, inverse_inertia = 1.0 / m1 + 1.0 / m2, 2.5 / (m1 * r1 * r1) + 2.5 / (m2 * r2 * r2)
    squares = {
        "normal": normal * inverse_mass,
        "sliding": 3.5 * c.slide_stiffness * inverse_mass,
        "rolling": c.roll_stiffness * c.reduced_radius**2 * inverse_inertia,
        "twisting": c.twist_stiffness * inverse_inertia,
    }
    return {mode: 2.0 * math.pi / math.sqrt(w) if w > 0.0 else math.inf for mode, w in squares.items()}


def largest_pull(law: ContactLaw, pairing: Pairing, r1: float, r2: float) -> float:
    """Largest force [N] with which a contact holds two spheres of radii r1 and r2 [m] along n: 3πγR for JKR.

    The least force between breaking and rest, at `PULLS` overlaps: within 1e-4 of it where the force is smooth.
    """
    c = contact_constants(law)(pairing, r1, r2, 1.0, 1.0)
    rest = law.normal_mode(pairing.surface_energy, pairing.modulus, c.reduced_radius).rest_overlap
    shares = [k / (PULLS - 1) for k in range(PULLS)]
    overlaps = [rest * share - c.break_overlap * (1.0 - share) for share in shares]
    return -min(float(law.force(overlap, law.radius_root(overlap, c), c)) for overlap in overlaps)
