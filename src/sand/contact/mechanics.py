"""Mechanics of one contact, the same for every contact law: pose, displacements, springs, limits, slip and energies.

By default the spring stiffnesses are constants, evaluated at the equilibrium contact radius a₀, so that all forces are
exact gradients of the energy (Dominik & Tielens 1997; Dominik & Nübold 2002, appendix A.5).  Normal forces and energies
come from the contact law (`law.ContactLaw`).
"""

import math
from typing import NamedTuple

from ..compiler.jit import formula
from ..numerics.vec import across, add, axpy, cross, dot, scale, sub
from . import tangential
from .law import ContactConstants, Derived


class Pose(NamedTuple):
    """Relative position and orientation of two grains in contact."""

    n: tuple  # unit vector from grain 2 to grain 1
    distance: float  # D [m]
    inverse_distance: float  # 1/D [1/m]
    n1: tuple  # contact pointers: unit vectors from each centre to the contact, laboratory frame
    n2: tuple
    twist: float  # φ [rad]


@formula
def direction_of(separation):
    """Unit vector, length D [m] and 1/D of x1 − x2 [m]."""
    distance = math.sqrt(dot(separation, separation))
    inverse = 1.0 / distance
    return scale(inverse, separation), distance, inverse


@formula
def pose_of(separation, n1, n2, twist):
    """Pose of two grains with x1 − x2 [m], contact pointers n1, n2 in the laboratory frame and twist φ [rad]."""
    n, distance, inverse = direction_of(separation)
    return Pose(n, distance, inverse, n1, n2, twist)


class Displacements(NamedTuple):
    """The four displacements of a contact from its unstrained configuration."""

    overlap: float  # δ [m]
    slide: tuple  # ζ [m]
    roll: tuple  # R (n1 + n2) [m]; its tangential part is ξ
    twist: float  # φ [rad]


@formula
def scaled_stiffness(constants, y, follow):
    """Constants with the tangential stiffnesses of the present contact radius, y = √(a/a₀).

    With `follow` ("dt97") k_s ∝ a, k_r ∝ a^(3/2) and k_t ∝ a³; otherwise ("frozen") they are unchanged.
    """
    y = y if follow else 1.0  # one choice, so that no branch remains in the loop over contacts
    y2 = y * y
    return ContactConstants(
        constants.reduced_radius,
        constants.rest_radius,
        constants.break_overlap,
        constants.slide_stiffness * y2,
        constants.roll_stiffness * (y2 * y),
        constants.twist_stiffness * (y2 * y2 * y2),
        constants.slide_limit,
        constants.roll_limit,
        constants.twist_limit,
        constants.damping,
        constants.damping_per_radius,
        constants.slide_damping,
        constants.roll_damping,
        constants.twist_damping,
        constants.max_squared_frequency,
        constants.normal,
        Derived(
            constants.derived.roll_torque_stiffness * (y2 * y),
            constants.derived.squared_slide_limit,
            constants.derived.squared_roll_limit,
            constants.derived.inverse_break_overlap,
            constants.derived.radius1,
            constants.derived.radius2,
            constants.derived.inverse_radius1,
            constants.derived.inverse_radius2,
            constants.derived.inverse_smaller_radius,
            constants.derived.inverse_sum,
        ),
    )


@formula
def contact_load(pose, normal, r1, r2, constants):
    """Force on grain 1 [N] and torques on both grains [N m]; the force on grain 2 is the opposite.

        F1 = F_n n + k_s ((d·n)/D) ζ
        M1 = −r1 k_s n1×ζ − R² k_r n1×n2 − k_t φ n
        M2 = +r2 k_s n2×ζ − R² k_r n2×n1 + k_t φ n

    Here d = r1 n1 − r2 n2, and ζ is its part across n (`tangential.sliding`).  The factor (d·n)/D makes
    M1 + M2 + (x1−x2)×F1 = 0 exact.

    Parameters
    ----------
    pose : Pose
        Relative pose of the grains.
    normal : float
        Normal force F_n [N] of the contact law, positive in compression.
    r1, r2 : float
        Radii [m].
    constants : ContactConstants
        Constants with the present stiffnesses (see `scaled_stiffness`).
    """
    return load_of_springs(pose, tangential.sliding(pose.n1, pose.n2, pose.n, r1, r2), normal, r1, r2, constants)


@formula
def load_of_springs(pose, sliding, normal, r1, r2, constants):
    """As `contact_load`, with ζ and d·n [m] as of `tangential.sliding`."""
    slide, along = sliding
    pull = constants.slide_stiffness * along * pose.inverse_distance
    force, torque1, torque = load_on_grain(pose, pose.n2, slide, pull, normal, r1, constants)
    return force, torque1, add(scale(r2 * constants.slide_stiffness, cross(pose.n2, slide)), torque)


