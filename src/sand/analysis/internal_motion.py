"""Motion of the grains of a cluster relative to its rigid motion."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.box import Box
from ..basics.clusters import in_one_piece
from .body_motion import body_motion
from .clusters import cluster_labels

__all__ = ["internal_kinetic_energy"]


class RigidMotion(NamedTuple):
    """The rigid motion of K clusters of n grains."""

    label: np.ndarray  # (n,) cluster of each grain
    spin: np.ndarray  # (3, K) Ω = J⁻¹ L of each cluster [rad/s]
    offset: np.ndarray  # (3, n) s, from the centre of mass of the cluster [m]


def rigid_motion(grains: Any, pairs: np.ndarray, box: Box) -> RigidMotion:
    """The rigid motion of each cluster; arguments as for `internal_kinetic_energy`."""
    label, pairs = cluster_labels(len(grains), pairs), np.asarray(pairs, np.int64).reshape(-1, 2)
    mass, inertia = np.asarray(grains.mass), np.asarray(grains.inertia)
    count = int(label.max()) + 1

    def summed(values: np.ndarray) -> np.ndarray:
        """Sums over the grains of each cluster, of values (…, n): (…, K)."""
        flat = values.reshape(-1, len(label))
        return np.array([np.bincount(label, each, count) for each in flat]).reshape(*values.shape[:-1], count)

    position = in_one_piece(np.array(grains.position), pairs, box, label).T
    velocity, total = np.asarray(grains.velocity).T, summed(mass)
    s = position - (summed(mass * position) / total)[:, label]
    u = velocity - (summed(mass * velocity) / total)[:, label]
    angular = summed(mass * np.cross(s, u, axis=0) + inertia * np.asarray(grains.spin).T)
    tensor = summed(mass * (s * s).sum(axis=0) + inertia) * np.eye(3)[:, :, None] - summed(mass * s[:, None] * s[None])
    return RigidMotion(label, np.linalg.solve(tensor.T, angular.T[:, :, None])[:, :, 0].T, s)


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
    motion = body_motion(grains, pairs, box)
    return motion.internal, np.where(motion.grains > 1, 6 * motion.grains - 6, 0)
