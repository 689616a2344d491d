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

__all__ = ["MEDIAN_ENERGY", "BodyMotion", "BodyTemperatures", "body_motion", "body_temperatures"]

MEDIAN_ENERGY = 1.1829869421876689
"""Median of the energy of three degrees of freedom in equilibrium [k_B T]: of the gamma distribution of shape 3/2."""


class BodyMotion(NamedTuple):
    """Motion of each body of a frame or a state, (K,) each, in the order of their lowest grains."""

    grains: np.ndarray  # number of grains
    mass: np.ndarray  # [kg]
    translation: np.ndarray  # ½ P²/M [J]
    rotation: np.ndarray  # ½ L·J⁻¹L about the centre of mass, spins included [J]
    internal: np.ndarray  # kinetic energy of the grains beyond the rigid motion [J]; 0 for single grains


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
    return motion_of(grains, pairs, box, cluster_labels(len(grains.position), pairs))


def motion_of(grains: Any, pairs: np.ndarray, box: Box, labels: np.ndarray) -> BodyMotion:
    """As `body_motion`, with the cluster of each grain (N,), which is known."""
    mass, inertia = np.asarray(grains.mass, float), _inertia(grains)
    velocity, spin = np.asarray(grains.velocity, float), np.asarray(grains.spin, float)
    count = np.bincount(labels)
    moving = 0.5 * mass * np.einsum("ij,ij->i", velocity, velocity)
    turning = 0.5 * inertia * np.einsum("ij,ij->i", spin, spin)
    motion = BodyMotion(
        count,
        np.bincount(labels, mass),
        np.bincount(labels, moving),
        np.bincount(labels, turning),
        np.zeros(len(count)),
    )
    joined = np.flatnonzero(count[labels] > 1)
    if joined.size:
        members = joined[np.argsort(labels[joined], kind="stable")]
        bonds = np.asarray(pairs, np.int64).reshape(-1, 2)
        position = in_one_piece(np.array(grains.position), bonds, box, labels)[members]
        of_members = (values[members] for values in (velocity, spin, mass, inertia, labels))
        for own, values in zip(motion[2:], _of_clusters(position, *of_members), strict=True):
            own[count > 1] = values
    return motion


def _inertia(grains: Any) -> np.ndarray:
    """Moments of inertia (N,) of the grains; frames of a trajectory have none of their own, 2/5 m r² of a sphere."""
    own = getattr(grains, "inertia", None)
    if own is not None:
        return np.asarray(own, float)
    return 0.4 * np.asarray(grains.mass, float) * np.asarray(grains.radius, float) ** 2


def _of_clusters(
    x: np.ndarray, v: np.ndarray, w: np.ndarray, mass: np.ndarray, inertia: np.ndarray, labels: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Energies (K,) of translation, rotation and internal motion of clusters, whose grains stand one after another."""
    new = np.append(True, labels[1:] != labels[:-1])
    starts, own = np.flatnonzero(new), np.cumsum(new) - 1

    def summed(values: np.ndarray) -> np.ndarray:
        return np.add.reduceat(values, starts, axis=0)

    m, i = mass[:, None], inertia[:, None]
    means = summed(m * np.hstack((x, v))) / summed(m)
    s, u = np.hsplit(np.hstack((x, v)) - means[own], 2)
    square = np.einsum("ij,ij->i", s, s)[:, None]
    products = (s[:, :, None] * s[:, None, :]).reshape(-1, 9)
    sums = summed(np.hstack((m, m * np.cross(s, u) + i * w, m * square + i, m * products)))
    angular, tensor = sums[:, 1:4], sums[:, 4, None, None] * np.eye(3) - sums[:, 5:].reshape(-1, 3, 3)
    turning = np.linalg.solve(tensor, angular[:, :, None])[:, :, 0]
    # velocities relative to the rigid motion, so that no energies of almost equal size are subtracted
    du, dw = u - np.cross(turning[own], s), w - turning[own]
    internal = 0.5 * summed(mass * np.einsum("ij,ij->i", du, du) + inertia * np.einsum("ij,ij->i", dw, dw))
    translation = 0.5 * sums[:, 0] * np.einsum("ij,ij->i", means[:, 3:], means[:, 3:])
    return translation, 0.5 * np.einsum("ij,ij->i", angular, turning), internal


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
