"""The polynomial of the real part of an Ewald sum of charges or dipoles, and its error.

All lengths are in units of the radius r_c, y = α r_c, s = r²/r_c², u = 2s − 1.  A charge smeared out with a Gaussian
has the potential A_s; a smeared dipole begins with B_s, and further derivatives follow:

    A_s = 2y/√π ∫₀¹ exp(−y² s v²) dv = erf(y r)/r,  B_s = −2 dA_s/ds,  C_s = −2 dB_s/ds,  D_s = −2 dC_s/ds

A polynomial p(u) replaces A_s (charges) or B_s (dipoles) for s ≤ 1.  It equals the bare 1/r or 1/r³ at r_c with its
first two derivatives: with n = 1 or 3, p = 1 − (n/4)(u − 1) + (n(n + 2)/32)(u − 1)² + (1 − u)³ Σ a_j T_j(u).  The a_j
minimise the mean square error of force and potential of two charges, or of force and flux density of two dipoles in
random directions, given errors of A, B, C and D,

    δF² = (B r)² (kq1q2)²,  δφ² = A² (kq2)²
    ⟨δF²⟩ = (r²/9) [(D r² − 3C)² + 6C²] (kμ1μ2)²,  ⟨δB²⟩ = (1/3) [(C r² − B)² + 2B²] (kμ2)²
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from ...basics.constants import COULOMB, MAGNETIC

erfc = np.vectorize(math.erfc, otypes=[float])
"""Complementary error function; the one of SciPy, which is slow to import, is not faster here."""
NODES = 128
"""Gauss–Legendre nodes in r and in v: integrands are smooth, errors below 1e-13."""
NEAR_PAIRS = 0.1
"""Weight of near pairs in the fit, beside the weight r² of a homogeneous gas, in units of r_c²."""
FIELD_WEIGHT = 10.0
"""Weight of the squared error of flux density or potential, in units r_c = 1, beside that of the force."""
TAIL = 4.0
"""Distance beyond r_c, in units of 1/α, up to which the error of omitted pairs is integrated."""
CONSTRAINTS = 3


class Sources(NamedTuple):
    """What an Ewald sum is of: charges or dipoles."""

    name: str
    order: int  # 0: charges, 1: dipoles
    k: float  # 1/(4πε₀) or μ₀/4π
    field: str  # the load beside the force of which the error is predicted
    force_size: float  # F²/(kq²/a²)² or F²/(kμ²/a⁴)² of the typical force, see `ewald`
    field_size: float  # φ²/(kq/a)² or B²/(kμ/a³)² of the typical potential or flux density
    pair_cost: float  # relative cost of a pair in the real part; 1 is 8 ns (Zen 3)
    wave_cost: float  # of a wave vector of one grain


CHARGES = Sources("charges", 0, COULOMB, "potential", 3.0, 1.0, 0.8, 0.11)
DIPOLES = Sources("dipoles", 1, MAGNETIC, "torque", 6.0, 2.0, 1.0, 0.16)


class Polynomial(NamedTuple):
    """p(u) and the rms errors of the real part: mean square loads integrated over r² dr; r_c = k = 1, q or μ = 1."""

    coefficients: tuple[float, ...]  # that of the highest power first
    force_error: float
    field_error: float


@functools.cache
def _nodes() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights in 0 … 1."""
    x, weight = np.polynomial.legendre.leggauss(NODES)
    return 0.5 * (x + 1.0), 0.5 * weight


def smeared(y: float, r: np.ndarray, order: int = 1) -> tuple[np.ndarray, ...]:
    """A_s, B_s and C_s of charges (order 0), or B_s, C_s and D_s of dipoles (order 1)."""
    v, weight = _nodes()
    factor = 2.0 / math.sqrt(math.pi) * np.exp(-np.outer((y * r) ** 2, v**2)) * weight
    return tuple(2.0**n * y ** (2 * n + 1) * (factor @ v ** (2 * n)) for n in range(order, order + 3))


