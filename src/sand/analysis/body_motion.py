"""Rigid motion of bodies: energies of translation and rotation, and the temperatures that they correspond to.

A body is a cluster of grains in contact, or a single grain.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.box import Box
from ..basics.clusters import in_one_piece
from ..basics.constants import BOLTZMANN
from ..basics.errors import refuse_other
from .clusters import cluster_labels

__all__ = [
    "MEDIAN_ENERGY",
    "BodyMotion",
    "BodyTemperatures",
    "body_motion",
    "body_temperatures",
    "internal_kinetic_energy",
]

MEDIAN_ENERGY = 1.1829869421876689
"""Median of the energy of three degrees of freedom in equilibrium [k_B T]: of the gamma distribution of shape 3/2."""


class BodyMotion(NamedTuple):
    """Motion of each body of a frame or a state, (K,) each, in the order of their lowest grains."""

    grains: np.ndarray  # number of grains
    mass: np.ndarray  # [kg]
    translation: np.ndarray  # ½ P²/M [J]
    rotation: np.ndarray  # ½ L·J⁻¹L about the centre of mass, spins included [J]
    internal: np.ndarray  # kinetic energy of the grains beyond the rigid motion [J]; 0 for single grains


class RigidMotion(NamedTuple):
    """The rigid motion of K clusters of n grains."""

    label: np.ndarray  # (n,) cluster of each grain
    velocity: np.ndarray  # (3, K) of the centre of mass [m/s]
    angular: np.ndarray  # (3, K) angular momentum L about the centre of mass, spins included [J s]
    spin: np.ndarray  # (3, K) Ω = J⁻¹ L [rad/s]
    offset: np.ndarray  # (3, n) s, of each grain from the centre of mass of its cluster [m]
    relative: np.ndarray  # (3, n) velocity beyond the rigid motion, v − V − Ω × s [m/s]
    relative_spin: np.ndarray  # (3, n) ω − Ω [rad/s]


class BodyTemperatures(NamedTuple):
    """Temperatures of the bodies [K], all equal in equilibrium."""

    translation: float  # 2/3 of the mean energy of translation over k_B
    rotation: float  # 2/3 of the mean energy of rotation over k_B
    rotation_median: float  # median energy of rotation over 1.183 k_B, the median of an equilibrium distribution


@checked
def body_motion(grains: Any, pairs: np.ndarray, box: Box) -> BodyMotion:
    """Energies of translation and rotation of each body, and of its grains beyond this rigid motion.

    With momentum P, angular momentum L about the centre of mass (spins included) and the inertia tensor
    J = Σ [m (s² 1 − s s) + I 1] of a body: K = P²/2M + ½ L·J⁻¹L + internal energy. A single grain has ½mv² and ½Iω².

    Parameters
    ----------
    grains : Grains
        Grains of a simulation or a frame.
    pairs : ndarray
        Contacts (C, 2).
    box : Box
        Boundary conditions; clusters across a periodic boundary are made whole.

    Returns
    -------
    BodyMotion
        Of each body, (K,).
    """
    refuse_other(grains, "position", "velocity", "spin", "mass", called="grains")
    return motion_of(grains, rigid_motion(grains, pairs, box, cluster_labels(len(grains.position), pairs)))


def motion_of(grains: Any, rigid: RigidMotion) -> BodyMotion:
    """As `body_motion`, from the rigid motion of the clusters."""
    mass, count = np.asarray(grains.mass, float), np.bincount(rigid.label)
    # from relative velocities, so that no energies of almost equal size are subtracted
    moving = mass * (rigid.relative**2).sum(axis=0) + _inertia(grains) * (rigid.relative_spin**2).sum(axis=0)
    total, internal = np.bincount(rigid.label, mass), np.where(count > 1, np.bincount(rigid.label, 0.5 * moving), 0.0)
    translation = 0.5 * total * (rigid.velocity**2).sum(axis=0)
    return BodyMotion(count, total, translation, 0.5 * (rigid.angular * rigid.spin).sum(axis=0), internal)


def rigid_motion(grains: Any, pairs: np.ndarray, box: Box, label: np.ndarray) -> RigidMotion:
    """The rigid motion of each cluster; arguments as for `body_motion`, and the cluster of each grain (N,)."""
    mass, inertia, count = np.asarray(grains.mass, float), _inertia(grains), int(label.max()) + 1

    def summed(values: np.ndarray) -> np.ndarray:
        """Sums over the grains of each cluster, of values (…, n): (…, K)."""
        flat = values.reshape(-1, len(label))
        return np.array([np.bincount(label, each, count) for each in flat]).reshape(*values.shape[:-1], count)

    bonds, total = np.asarray(pairs, np.int64).reshape(-1, 2), summed(mass)
    x, v = in_one_piece(np.array(grains.position), bonds, box, label).T, np.asarray(grains.velocity, float).T
    w, mean = np.asarray(grains.spin, float).T, summed(mass * v) / total
    s, u = x - (summed(mass * x) / total)[:, label], v - mean[:, label]
    angular = summed(mass * np.cross(s, u, axis=0) + inertia * w)
    tensor = summed(mass * (s * s).sum(axis=0) + inertia) * np.eye(3)[:, :, None] - summed(mass * s[:, None] * s[None])
    spin, several = angular / summed(inertia), np.bincount(label, minlength=count) > 1  # that of single grains
    spin[:, several] = np.linalg.solve(tensor.T[several], angular.T[several, :, None])[:, :, 0].T
    turning = spin[:, label]
    return RigidMotion(label, mean, angular, spin, s, u - np.cross(turning, s, axis=0), w - turning)


def _inertia(grains: Any) -> np.ndarray:
    """Moments of inertia (N,) of the grains; frames of a trajectory have none of their own, 2/5 m r² of a sphere."""
    own = getattr(grains, "inertia", None)
    if own is not None:
        return np.asarray(own, float)
    return 0.4 * np.asarray(grains.mass, float) * np.asarray(grains.radius, float) ** 2


@checked
def internal_kinetic_energy(grains: Any, pairs: np.ndarray, box: Box) -> tuple[np.ndarray, np.ndarray]:
    """Kinetic energy of each cluster beyond its rigid motion: the vibration of its contacts.

    As of `body_motion`. A cluster of n > 1 grains has 6n − 6 internal degrees of freedom, each with a mean kinetic
    energy of ½ k_B T in equilibrium; a single grain has none.

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


