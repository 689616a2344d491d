"""Multipole expansions of the potential of dipoles: index tables, and the operators of the tree sum.

The Taylor series of 1/|R + a − b|, the potential at a (from the centre of one cell) of a source at b (from the centre
of another), R the vector between the centres, contains the derivatives D_n = ∂ⁿ(1/R), n = (i, j, k).  These are
harmonic, D_{i,j,k+2} = −D_{i+2,j,k} − D_{i,j+2,k}, so that those with k ≤ 1 suffice, 2n + 1 of each degree n:

    1/|R + a − b| = Σ_n Σ_m h_n(a) h_m(−b) D_{n+m}(R),  n and m with k ≤ 1

The harmonic polynomials h_n are defined by h_0 = 1, ∂h_n/∂x = h_{n−x}, ∂h_n/∂y = h_{n−y}, and follow from Euler's
theorem |n| h_n = a·∇h_n.  A dipole at the centre of a cell has the moments M = −μ of degree 1.  Every operator is a
product of this kind:

    moments about another centre    M'_{n+m} = Σ h_n(new centre − old centre) M_m    (`add_shifted_moments`)
    local expansion from moments    L_n = Σ_m D_{n+m}(R) M_m                           (`add_expansions`)
    local expansion elsewhere       L'_n = Σ_m L_{n+m} h_m(new centre − old centre)    (`add_shifted_expansion`)

where n + m with k = 2 is replaced by the identity above.  The potential is φ(a) = Σ_n L_n h_n(a).  Terms up to the
total degree p = |n| + |m| are summed, so that the forces of two cells on each other are opposite and equal (Dehnen
2002).
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from ...basics.alignment import SIMD_WIDTH
from ...compiler.jit import loop

LANES = SIMD_WIDTH
"""Pairs of cells, or grains, that are processed together."""


class Tables(NamedTuple):
    """Indices and coefficients of the operators for expansions up to the total degree p.

    Derivatives with k ≤ 1 are sorted by degree, the first of degree n is n²; (p+1)² of them are followed by those with
    k = 2.  Moments and local expansions have the p² first indices, up to degree p − 1.
    """

    sum: np.ndarray  # (p², p²) uint32: index of n + m, for |n| + |m| ≤ p
    within: np.ndarray  # (p²,) uint32: number of indices n with |n| + |m| ≤ p, |n| < p, for each m
    inside: np.ndarray  # (p²,) uint32: number of indices n with |n| + |m| < p
    twice: np.ndarray  # (3, p(p−1)/2) uint32: indices of (i, j, 2), (i+2, j, 0) and (i, j+2, 0)
    lower: np.ndarray  # (5, (p+1)²) uint32: indices of n − x, n − y, n − z, n − 2x, n − 2y
    factor: np.ndarray  # (5, (p+1)²): their coefficients in the recurrence of D_n R²
    below: np.ndarray  # (4, p²) uint32: indices of n − x, n − y and of the two terms of ∂h_n/∂z
    share: np.ndarray  # (4, p²): their coefficients in the recurrence of h_n


def indices(degree: int) -> list[tuple[int, int, int]]:
    """(i, j, k) with k ≤ 1 up to a degree, sorted by degree."""
    found = []
    for n in range(degree + 1):
        found += [(n - j, j, 0) for j in range(n + 1)] + [(n - 1 - j, j, 1) for j in range(n)]
    return found


@functools.cache
def tables(degree: int) -> Tables:
    """The tables for expansions up to the total degree p ≥ 3."""
    every = indices(degree)
    twice = [(n - 2 - j, j, 2) for n in range(2, degree + 1) for j in range(n - 1)]
    number = {index: c for c, index in enumerate(every + twice)}
    few = every[: degree**2]
    total = np.zeros((len(few), len(few)), np.uint32)
    for a, n in enumerate(few):
        for b, m in enumerate(few):
            if sum(n) + sum(m) <= degree:
                total[a, b] = number[n[0] + m[0], n[1] + m[1], n[2] + m[2]]
    lower, factor = np.zeros((5, len(every)), np.uint32), np.zeros((5, len(every)))
    below, share = np.zeros((4, len(few)), np.uint32), np.zeros((4, len(few)))
    for c, (i, j, k) in enumerate(every[1:], 1):
        own = i + j + k
        for t, (index, value) in enumerate(
            [
                ((i - 1, j, k), -(2 * own - 1) * i / own),
                ((i, j - 1, k), -(2 * own - 1) * j / own),
                ((i, j, k - 1), -(2 * own - 1) * k / own),
                ((i - 2, j, k), -(own - 1) * i * (i - 1) / own),
                ((i, j - 2, k), -(own - 1) * j * (j - 1) / own),
            ]
        ):
            if index in number and value != 0.0:
                lower[t, c], factor[t, c] = number[index], value
        along_z = [((i, j, 0), 1.0)] if k == 1 else [((i - 2, j, 1), -1.0), ((i, j - 2, 1), -1.0)]
        for t, (index, value) in enumerate([((i - 1, j, k), 1.0), ((i, j - 1, k), 1.0), *along_z]):
            if c < len(few) and index in number:
                below[t, c], share[t, c] = number[index], value / own
    return Tables(
        total,
        np.array([min(degree - sum(m) + 1, degree) ** 2 for m in few], np.uint32),
        np.array([(degree - sum(m)) ** 2 for m in few], np.uint32),
        np.array(
            [[number[i, j, 2], number[i + 2, j, 0], number[i, j + 2, 0]] for i, j, _ in twice], np.uint32
        ).T.copy(),
        lower,
        factor,
        below,
        share,
    )


@loop
def set_derivatives(tables, derivative, row, x, y, z):
    """D_n of 1/R for R = (x, y, z), (LANES,) each, with k ≤ 2; `row` is a buffer.

    |n| R² D_n + (2|n| − 1) Σ_e n_e R_e D_{n−e} + (|n| − 1) Σ_e n_e (n_e − 1) D_{n−2e} = 0, e = x, y, z.
    """
    for s in range(LANES):
        derivative[0, s] = 1.0 / np.sqrt(x[s] * x[s] + y[s] * y[s] + z[s] * z[s])
    for c in range(1, tables.lower.shape[1]):
        c0, c1, c2, c3, c4 = (
            tables.lower[0, c], tables.lower[1, c], tables.lower[2, c], tables.lower[3, c], tables.lower[4, c]
        )  # fmt: skip
        f0, f1, f2, f3, f4 = (
            tables.factor[0, c], tables.factor[1, c], tables.factor[2, c], tables.factor[3, c], tables.factor[4, c]
        )  # fmt: skip
        for s in range(LANES):
            first = f0 * x[s] * derivative[c0, s] + f1 * y[s] * derivative[c1, s] + f2 * z[s] * derivative[c2, s]
            inverse = derivative[0, s] * derivative[0, s]
            row[s] = inverse * (first + f3 * derivative[c3, s] + f4 * derivative[c4, s])
        for s in range(LANES):
            derivative[c, s] = row[s]
    for t in range(tables.twice.shape[1]):
        c, c0, c1 = tables.twice[0, t], tables.twice[1, t], tables.twice[2, t]
        for s in range(LANES):
            row[s] = -derivative[c0, s] - derivative[c1, s]
        for s in range(LANES):
            derivative[c, s] = row[s]


@loop
def set_harmonics(tables, harmonic, row, count, x, y, z):
    """The first `count` polynomials h_n(x, y, z), (LANES,) each; `row` is a buffer."""
    for s in range(LANES):
        harmonic[0, s] = 1.0
    for c in range(1, count):
        c0, c1, c2, c3 = tables.below[0, c], tables.below[1, c], tables.below[2, c], tables.below[3, c]
        f0, f1, f2, f3 = tables.share[0, c], tables.share[1, c], tables.share[2, c], tables.share[3, c]
        for s in range(LANES):
            along_z = f2 * harmonic[c2, s] + f3 * harmonic[c3, s]
            row[s] = f0 * x[s] * harmonic[c0, s] + f1 * y[s] * harmonic[c1, s] + z[s] * along_z
        for s in range(LANES):
            harmonic[c, s] = row[s]


@loop
def add_expansions(tables, derivative, moment, local):
    """Local expansions L_n = Σ_m D_{n+m} M_m of LANES pairs of cells; arrays (…, LANES)."""
    for m in range(1, tables.within.size):
        for n in range(1, tables.within[m]):
            c = tables.sum[m, n]
            for s in range(LANES):
                local[n, s] += derivative[c, s] * moment[m, s]


@loop
def complete(tables, values):
    """Set the entries with k = 2 of harmonic coefficients (E,) from those with k = 0."""
    for t in range(tables.twice.shape[1]):
        values[tables.twice[0, t]] = -values[tables.twice[1, t]] - values[tables.twice[2, t]]


@loop
def fold(tables, values):
    """Replace the entries with k = 2 of moments (E,) by entries with k = 0 that have the same potential."""
    for t in range(tables.twice.shape[1]):
        c, c0, c1 = tables.twice[0, t], tables.twice[1, t], tables.twice[2, t]
        values[c0] -= values[c]
        values[c1] -= values[c]
        values[c] = 0.0


@loop
def add_moments(tables, harmonic, moment, total):
    """Moments M_{n+m} += −h_n(−b) μ_m of LANES dipoles at b, |m| = 1; `harmonic` is h(−b), `moment` μ (3, LANES)."""
    for m in range(1, 4):
        for n in range(tables.inside[m]):
            c = tables.sum[m, n]
            for s in range(LANES):
                total[c, s] -= harmonic[n, s] * moment[m - 1, s]


@loop
def add_shifted_moments(tables, harmonic, moment, total):
    """Moments about another centre, M_{n+m} += Σ h_n M_m, from M (p²,) and h(new centre − old centre)."""
    for m in range(1, tables.inside.size):
        for n in range(tables.inside[m]):
            total[tables.sum[m, n]] += harmonic[n, 0] * moment[m]


@loop
def add_shifted_expansion(tables, harmonic, complete_local, local):
    """Local expansion elsewhere, L'_n += Σ_m L_{n+m} h_m, from complete L (E,) and h(new centre − old centre)."""
    for m in range(tables.inside.size):
        for n in range(1, tables.inside[m]):
            local[n] += complete_local[tables.sum[m, n]] * harmonic[m, 0]


@loop
def add_derivatives(tables, harmonic, complete_local, derivative):
    """First and second derivatives Σ_m L_{n+m} h_m of φ, |n| ≤ 2, at LANES points; `derivative` (9, LANES)."""
    for m in range(tables.inside.size):
        for n in range(1, min(tables.inside[m], np.uint32(9))):
            c = tables.sum[m, n]
            for s in range(LANES):
                derivative[n, s] += complete_local[c] * harmonic[m, s]
