"""Sliding, rolling, twisting: displacements, springs, limits (Dominik & Tielens 1995, 1996, 1997).

Contact pointers n1, n2 are unit vectors from each centre to the contact, fixed to the grains.  Without strain n1 = −n
and n2 = +n, where n points from grain 2 to grain 1 (e_perp in the paper, Eq. 44).
"""

import math

from ..compiler.jit import formula
from ..numerics.vec import add, axpy, dot, scale, sub


@formula
def sliding(n1, n2, n, r1, r2):
    """Sliding displacement ζ [m] and d·n [m] with d = r1 n1 − r2 n2 (ζ = −δ_parallel of Eq. 46)."""
    d = sub(scale(r1, n1), scale(r2, n2))
    along = dot(d, n)
    return axpy(-along, n, d), along


@formula
def rolling(n1, n2, reduced_radius):
    """Rolling displacement ξ = R (n1 + n2) [m], minus Eq. 47, which points from the contact to the axis."""
    return scale(reduced_radius, add(n1, n2))


@formula
def twisting_rate(n, turn, speed, inverse_distance, dt):
    """Twisting rate dφ/dt = Ω·n [rad/s] with n in the middle of the step, from Ω = ω1 − ω2, v1 − v2 and 1/D.

    `n` is the axis at the end of the step.  Half a step earlier the axis is n − (dt/2) v_across/D, to second order in
    dt, and Ω·v_across = Ω·v − (Ω·n)(v·n).
    """
    along = dot(turn, n)
    return along - 0.5 * dt * inverse_distance * (dot(turn, speed) - along * dot(speed, n))


@formula
def pointers_for(slide, roll, n, r1, r2):
    """Unit contact pointers n1, n2 with the given tangential displacements; exact for any radii.

    t1 = ξ/r1 + ζ/(r1+r2), t2 = ξ/r2 − ζ/(r1+r2), n1 = −n√(1−t1²) + t1, n2 = n√(1−t2²) + t2
    """
    return pointers_by(slide, roll, n, 1.0 / r1, 1.0 / r2, 1.0 / (r1 + r2))[:2]


@formula
def pointers_by(slide, roll, n, inverse1, inverse2, inverse_sum):
    """As `pointers_for`, from 1/r1, 1/r2 and 1/(r1 + r2) [1/m]; returns n1, n2, −n1·n and n2·n."""
    shared = scale(inverse_sum, slide)
    t1 = axpy(inverse1, roll, shared)
    t2 = sub(scale(inverse2, roll), shared)
    c1, c2 = cosine(t1), cosine(t2)
    return axpy(-c1, n, t1), axpy(c2, n, t2), c1, c2


@formula
def pointer(sign, n, t):
    """The unit vector ±n√(1−t²) + t, for t perpendicular to n."""
    return axpy(sign * cosine(t), n, t)


@formula
def cosine(t):
    """√(1−t²), the part along n of a pointer with the part t across it."""
    return math.sqrt(max(1.0 - dot(t, t), 0.0))


@formula
def slide_stiffness(shear, a0):
    """Sliding stiffness k_s = 8 G* a₀ [N/m], 1/G* = Σ (2−ν)/G."""
    return 8.0 * shear * a0


@formula
def roll_stiffness(pull_off, reduced_radius):
    """Rolling stiffness k_r = 4 F_c/R = 12πγ [N/m]."""
    return 4.0 * pull_off / reduced_radius


@formula
def twist_stiffness(twist_shear, a0):
    """Twisting stiffness k_t = (16/3) G′ a₀³ [N m], 1/G′ = Σ 1/G."""
    return 16.0 / 3.0 * twist_shear * a0 * a0 * a0


@formula
def slide_limit(shear, twist_shear, a0):
    """Critical sliding displacement ζ_c = a₀ G′/(16π G*) [m], (2−ν) a₀/(16π) for equal materials."""
    return a0 * twist_shear / (16.0 * math.pi * shear)


TWIST_LIMIT = 1.0 / (16.0 * math.pi)
"""Critical twisting angle φ_c [rad]."""
