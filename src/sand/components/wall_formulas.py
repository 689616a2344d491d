"""Mechanics of the contact of a grain with a plane wall: the limit r2 → ∞ of the contact of two grains (`mechanics`).

R = r1 and n2 = n, the normal of the wall towards the grains.  The contact pointer of the wall becomes a point A, the
anchor, that is fixed to the wall.  Limits, slip, losses and stored energies are those of `mechanics`.
"""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

from ..compiler.jit import formula
from ..contact import tangential
from ..contact.law import ContactLaw, reduced_constants
from ..contact.mechanics import Displacements, load_on_grain
from ..numerics.vec import across, axpy, scale, sub


class WallPose(NamedTuple):
    """Position and orientation of a grain in contact with a wall."""

    n: tuple  # normal of the wall, from the wall to the grain
    height: float  # distance of the centre of the grain from the plane [m]
    offset: tuple  # part of x − A along the plane [m]
    n1: tuple  # contact pointer of the grain, laboratory frame
    twist: float  # φ [rad]


@formula
def wall_displacements(pose, radius):
    """Displacements: δ = r1 − h, ζ = (x − A)_∥ + r1 (n1)_∥, the vector r1 (n1 + n) of rolling, φ.

    From `tangential.sliding` with x2 = x1 − D n and A = x2 + r2 n2: ζ = (r1 n1 − r2 n2)_∥ = r1 (n1)_∥ − (A − x1)_∥.
    """
    slide = axpy(radius, across(pose.n1, pose.n), pose.offset)
    return Displacements(radius - pose.height, slide, tangential.rolling(pose.n1, pose.n, radius), pose.twist)


@formula
def wall_load(pose, slide, normal, radius, constants):
    """Force on the grain [N], its opposite on the wall, torque on the grain [N m], and none on the wall.

        F = F_n n − k_s ζ
        M = −r1 k_s n1×ζ − r1² k_r n1×n − k_t φ n

    The limit of `mechanics.contact_load`, where (d·n)/D → −1.

    Parameters
    ----------
    pose : WallPose
        The pose.
    slide : tuple
        ζ [m].
    normal : float
        Normal force F_n [N] of the contact law, positive in compression.
    radius : float
        r1 [m].
    constants : ContactConstants
        Constants with the present stiffnesses.
    """
    force, torque, _ = load_on_grain(pose, pose.n, slide, -constants.slide_stiffness, normal, radius, constants)
    return force, torque, (0.0, 0.0, 0.0)


@formula
def wall_pointers(slide, roll, n, radius):
    """Contact pointer n1 and (x − A)_∥ with the given displacements ζ and ξ, both along the plane.

    The limit of `tangential.pointers_for`: t1 = ξ/r1, n1 = −n √(1 − t1²) + t1, (x − A)_∥ = ζ − ξ.
    """
    t1 = scale(1.0 / radius, roll)
    return tangential.pointer(-1.0, n, t1), sub(slide, roll)


@functools.cache
def wall_constants(law: ContactLaw) -> Callable:
    """The formula `(pairing, radius, mass, wall_mass)` → `ContactConstants` of a grain and a plane wall.

    The limit r2 → ∞ of `contact_constants`: R = r1 and 1/I2 = 0.  `wall_mass` is infinite if the motion of the wall is
    given.
    """
    constants_of = reduced_constants(law)

    @formula
    def constants_at_wall(pairing, radius, mass, wall_mass):
        inverse_inertia = 2.5 / (mass * radius * radius)
        return constants_of(pairing, radius, (radius, math.inf), 1.0 / mass + 1.0 / wall_mass, inverse_inertia)

    return constants_at_wall
