"""JKR contacts: two adhesive elastic spheres (Johnson, Kendall & Roberts 1971; Dominik & Tielens 1997).

All quantities are functions of y = √(a/a₀), where a is the contact radius and a₀ its equilibrium value:

    F/F_c    = 4 (y⁶ − y³)                        positive in compression
    δ/δ_c    = 6^(1/3) (2 y⁴ − (4/3) y)           positive in compression
    U/F_cδ_c = 4·6^(1/3) (4/5 y¹⁰ − 4/3 y⁷ + 1/3 y⁴)

γ is the energy of one free surface (work of adhesion 2γ).  The overlap has its minimum −δ_c at y_m = (1/6)^(1/3), where
da/dδ is infinite.  The variable s = √(1 + δ/δ_c) removes this singularity: y = y_m + s p(s) with a smooth function p.

Without adhesion (γ = 0) a contact is Hertzian, F = (4/3) E* √R δ^(3/2), and has no tangential springs.
"""

import math
from typing import NamedTuple

from ..basics.units import text_past
from ..compiler.jit import formula
from .law import ContactLaw, NormalMode, register

CUBE_ROOT_6 = 6.0 ** (1.0 / 3.0)
ROOT_AT_BREAK = 1.0 / CUBE_ROOT_6
"""y_m = √(a/a₀) where the contact breaks."""

# p² (A + B s p + (s p)²) = K with the numbers of p²(6 y_m² + 4 y_m s p + s² p²) = 1/(2·6^(1/3))
_A = 6.0 * ROOT_AT_BREAK**2
_B = 4.0 * ROOT_AT_BREAK
_K = 0.5 / CUBE_ROOT_6

#: p(s) on 0 ≤ s ≤ 3.5 to 4e-8, low order first: Chebyshev fit of tests/reference/jkr.py
POLYNOMIAL = (
    0.38913581804171538,
    -0.09171720130579257,
    0.037796088297796029,
    -0.017659170052408035,
    0.0082334389933927474,
    -0.0034639760188790755,
    0.0011930018594373834,
    -0.00030740813259474596,
    5.4059942220020991e-05,
    -5.7004524231251032e-06,
    2.6965646040310146e-07,
)
POLYNOMIAL_RANGE = 3.5
"""Largest s for which the polynomial is valid; δ = 11.25 δ_c."""

ROOT_AT_TOUCH = (2.0 / 3.0) ** (1.0 / 3.0)
"""y at zero overlap, where the contact forms."""


@formula
def polynomial_root(s):
    """y = √(a/a₀) from s = √(1 + δ/δ_c), 0 ≤ s ≤ 3.5, without branches; relative error 1e-14.

    The polynomial for p(s) is followed by one Newton step.
    """
    c, t = POLYNOMIAL, s * s
    even, odd = c[8] + t * c[10], c[7] + t * c[9]  # powers apart: half as many operations that wait for each other
    even, odd = c[6] + t * even, c[5] + t * odd
    even, odd = c[4] + t * even, c[3] + t * odd
    even, odd = c[2] + t * even, c[1] + t * odd
    p = (c[0] + t * even) + s * odd
    z = s * p
    p -= (p * p * (_A + z * (_B + z)) - _K) / (p * (2.0 * _A + z * (3.0 * _B + 4.0 * z)))
    return ROOT_AT_BREAK + s * p


@formula
def root(s):
    """y = √(a/a₀) from s = √(1 + δ/δ_c) ≥ 0, at any compression."""
    if s <= POLYNOMIAL_RANGE:
        return polynomial_root(s)
    overlap = s * s - 1.0
    y = math.sqrt(math.sqrt(s * s / (2.0 * CUBE_ROOT_6)))
    for _ in range(4):
        cube = y * y * y
        y -= (CUBE_ROOT_6 * (2.0 * cube * y - 4.0 / 3.0 * y) - overlap) / (CUBE_ROOT_6 * (8.0 * cube - 4.0 / 3.0))
    return y


@formula
def stretch(overlap, inverse_pull_off_overlap):
    """s = √(1 + δ/δ_c) from δ [m] and 1/δ_c [1/m]; 0 beyond the breaking point."""
    return math.sqrt(max(1.0 + overlap * inverse_pull_off_overlap, 0.0))


@formula
def force_at(y, pull_off_force):
    """Normal force [N] on grain 1 along n, positive in compression: F = 4 F_c (y⁶ − y³)."""
    cube = y * y * y
    return 4.0 * pull_off_force * (cube * cube - cube)


@formula
def stiffness_at(y, pull_off_force, pull_off_overlap):
    """dF/dδ [N/m] at y = √(a/a₀): (9 F_c/δ_c 6^(−1/3)) (2y⁵ − y²)/(6y³ − 1); infinite at breaking, y³ = 1/6."""
    square = y * y
    slope = pull_off_overlap * CUBE_ROOT_6 * (6.0 * square * y - 1.0)
    return 9.0 * pull_off_force * square * (2.0 * square * y - 1.0) / slope


@formula
def overlap_at(y, pull_off_overlap):
    """Overlap δ [m] at y = √(a/a₀)."""
    return pull_off_overlap * CUBE_ROOT_6 * (2.0 * y * y * y * y - 4.0 / 3.0 * y)


@formula
def energy_at(y, pull_off_force, pull_off_overlap):
    """Energy [J] stored in the normal mode, 0 for separated surfaces; dU = F dδ."""
    y2 = y * y
    y4 = y2 * y2
    shape = 0.8 * y4 * y4 * y2 - 4.0 / 3.0 * y4 * y2 * y + y4 / 3.0
    return pull_off_force * pull_off_overlap * 4.0 * CUBE_ROOT_6 * shape


