"""The whole contact law: JKR normal force and springs that slide, roll and twist up to a limit.

The stiffnesses are frozen at a₀, so forces are exact gradients of the energy (Dominik & Tielens 1997;
Dominik & Nübold 2002, appendix A.5).
"""

import math
from typing import NamedTuple

from ..core.jit import formula
from ..core.vec import across, add, axpy, cross, dot, scale, sub
from . import adhesion, tangential


class Bond(NamedTuple):
    """The constants of one contact; made by `bond_between`, stored as one column per contact."""

    reduced_radius: float  # R [m]
    pull_off_force: float  # F_c [N]
    pull_off_overlap: float  # δ_c [m]
    slide_stiffness: float  # k_s [N/m]
    roll_stiffness: float  # k_r [N/m]
    twist_stiffness: float  # k_t [N m]
    slide_limit: float  # ζ_c [m]
    roll_limit: float  # ξ_c [m]
    twist_limit: float  # φ_c [rad]
    fastest: float  # ω² of the pair's fastest mode [1/s²]


class Pairing(NamedTuple):
    """What two materials make together."""

    surface_energy: float  # γ_eff [J/m²]
    modulus: float  # E* [Pa]
    shear: float  # G* [Pa]
    twist_shear: float  # G′ [Pa]
    roll_limit: float  # ξ_c [m]


class Pose(NamedTuple):
    """How two grains in contact stand to each other."""

    n: tuple  # unit vector from grain 2 to grain 1
    distance: float  # D [m]
    n1: tuple  # pointer of grain 1, laboratory frame
    n2: tuple  # pointer of grain 2
    twist: float  # φ [rad]


class Strain(NamedTuple):
    """The four displacements of a contact."""

    overlap: float  # δ [m]
    slide: tuple  # ζ [m]
    roll: tuple  # ξ [m], tangential part
    twist: float  # φ [rad]


@formula
def bond_between(pairing, r1, r2, m1, m2):
    """The constants of a contact between grains of radii r1, r2 [m] and masses m1, m2 [kg]."""
    reduced = r1 * r2 / (r1 + r2)
    a0 = adhesion.rest_radius(pairing.surface_energy, reduced, pairing.modulus)
    pull = adhesion.pull_off_force(pairing.surface_energy, reduced)
    k_s = tangential.slide_stiffness(pairing.shear, a0)
    k_r = tangential.roll_stiffness(pull, reduced)
    k_t = tangential.twist_stiffness(pairing.twist_shear, a0)
    k_n = adhesion.normal_stiffness(a0, pairing.modulus)
    # squared frequencies of the four modes of the free pair; I = (2/5) m r²
    light = 1.0 / m1 + 1.0 / m2
    rolls = 2.5 * reduced * reduced * (1.0 / (m1 * r1 * r1) + 1.0 / (m2 * r2 * r2))
    twists = 2.5 * (1.0 / (m1 * r1 * r1) + 1.0 / (m2 * r2 * r2))
    fastest = max(max(k_n * light, 3.5 * k_s * light), max(k_r * rolls, k_t * twists))
    return Bond(
        reduced,
        pull,
        adhesion.pull_off_overlap(a0, reduced),
        k_s,
        k_r,
        k_t,
        tangential.slide_limit(pairing.shear, pairing.twist_shear, a0),
        pairing.roll_limit,
        tangential.TWIST_LIMIT,
        fastest,
    )


@formula
def contact_load(pose, overlap, y, r1, r2, bond):
    """Force on grain 1 [N] and torques on both grains [N m]; the force on grain 2 is the opposite.

        F1 = F_JKR n + k_s ((d·n)/D) ζ
        M1 = −r1 k_s n1×ζ − R² k_r n1×n2 − k_t φ n
        M2 = +r2 k_s n2×ζ − R² k_r n2×n1 + k_t φ n

    The factor (d·n)/D makes M1 + M2 + (x1−x2)×F1 = 0 exact.

    Args:
        y: √(a/a₀) of this overlap, from `adhesion.root` or `root_in_reach`.
    """
    zeta, along = tangential.sliding(pose.n1, pose.n2, pose.n, r1, r2)
    normal = adhesion.force_at(y, bond.pull_off_force)
    push = axpy(normal, pose.n, scale(bond.slide_stiffness * along / pose.distance, zeta))
    bend = scale(bond.reduced_radius**2 * bond.roll_stiffness, cross(pose.n1, pose.n2))
    turn = axpy(bond.twist_stiffness * pose.twist, pose.n, bend)
    torque1 = sub(scale(-r1 * bond.slide_stiffness, cross(pose.n1, zeta)), turn)
    torque2 = add(scale(r2 * bond.slide_stiffness, cross(pose.n2, zeta)), turn)
    return push, torque1, torque2


