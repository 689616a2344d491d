"""The symplectic rotor: free rotation of a rigid body.

The kinetic energy of a rotor with angular momentum L in its own frame is that of a sphere and two terms more,

    |L|²/2I₂ + ½ (1/I₁ − 1/I₂) L₁² + ½ (1/I₃ − 1/I₂) L₃².

Each alone generates an exact rotation.  That of the sphere commutes with the others, so that it is applied once, Φ₀(t);
the others are applied in n pieces (a symmetric top and one more axis, as Touma & Wisdom 1994, with quaternions as
Miller et al. 2002; both cited from memory):

    Φ₀(t) [Φ₁(t/2n) Φ₃(t/n) Φ₁(t/2n)]ⁿ,   Φ_k(t): q → q exp(a e_k/2), L → Rot(e_k, −a) L, a = t (1/I_k − 1/I₂) L_k

It is symplectic, of second order, keeps |L| and, in the laboratory frame, L to rounding, and is exact for a sphere and
for symmetric bodies such as straight chains.
"""

import math

import numpy as np

from ..compiler.jit import formula
from .quaternion import normalised
from .vec import norm, scale

LARGEST_PIECE = 0.1
"""Free rotation is computed in pieces t with t |L| √(…) at most this, see `parting_rate`, and at most η, so that its
error falls as η²."""


@formula
def product(a, b):
    """Quaternion of rotation b followed by rotation a."""
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
        a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@formula
def _about_first(q, angular, angle):
    """Rotation of the body about its first axis by an angle [rad]: new orientation and angular momentum."""
    s, c = math.sin(0.5 * angle), math.cos(0.5 * angle)
    sine, cosine = 2.0 * s * c, c * c - s * s
    x, y, z, w = q
    turned_q = (c * x + s * w, c * y + s * z, c * z - s * y, c * w - s * x)
    return turned_q, (angular[0], cosine * angular[1] + sine * angular[2], cosine * angular[2] - sine * angular[1])


@formula
def _about_third(q, angular, angle):
    """As `_about_first`, about the third axis."""
    s, c = math.sin(0.5 * angle), math.cos(0.5 * angle)
    sine, cosine = 2.0 * s * c, c * c - s * s
    x, y, z, w = q
    turned_q = (c * x + s * y, c * y - s * x, c * z + s * w, c * w - s * z)
    return turned_q, (cosine * angular[0] + sine * angular[1], cosine * angular[1] - sine * angular[0], angular[2])


@formula
def asymmetric_rotation(q, angular, inertia, t):
    """A step of a free rotor but for the rotation of a sphere with I₂, which commutes with it: Φ₁(t/2) Φ₃(t) Φ₁(t/2).

    Parameters
    ----------
    q : tuple
        Orientation: rotation from the principal axes to the laboratory frame.
    angular : tuple
        Angular momentum in the body [J s].
    inertia : tuple
        Principal moments of inertia [kg m²].
    t : float
        Step [s].

    Returns
    -------
    tuple
        New orientation and angular momentum.
    """
    first, third = t * (1.0 / inertia[0] - 1.0 / inertia[1]), t * (1.0 / inertia[2] - 1.0 / inertia[1])
    q, angular = _about_first(q, angular, 0.5 * first * angular[0])
    q, angular = _about_third(q, angular, third * angular[2])
    q, angular = _about_first(q, angular, 0.5 * first * angular[0])
    return normalised(q), angular


@formula
def parting_rate(inertia):
    """√((1/I₁ − 1/I₂)(1/I₂ − 1/I₃)) [1/(kg m²)]: times |L|, the rate at which motions about the second axis part.

    It is 0 for symmetric bodies, for which a step of any length is exact.  A piece t of `asymmetric_rotation` errs by
    about t³|L|³ (1/I₁ − 1/I₂)(1/I₂ − 1/I₃) times the larger of the two differences.
    """
    return math.sqrt((1.0 / inertia[0] - 1.0 / inertia[1]) * (1.0 / inertia[1] - 1.0 / inertia[2]))


@formula
def free_sphere(q, angular, inertia, t):
    """The rotation of a body with three equal moments of inertia, about its constant angular momentum; exact."""
    size = norm(angular)
    if size == 0.0:
        return q
    half = 0.5 * t * size / inertia
    axis = scale(math.sin(half) / size, angular)
    return normalised(product(q, (axis[0], axis[1], axis[2], math.cos(half))))


@formula
def free_rotation(q, angular, inertia, t, piece):
    """Orientation and angular momentum in the body [J s] after a free rotation of t [s].

    Pieces are at most `piece`, in units of the time in which motions about the second axis part.
    """
    # a number that free rotation keeps: pieces of changing length would change the energy
    pieces = int(t * norm(angular) * parting_rate(inertia) / piece) + 1
    for _ in range(pieces):
        q, angular = asymmetric_rotation(q, angular, inertia, t / pieces)
    return free_sphere(q, angular, inertia[1], t), angular


def principal_frame(mass: np.ndarray, inertia: np.ndarray, offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments of inertia (3,) [kg m²], ascending, and axes as columns, right-handed.  Not compiled.

    Parameters
    ----------
    mass, inertia : ndarray
        (n,) masses [kg] and moments of inertia of the grains [kg m²].
    offset : ndarray
        (3, n) their vectors from the centre of mass [m].
    """
    tensor = ((mass * offset**2).sum() + inertia.sum()) * np.eye(3) - (mass * offset) @ offset.T
    principal, axes = np.linalg.eigh(tensor)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    return principal, axes
