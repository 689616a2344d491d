"""Contact law: JKR normal force, and springs that resist sliding, rolling and twisting up to a limit.

By default the spring stiffnesses are constants, evaluated at the equilibrium contact radius a₀, so that all forces are
exact gradients of the energy (Dominik & Tielens 1997; Dominik & Nübold 2002, appendix A.5).  Without adhesion (γ = 0)
a contact is Hertzian and has no springs.
"""

import math
from typing import NamedTuple

from ..compiler.jit import formula
from ..numerics.vec import across, add, axpy, cross, dot, scale, sub
from . import jkr, tangential


class ContactConstants(NamedTuple):
    """Constants of one contact, computed by `contact_constants` and stored as a column of `ContactArrays.constants`."""

    reduced_radius: float  # R [m]
    rest_radius: float  # a₀ [m]
    pull_off_force: float  # F_c [N]
    pull_off_overlap: float  # δ_c [m]; R without adhesion, to keep the formulas finite
    break_overlap: float  # the contact breaks at δ = −break_overlap [m]: δ_c, or 0 without adhesion
    hertz: float  # (4/3) E* √R [N/m^1.5] without adhesion, else 0
    slide_stiffness: float  # k_s [N/m]
    roll_stiffness: float  # k_r [N/m]
    twist_stiffness: float  # k_t [N m]
    slide_limit: float  # ζ_c [m]
    roll_limit: float  # ξ_c [m]
    twist_limit: float  # φ_c [rad]
    damping: float  # c [kg/s], independent of the contact radius
    damping_per_radius: float  # c/a [kg/(m s)]
    max_squared_frequency: float  # ω² of the fastest mode of the pair [1/s²]


class Pairing(NamedTuple):
    """Parameters of a pair of materials under the settings of `sand.Contact`."""

    surface_energy: float  # γ_eff [J/m²]
    modulus: float  # E* [Pa]
    shear: float  # G* [Pa]
    twist_shear: float  # G′ [Pa]
    roll_limit: float  # ξ_c [m]
    slide_factor: float  # multipliers of k_s, k_r, k_t
    roll_factor: float
    twist_factor: float
    damping: float  # c [kg/s]
    damping_per_radius: float  # c/a [kg/(m s)]


class Pose(NamedTuple):
    """Relative position and orientation of two grains in contact."""

    n: tuple  # unit vector from grain 2 to grain 1
    distance: float  # D [m]
    n1: tuple  # contact pointers: unit vectors from each centre to the contact, laboratory frame
    n2: tuple
    twist: float  # φ [rad]


class Displacements(NamedTuple):
    """The four displacements of a contact from its unstrained configuration."""

    overlap: float  # δ [m]
    slide: tuple  # ζ [m]
    roll: tuple  # R (n1 + n2) [m]; its tangential part is ξ
    twist: float  # φ [rad]


HERTZ_CONTACT_RADIUS = 0.3
"""a/R at which the highest frequency of a contact without adhesion is evaluated."""
DAMPING_FACTOR = 4.0
"""Damping counts as a mode of frequency 4 c/m̄, which keeps time steps below the damping time m̄/c."""


@formula
def contact_constants(pairing, r1, r2, m1, m2):
    """Constants of a contact between two grains.

    Parameters
    ----------
    pairing : Pairing
        Parameters of the two materials.
    r1, r2 : float
        Radii [m].
    m1, m2 : float
        Masses [kg].

    Returns
    -------
    ContactConstants
        Its `max_squared_frequency` is that of the fastest of the four modes of the free pair, or of the damping.
    """
    reduced = r1 * r2 / (r1 + r2)
    adhesive = pairing.surface_energy > 0.0
    a0 = jkr.rest_radius(pairing.surface_energy, reduced, pairing.modulus)
    pull_off = jkr.pull_off_force(pairing.surface_energy, reduced)
    pull_off_overlap = jkr.pull_off_overlap(a0, reduced) if adhesive else reduced
    k_s = pairing.slide_factor * tangential.slide_stiffness(pairing.shear, a0)
    k_r = pairing.roll_factor * tangential.roll_stiffness(pull_off, reduced)
    k_t = pairing.twist_factor * tangential.twist_stiffness(pairing.twist_shear, a0)
    radius = a0 if adhesive else HERTZ_CONTACT_RADIUS * reduced
    k_n = jkr.normal_stiffness(a0, pairing.modulus) if adhesive else 2.0 * pairing.modulus * radius
    damping = pairing.damping + pairing.damping_per_radius * radius
    # squared frequencies of the four modes of the free pair; I = (2/5) m r². Sliding: r²/I = 5/(2m) adds 5/2 to each
    # 1/m, hence 7/2; rolling (stiffness k_r R²) and twisting: 1/I1 + 1/I2
    inverse_mass = 1.0 / m1 + 1.0 / m2
    inverse_inertia = 2.5 * (1.0 / (m1 * r1 * r1) + 1.0 / (m2 * r2 * r2))
    squared_frequency = max(k_n * inverse_mass, 3.5 * k_s * inverse_mass)
    squared_frequency = max(squared_frequency, max(k_r * reduced * reduced, k_t) * inverse_inertia)
    return ContactConstants(
        reduced,
        a0,
        pull_off,
        pull_off_overlap,
        pull_off_overlap if adhesive else 0.0,
        0.0 if adhesive else 4.0 / 3.0 * pairing.modulus * math.sqrt(reduced),
        k_s,
        k_r,
        k_t,
        # without springs no contact slides; a limit of 0 would be exceeded by rounding errors
        tangential.slide_limit(pairing.shear, pairing.twist_shear, a0) if adhesive else reduced,
        pairing.roll_limit,
        tangential.TWIST_LIMIT,
        pairing.damping,
        pairing.damping_per_radius,
        max(squared_frequency, (DAMPING_FACTOR * damping * inverse_mass) ** 2),
    )