@formula
def load_on_grain(pose, n2, slide, pull, normal, radius, constants):
    """Force F_n n + `pull` ζ and torque −r k_s n1×ζ − M on a grain, and M = R² k_r n1×n2 + k_t φ n.

    Parameters
    ----------
    pose : Pose or WallPose
        The pose.
    n2 : tuple
        Contact pointer of the other grain; n at a wall.
    slide : tuple
        ζ [m].
    pull : float
        k_s (d·n)/D [N/m]; −k_s at a wall.
    normal : float
        F_n [N].
    radius : float
        Radius r of the grain [m].
    constants : ContactConstants
        Constants with the present stiffnesses.
    """
    force = axpy(normal, pose.n, scale(pull, slide))
    rolling_torque = scale(constants.derived.roll_torque_stiffness, cross(pose.n1, n2))
    torque = axpy(constants.twist_stiffness * pose.twist, pose.n, rolling_torque)
    return force, sub(scale(-radius * constants.slide_stiffness, cross(pose.n1, slide)), torque), torque


@formula
def displacements_of(pose, overlap, r1, r2, constants):
    """Displacements of a contact in the given pose."""
    zeta, _ = tangential.sliding(pose.n1, pose.n2, pose.n, r1, r2)
    return Displacements(overlap, zeta, tangential.rolling(pose.n1, pose.n2, constants.reduced_radius), pose.twist)


@formula
def exceeds_limits(displacements, n, constants):
    """Whether a displacement exceeds its limit, so that the contact must slip or break."""
    slides = exceeds_sliding_or_twisting(displacements, constants)
    return breaks(displacements, constants) | slides | exceeds_rolling(displacements, n, constants)


@formula
def breaks(displacements, constants):
    """Whether the contact is stretched beyond breaking."""
    return displacements.overlap < -constants.break_overlap


@formula
def exceeds_sliding_or_twisting(displacements, constants):
    """Whether ζ or φ exceeds its limit."""
    squared_slide = dot(displacements.slide, displacements.slide)
    return (squared_slide > constants.derived.squared_slide_limit) | (abs(displacements.twist) > constants.twist_limit)


@formula
def exceeds_rolling(displacements, n, constants):
    """Whether ξ exceeds its limit."""
    return _squared_rolling(displacements.roll, n) > constants.derived.squared_roll_limit


@formula
def _squared_rolling(roll, n):
    """ξ² = q² − (q·n)² [m²] for q = R (n1 + n2), where q·n is of second order."""
    along = dot(roll, n)
    return dot(roll, roll) - along * along


@formula
def _slip_factor(size, limit, share, reset):
    """Factor by which slip reduces a displacement: 1 below the limit, else `share` = limit/size or, with `reset`, 0."""
    return share * (1.0 - reset) if size > limit else 1.0  # a choice by `reset` would be a branch in loops


@formula
def after_slip(displacements, n, constants, reset):
    """Displacements after slip: those beyond a limit are set to the limit or, with `reset`, to 0 (paper, A.6).

    The returned `roll` is the tangential displacement ξ′ for which new contact pointers are computed.
    """
    xi, slide = across(displacements.roll, n), displacements.slide
    slide_limit, roll_limit = constants.derived.squared_slide_limit, constants.derived.squared_roll_limit
    slide2, roll2, twist = dot(slide, slide), _squared_rolling(displacements.roll, n), abs(displacements.twist)
    a, b, c = max(slide2, slide_limit), max(roll2, roll_limit), max(twist, constants.twist_limit)
    inverse = 1.0 / (a * b * c)  # one division for three
    slide_share, roll_share = math.sqrt(slide_limit * (b * c * inverse)), math.sqrt(roll_limit * (a * c * inverse))
    twist_share = constants.twist_limit * (a * b * inverse)
    return Displacements(
        displacements.overlap,
        scale(_slip_factor(slide2, slide_limit, slide_share, reset), slide),
        scale(_slip_factor(roll2, roll_limit, roll_share, reset), xi),
        _slip_factor(twist, constants.twist_limit, twist_share, reset) * displacements.twist,
    )


@formula
def after_rolling(displacements, n, constants, reset):
    """As `after_slip`, for a contact that is beyond the limit of rolling alone."""
    xi, limit = across(displacements.roll, n), constants.derived.squared_roll_limit
    roll2 = _squared_rolling(displacements.roll, n)
    share = math.sqrt(limit / max(roll2, limit))
    roll = scale(_slip_factor(roll2, limit, share, reset), xi)
    return Displacements(displacements.overlap, displacements.slide, roll, displacements.twist)


@formula
def energies(pose, normal, r1, r2, constants):
    """Energies [J] stored in the normal, sliding, rolling and twisting modes; `normal` is the first.

    The rolling energy includes the normal part of n1 + n2: the torque −R² k_r n1×n2 is its exact gradient.
    """
    return stored_energies(displacements_of(pose, 0.0, r1, r2, constants), normal, constants)


