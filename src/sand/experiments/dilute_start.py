"""Thermal starts of flights in a magnetic field: orientations by Langevin's law, directions of flight at random."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ndtri

from .dilute_body import Body
from .scattering.event_draws import event_uniforms

Vector = tuple[float, float, float]
BLOCKS = range(1, 4)
"""Blocks of random numbers of an event, beside that of its draw."""
WEAK = 1e-6
"""μB/k_BT below which directions are uniform."""


def cosine_in_field(ratio: float, uniform: float) -> float:
    """cos θ of a moment in a field, density ∝ e^(x cos θ), x = μB/k_BT: 1 + ln(u + (1 − u) e^(−2x))/x."""
    if ratio < WEAK:
        return 2.0 * uniform - 1.0
    return 1.0 + math.log(uniform + (1.0 - uniform) * math.exp(-2.0 * ratio)) / ratio


def direction(cosine: float, uniform: float, axis: np.ndarray) -> np.ndarray:
    """Unit vector at this cosine from a unit vector, at a random azimuth."""
    angle, sine = 2.0 * math.pi * uniform, math.sqrt(max(1.0 - cosine * cosine, 0.0))
    return _frame(axis) @ np.array([sine * math.cos(angle), sine * math.sin(angle), cosine])


def orientation_in_field(moment: np.ndarray, field: np.ndarray, heat: float, uniforms: tuple[float, ...]) -> np.ndarray:
    """Rotation (3, 3) of a body with this net moment in its frame, thermal in a field [T]; from three uniform deviates.

    The moment has Langevin's distribution about the field; the body is at a random angle about the moment.
    """
    size, strength = float(np.linalg.norm(moment)), float(np.linalg.norm(field))
    own = moment / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    along = field / strength if strength > 0.0 else np.array([0.0, 0.0, 1.0])
    target = direction(cosine_in_field(size * strength / heat, uniforms[0]), uniforms[1], along)
    return rotation_onto(own, target, uniforms[2])


def rotation_onto(own: np.ndarray, target: np.ndarray, uniform: float) -> np.ndarray:
    """Rotation (3, 3) of one unit vector onto another, with a random angle about it."""
    about = Rotation.from_rotvec([0.0, 0.0, 2.0 * math.pi * uniform]).as_matrix()
    return np.asarray(_frame(target) @ about @ _frame(own).T)


def start_in_field(
    pair: tuple[Body, Body], approach: Vector, heat: float, spin_energy: float, field: Vector, event: tuple[int, int]
) -> np.ndarray:
    """State (20,) of a pair on a plane before the encounter, of an event (seed, number).

    Parameters
    ----------
    pair : tuple of Body
        The bodies.
    approach : tuple of float
        Relative speed [m/s], impact parameter and distance of the plane [m].
    heat, spin_energy : float
        k_BT and the mean energy of rotation of a body [J].
    field : tuple of float
        B [T].
    event : tuple of int
        Seed and number, of which all random numbers are functions.
    """
    speed, b, distance = approach
    uniforms = [value for block in BLOCKS for value in event_uniforms(*event, block)]
    flight = direction(2.0 * uniforms[0] - 1.0, uniforms[1], np.array([0.0, 0.0, 1.0]))
    side = direction(0.0, uniforms[2], flight)
    turns, momenta = [], []
    for k, body in enumerate(pair):
        own = uniforms[3 + 6 * k : 9 + 6 * k]
        rotation = orientation_in_field(body.grains.moment.sum(axis=1), np.array(field), heat, tuple(own[:3]))
        turns.append(Rotation.from_matrix(rotation).as_quat())
        normal = ndtri(np.array(own[3:]))
        momenta.append(rotation @ (normal * np.sqrt(2.0 / 3.0 * spin_energy * np.array(body.flying.inertia))))
    return np.concatenate([b * side - distance * flight, speed * flight, *turns, *momenta])


def _frame(axis: np.ndarray) -> np.ndarray:
    """Right-handed frame (3, 3) whose third column is a unit vector."""
    other = np.zeros(3)
    other[int(np.argmin(np.abs(axis)))] = 1.0
    first = np.cross(other, axis)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])