@formula
def scaled_stiffness(constants, y, follow):
    """ContactConstants with the tangential stiffnesses of the present contact radius, y = √(a/a₀).

    With `follow` ("dt97") k_s ∝ a, k_r ∝ a^(3/2) and k_t ∝ a³; otherwise ("frozen") they are unchanged.
    """
    y2 = y * y
    return ContactConstants(
        constants.reduced_radius,
        constants.rest_radius,
        constants.pull_off_force,
        constants.pull_off_overlap,
        constants.break_overlap,
        constants.hertz,
        constants.slide_stiffness * (y2 if follow else 1.0),
        constants.roll_stiffness * (y2 * y if follow else 1.0),
        constants.twist_stiffness * (y2 * y2 * y2 if follow else 1.0),
        constants.slide_limit,
        constants.roll_limit,
        constants.twist_limit,
        constants.damping,
        constants.damping_per_radius,
        constants.max_squared_frequency,
    )


@formula
def normal_force(overlap, y, constants):
    """Normal force [N], positive in compression: JKR, or Hertz F = (4/3) E* √R δ^(3/2) without adhesion."""
    pressed = max(overlap, 0.0)
    return jkr.force_at(y, constants.pull_off_force) + constants.hertz * pressed * math.sqrt(pressed)


@formula
def contact_radius(overlap, y, constants):
    """Contact radius [m]: a = a₀ y² (JKR) or √(R δ) (Hertz)."""
    pressed = math.sqrt(constants.reduced_radius * max(overlap, 0.0))
    return constants.rest_radius * y * y + (pressed if constants.hertz > 0.0 else 0.0)


@formula
def damping_force(overlap, y, closing, constants):
    """Damping force [N] on grain 1 along n: (c + (c/a) a) dδ/dt, with dδ/dt = `closing` [m/s]."""
    return (constants.damping + constants.damping_per_radius * contact_radius(overlap, y, constants)) * closing


@formula
def contact_load(pose, overlap, y, r1, r2, constants):
    """Force on grain 1 [N] and torques on both grains [N m]; the force on grain 2 is the opposite.

        F1 = F_JKR n + k_s ((d·n)/D) ζ
        M1 = −r1 k_s n1×ζ − R² k_r n1×n2 − k_t φ n
        M2 = +r2 k_s n2×ζ − R² k_r n2×n1 + k_t φ n

    The factor (d·n)/D makes M1 + M2 + (x1−x2)×F1 = 0 exact.

    Parameters
    ----------
    pose : Pose
        Relative pose of the grains.
    overlap : float
        δ [m].
    y : float
        √(a/a₀) at this overlap, from `jkr.root` or `jkr.polynomial_root`.
    r1, r2 : float
        Radii [m].
    constants : ContactConstants
        Constants with the present stiffnesses (see `scaled_stiffness`).
    """
    zeta, along = tangential.sliding(pose.n1, pose.n2, pose.n, r1, r2)
    normal = normal_force(overlap, y, constants)
    force = axpy(normal, pose.n, scale(constants.slide_stiffness * along / pose.distance, zeta))
    rolling_torque = scale(constants.reduced_radius**2 * constants.roll_stiffness, cross(pose.n1, pose.n2))
    torque = axpy(constants.twist_stiffness * pose.twist, pose.n, rolling_torque)
    torque1 = sub(scale(-r1 * constants.slide_stiffness, cross(pose.n1, zeta)), torque)
    torque2 = add(scale(r2 * constants.slide_stiffness, cross(pose.n2, zeta)), torque)
    return force, torque1, torque2


@formula
def displacements_of(pose, overlap, r1, r2, constants):
    """Displacements of a contact in the given pose."""
    zeta, _ = tangential.sliding(pose.n1, pose.n2, pose.n, r1, r2)
    return Displacements(overlap, zeta, tangential.rolling(pose.n1, pose.n2, constants.reduced_radius), pose.twist)


@formula
def exceeds_limits(displacements, n, constants):
    """Whether a displacement exceeds its limit, so that the contact must slip or break."""
    xi = across(displacements.roll, n)
    return (
        (displacements.overlap < -constants.break_overlap)
        | (dot(displacements.slide, displacements.slide) > constants.slide_limit * constants.slide_limit)
        | (dot(xi, xi) > constants.roll_limit * constants.roll_limit)
        | (abs(displacements.twist) > constants.twist_limit)
    )


