"""How much two bodies with charges attract each other at most: multipoles about their centres of mass.

Charges q at x, with |x| ≤ a, are multipoles of all orders n.  Each is a sum of axial ones, n-fold derivatives of 1/r
along a unit vector over n!, with the weights |q||x|ⁿ; for n = 1, 2 smaller weights do, W₁ = |Σ q x| and W₂ = 2/3 (λ₁ −
λ₃) with the largest and the smallest eigenvalue of Σ q (3 x xᵀ − |x|²)/2.  For n ≥ 3 Wₙ ≤ A₃ aⁿ⁻³, A₃ = Σ|q||x|³.  No
derivative of 1/r of the order l along unit vectors is above l!/rˡ⁺¹ (Banach 1938: no different vectors give more of a
symmetric tensor than equal ones, and these give l! Pₗ/rˡ⁺¹).  So at a distance r > a + a′ of the centres

    −U ≤ C₁/r + k Σ C(n+m, n) WₙW′ₘ/rⁿ⁺ᵐ⁺¹,   C₁ = max(0, −k q q′) of the net charges, k = 1/4πε₀, n + m ≥ 1,

and the inward force is at most the derivative of this series, which so bounds its work from r to infinity, too.  From
r = R = 2 (e + e′) on, with the extents e ≥ a, the terms of n + m = 1 are C₂/r², and all others at most C₃/r³; C₃/R³ is
their sum at R.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..basics.constants import COULOMB

NEAREST = 2.0
"""Smallest distance R of the bound in units of e + e′."""


class Multipoles(NamedTuple):
    """Charges of a body, each a number or (N,): Σ|q|, Σq [C], W₁ [C m], W₂ [C m²], A₃ [C m³]."""

    charge_sum: Any = 0.0
    charge: Any = 0.0
    dipole: Any = 0.0
    quadrupole: Any = 0.0
    third: Any = 0.0


class Attraction(NamedTuple):
    """−U ≤ C₁/r + C₂/r² + C₃/r³ of charges at r ≥ R [J m, J m², J m³, m]."""

    first: Any
    second: Any
    third: Any
    nearest: Any


def multipoles_of(x: np.ndarray, charge: np.ndarray, net: float) -> Multipoles:
    """Multipoles of charges (n,) [C] at x (3, n) [m], with the net charge."""
    size = np.linalg.norm(x, axis=0)
    eigenvalues = np.linalg.eigvalsh(1.5 * (charge * x) @ x.T)  # the trace shifts all by the same
    return Multipoles(
        float(np.abs(charge).sum()),
        net,
        float(np.linalg.norm(x @ charge)),
        float(eigenvalues[2] - eigenvalues[0]) * 2.0 / 3.0,
        float((np.abs(charge) * size**3).sum()),
    )


def attraction_of(a: Any, b: Any) -> Attraction:
    """C₁, C₂, C₃ and R of two bodies, `Sizes` with their extents."""
    nearest = NEAREST * (a.extent + b.extent)
    (low1, rest1, s1), (low2, rest2, s2) = (_parts(each, nearest) for each in (a, b))
    total = rest1 * rest2 * _both(s1, s2)
    for n in range(3):
        total = total + low1[n] * rest2 * _from_three(n, s2) + low2[n] * rest1 * _from_three(n, s1)
        for m in range(max(0, 2 - n), 3):
            total = total + BINOMIAL[n][m] * low1[n] * low2[m]
    second = COULOMB * (abs(a.charge) * b.dipole + abs(b.charge) * a.dipole)
    third = COULOMB * np.maximum(0.0, total) * nearest**2  # not below 0 by rounding
    return Attraction(np.maximum(0.0, -COULOMB * a.charge * b.charge), second, third, nearest)


BINOMIAL = ((1, 1, 1), (1, 2, 3), (1, 3, 6))
"""C(n + m, n) for n, m ≤ 2."""


def _parts(body: Any, nearest: Any) -> tuple[tuple[Any, ...], Any, Any]:
    """Wₙ/Rⁿ for n ≤ 2, A₃/e³ and e/R."""
    low = abs(body.charge), body.dipole / nearest, body.quadrupole / nearest**2
    return low, body.third / body.extent**3, body.extent / nearest


def _from_three(m: int, s: Any) -> Any:
    """Σ C(n+m, n) sⁿ over n ≥ 3, for m = 0, 1, 2."""
    return s**3 * (1.0, 4.0 - 3.0 * s, 10.0 - 15.0 * s + 6.0 * s * s)[m] / (1.0 - s) ** (m + 1)


def _both(s: Any, z: Any) -> Any:
    """Σ C(n+m, n) sⁿzᵐ over n, m ≥ 3."""
    found = 1.0 / (1.0 - s - z)
    for n in range(3):
        found = found - s**n * (1.0 - z) ** -(n + 1) - z**n * _from_three(n, s)
    return found