def screened(y: float, r: np.ndarray, order: int = 1) -> tuple[np.ndarray, ...]:
    """A, B and C (order 0), or B, C and D (order 1) of the real part without a cut-off."""
    t = y * r
    gauss = 2.0 / math.sqrt(math.pi) * np.exp(-t * t)
    a = erfc(t)
    b = a + t * gauss
    c = 3.0 * b + 2.0 * t**3 * gauss
    return (a / r, b / r**3, c / r**5, (5.0 * c + 4.0 * t**5 * gauss) / r**7)[order : order + 3]


def _loads(order: int, r: np.ndarray, one: np.ndarray, two: np.ndarray, three: np.ndarray) -> np.ndarray:
    """Square roots of the terms of δF², then of those of δφ² or ⟨δB²⟩: (2, nodes) of charges, (4, nodes) of dipoles."""
    if order == 0:
        return np.stack([two * r, one])
    b, c, d = one, two, three
    force = (d * r**2 - 3.0 * c) * r / 3.0, math.sqrt(6.0) * c * r / 3.0
    return np.stack([*force, (c * r**2 - b) / math.sqrt(3.0), math.sqrt(2.0 / 3.0) * b])


def _fixed(order: int) -> tuple[float, float]:
    """First derivative by u of the bare 1/r or 1/r³ at r_c, and half of the second one."""
    power = 2 * order + 1
    return -power / 4.0, power * (power + 2) / 32.0


@functools.cache
def _basis(degree: int, order: int) -> np.ndarray:
    """Loads of the fixed part of p, then of each (1 − u)³ T_j, as in `_loads`: (1 + functions, terms, nodes)."""
    r, _ = _nodes()
    u = 2.0 * r**2 - 1.0
    first, second = _fixed(order)
    rows = [(1.0 + first * (u - 1.0) + second * (u - 1.0) ** 2, 2.0 * second * (u - 1.0) + first, 2.0 * second + 0 * u)]
    g, g1, g2 = (1.0 - u) ** 3, -3.0 * (1.0 - u) ** 2, 6.0 * (1.0 - u)
    for j in range(degree - CONSTRAINTS + 1):
        one = np.eye(j + 1)[j]
        t, t1, t2 = (chebyshev.chebval(u, chebyshev.chebder(one, m)) for m in range(3))
        rows.append((g * t, g1 * t + g * t1, g2 * t + 2.0 * g1 * t1 + g * t2))
    return np.array([_loads(order, r, p, -4.0 * p1, 16.0 * p2) for p, p1, p2 in rows])


def _scale(order: int) -> np.ndarray:
    """Square roots of the weights of the fit, (terms, nodes)."""
    r, weight = _nodes()
    of_loads = np.repeat([1.0, FIELD_WEIGHT], order + 1)
    return np.sqrt((r**2 + NEAR_PAIRS) * weight) * np.sqrt(of_loads)[:, None]


@functools.cache
def _solver(degree: int, order: int) -> np.ndarray:
    """The matrix that gives the a_j of the least squares from weighted loads, (functions, terms · nodes)."""
    functions = _basis(degree, order)[1:] * _scale(order)
    return np.linalg.pinv(functions.reshape(len(functions), -1).T)


@functools.lru_cache(1024)
def fitted(y: float, degree: int, order: int = 1) -> Polynomial:
    """The polynomial of this degree for y = α r_c and charges (order 0) or dipoles (order 1), with its errors."""
    r, weight = _nodes()
    rows = _basis(degree, order)
    wanted = _loads(order, r, *smeared(y, r, order)) - rows[0]
    found = _solver(degree, order) @ (wanted * _scale(order)).ravel()
    inside = ((wanted - np.tensordot(found, rows[1:], 1)) ** 2 * r**2 * weight).sum(axis=1)
    beyond = 1.0 + TAIL / y * r
    outside = (_loads(order, beyond, *screened(y, beyond, order)) ** 2 * beyond**2 * TAIL / y * weight).sum(axis=1)
    error = np.sqrt((inside + outside).reshape(2, -1).sum(axis=1))
    cubic = chebyshev.chebmul(chebyshev.poly2cheb([1.0, -3.0, 3.0, -1.0]), found)
    first, second = _fixed(order)
    fixed = chebyshev.poly2cheb([1.0 - first + second, first - 2.0 * second, second])
    powers = chebyshev.cheb2poly(chebyshev.chebadd(cubic, fixed))
    return Polynomial(tuple(map(float, powers[::-1])), float(error[0]), float(error[1]))
