"""Upper bound of the rate of encounters of two bodies, from which hits are drawn by exact thinning.

No impact parameter above b̂(v) = max(e, β v^(−2/3)) leads to a hit, with the sum e of the extents of both bodies and

    β² = 3 (2k Σ|μ| Σ|μ′|/m̄)^(2/3),

the largest b of capture (Eqs. 12, 13 of Dominik & Nübold 2002) for the sum of all |μ|: the net moment misses the hits
of bodies whose moments cancel.  With charges b̂² is larger by 2Qe/m̄v², Q = Σ|q| Σ|q′|/4πε₀, the focusing of paths
that touch.  Speeds have Maxwell's distribution with s² = k_BT/m̄, so that the rate of encounters in a volume V is K̂/V,

    K̂ = π ⟨b̂² v⟩ ≤ π [β² ⟨v^(−1/3)⟩ + e² ⟨v⟩ + 2eQ/m̄ ⟨v^(−1)⟩],  ⟨v^p⟩ = s^p 2^(p/2) Γ((3+p)/2)/Γ(3/2)
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.special import gammaincinv

from ..basics.constants import BOLTZMANN, COULOMB, MAGNETIC
from .scattering.rigid_flight import contact_energy

POWERS = (-1.0 / 3.0, 1.0, -1.0)
"""p of the three parts of K̂."""


class Sizes(NamedTuple):
    """What the bound of a body needs, a number or (N,): m [kg], Σ|μ| [A m²], extent [m], Σ|q| [C]."""

    mass: Any
    strength: Any
    extent: Any
    charge: Any


class Approach(NamedTuple):
    """A pair's relative motion at a large distance."""

    speed: float  # v [m/s]
    impact_parameter: float  # b [m]
    bound: float  # b̂(v) [m]; no hit if b is larger


def mean_power(power: float, spread: Any) -> Any:
    """⟨v^p⟩ of Maxwell's distribution whose components have the standard deviation `spread` [m/s]."""
    return spread**power * 2.0 ** (0.5 * power) * math.gamma(0.5 * (3.0 + power)) / math.gamma(1.5)


class Majorant:
    """The bound at a temperature.

    Parameters
    ----------
    temperature : float
        T [K] > 0.
    widening : float, optional
        Factor of b̂ ≥ 1; results do not depend on it.
    """

    def __init__(self, temperature: float, widening: float = 1.0):
        self.heat, self.widening = BOLTZMANN * temperature, widening

    def squares(self, a: Sizes, b: Sizes) -> tuple[Any, Any, Any, Any]:
        """m̄ [kg], and the factors of v^(−4/3), 1 and v^(−2) in the bound of b̂²."""
        reduced, extent, wide = a.mass * b.mass / (a.mass + b.mass), a.extent + b.extent, self.widening**2
        far = 3.0 * np.cbrt(contact_energy(a.strength, b.strength, 1.0, MAGNETIC) / reduced) ** 2
        focusing = 2.0 * extent * COULOMB * a.charge * b.charge / reduced
        return reduced, wide * far, wide * extent**2, wide * focusing

    def parts(self, a: Sizes, b: Sizes) -> tuple[Any, Any, Any]:
        """Parts of K̂ [m³/s] for the powers `POWERS` of the speed."""
        reduced, *factors = self.squares(a, b)
        spread = np.sqrt(self.heat / reduced)
        first, second, third = (
            math.pi * factor * mean_power(power, spread) for factor, power in zip(factors, POWERS, strict=True)
        )
        return first, second, third

    def kernel(self, a: Sizes, b: Sizes) -> Any:
        """K̂ [m³/s]."""
        return sum(self.parts(a, b))

    def bound(self, a: Sizes, b: Sizes, speed: Any) -> Any:
        """b̂ [m] at a speed [m/s]."""
        _, far, near, focusing = self.squares(a, b)
        captured, grazing = far * speed ** (-4.0 / 3.0), near + focusing / speed**2
        # charges and moments together attract from farther than either
        return np.sqrt(np.where(focusing > 0.0, captured + grazing, np.maximum(captured, grazing)))

    def draw(self, a: Sizes, b: Sizes, uniforms: tuple[float, ...]) -> Approach:
        """Speed and impact parameter of an encounter, from three uniform deviates.

        One part of K̂ is drawn by its share; its speeds have x = v²/2s² of the gamma distribution of shape (3 + p)/2;
        b² is uniform up to the bound.
        """
        parts = np.cumsum(self.parts(a, b))
        part = min(int(np.searchsorted(parts, uniforms[0] * parts[-1])), len(POWERS) - 1)
        reduced, far, near, focusing = (float(each) for each in self.squares(a, b))
        x = float(gammaincinv(0.5 * (3.0 + POWERS[part]), uniforms[1]))
        speed = math.sqrt(2.0 * self.heat / reduced * x)
        square = uniforms[2] * (far * speed ** (-4.0 / 3.0) + near + focusing / speed**2)
        return Approach(speed, math.sqrt(square), float(self.bound(a, b, speed)))
