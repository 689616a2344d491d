"""Vectors as tuples of three scalars: as fast as scalars in compiled code, and readable.

Quaternions ϱ are tuples (vector part 1–3, scalar part 4), as in Eq. 30 of Dominik & Nübold (2002).
"""

import math

from ..basics import box
from ..compiler.jit import formula
from .kinds_of_box import unless_straight

# `basics` does not need the compiler
nearest_image = unless_straight(box.nearest_image)(box.nearest_image_tilted)


@formula
def load(array, i):
    """Column i of a (3, N) array."""
    return array[0, i], array[1, i], array[2, i]


@formula
def put(array, i, v):
    """Set column i of a (3, N) array."""
    array[0, i] = v[0]
    array[1, i] = v[1]
    array[2, i] = v[2]


@formula
def accrue(array, i, v):
    """Add v to column i of a (3, N) array."""
    array[0, i] += v[0]
    array[1, i] += v[1]
    array[2, i] += v[2]


@formula
def load4(array, i):
    """Column i of a (4, N) array."""
    return array[0, i], array[1, i], array[2, i], array[3, i]


@formula
def put4(array, i, v):
    """Set column i of a (4, N) array."""
    array[0, i] = v[0]
    array[1, i] = v[1]
    array[2, i] = v[2]
    array[3, i] = v[3]


@formula
def add(u, v):
    """Sum u + v."""
    return u[0] + v[0], u[1] + v[1], u[2] + v[2]


@formula
def sub(u, v):
    """Difference u − v."""
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


@formula
def scale(s, v):
    """Product s v of a number and a vector."""
    return s * v[0], s * v[1], s * v[2]


@formula
def axpy(s, u, v):
    """s u + v."""
    return s * u[0] + v[0], s * u[1] + v[1], s * u[2] + v[2]


@formula
def dot(u, v):
    """Scalar product u · v."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@formula
def cross(u, v):
    """Vector product u × v."""
    return (
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    )


@formula
def norm(v):
    """Length |v|."""
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@formula
def across(v, n):
    """Component of v perpendicular to the unit vector n."""
    along = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
    return v[0] - along * n[0], v[1] - along * n[1], v[2] - along * n[2]
