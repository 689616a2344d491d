"""Motion of the grains of a cluster relative to its rigid motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arguments import checked
from ..box import Box
from .clusters import cluster_labels, unwrapped

__all__ = ["internal_kinetic_energy"]


@checked
def internal_kinetic_energy(grains: Any, pairs: np.ndarray, box: Box) -> tuple[np.ndarray, np.ndarray]:
    """Kinetic energy of each cluster beyond its rigid motion: the vibration of its contacts.

    K − P²/2M − ½ Ω·J Ω,  Ω = J⁻¹ L, with momentum P, angular momentum L about the centre of mass (spins included) and
    the inertia tensor J = Σ [m (s² 1 − s s) + I 1].  A cluster of n > 1 grains has 6n − 6 internal degrees of freedom,
    each with a mean kinetic energy of ½ k_B T in equilibrium; a single grain has none.

    Parameters
    ----------
    grains : Grains
        Grains of a simulation or a frame.
    pairs : ndarray
        Contacts (C, 2).
    box : Box
        Boundary conditions.

    Returns
    -------
    energy : ndarray
        Internal kinetic energy of each cluster [J], (K,).
    degrees : ndarray
        Internal degrees of freedom of each cluster, (K,).
    """
    labels = cluster_labels(len(grains), pairs)
    count = int(labels.max()) + 1
    members = np.bincount(labels, minlength=count)
    degrees = np.where(members > 1, 6 * members - 6, 0)
    if count == len(labels):
        return np.zeros(count), degrees
    mass, inertia = np.asarray(grains.mass), np.asarray(grains.inertia)
    velocity, spin = np.asarray(grains.velocity), np.asarray(grains.spin)

    def summed(values: np.ndarray) -> np.ndarray:
        total = np.zeros((count, *values.shape[1:]))
        np.add.at(total, labels, values)
        return total

    position = unwrapped(np.asarray(grains.position), pairs, box)
    total = summed(mass)[:, None]
    s = position - (summed(mass[:, None] * position) / total)[labels]
    u = velocity - (summed(mass[:, None] * velocity) / total)[labels]
    angular = summed(mass[:, None] * np.cross(s, u) + inertia[:, None] * spin)
    own = (mass * (s * s).sum(axis=1) + inertia)[:, None, None] * np.eye(3)
    tensor = summed(own - mass[:, None, None] * s[:, :, None] * s[:, None, :])
    rotation = np.linalg.solve(tensor, angular[:, :, None])[:, :, 0]
    # as the energy of velocities relative to the rigid motion, which has no differences of large numbers
    turning = rotation[labels]
    v, w = u - np.cross(turning, s), spin - turning
    energy = summed(0.5 * mass * (v * v).sum(axis=1) + 0.5 * inertia * (w * w).sum(axis=1))
    return np.where(members > 1, energy, 0.0), degrees