@formula
def strain_of(pose, overlap, r1, r2, bond):
    """The four displacements."""
    zeta, _ = tangential.sliding(pose.n1, pose.n2, pose.n, r1, r2)
    xi = across(tangential.rolling(pose.n1, pose.n2, bond.reduced_radius), pose.n)
    return Strain(overlap, zeta, xi, pose.twist)


@formula
def beyond_limits(strain, bond):
    """True where the contact must move or break."""
    return (
        (strain.overlap < -bond.pull_off_overlap)
        | (dot(strain.slide, strain.slide) > bond.slide_limit * bond.slide_limit)
        | (dot(strain.roll, strain.roll) > bond.roll_limit * bond.roll_limit)
        | (abs(strain.twist) > bond.twist_limit)
    )


@formula
def _yielded(size, limit, release):
    """Factor that takes a displacement of this size to where the limit leaves it."""
    if size <= limit:
        return 1.0
    return 0.0 if release else limit / size


@formula
def yielded(strain, bond, release):
    """The displacements after the contact has moved: clamped to the limit, or released to 0 (paper, A.6)."""
    slides = _yielded(math.sqrt(dot(strain.slide, strain.slide)), bond.slide_limit, release)
    rolls = _yielded(math.sqrt(dot(strain.roll, strain.roll)), bond.roll_limit, release)
    twists = _yielded(abs(strain.twist), bond.twist_limit, release)
    return Strain(strain.overlap, scale(slides, strain.slide), scale(rolls, strain.roll), twists * strain.twist)


@formula
def energies(pose, overlap, r1, r2, bond):
    """Stored energy [J] of the modes: normal, sliding, rolling, twisting.

    The rolling energy uses all of n1 + n2, of which the torque −R² k_r n1×n2 is the exact gradient.
    """
    zeta, _ = tangential.sliding(pose.n1, pose.n2, pose.n, r1, r2)
    xi = tangential.rolling(pose.n1, pose.n2, bond.reduced_radius)
    y = adhesion.root(adhesion.stretch(overlap, bond.pull_off_overlap))
    return (
        adhesion.energy_at(y, bond.pull_off_force, bond.pull_off_overlap),
        0.5 * bond.slide_stiffness * dot(zeta, zeta),
        0.5 * bond.roll_stiffness * dot(xi, xi),
        0.5 * bond.twist_stiffness * pose.twist * pose.twist,
    )


@formula
def lost_by_yielding(before, reached, left, bond):
    """Energy [J] lost in a step by sliding, rolling, twisting: ½k (q_before + q_left)·(q_reached − q_left).

    It is the work of the mode's force over the step less what stays stored, so that with trapezoidal work
    (velocity Verlet) nothing is lost from the books.  A broken contact leaves q = 0.
    """
    slide = dot(add(before.slide, left.slide), sub(reached.slide, left.slide))
    roll = dot(add(before.roll, left.roll), sub(reached.roll, left.roll))
    twist = (before.twist + left.twist) * (reached.twist - left.twist)
    return (
        0.5 * bond.slide_stiffness * slide,
        0.5 * bond.roll_stiffness * roll,
        0.5 * bond.twist_stiffness * twist,
    )


@formula
def forming(bond):
    """Energy [J] lost at first touch, where U jumps from 0 to −0.846614 F_c δ_c, and the force there [N]."""
    y = adhesion.ROOT_AT_TOUCH
    lost = -adhesion.energy_at(y, bond.pull_off_force, bond.pull_off_overlap)
    return lost, adhesion.force_at(y, bond.pull_off_force)


@formula
def breaking(bond):
    """Energy [J] lost where the neck snaps, (4/45) F_c δ_c, and the force just before, −(5/9) F_c [N]."""
    y = adhesion.ROOT_AT_BREAK
    lost = adhesion.energy_at(y, bond.pull_off_force, bond.pull_off_overlap)
    return lost, adhesion.force_at(y, bond.pull_off_force)
