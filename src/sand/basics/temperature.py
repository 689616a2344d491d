"""Temperature of the translation of grains and clusters."""

from __future__ import annotations

import numpy as np

from .constants import BOLTZMANN
from .grains import Grains


def sums_of_clusters(
    grains: Grains, labels: np.ndarray | None, vectors: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass [kg], sum of vectors (K, 3) and number of grains of each cluster, or of each grain if `labels` is None."""
    if labels is None:
        return grains.mass, vectors, np.ones(len(grains), int)
    sums = np.column_stack([np.bincount(labels, vectors[:, axis]) for axis in range(3)])
    return np.bincount(labels, grains.mass), sums, np.bincount(labels)


def kinetic_temperature(grains: Grains, labels: np.ndarray | None = None) -> float:
    """T [K] from the translational energy (3/2) (N − 1) k_B T of N grains in the centre-of-mass frame; 0 for one grain.

    The momentum is zero in this frame, so that 3 (N − 1) degrees of freedom are left. With `labels` (N,), the cluster
    of each grain, it is that of the translation of the clusters.
    """
    mass, momentum, _ = sums_of_clusters(grains, labels, grains.mass[:, None] * grains.velocity)
    velocity = grains.velocity if labels is None else momentum / mass[:, None]
    drift = momentum.sum(axis=0) / mass.sum()
    energy = 0.5 * (mass * ((velocity - drift) ** 2).sum(axis=1)).sum()
    return float(2.0 * energy / (3.0 * max(len(mass) - 1, 1) * BOLTZMANN))
