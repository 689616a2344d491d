"""The polynomial of the real part of an Ewald sum of dipoles, and its error.

All lengths are in units of the radius r_c, y = α r_c, s = r²/r_c², u = 2s − 1.  The smeared dipole has

    B_s = y³ h(y² s),  C_s = −2 dB_s/ds,  D_s = 4 d²B_s/ds²,  h(t) = 4/√π ∫₀¹ v² exp(−t v²) dv

A polynomial p(u) replaces B_s for s ≤ 1.  With p(1) = 1, p′(1) = −3/4, p″(1) = 15/16 it equals the bare dipole at
r_c in B, C and D: p = 1 − ¾(u − 1) + 15/32 (u − 1)² + (1 − u)³ Σ a_j T_j(u).  The a_j minimise the mean square error
of force and flux density of two dipoles in random directions, given errors b, c, d of B, C and D,

    ⟨δF²⟩ = (r²/9) [(D r² − 3C)² + 6C²] (kμ1μ2)²,  ⟨δB²⟩ = (1/3) [(C r² − B)² + 2B²] (kμ2)²
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

NODES = 128
"""Gauss–Legendre nodes in r and in v: integrands are smooth, errors below 1e-13."""
NEAR_PAIRS = 0.1
"""Weight of near pairs in the fit, beside the weight r² of a homogeneous gas, in units of r_c²."""
FIELD_WEIGHT = 10.0
"""Weight of the squared error of the flux density, in units r_c = 1, beside that of the force."""
TAIL = 4.0
"""Distance beyond r_c, in units of 1/α, up to which the error of omitted pairs is integrated."""
CONSTRAINTS = 3


class Polynomial(NamedTuple):
    """p(u) and the rms errors of the real part: mean square loads integrated over r² dr, r_c = 1, k = μ = 1."""

    coefficients: tuple[float, ...]  # that of the highest power first
    force_error: float
    field_error: float


@functools.cache
def _nodes() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights in 0 … 1."""
    x, weight = np.polynomial.legendre.leggauss(NODES)
    return 0.5 * (x + 1.0), 0.5 * weight


def smeared(y: float, r: np.ndarray) -> tuple[np.ndarray, ...]:
    """B_s, C_s and D_s."""
    v, weight = _nodes()
    factor = 4.0 / math.sqrt(math.pi) * np.exp(-np.outer((y * r) ** 2, v**2)) * weight
    return y**3 * (factor @ v**2), 2.0 * y**5 * (factor @ v**4), 4.0 * y**7 * (factor @ v**6)


def screened(y: float, r: np.ndarray) -> tuple[np.ndarray, ...]:
    """B, C and D of the real part without a cut-off."""
    from scipy.special import erfc  # slow import

    t = y * r
    gauss = 2.0 / math.sqrt(math.pi) * np.exp(-t * t)
    b = erfc(t) + t * gauss
    c = 3.0 * b + 2.0 * t**3 * gauss
    return b / r**3, c / r**5, (5.0 * c + 4.0 * t**5 * gauss) / r**7


def _loads(r: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Square roots of the terms of ⟨δF²⟩ (2) and ⟨δB²⟩ (2), (4, nodes)."""
    force = (d * r**2 - 3.0 * c) * r / 3.0, math.sqrt(6.0) * c * r / 3.0
    return np.stack([*force, (c * r**2 - b) / math.sqrt(3.0), math.sqrt(2.0 / 3.0) * b])


@functools.cache
def _basis(degree: int) -> np.ndarray:
    """Loads of the fixed part of p, then of each (1 − u)³ T_j, in the form of `_loads`: (1 + functions, 4, nodes)."""
    r, _ = _nodes()
    u = 2.0 * r**2 - 1.0
    rows = [
        (1.0 - 0.75 * (u - 1.0) + 15.0 / 32.0 * (u - 1.0) ** 2, 15.0 / 16.0 * (u - 1.0) - 0.75, 15.0 / 16.0 + 0 * u)
    ]
    g, g1, g2 = (1.0 - u) ** 3, -3.0 * (1.0 - u) ** 2, 6.0 * (1.0 - u)
    for j in range(degree - CONSTRAINTS + 1):
        one = np.eye(j + 1)[j]
        t, t1, t2 = (chebyshev.chebval(u, chebyshev.chebder(one, m)) for m in range(3))
        rows.append((g * t, g1 * t + g * t1, g2 * t + 2.0 * g1 * t1 + g * t2))
    return np.array([_loads(r, p, -4.0 * p1, 16.0 * p2) for p, p1, p2 in rows])


def _scale() -> np.ndarray:
    """Square roots of the weights of the fit, (4, nodes)."""
    r, weight = _nodes()
    return np.sqrt((r**2 + NEAR_PAIRS) * weight) * np.sqrt([1.0, 1.0, FIELD_WEIGHT, FIELD_WEIGHT])[:, None]


@functools.cache
def _solver(degree: int) -> np.ndarray:
    """The matrix that gives the a_j of the least squares from weighted loads, (functions, 4 · nodes)."""
    functions = _basis(degree)[1:] * _scale()
    return np.linalg.pinv(functions.reshape(len(functions), -1).T)


@functools.lru_cache(1024)
def fitted(y: float, degree: int) -> Polynomial:
    """The polynomial of this degree for y = α r_c, with its errors."""
    r, weight = _nodes()
    rows = _basis(degree)
    wanted = _loads(r, *smeared(y, r)) - rows[0]
    found = _solver(degree) @ (wanted * _scale()).ravel()
    inside = ((wanted - np.tensordot(found, rows[1:], 1)) ** 2 * r**2 * weight).sum(axis=1)
    beyond = 1.0 + TAIL / y * r
    outside = (_loads(beyond, *screened(y, beyond)) ** 2 * beyond**2 * TAIL / y * weight).sum(axis=1)
    error = np.sqrt((inside + outside).reshape(2, 2).sum(axis=1))
    cubic = chebyshev.chebmul(chebyshev.poly2cheb([1.0, -3.0, 3.0, -1.0]), found)
    powers = chebyshev.cheb2poly(chebyshev.chebadd(cubic, chebyshev.poly2cheb([2.21875, -1.6875, 0.46875])))
    return Polynomial(tuple(map(float, powers[::-1])), float(error[0]), float(error[1]))
