"""The virial of the reciprocal part of an Ewald sum, in NumPy: it is needed for output only.

With the energies U_q of the wave vectors q, as in `ewald_loops` and `mesh_loops`, Σ_q U_q = U, and the structure
factors S(q) of charges q_j, or of dipoles, S = Σ (μ_j·q) exp(i q·x_j), the virial W_ab = −∂U/∂ε_ba at fixed α is

    W_ab = Σ_q U_q [δ_ab − 2 q_a q_b (1/q² + 1/4α²)] − Σ_j μ_ja B_jb + δ_ab U_mean

(Nosé & Klein 1983, Mol. Phys. 50, 1055; Aguado & Madden 2003, J. Chem. Phys. 119, 7471).  B_j is the flux density of
the waves at dipole j, that of the dipole itself included; charges have no such term.  The energy U_mean, of the uniform
background of charges or of the boundary of dipoles in vacuum, is proportional to 1/V.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ...basics.alignment import SIMD_WIDTH
from ...compiler.recipes import factory
from ...numerics.flow import compression

NEGLIGIBLE = 1e-15
"""Waves of a mesh with an influence below this fraction of the largest one are left out: their φ̂ is noise."""
AT_ONCE = 1_000_000
"""Largest number of phases exp(i q·x) in memory."""


def _tensor(energy: np.ndarray, q: np.ndarray, alpha: float) -> np.ndarray:
    """Σ U_q [δ_ab − 2 q_a q_b (1/q² + 1/4α²)] [J] for energies U_q (K,) and wave vectors q (K, 3) ≠ 0."""
    weight = 2.0 * energy * (1.0 / (q * q).sum(axis=1) + 0.25 / alpha**2)
    return np.asarray(energy.sum() * np.eye(3) - (q.T * weight) @ q)


def _of_mean(grains: Any, parameters: Any, span: Any, *, dipoles: bool) -> np.ndarray:
    """δ_ab U_mean [J]."""
    mean_field = parameters.mean_field * compression(parameters.volume, span)
    total = grains.moment.sum(axis=1) if dipoles else grains.charge.sum()
    return np.asarray((-0.5 if dipoles else 0.5) * mean_field * (total**2).sum() * np.eye(3))


def _own_waves(grains: Any, vectors: np.ndarray, span: Any, parameters: Any, *, dipoles: bool) -> np.ndarray:
    """What the summed waves give by the own charge or dipole of each grain, to be removed as in `ewald.own_field`.

    The integral over the sphere q < Q that has the volume of the vectors is (k/3π) q_j² Q exp(−Q²/4α²) δ_ab of a charge
    and (k/15π) (δ_ab μ² + 2 μ_a μ_b) Q³ exp(−Q²/4α²) of a dipole; it vanishes for all vectors.
    """
    volume = 1.0 / (span.inverse_x * span.inverse_y * span.inverse_z)
    number = np.where(vectors[:, :2].any(axis=1), 2.0, 1.0).sum() + 1.0  # with opposites, along z given already, and 0
    largest = (6.0 * math.pi**2 * number / volume) ** (1.0 / 3.0)
    size = parameters.k / math.pi * math.exp(-((0.5 * largest / parameters.alpha) ** 2))
    if not dipoles:
        return np.asarray(size * largest / 3.0 * (grains.charge**2).sum() * np.eye(3))
    square = grains.moment @ grains.moment.T
    return np.asarray(size * largest**3 / 15.0 * (square.trace() * np.eye(3) + 2.0 * square))


def _vectors(waves: Any, span: Any) -> tuple[np.ndarray, np.ndarray]:
    """Half of the wave vectors (K, 3) [1/m], as the loops sum them, and their weights (K,)."""
    n_x, n_y, number, first = waves.column
    column = np.repeat(np.arange(number.size), number)
    m = np.arange(column.size) - np.repeat(np.cumsum(number) - number, number)
    n, weight = np.stack([n_x[column], n_y[column], m], axis=1), waves.weight[first[column] + m]
    n, weight = np.concatenate([n, n[m > 0] * [1, 1, -1]]), np.concatenate([weight, weight[m > 0]])
    used = n.any(axis=1)
    return 2.0 * math.pi * n[used] * [span.inverse_x, span.inverse_y, span.inverse_z], weight[used]


@factory
def direct_virial(dipoles: bool) -> Callable:
    """`LongRangeSums.reciprocal_virial` of a sum over wave vectors, of dipoles or of charges."""

    def virial(grains: Any, span: Any, parameters: Any) -> np.ndarray:
        vectors, weights = _vectors(parameters.waves, span)
        found = _of_mean(grains, parameters, span, dipoles=dipoles)
        parts = max(1, len(vectors) * grains.mass.size // AT_ONCE)
        for q, weight in zip(np.array_split(vectors, parts), np.array_split(weights, parts), strict=True):
            wave = np.exp(1j * (q @ grains.position))
            if dipoles:
                moments = wave @ grains.moment.T
                factor = (moments * q).sum(axis=1)
                found += (weight[:, None] * (factor.conj()[:, None] * moments).real).T @ q
            else:
                factor = wave @ grains.charge
            found += _tensor(0.5 * weight * np.abs(factor) ** 2, q, parameters.alpha)
        return found - _own_waves(grains, vectors, span, parameters, dipoles=dipoles)

    return virial


@factory
def mesh_virial(dipoles: bool) -> Callable:
    """`LongRangeSums.reciprocal_virial` of a mesh, which holds the potential φ after its rounds, U_q = |φ̂|²/(2 N G).

    The derivative of the influence function is taken as that of exp(−q²/4α²)/q²: like the forces, the virial has errors
    by aliases.
    """

    def virial(grains: Any, span: Any, parameters: Any) -> np.ndarray:
        from scipy.fft import rfftn  # slow import

        mesh, found = parameters.mesh, _of_mean(grains, parameters, span, dipoles=dipoles)
        potential = mesh.density[..., : mesh.density.shape[2] - (SIMD_WIDTH - 1)]
        spectrum, size = np.abs(rfftn(potential)) ** 2, potential.shape
        numbers = [np.fft.fftfreq(size[0], 1.0 / size[0]), np.fft.fftfreq(size[1], 1.0 / size[1])]
        numbers.append(np.arange(size[2] // 2 + 1.0))
        inverse = span.inverse_x, span.inverse_y, span.inverse_z
        q_x, q_y, q_z = (2.0 * math.pi * n * each for n, each in zip(numbers, inverse, strict=True))
        twice = np.where((numbers[2] == 0.0) | (2.0 * numbers[2] == size[2]), 1.0, 2.0)  # q_z and −q_z
        least = NEGLIGIBLE * mesh.influence.max()
        for k in range(size[0]):
            q = np.stack(np.broadcast_arrays(q_x[k], q_y[:, None], q_z), axis=-1)
            used = mesh.influence[k] > least
            energy = twice * spectrum[k] / (2.0 * potential.size * np.where(used, mesh.influence[k], np.inf))
            found += _tensor(energy[used], q[used], parameters.alpha)
        return found - grains.moment @ mesh.field.T if dipoles else found

    return virial
