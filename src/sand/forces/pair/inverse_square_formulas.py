"""Central forces of inverse-square type: Coulomb forces and Newtonian attraction.

U = k q1 q2/r with k = 1/(4πε₀) for charges and −G for masses; with a cut-off U → S(r) U, as for dipoles.
"""

import math

from ...compiler.jit import formula
from ...numerics.vec import axpy, dot, scale
from .dipole_formulas import cut_weight
from .dipole_rates import cut_curvature


@formula
def central_field(apart, k, cutoff):
    """Force on 1 per unit of both charges, F1/(q1 q2) = k (S/r³ + s/r) r, r = x1 − x2, s = −2 dS/d(r²)."""
    square = dot(apart, apart)
    weight, slope = cut_weight(square, cutoff)
    inverse = 1.0 / math.sqrt(square)
    return scale(k * inverse * (weight * inverse * inverse + slope), apart)


@formula
def central_potential(apart, k, cutoff):
    """Energy per unit of both charges, U/(q1 q2) = k S/r."""
    square = dot(apart, apart)
    return k * cut_weight(square, cutoff)[0] / math.sqrt(square)


@formula
def central_rate(apart, moving, k, cutoff):
    """Rate of change of `central_field` for ṙ = v1 − v2 (`moving`) [m/s]."""
    square, radial = dot(apart, apart), dot(apart, moving)
    weight, slope = cut_weight(square, cutoff)
    slope_rate = 2.0 * cut_curvature(square, cutoff) * radial
    inverse = 1.0 / math.sqrt(square)
    inverse2 = inverse * inverse
    grow = -slope * radial * inverse2 - 3.0 * weight * radial * inverse2 * inverse2
    grow += slope_rate - slope * radial * inverse2
    return scale(k * inverse, axpy(grow, apart, scale(weight * inverse2 + slope, moving)))