@formula
def rest_radius(surface_energy, reduced_radius, modulus):
    """Contact radius a₀ [m] at equilibrium: a₀³ = 9πγR²/E*."""
    return (9.0 * math.pi * surface_energy * reduced_radius * reduced_radius / modulus) ** (1.0 / 3.0)


@formula
def pull_off_force(surface_energy, reduced_radius):
    """Pull-off force [N], the largest tension of a contact: F_c = 3πγR."""
    return 3.0 * math.pi * surface_energy * reduced_radius


@formula
def pull_off_overlap(a0, reduced_radius):
    """Pull-off displacement δ_c = a₀²/(2·6^(1/3) R) [m]: the contact breaks at δ = −δ_c."""
    return a0 * a0 / (2.0 * CUBE_ROOT_6 * reduced_radius)


@formula
def rest_overlap(a0, reduced_radius):
    """Overlap at equilibrium [m]: δ₀ = a₀²/(3R)."""
    return a0 * a0 / (3.0 * reduced_radius)


@formula
def normal_stiffness(a0, modulus):
    """Normal stiffness at equilibrium [N/m]: k_n = (6/5) E* a₀."""
    return 1.2 * modulus * a0


HERTZ_CONTACT_RADIUS = 0.3
"""a/R at which the highest frequency of a contact without adhesion is evaluated."""
LARGEST_RATIO = 0.3
"""a₀/R above which JKR theory, for contacts much smaller than the spheres, is an estimate."""


class Constants(NamedTuple):
    """Constants of a JKR contact."""

    pull_off_force: float  # F_c [N]
    pull_off_overlap: float  # δ_c [m]; R without adhesion, to keep the formulas finite
    hertz: float  # (4/3) E* √R [N/m^1.5] without adhesion, else 0


@formula
def _normal_mode(surface_energy, modulus, reduced):
    adhesive = surface_energy > 0.0
    a0 = rest_radius(surface_energy, reduced, modulus)
    delta_c = pull_off_overlap(a0, reduced) if adhesive else reduced
    radius = a0 if adhesive else HERTZ_CONTACT_RADIUS * reduced
    return NormalMode(
        a0,
        rest_overlap(a0, reduced),
        delta_c if adhesive else 0.0,
        radius,
        normal_stiffness(a0, modulus) if adhesive else 2.0 * modulus * radius,
        Constants(
            pull_off_force(surface_energy, reduced),
            delta_c,
            0.0 if adhesive else 4.0 / 3.0 * modulus * math.sqrt(reduced),
        ),
    )


@formula
def _radius_root(overlap, c):
    # 1/δ_c; without adhesion 1/R, as `derived_constants` and `_normal_mode` have it
    return root(stretch(overlap, c.derived.inverse_break_overlap))


@formula
def _fast_radius_root(overlap, c):
    s = stretch(overlap, c.derived.inverse_break_overlap)
    return polynomial_root(s), s <= POLYNOMIAL_RANGE


@formula
def _adhesive_force(overlap, y, c):
    return force_at(y, c.normal.pull_off_force)


@formula
def _force(overlap, y, c):
    pressed = max(overlap, 0.0)
    return _adhesive_force(overlap, y, c) + c.normal.hertz * pressed * math.sqrt(pressed)


@formula
def _energy(overlap, y, c):
    pressed = max(overlap, 0.0)
    stored = energy_at(y, c.normal.pull_off_force, c.normal.pull_off_overlap)
    return stored + 0.4 * c.normal.hertz * pressed * pressed * math.sqrt(pressed)


@formula
def _stiffness(overlap, y, c):
    stiffness = stiffness_at(y, c.normal.pull_off_force, c.normal.pull_off_overlap)
    return stiffness + 1.5 * c.normal.hertz * math.sqrt(max(overlap, 0.0))


@formula
def _adhesive_radius(overlap, y, c):
    return c.rest_radius * y * y


@formula
def _contact_radius(overlap, y, c):
    pressed = math.sqrt(c.reduced_radius * max(overlap, 0.0))
    return _adhesive_radius(overlap, y, c) + (pressed if c.normal.hertz > 0.0 else 0.0)


@formula
def _at_touch(c):
    """U jumps from 0 to −0.846614 F_c δ_c."""
    return energy_at(ROOT_AT_TOUCH, c.normal.pull_off_force, c.normal.pull_off_overlap)


@formula
def _at_break(c):
    """U = (4/45) F_c δ_c and F = −(5/9) F_c."""
    energy = energy_at(ROOT_AT_BREAK, c.normal.pull_off_force, c.normal.pull_off_overlap)
    return energy, force_at(ROOT_AT_BREAK, c.normal.pull_off_force)


def _warning(surface_energy: float, modulus: float, reduced: float) -> str:
    ratio = rest_radius(surface_energy, reduced, modulus) / reduced
    if ratio <= LARGEST_RATIO:
        return ""
    shown = text_past(ratio, LARGEST_RATIO, 2)
    return f"a0/R = {shown}; JKR assumes a0/R below {LARGEST_RATIO}: take forces and energies as estimates"


LAW = register(
    ContactLaw(
        name="jkr",
        references="Johnson, Kendall & Roberts 1971; Dominik & Tielens 1997",
        constants_type=Constants,
        normal_mode=_normal_mode,
        radius_root=_radius_root,
        fast_radius_root=_fast_radius_root,
        force=_force,
        energy=_energy,
        stiffness=_stiffness,
        contact_radius=_contact_radius,
        at_touch=_at_touch,
        at_break=_at_break,
        warning=_warning,
        adhesive_force=_adhesive_force,
        adhesive_radius=_adhesive_radius,
    )
)