@checked
def body_temperatures(motion: BodyMotion, which: np.ndarray | None = None) -> BodyTemperatures:
    """Temperatures of translation and rotation of bodies [K].

    T = 2⟨E⟩/3k_B, and for the median T = median(E)/1.183 k_B, which a few fast rotors do not change. Velocities are
    those in the frame of the box. In a box without external forces, whose momentum is zero, K bodies in equilibrium
    have (1 − 1/K) T of translation.

    Parameters
    ----------
    motion : BodyMotion
        From `body_motion`.
    which : ndarray or None, optional
        Chosen bodies (K,), True or False; all by default.

    Returns
    -------
    BodyTemperatures
        NaN if no body is chosen.
    """
    if which is None:
        return temperatures_of(motion.translation, motion.rotation)
    chosen = np.asarray(which, bool)
    return temperatures_of(motion.translation[chosen], motion.rotation[chosen])


def temperatures_of(translation: np.ndarray, rotation: np.ndarray) -> BodyTemperatures:
    """As `body_temperatures`, from the energies of bodies (K,) [J]."""
    count = len(translation)
    if not count:
        return BodyTemperatures(np.nan, np.nan, np.nan)
    middle = np.sort(rotation)[(count - 1) // 2 : count // 2 + 1].tolist()  # NaN, if there is any, is sorted last
    return BodyTemperatures(
        2.0 * float(translation.sum()) / (3.0 * BOLTZMANN * count),
        2.0 * float(rotation.sum()) / (3.0 * BOLTZMANN * count),
        sum(middle) / len(middle) / (MEDIAN_ENERGY * BOLTZMANN),
    )
