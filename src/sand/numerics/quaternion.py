"""Unit quaternions ϱ (vector part 1–3, scalar part 4) for orientations: Eqs. 30–32 of the paper.

R(ϱ) rotates body vectors into the laboratory frame (active rotation); initially ϱ = (0, 0, 0, 1).  ω is given in the
laboratory frame.
"""

import math

import numpy as np

from ..compiler.jit import formula
from .vec import add, axpy, cross, scale


@formula
def turned(q, v):
    """R(ϱ) v: body vector rotated into the laboratory frame (Eq. 30, |ϱ| = 1)."""
    u = (q[0], q[1], q[2])
    t = cross(scale(2.0, u), v)
    return add(axpy(q[3], t, v), cross(u, t))


@formula
def turned_back(q, v):
    """R(ϱ)ᵀ v: laboratory vector rotated into the body frame."""
    return turned((-q[0], -q[1], -q[2], q[3]), v)


@formula
def rotation_by(angle):
    """Quaternion of a rotation by the vector `angle` [rad]; |ϱ| = 1 to 1e-7 for angles up to 0.4 rad.

    sin and cos of half the angle, h, are series to h⁵ and h⁴; the error of the angle is h⁷/420, 2e-12 for 0.1 rad.
    """
    h = scale(0.5, angle)
    s = h[0] * h[0] + h[1] * h[1] + h[2] * h[2]
    sine = 1.0 + s * (-1.0 / 6.0 + s * (1.0 / 120.0))
    return sine * h[0], sine * h[1], sine * h[2], 1.0 + s * (-0.5 + s * (1.0 / 24.0))


@formula
def _renormalised(q):
    """ϱ/|ϱ| by one Newton step of 1/√n² from 1, for n² = 1 to within 1e-7."""
    c = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return c * q[0], c * q[1], c * q[2], c * q[3]


@formula
def turn(q, angle):
    """Quaternion after a rotation by the vector `angle` = ω dt [rad] in the laboratory frame, renormalised (Eq. 32)."""
    x, y, z, cosine = rotation_by(angle)
    return _renormalised(
        (
            cosine * q[0] + x * q[3] + y * q[2] - z * q[1],
            cosine * q[1] + y * q[3] + z * q[0] - x * q[2],
            cosine * q[2] + z * q[3] + x * q[1] - y * q[0],
            cosine * q[3] - x * q[0] - y * q[1] - z * q[2],
        )
    )


@formula
def turned_by(angle, v):
    """Laboratory vector rotated by the vector `angle` [rad], consistent with `turn`."""
    return turned(_renormalised(rotation_by(angle)), v)


@formula
def normalised(q):
    """ϱ/|ϱ|."""
    c = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return c * q[0], c * q[1], c * q[2], c * q[3]


@formula
def turning_rate(q, w):
    """Rate of change ϱ̇ = ½ ω∘ϱ (Eq. 31), ω in the laboratory frame."""
    x, y, z = scale(0.5, w)
    return (
        x * q[3] + y * q[2] - z * q[1],
        y * q[3] + z * q[0] - x * q[2],
        z * q[3] + x * q[1] - y * q[0],
        -x * q[0] - y * q[1] - z * q[2],
    )


def matrix_of(q: np.ndarray) -> np.ndarray:
    """Rotation matrix of a unit quaternion.  Not compiled."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(matrix: np.ndarray) -> np.ndarray:
    """Unit quaternion ϱ of a rotation matrix, the inverse of `matrix_of`.  Not compiled.

    Each row of the matrix 4 ϱ ϱᵀ, whose elements are sums of those of the rotation matrix, is proportional to ϱ; the
    longest one is accurate (Shepperd 1978).
    """
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    products = np.array(
        [
            [1 + a - e - i, b + d, c + g, h - f],
            [b + d, 1 - a + e - i, f + h, c - g],
            [c + g, f + h, 1 - a - e + i, d - b],
            [h - f, c - g, d - b, 1 + a + e + i],
        ]
    )
    longest = products[np.argmax(products.diagonal())]
    return longest / np.linalg.norm(longest)
