"""Contact parameters of pairs of materials."""

from __future__ import annotations

import math
from collections.abc import Callable

from ..basics.material import Material
from .law import Pairing

MIXING: dict[str, Callable[[float, float], float]] = {
    "geometric": lambda a, b: math.sqrt(a * b),
    "harmonic": lambda a, b: 2.0 * a * b / (a + b) if a + b > 0.0 else 0.0,
    "smaller": min,
}
"""Mixing rules for γ_eff of two materials; each gives γ for equal materials, and 0 if one has no surface energy."""


def pairing_between(
    a: Material,
    b: Material,
    *,
    mixing: str = "geometric",
    rolling_limit: float | None = None,
    factors: tuple[float, float, float] = (1.0, 1.0, 1.0),
    surface_energy_factor: float = 1.0,
    damping: float = 0.0,
    viscous_time: float = 0.0,
    damping_ratio: float = 0.0,
) -> Pairing:
    """Contact parameters of a pair of materials.

    1/E* = Σ(1−ν²)/E, 1/G* = Σ(2−ν)/G, 1/G′ = Σ 1/G, the smaller ξ_c, and γ_eff by the mixing rule.

    Parameters
    ----------
    a, b : Material
        The materials, which may be the same.
    mixing : str, optional
        Mixing rule for γ_eff, a key of `MIXING`.
    rolling_limit : float or None, optional
        Critical rolling displacement ξ_c [m], replacing those of the materials.
    factors : tuple[float, float, float], optional
        Multipliers of k_s, k_r and k_t.
    surface_energy_factor : float, optional
        Multiplier of γ_eff.
    damping : float, optional
        Constant damping coefficient c [kg/s] of the normal mode.
    viscous_time : float, optional
        T_vis [s] of viscoelastic damping, c/a = 2 T_vis E*/(ν1 ν2) (Krijt et al. 2013); 0 for none.
    damping_ratio : float, optional
        Share ζ of the critical damping of all four modes; 0 for none.

    Returns
    -------
    Pairing
        The parameters.
    """
    modulus = 1.0 / sum((1.0 - m.poisson_ratio**2) / m.young_modulus for m in (a, b))
    viscous = 2.0 * viscous_time * modulus / (a.poisson_ratio * b.poisson_ratio) if viscous_time > 0.0 else 0.0
    slide, roll, twist = factors
    return Pairing(
        surface_energy=surface_energy_factor * MIXING[mixing](a.surface_energy, b.surface_energy),
        modulus=modulus,
        shear=1.0 / sum((2.0 - m.poisson_ratio) / m.shear_modulus for m in (a, b)),
        twist_shear=1.0 / sum(1.0 / m.shear_modulus for m in (a, b)),
        roll_limit=rolling_limit or min(a.rolling_limit, b.rolling_limit),
        slide_factor=slide,
        roll_factor=roll,
        twist_factor=twist,
        damping=damping,
        damping_per_radius=viscous,
        damping_ratio=damping_ratio,
    )
