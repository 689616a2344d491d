"""Upper bound of the rate of encounters of two bodies, from which hits are drawn by exact thinning.

Encounters are drawn up to the impact parameter b̂(v),

    b̂² = β² v^(−4/3) + e² + 2 (Q/m̄v²) (e + r_c),   β² = 3 (α/m̄)^(2/3),   r_c = (α/m̄v²)^(1/3),
    α = 2k Σ|μ| Σ|μ′|,   Q = Σ|q| Σ|q′|/4πε₀,

with the sum e of the extents of both bodies.  All moments and charges at the centres, aligned, have the potential
−Q/r − α/r³; sums of |μ| and |q|, as bodies whose net moments vanish attract each other, too.  A path that leads to a
touch passes all r ≥ e, and its angular momentum m̄bv lets it pass r only if

    b² ≤ f(r) = r² + 2Qr/m̄v² + 2 r_c³/r.

So each f(r) with r ≥ e bounds b².  Take the larger one of e and r_c: f(r_c) = 3 r_c² + 2Q r_c/m̄v² with 3 r_c² =
β² v^(−4/3), the capture of Eqs. 12, 13 of Dominik & Nübold 2002; and f(e) = e² + 2Qe/m̄v² + 2 r_c³/e, of which the last
term is below 2 r_c² if e > r_c.  Both are at most b̂².  Grains that are nearer than the centres of their bodies and
energy of rotation that becomes one of motion are not in this estimate: flights with a wider bound show that b̂ holds.
Charges of both signs attract each other far less than Q/r.  As each r ≥ e will do, b̂² also holds with R in place of e
and C₁ + C₂/R + C₃/R² in place of Q (`dilute_charges`); it is made 1.1 times as wide for what rotation gives to the
motion, up to 0.03 of b̂ of slow bodies without spin.  Of both a pair has the one with the smaller K̂.

Speeds have Maxwell's distribution with s² = k_BT/m̄, so that the rate of encounters in a volume V is K̂/V,

    K̂ = π ⟨b̂² v⟩ = π [β² ⟨v^(−1/3)⟩ + e² ⟨v⟩ + 2eQ/m̄ ⟨v^(−1)⟩ + 2 (Q/m̄) (α/m̄)^(1/3) ⟨v^(−5/3)⟩],
    ⟨v^p⟩ = s^p 2^(p/2) Γ((3+p)/2)/Γ(3/2)
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.special import gammaincinv

from ..basics.constants import BOLTZMANN, COULOMB, MAGNETIC
from .dilute_charges import attraction_of
from .scattering.rigid_flight import contact_energy

POWERS = (-1.0 / 3.0, 1.0, -1.0, -5.0 / 3.0)
"""p of the parts of K̂, ⟨v^p⟩; those of b̂² have v^(p − 1)."""
MEANS = tuple(2.0 ** (0.5 * p) * math.gamma(0.5 * (3.0 + p)) / math.gamma(1.5) for p in POWERS)
"""⟨v^p⟩/s^p of Maxwell's distribution."""
SPARE = 1.1
"""Factor of b̂ where it is that of the multipoles of charges."""


class Sizes(NamedTuple):
    """What the bound of a body needs, a number or (N,): m [kg], Σ|μ| [A m²], extent [m], `Multipoles`, V [m/s]."""

    mass: Any
    moment_sum: Any
    extent: Any
    charge_sum: Any = 0.0
    charge: Any = 0.0
    dipole: Any = 0.0
    quadrupole: Any = 0.0
    third: Any = 0.0
    vx: Any = 0.0  # of bodies that keep their motion
    vy: Any = 0.0
    vz: Any = 0.0


class Approach(NamedTuple):
    """A pair's relative motion at a large distance."""

    speed: float  # v [m/s]
    impact_parameter: float  # b [m]
    bound: float  # b̂(v) [m]


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

    def squares(self, a: Sizes, b: Sizes) -> tuple[Any, ...]:
        """m̄ [kg], and the factors of v^(p − 1) in b̂² for the powers `POWERS`."""
        reduced, extent, wide = a.mass * b.mass / (a.mass + b.mass), a.extent + b.extent, self.widening**2
        root = np.cbrt(contact_energy(a.moment_sum, b.moment_sum, 1.0, MAGNETIC) / reduced)

        def factors(distance: Any, product: Any, wide: float) -> tuple[Any, ...]:
            focusing = 2.0 * wide * product / reduced
            return reduced, 3.0 * wide * root**2, wide * distance**2, focusing * distance, focusing * root

        centred = factors(extent, COULOMB * a.charge_sum * b.charge_sum, wide)
        if not np.any(centred[3]):
            return centred
        first, second, third, nearest = attraction_of(a, b)
        other = factors(nearest, first + second / nearest + third / nearest**2, wide * SPARE**2)
        is_smaller = sum(self._parts(*other)) < sum(self._parts(*centred))
        return tuple(np.where(is_smaller, new, old) for new, old in zip(other, centred, strict=True))

    def kernel(self, a: Sizes, b: Sizes) -> Any:
        """K̂ [m³/s]."""
        return sum(self._parts(*self.squares(a, b)))

    def bound(self, a: Sizes, b: Sizes, speed: Any) -> Any:
        """b̂ [m] at a speed [m/s]."""
        return np.sqrt(_square(self.squares(a, b)[1:], speed))

    def draw(self, a: Sizes, b: Sizes, uniforms: tuple[float, ...]) -> Approach:
        """Speed and impact parameter of an encounter, from three uniform deviates.

        One part of K̂ is drawn by its share; its speeds have x = v²/2s² of the gamma distribution of shape (3 + p)/2;
        b² is uniform in (0, b̂²).
        """
        reduced, *factors = self.squares(a, b)
        parts = np.cumsum(self._parts(reduced, *factors))
        part = min(int(np.searchsorted(parts, uniforms[0] * parts[-1])), len(POWERS) - 1)
        x = float(gammaincinv(0.5 * (3.0 + POWERS[part]), uniforms[1]))
        speed = math.sqrt(2.0 * self.heat / reduced * x)
        square = float(_square(factors, speed))
        return Approach(speed, math.sqrt(uniforms[2] * square), math.sqrt(square))

    def _parts(self, reduced: Any, *factors: Any) -> list[Any]:
        """Parts of K̂ [m³/s] for the powers `POWERS` of the speed."""
        spread = np.sqrt(self.heat / reduced)
        return [math.pi * f * mean * spread**p for p, mean, f in zip(POWERS, MEANS, factors, strict=True)]


def _square(factors: Any, speed: Any) -> Any:
    """b̂² [m²] at a speed [m/s]."""
    return sum(factor * speed ** (power - 1.0) for power, factor in zip(POWERS, factors, strict=True))
