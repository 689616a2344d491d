"""Loops over pairs of free bodies, for `experiments.parting`: thousands of fragments have millions of pairs."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...compiler.jit import kernel, loop
from ...numerics.vec import axpy, dot, load, norm, sub

SLOWEST = 0.5 * (math.sqrt(3.0) - 1.0)
"""Least rate at which two bodies recede while their relative velocity is within u/2 of the first one, over u."""


class FreeBodies(NamedTuple):
    """K bodies of N grains, in the order of the bodies.

    Attributes
    ----------
    mass, radius : ndarray
        (K,) [kg, m]; spheres about the centres of mass that contain the grains.
    centre, velocity : ndarray
        Of the centres of mass, (3, K) [m, m/s].
    first : ndarray
        Of the grains of each body, (K + 1,).
    distance : ndarray
        Of grains from the centre of mass of their body, (N,) [m].
    strength : ndarray
        (F, N), of each force s with w = s s'/r^power, see `experiments.parting`.
    power : ndarray
        (F,).
    """

    mass: np.ndarray
    centre: np.ndarray
    velocity: np.ndarray
    radius: np.ndarray
    first: np.ndarray
    distance: np.ndarray
    strength: np.ndarray
    power: np.ndarray


@loop
def relative(bodies, one, other, margin):
    """Separation and velocity of a body relative to another one, and (1 + margin) times the sum of their radii."""
    x = sub(load(bodies.centre, one), load(bodies.centre, other))
    v = sub(load(bodies.velocity, one), load(bodies.velocity, other))
    return x, v, (1.0 + margin) * (bodies.radius[one] + bodies.radius[other])


def stay_apart(bodies, margin):
    """Whether no two bodies on straight paths come as near as (1 + margin) times the sum of their radii."""
    for one in range(1, bodies.mass.size):
        for other in range(one):
            x, v, reach = relative(bodies, one, other, margin)
            approach = dot(x, v)
            if not approach >= 0.0:  # NaN is no reason to part
                x = axpy(-approach / dot(v, v), v, x)
            if not norm(x) > reach:
                return False
    return True


@loop
def work_of_attraction(bodies, one, other, distance, margin):
    """Largest work [J] of the attraction between two bodies from a distance [m] beyond their reach to infinity.

    Σ s s'/(distance − (1 + margin)(ρ + ρ'))^power over pairs of their grains and forces.
    """
    work = 0.0
    for force in range(bodies.power.size):
        strength = bodies.strength[force]
        for i in range(bodies.first[one], bodies.first[one + 1]):
            for j in range(bodies.first[other], bodies.first[other + 1]):
                gap = distance - (1.0 + margin) * (bodies.distance[i] + bodies.distance[j])
                work += strength[i] * strength[j] / gap ** bodies.power[force]
    return work


def recede_for_ever(bodies, momentum, margin):
    """Whether all bodies recede faster than their attraction can turn them back, see `experiments.parting`.

    `momentum` (K,) is filled with the largest momenta p that the attraction may still give to each body.
    """
    count = bodies.mass.size
    for one in range(1, count):  # all pairs, before any work is computed
        for other in range(one):
            x, v, reach = relative(bodies, one, other, margin)
            if not (dot(x, v) > 0.0 and norm(x) > reach):
                return False
    momentum[:] = 0.0
    for one in range(1, count):
        for other in range(one):
            x, v, _ = relative(bodies, one, other, margin)
            distance = norm(x)
            work, recession = work_of_attraction(bodies, one, other, distance, margin), dot(x, v) / distance
            if count == 2:
                reduced = bodies.mass[0] * bodies.mass[1] / (bodies.mass[0] + bodies.mass[1])
                return 0.5 * reduced * recession**2 > work
            momentum[one] += work / (SLOWEST * recession)
            momentum[other] += work / (SLOWEST * recession)
    for one in range(1, count):
        for other in range(one):
            x, v, _ = relative(bodies, one, other, margin)
            change = momentum[one] / bodies.mass[one] + momentum[other] / bodies.mass[other]
            if not change <= 0.5 * dot(x, v) / norm(x):
                return False
    return True


stay_apart = kernel(stay_apart, nogil=True, purpose="paths of fragments")
recede_for_ever = kernel(recede_for_ever, nogil=True, purpose="attraction of fragments")
