"""Magnetic moments of aggregates."""

from __future__ import annotations

import numpy as np


def aggregate_moments(moment: np.ndarray, labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vector sums (K, 3) [A m²] of the moments of each cluster, and their alignment |Σμ|/Σ|μ| (K,), 0 without moments.

    Parameters
    ----------
    moment : ndarray
        (N, 3) [A m²].
    labels : ndarray
        cluster of each grain (N,), 0…K−1.
    """
    mu = np.asarray(moment, float)
    sums = np.column_stack([np.bincount(labels, mu[:, axis]) for axis in range(3)])
    sizes = np.bincount(labels, np.linalg.norm(mu, axis=1))
    with np.errstate(invalid="ignore"):
        return sums, np.where(sizes > 0.0, np.linalg.norm(sums, axis=1) / sizes, 0.0)
