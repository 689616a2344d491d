"""Motion of the grains of a cluster relative to its rigid motion."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..arguments import checked
from ..box import Box
from .clusters import cluster_labels, in_one_piece

__all__ = ["internal_kinetic_energy"]


class RigidMotion(NamedTuple):
    """The rigid motion of K clusters, and of their n grains relative to it."""

    label: np.ndarray  # (n,) cluster of each grain
    spin: np.ndarray  # (3, K) Ω = J⁻¹ L of each cluster [rad/s]
    offset: np.ndarray  # (3, n) s, from the centre of mass of the cluster [m]
    velocity: np.ndarray  # (3, n) relative to that of the centre of mass [m/s]


def rigid_motion(grains: Any, pairs: np.ndarray, box: Box) -> RigidMotion:
    """The rigid motion of each cluster; arguments as for `internal_kinetic_energy`."""
    labels, pairs = cluster_labels(len(grains), pairs), np.asarray(pairs, np.int64).reshape(-1, 2)
    position = in_one_piece(np.array(grains.position), pairs, box, labels)
    return _motion_of(grains, position, np.arange(len(labels)), labels)


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
    members = np.bincount(labels)
    return internal_energies(grains, np.asarray(pairs), box, labels), np.where(members > 1, 6 * members - 6, 0)


def internal_energies(grains: Any, pairs: np.ndarray, box: Box, labels: np.ndarray) -> np.ndarray:
    """The energies of `internal_kinetic_energy`, for clusters whose labels are known."""
    members = np.bincount(labels)
    energies = np.zeros(len(members))
    if len(members) == len(labels):
        return energies
    own = np.flatnonzero(members[labels] > 1)  # single grains have none
    label = (np.cumsum(members > 1) - 1)[labels[own]]
    position = in_one_piece(np.array(grains.position), np.asarray(pairs, np.int64).reshape(-1, 2), box, labels)
    motion = _motion_of(grains, position, own, label)
    # as the energy of velocities relative to the rigid motion, which has no differences of large numbers
    turning = motion.spin[:, label]
    v, w = motion.velocity - _cross(turning, motion.offset), np.asarray(grains.spin)[own].T - turning
    mass, inertia = np.asarray(grains.mass)[own], np.asarray(grains.inertia)[own]
    energies[members > 1] = np.bincount(label, 0.5 * mass * _square(v) + 0.5 * inertia * _square(w))
    return energies


def _motion_of(grains: Any, position: np.ndarray, own: np.ndarray, label: np.ndarray) -> RigidMotion:
    """The rigid motion of clusters of the grains `own`, whose positions (N, 3) do not cross the box."""
    mass, inertia = np.asarray(grains.mass)[own], np.asarray(grains.inertia)[own]
    count = int(label.max()) + 1

    def summed(values: np.ndarray) -> np.ndarray:
        """Sums over the grains of each cluster, of values (…, n): (…, K)."""
        flat = values.reshape(-1, len(own))
        return np.array([np.bincount(label, each, count) for each in flat]).reshape(*values.shape[:-1], count)

    velocity, spin, position = np.asarray(grains.velocity)[own].T, np.asarray(grains.spin)[own].T, position[own].T
    total = summed(mass)
    s = position - (summed(mass * position) / total)[:, label]
    u = velocity - (summed(mass * velocity) / total)[:, label]
    angular = summed(mass * _cross(s, u) + inertia * spin)
    diagonal = mass * _square(s) + inertia
    tensor = np.empty((count, 3, 3))
    for i, j in np.ndindex(3, 3):
        products = mass * s[i] * s[j]
        tensor[:, i, j] = summed(diagonal - products if i == j else 0.0 - products)
    return RigidMotion(label, np.linalg.solve(tensor, angular.T[:, :, None])[:, :, 0].T, s, u)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of vectors (3, n)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _square(a: np.ndarray) -> np.ndarray:
    """Squares of vectors (3, n)."""
    found: np.ndarray = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
    return found
