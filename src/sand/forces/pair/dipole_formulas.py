"""Point dipoles (Eqs. 6, 34–39 of the paper), their smooth cut-off, and the scales of magnetic capture.

Symbols: positions x [m], moments μ [A m²], `apart` r = x1 − x2 [m], k = μ₀/4π [T m/A].
"""

import math
from typing import NamedTuple

from ...compiler.jit import formula
from ...numerics.vec import add, axpy, dot, scale, sub


class Cutoff(NamedTuple):
    """Parameters of the weight S(r²): 1 up to r_s, 0 from r_c on, twice continuously differentiable in between."""

    square: float  # r_c² [m²]; 1e300 without cut-off
    inverse_shell: float  # 1/(r_c² − r_s²) [1/m²]; 1e-200 without cut-off


@formula
def invariants(apart, inverse, moment1, moment2):
    """1/r², μ1·r, μ2·r, μ1·μ2 and (μ1·r)(μ2·r)/r² of a pair; `inverse` = 1/r."""
    inverse2 = inverse * inverse
    along1, along2 = dot(moment1, apart), dot(moment2, apart)
    return inverse2, along1, along2, dot(moment1, moment2), along1 * along2 * inverse2


@formula
def loads_of(apart, moment1, moment2, inverse3, a, b, radial):
    """Force a μ2 + b μ1 + radial r on 1; flux densities b r − inverse3 μ2 at 1 and a r − inverse3 μ1 at 2."""
    return (
        axpy(radial, apart, add(scale(a, moment2), scale(b, moment1))),
        sub(scale(b, apart), scale(inverse3, moment2)),
        sub(scale(a, apart), scale(inverse3, moment1)),
    )


@formula
def pair_load(apart, moment1, moment2, k):
    """Force on 1 [N], flux densities at 1 and at 2 [T], and energy U = −μ1·B1 [J] of a pair (Eqs. 35, 39).

    F1 = (3k/r⁵) [ (μ1·r) μ2 + (μ2·r) μ1 + (μ1·μ2 − 5 (μ1·r)(μ2·r)/r²) r ],  r = x1 − x2
    B1 = k [ 3 r (μ2·r)/r⁵ − μ2/r³ ]
    """
    inverse = 1.0 / math.sqrt(dot(apart, apart))
    inverse2, along1, along2, both, product = invariants(apart, inverse, moment1, moment2)
    inverse3 = k * inverse2 * inverse
    three = 3.0 * inverse3 * inverse2
    radial = three * (both - 5.0 * product)
    force, field1, field2 = loads_of(apart, moment1, moment2, inverse3, three * along1, three * along2, radial)
    return force, field1, field2, inverse3 * (both - 3.0 * product)


@formula
def cut_weight(square, cutoff):
    """Weight S and slope −2 dS/d(r²) [1/m²]: S = t³(10 − 15t + 6t²), t = (r_c² − r²)/(r_c² − r_s²) clipped to 0…1."""
    t = min(max((cutoff.square - square) * cutoff.inverse_shell, 0.0), 1.0)
    rest = 1.0 - t
    return t * t * t * (10.0 + t * (6.0 * t - 15.0)), 60.0 * cutoff.inverse_shell * t * t * rest * rest


@formula
def pair_load_cut(apart, moment1, moment2, k, cutoff):
    """`pair_load` for the energy S(r) U; the forces are its exact gradient, so the cut-off conserves energy.

    F = S F_dipole − U ∇S and B → S B.  Torques and r×F still cancel, since ∇S is parallel to r.
    """
    weight, slope = cut_weight(dot(apart, apart), cutoff)
    inverse = 1.0 / math.sqrt(dot(apart, apart))
    inverse2, along1, along2, both, product = invariants(apart, inverse, moment1, moment2)
    uncut3 = k * inverse2 * inverse
    energy = uncut3 * (both - 3.0 * product)
    inverse3 = weight * uncut3
    three = 3.0 * inverse3 * inverse2
    radial = three * (both - 5.0 * product) + slope * energy
    force, field1, field2 = loads_of(apart, moment1, moment2, inverse3, three * along1, three * along2, radial)
    return force, field1, field2, weight * energy


@formula
def contact_energy(moment1, moment2, distance, k):
    """|U_min| = α/d³ [J], α = 2kμμ′, of two moments aligned head to tail at a distance d (Eq. 7)."""
    return 2.0 * k * moment1 * moment2 / distance**3


@formula
def coupling(moment, distance, temperature, k, boltzmann):
    """Coupling parameter λ = k μ²/(d³ k_B T) (Eq. 1), d the sum of the radii."""
    return k * moment * moment / (distance**3 * boltzmann * temperature)


@formula
def interaction_radius(moment, distance, temperature, k, boltzmann):
    """Interaction radius R_m = 2 d λ^(1/3) [m] (Eq. 2)."""
    return 2.0 * distance * coupling(moment, distance, temperature, k, boltzmann) ** (1.0 / 3.0)


@formula
def capture_radius(moment1, moment2, reduced_mass, speed, k):
    """Largest impact parameter that leads to capture, b_max = √3 (α/(m̄ v²))^(1/3) [m] (Eqs. 12, 13).

    The expression printed as Eq. 13 in the paper is b_max².
    """
    alpha = 2.0 * k * moment1 * moment2
    return math.sqrt(3.0) * (alpha / (reduced_mass * speed * speed)) ** (1.0 / 3.0)