@formula
def stored_energies(displacements, normal, constants):
    """As `energies`, from the displacements of a contact."""
    return (
        normal,
        0.5 * constants.slide_stiffness * dot(displacements.slide, displacements.slide),
        0.5 * constants.roll_stiffness * dot(displacements.roll, displacements.roll),
        0.5 * constants.twist_stiffness * displacements.twist * displacements.twist,
    )


@formula
def slip_losses(start, end, left, constants):
    """Energies [J] dissipated in a step by sliding, rolling and twisting: ½k (q_start + q_left)·(q_end − q_left).

    This is the work done on the spring in the step minus the increase of its stored energy.  With work by the
    trapezoidal rule, as in velocity Verlet, the energy balance is exact.  A broken contact leaves q = 0.  For rolling,
    q is the whole vector R (n1 + n2), as in the torque and the energy: its normal part matters where ξ_c is not small
    compared with r.

    Parameters
    ----------
    start, end : Displacements
        Displacements at the start of the step, and at its end before slip.
    left : Displacements
        Displacements after slip.
    constants : ContactConstants
        Constants of the contact.
    """
    slide = dot(add(start.slide, left.slide), sub(end.slide, left.slide))
    twist = (start.twist + left.twist) * (end.twist - left.twist)
    return (
        0.5 * constants.slide_stiffness * slide,
        roll_loss(start.roll, end.roll, left.roll, constants),
        0.5 * constants.twist_stiffness * twist,
    )


@formula
def roll_loss(start, end, left, constants):
    """As `slip_losses` of rolling alone, from the vectors R (n1 + n2) [m]."""
    return 0.5 * constants.roll_stiffness * dot(add(start, left), sub(end, left))


@formula
def release_loss(start, end, constants):
    """As `slip_losses` of all three modes together, of a contact that breaks."""
    zero = (0.0, 0.0, 0.0)
    slid, rolled, twisted = slip_losses(start, end, Displacements(end.overlap, zero, zero, 0.0), constants)
    return slid + rolled + twisted


@formula
def stiffness_loss(start, end, start_constants, end_constants):
    """Energy [J] that changing stiffnesses remove from the springs in a step: ½ (k_start − k_end) q_start·q_end.

    It is zero for frozen stiffnesses and negative where the springs stiffen: "dt97" is not conservative, and this is
    the energy that it creates or destroys.

    Parameters
    ----------
    start, end : Displacements
        Displacements at the start and at the end of the step.
    start_constants, end_constants : ContactConstants
        Constants with the stiffnesses at those times.
    """
    slide = (start_constants.slide_stiffness - end_constants.slide_stiffness) * dot(start.slide, end.slide)
    roll = (start_constants.roll_stiffness - end_constants.roll_stiffness) * dot(start.roll, end.roll)
    twist = (start_constants.twist_stiffness - end_constants.twist_stiffness) * start.twist * end.twist
    return 0.5 * (slide + roll + twist)


@formula
def time_since(path, speed, dt):
    """Time [s] since two surfaces passed a point `path` [m] behind, at most dt; 0 where the speed [m/s] is not above 0.

    For forming the path is the overlap and the speed that of closing, for breaking the path is −δ − δ_c.
    """
    return min(path / speed, dt) if speed > 0.0 else 0.0


@formula
def contact_speed_gain(energy_drop, force, stiffness, closing, reduced, dt):
    """Increase w′ − w of the closing speed [m/s] by the contact force between first touch and the present overlap δ.

    ½ m̄ w′² + U(δ) + dt² (k w′²/12 − F²/(24 m̄)) = ½ m̄ w² + U(0), k = dF/dδ: the left-hand side is the modified
    energy that velocity Verlet conserves (shadow Hamiltonian; Hairer, Lubich & Wanner 2006, IX.1).  Without the terms
    in dt² the mean energy of the oscillation that follows is too low by a fraction (ω dt)²/8.  w′ = 0 where no kinetic
    energy is left (no adhesion, grazing contact).

    Parameters
    ----------
    energy_drop : float
        U(0) − U(δ) [J].
    force : float
        Normal force F(δ) [N].
    stiffness : float
        k [N/m].
    closing : float
        Closing speed w at first touch [m/s]; the gain is 0 for a pair that is not closing.
    reduced : float
        Reduced mass m̄ [kg].
    dt : float
        Time step [s].
    """
    if not closing > 0.0:
        return 0.0
    accelerated = force * dt / reduced
    stiff = stiffness * dt * dt / reduced
    square = closing * closing + 2.0 * energy_drop / reduced + accelerated * accelerated / 12.0
    return math.sqrt(max(square / (1.0 + stiff / 6.0), 0.0)) - closing