@formula
def _slip_factor(size, limit, reset):
    """Factor that reduces a displacement of this size to its limit, or to 0."""
    if size <= limit:
        return 1.0
    return 0.0 if reset else limit / size


@formula
def after_slip(displacements, n, constants, reset):
    """Displacements after slip: those beyond a limit are set to the limit or, with `reset`, to 0 (paper, A.6).

    The returned `roll` is the tangential displacement ξ′ for which new contact pointers are computed.
    """
    xi = across(displacements.roll, n)
    slide_size = math.sqrt(dot(displacements.slide, displacements.slide))
    slide = scale(_slip_factor(slide_size, constants.slide_limit, reset), displacements.slide)
    roll = scale(_slip_factor(math.sqrt(dot(xi, xi)), constants.roll_limit, reset), xi)
    twist = _slip_factor(abs(displacements.twist), constants.twist_limit, reset) * displacements.twist
    return Displacements(displacements.overlap, slide, roll, twist)


@formula
def normal_energy(overlap, y, constants):
    """Energy [J] of the normal mode: JKR, or Hertz (2/5)·(4/3) E* √R δ^(5/2); 0 for separated surfaces."""
    pressed = max(overlap, 0.0)
    stored = jkr.energy_at(y, constants.pull_off_force, constants.pull_off_overlap)
    return stored + 0.4 * constants.hertz * pressed * pressed * math.sqrt(pressed)


@formula
def normal_stiffness_at(overlap, y, constants):
    """dF/dδ [N/m] of the normal mode: JKR, or Hertz (3/2)·(4/3) E* √(R δ); 0 for separated surfaces."""
    stiffness = jkr.stiffness_at(y, constants.pull_off_force, constants.pull_off_overlap)
    return stiffness + 1.5 * constants.hertz * math.sqrt(max(overlap, 0.0))


@formula
def energies(pose, overlap, y, r1, r2, constants):
    """Energies [J] stored in the normal, sliding, rolling and twisting modes.

    The rolling energy includes the normal part of n1 + n2: the torque −R² k_r n1×n2 is its exact gradient.
    """
    zeta, _ = tangential.sliding(pose.n1, pose.n2, pose.n, r1, r2)
    xi = tangential.rolling(pose.n1, pose.n2, constants.reduced_radius)
    return (
        normal_energy(overlap, y, constants),
        0.5 * constants.slide_stiffness * dot(zeta, zeta),
        0.5 * constants.roll_stiffness * dot(xi, xi),
        0.5 * constants.twist_stiffness * pose.twist * pose.twist,
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
    roll = dot(add(start.roll, left.roll), sub(end.roll, left.roll))
    twist = (start.twist + left.twist) * (end.twist - left.twist)
    return (
        0.5 * constants.slide_stiffness * slide,
        0.5 * constants.roll_stiffness * roll,
        0.5 * constants.twist_stiffness * twist,
    )


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
def forming_loss(constants):
    """Energy [J] dissipated when a contact forms: U jumps from 0 to −0.846614 F_c δ_c; 0 without adhesion."""
    return -jkr.energy_at(jkr.ROOT_AT_TOUCH, constants.pull_off_force, constants.pull_off_overlap)


@formula
def breaking_loss(constants):
    """Energy [J] dissipated when a contact breaks, (4/45) F_c δ_c, and the force just before, −(5/9) F_c [N]."""
    y = jkr.ROOT_AT_BREAK
    lost = jkr.energy_at(y, constants.pull_off_force, constants.pull_off_overlap)
    return lost, jkr.force_at(y, constants.pull_off_force)


@formula
def contact_speed_gain(overlap, closing, reduced, constants, dt):
    """Increase w′ − w of the closing speed [m/s] by the contact force between first touch and this overlap.

    ½ m̄ w′² + U(δ) + dt² (k w′²/12 − F²/(24 m̄)) = ½ m̄ w² + U(0), k = dF/dδ: the left-hand side is the modified
    energy that velocity Verlet conserves (shadow Hamiltonian; Hairer, Lubich & Wanner 2006, IX.1).  Without the terms
    in dt² the mean energy of the oscillation that follows is too low by a fraction (ω dt)²/8.  w′ = 0 where no kinetic
    energy is left (no adhesion, grazing contact).

    Parameters
    ----------
    overlap : float
        δ [m].
    closing : float
        Closing speed w at first touch [m/s]; the gain is 0 for a pair that is not closing.
    reduced : float
        Reduced mass m̄ [kg].
    constants : ContactConstants
        Constants of the contact.
    dt : float
        Time step [s].
    """
    if not closing > 0.0:
        return 0.0
    y = jkr.root(jkr.stretch(overlap, constants.pull_off_overlap))
    energy_drop = -forming_loss(constants) - normal_energy(overlap, y, constants)
    force = normal_force(overlap, y, constants) * dt / reduced
    stiffness = normal_stiffness_at(overlap, y, constants) * dt * dt / reduced
    square = (closing * closing + 2.0 * energy_drop / reduced + force * force / 12.0) / (1.0 + stiffness / 6.0)
    return math.sqrt(max(square, 0.0)) - closing
