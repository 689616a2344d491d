"""DMT contacts: Hertzian elasticity, and adhesion outside the contact area (Derjaguin, Muller & Toporov 1975).

    F = (4/3) E* √R δ^(3/2) − F_c,   F_c = 4πγR,   U = (8/15) E* √R δ^(5/2) − F_c δ,   δ ≥ 0

γ is the energy of one free surface (work of adhesion 2γ).  The contact forms and breaks at δ = 0 without a jump of the
energy, so that normal motion dissipates nothing.  The law holds for small Tabor parameters, that is for hard, small and
weakly adhesive grains, where JKR theory does not (Tabor 1977; Maugis 1992):

    μ_T = (R (2γ)²/(E*² z₀³))^(1/3)

Rolling stiffness and limits are those of JKR theory, for want of a derivation for DMT contacts.
"""

import math
from typing import NamedTuple

from ..basics.units import text_past
from ..compiler.jit import formula
from .jkr import HERTZ_CONTACT_RADIUS
from .law import ContactLaw, NormalMode, register

ATOMIC_DISTANCE = 0.16e-9
"""Equilibrium distance z₀ [m] of two surfaces (Maugis 1992)."""
DMT_BELOW, JKR_ABOVE = 0.1, 5.0
"""Tabor parameters below which DMT, and above which JKR theory is accurate."""


class Constants(NamedTuple):
    """Constants of a DMT contact."""

    pull_off_force: float  # F_c [N]
    hertz: float  # (4/3) E* √R [N/m^1.5]


def tabor_parameter(surface_energy: float, modulus: float, reduced_radius: float) -> float:
    """Tabor parameter μ_T from γ [J/m²], E* [Pa] and R [m]: DMT below about 0.1, JKR above about 5."""
    return (reduced_radius * (2.0 * surface_energy) ** 2 / (modulus**2 * ATOMIC_DISTANCE**3)) ** (1.0 / 3.0)


@formula
def _normal_mode(surface_energy, modulus, reduced):
    """a₀³ = 3πγR²/E*, δ₀ = a₀²/R, dF/dδ = 2 E* a."""
    a0 = (3.0 * math.pi * surface_energy * reduced * reduced / modulus) ** (1.0 / 3.0)
    radius = a0 if surface_energy > 0.0 else HERTZ_CONTACT_RADIUS * reduced
    constants = Constants(4.0 * math.pi * surface_energy * reduced, 4.0 / 3.0 * modulus * math.sqrt(reduced))
    return NormalMode(a0, a0 * a0 / reduced, 0.0, radius, 2.0 * modulus * radius, constants)


@formula
def _radius_root(overlap, c):
    """y = √(a/a₀) with a = √(Rδ); 1 without adhesion."""
    a0 = c.rest_radius if c.rest_radius > 0.0 else 1.0
    y = math.sqrt(math.sqrt(c.reduced_radius * max(overlap, 0.0)) / a0)
    return y if c.rest_radius > 0.0 else 1.0


@formula
def _fast_radius_root(overlap, c):
    return _radius_root(overlap, c), True


@formula
def _force(overlap, y, c):
    pressed = max(overlap, 0.0)
    return c.normal.hertz * pressed * math.sqrt(pressed) - (c.normal.pull_off_force if overlap >= 0.0 else 0.0)


@formula
def _energy(overlap, y, c):
    pressed = max(overlap, 0.0)
    return 0.4 * c.normal.hertz * pressed * pressed * math.sqrt(pressed) - c.normal.pull_off_force * pressed


@formula
def _stiffness(overlap, y, c):
    return 1.5 * c.normal.hertz * math.sqrt(max(overlap, 0.0))


@formula
def _contact_radius(overlap, y, c):
    return math.sqrt(c.reduced_radius * max(overlap, 0.0))


@formula
def _at_touch(c):
    return 0.0


@formula
def _at_break(c):
    return 0.0, -c.normal.pull_off_force


def _warning(surface_energy: float, modulus: float, reduced: float) -> str:
    tabor = tabor_parameter(surface_energy, modulus, reduced)
    if tabor <= DMT_BELOW:
        return ""
    better = "JKR is the better law" if tabor >= JKR_ABOVE else f"neither DMT nor JKR (above {JKR_ABOVE:g}) is exact"
    return f"Tabor parameter {text_past(tabor, DMT_BELOW, 2)}; DMT assumes below {DMT_BELOW}: {better}"


LAW = register(
    ContactLaw(
        name="dmt",
        references="Derjaguin, Muller & Toporov 1975; Tabor 1977; Maugis 1992",
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
    )
)
