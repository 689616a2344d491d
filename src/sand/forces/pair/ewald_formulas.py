"""The real part of an Ewald sum: bare interactions less a polynomial in r², which vanish at the radius r_c.

Ewald's real part is the interaction of bare dipoles less that of dipoles smeared out with a Gaussian,

    B(r) = 1/r³ − B_s(r),  C = −B′/r,  D = −C′/r,  B_s = [erf(αr) − 2αr/√π exp(−α²r²)]/r³
    U = k [B μ1·μ2 − C (μ1·r)(μ2·r)]

and, for charges, A(r) = 1/r − A_s(r), B = −A′/r, A_s = erf(αr)/r, U = k A q1 q2.  A_s and B_s are entire functions of
r².  Here they are polynomials p(u), u = 2 r²/r_c² − 1, fitted for 0 ≤ r ≤ r_c under the condition that the real part
and its first two derivatives are 0 at r_c (`ewald_fit`).  B, C and D are exact derivatives of these polynomials: forces
and torques are those of an energy that is continuous at r_c with its first derivatives, whatever the accuracy.
"""

import functools
import math
from collections.abc import Callable

from ...compiler.jit import formula
from ...numerics.vec import dot, scale
from .dipole_formulas import invariants, loads_of

CHUNK = 4
"""Coefficients of a polynomial that one function evaluates: fewer functions compile faster."""


@functools.cache
def polynomial(degree: int) -> Callable:
    """`p(u, coefficients)` → p, p′, p″/2 by Horner's rule, for a degree that is a multiple of 4.

    `coefficients` is a tuple of degree + 1 numbers, that of the highest power first.
    """
    if degree == 0:

        @formula
        def constant(u, coefficients):
            return coefficients[0], 0.0, 0.0

        return constant
    lower = polynomial(degree - CHUNK)
    n = degree - CHUNK + 1
    second, third, last = n + 1, n + 2, n + 3

    @formula
    def four_more(u, coefficients):
        p, p1, p2 = lower(u, coefficients)
        p2, p1, p = p2 * u + p1, p1 * u + p, p * u + coefficients[n]
        p2, p1, p = p2 * u + p1, p1 * u + p, p * u + coefficients[second]
        p2, p1, p = p2 * u + p1, p1 * u + p, p * u + coefficients[third]
        return p * u + coefficients[last], p1 * u + p, p2 * u + p1

    return four_more


@functools.cache
def real_part(degree: int) -> Callable:
    """The pair formula of the real part of dipoles, with a polynomial of this degree.

    `f(apart, moment1, moment2, k, stretch, coefficients)` → force on 1 [N], flux densities at 1 and 2 [T], energy [J];
    `apart` r = x1 − x2 [m], `stretch` = 2/r_c² [1/m²], coefficients of B_s [1/m³]; for r ≤ r_c, finite beyond.
    """
    smooth = polynomial(degree)

    @formula
    def pair_loads(apart, moment1, moment2, k, stretch, coefficients):
        square = dot(apart, apart)
        inverse = 1.0 / math.sqrt(square)
        inverse2, along1, along2, both, _ = invariants(apart, inverse, moment1, moment2)
        p, p1, p2 = smooth(min(square * stretch - 1.0, 1.0), coefficients)
        inverse3 = inverse2 * inverse
        inverse5 = 3.0 * inverse3 * inverse2
        b = k * (inverse3 - p)
        c = k * (inverse5 + 2.0 * stretch * p1)
        d = k * (5.0 * inverse5 * inverse2 - 8.0 * stretch * stretch * p2)
        radial = c * both - d * along1 * along2
        force, field1, field2 = loads_of(apart, moment1, moment2, b, c * along1, c * along2, radial)
        return force, field1, field2, b * both - c * along1 * along2

    return pair_loads


@functools.cache
def real_part_of_charges(degree: int) -> Callable:
    """The pair formula of the real part of charges, with a polynomial of this degree.

    `f(apart, product, stretch, coefficients)` → force on 1 [N], energy [J]; `product` = k q1 q2 [N m²], `stretch` =
    2/r_c² [1/m²], coefficients of A_s [1/m]; for r ≤ r_c, finite beyond.
    """
    smooth = polynomial(degree)

    @formula
    def pair_force(apart, product, stretch, coefficients):
        square = dot(apart, apart)
        inverse = 1.0 / math.sqrt(square)
        p, p1, _ = smooth(min(square * stretch - 1.0, 1.0), coefficients)
        b = product * (inverse * inverse * inverse + 2.0 * stretch * p1)
        return scale(b, apart), product * (inverse - p)

    return pair_force
