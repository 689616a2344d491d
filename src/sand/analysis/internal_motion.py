"""Motion of the grains of a cluster relative to its rigid motion."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..arguments import checked
from ..box import Box
from .clusters import cluster_labels, unwrapped

__all__ = ["internal_kinetic_energy"]


class RigidMotion(NamedTuple):
    """The rigid motion of each cluster, and of its grains relative to it."""

    label: np.ndarray  # (N,) cluster of each grain
    spin: np.ndarray  # (K, 3) Ω = J⁻¹ L of each cluster [rad/s]
    offset: np.ndarray  # (N, 3) s, from the centre of mass of the cluster [m]
    velocity: np.ndarray  # (N, 3) relative to that of the centre of mass [m/s]


def rigid_motion(grains: Any, pairs: np.ndarray, box: Box) -> RigidMotion:
    """The rigid motion of each cluster; arguments as for `internal_kinetic_energy`."""
    labels = cluster_labels(len(grains), pairs)
    count = int(labels.max()) + 1
    mass, inertia = np.asarray(grains.mass), np.asarray(grains.inertia)
    velocity, spin = np.asarray(grains.velocity), np.asarray(grains.spin)
    position = unwrapped(np.asarray(grains.position), pairs, box)
    total = _summed(mass, labels, count)[:, None]
    s = position - (_summed(mass[:, None] * position, labels, count) / total)[labels]
    u = velocity - (_summed(mass[:, None] * velocity, labels, count) / total)[labels]
    angular = _summed(mass[:, None] * np.cross(s, u) + inertia[:, None] * spin, labels, count)
    own = (mass * (s * s).sum(axis=1) + inertia)[:, None, None] * np.eye(3)
    tensor = _summed(own - mass[:, None, None] * s[:, :, None] * s[:, None, :], labels, count)
    return RigidMotion(labels, np.linalg.solve(tensor, angular[:, :, None])[:, :, 0], s, u)


def _summed(values: np.ndarray, labels: np.ndarray, count: int) -> np.ndarray:
    """Sum of the values of the grains of each of `count` clusters."""
    total = np.zeros((count, *values.shape[1:]))
    np.add.at(total, labels, values)
    return total


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
    motion = rigid_motion(grains, pairs, box)
    # as the energy of velocities relative to the rigid motion, which has no differences of large numbers
    turning = motion.spin[labels]
    v, w = motion.velocity - np.cross(turning, motion.offset), np.asarray(grains.spin) - turning
    kinetic = 0.5 * np.asarray(grains.mass) * (v * v).sum(axis=1)
    energy = _summed(kinetic + 0.5 * np.asarray(grains.inertia) * (w * w).sum(axis=1), labels, count)
    return np.where(members > 1, energy, 0.0), degrees
