"""The whole contact law: JKR normal force and springs that slide, roll and twist up to a limit.

By default the stiffnesses are frozen at a₀, so forces are exact gradients of the energy (Dominik & Tielens 1997;
Dominik & Nübold 2002, appendix A.5).  Without adhesion (γ = 0) a contact is Hertzian and has no springs.
"""

import math
from typing import NamedTuple

from ..compiler.jit import formula
from ..numerics.vec import across, add, axpy, cross, dot, scale, sub
from . import jkr, tangential


class Bond(NamedTuple):
    """The constants of one contact; made by `bond_between`, stored as columns of an array."""

    reduced_radius: float  # R [m]
    rest_radius: float  # a₀ [m]
    pull_off_force: float  # F_c [N]
    pull_off_overlap: float  # δ_c [m]; without adhesion a length that only keeps formulas finite
    break_overlap: float  # the contact breaks at δ below minus this [m]: δ_c, or 0 without adhesion
    hertz: float  # (4/3) E* √R [N/m^1.5] without adhesion, else 0
    slide_stiffness: float  # k_s [N/m]
    roll_stiffness: float  # k_r [N/m]
    twist_stiffness: float  # k_t [N m]
    slide_limit: float  # ζ_c [m]
    roll_limit: float  # ξ_c [m]
    twist_limit: float  # φ_c [rad]
    damping: float  # c [kg/s], whatever the contact radius
    damping_per_radius: float  # c/a [kg/(m s)]
    fastest: float  # ω² of the pair's fastest mode [1/s²]


class Pairing(NamedTuple):
    """What two materials make together under the settings of the law."""

    surface_energy: float  # γ_eff [J/m²]
    modulus: float  # E* [Pa]
    shear: float  # G* [Pa]
    twist_shear: float  # G′ [Pa]
    roll_limit: float  # ξ_c [m]
    slide_factor: float  # multipliers on k_s, k_r, k_t
    roll_factor: float
    twist_factor: float
    damping: float  # c [kg/s]
    damping_per_radius: float  # c/a [kg/(m s)]


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
    roll: tuple  # R (n1 + n2) [m]; its tangential part is ξ
    twist: float  # φ [rad]


HERTZ_RADIUS = 0.3
"""a/R at which the fastest period of a contact without adhesion is reckoned."""
DAMPING_SHARE = 4.0
"""Steps are kept below the time m̄/c of damping by counting it as a mode of frequency 4 c/m̄."""


@formula
def bond_between(pairing, r1, r2, m1, m2):
    """The constants of a contact between grains of radii r1, r2 [m] and masses m1, m2 [kg]."""
    reduced = r1 * r2 / (r1 + r2)
    sticks = pairing.surface_energy > 0.0
    a0 = jkr.rest_radius(pairing.surface_energy, reduced, pairing.modulus)
    pull = jkr.pull_off_force(pairing.surface_energy, reduced)
    pull_off_overlap = jkr.pull_off_overlap(a0, reduced) if sticks else reduced
    k_s = pairing.slide_factor * tangential.slide_stiffness(pairing.shear, a0)
    k_r = pairing.roll_factor * tangential.roll_stiffness(pull, reduced)
    k_t = pairing.twist_factor * tangential.twist_stiffness(pairing.twist_shear, a0)
    width = a0 if sticks else HERTZ_RADIUS * reduced
    k_n = jkr.normal_stiffness(a0, pairing.modulus) if sticks else 2.0 * pairing.modulus * width
    damping = pairing.damping + pairing.damping_per_radius * width
    # squared frequencies of the four modes of the free pair; I = (2/5) m r²
    light = 1.0 / m1 + 1.0 / m2
    turns = 2.5 * (1.0 / (m1 * r1 * r1) + 1.0 / (m2 * r2 * r2))
    fastest = max(max(k_n * light, 3.5 * k_s * light), max(k_r * reduced * reduced, k_t) * turns)
    return Bond(
        reduced,
        a0,
        pull,
        pull_off_overlap,
        pull_off_overlap if sticks else 0.0,
        0.0 if sticks else 4.0 / 3.0 * pairing.modulus * math.sqrt(reduced),
        k_s,
        k_r,
        k_t,
        # without springs nothing slides beyond a limit; 0 would flag rounding
        tangential.slide_limit(pairing.shear, pairing.twist_shear, a0) if sticks else reduced,
        pairing.roll_limit,
        tangential.TWIST_LIMIT,
        pairing.damping,
        pairing.damping_per_radius,
        max(fastest, (DAMPING_SHARE * damping * light) ** 2),
    )


@formula
def stiffened(bond, y, follow):
    """The bond with stiffnesses for y = √(a/a₀): as they are, or k_s ∝ a, k_r ∝ a^(3/2), k_t ∝ a³ ("dt97")."""
    y2 = y * y
    return Bond(
        bond.reduced_radius,
        bond.rest_radius,
        bond.pull_off_force,
        bond.pull_off_overlap,
        bond.break_overlap,
        bond.hertz,
        bond.slide_stiffness * (y2 if follow else 1.0),
        bond.roll_stiffness * (y2 * y if follow else 1.0),
        bond.twist_stiffness * (y2 * y2 * y2 if follow else 1.0),
        bond.slide_limit,
        bond.roll_limit,
        bond.twist_limit,
        bond.damping,
        bond.damping_per_radius,
        bond.fastest,
    )


@formula
def normal_force(overlap, y, bond):
    """Normal force [N], push positive: JKR, or Hertz (4/3) E* √R δ^(3/2) without adhesion."""
    pressed = max(overlap, 0.0)
    return jkr.force_at(y, bond.pull_off_force) + bond.hertz * pressed * math.sqrt(pressed)


@formula
def contact_radius(overlap, y, bond):
    """a [m]: a₀ y² (JKR) or √(Rδ) (Hertz)."""
    pressed = math.sqrt(bond.reduced_radius * max(overlap, 0.0))
    return bond.rest_radius * y * y + (pressed if bond.hertz > 0.0 else 0.0)


@formula
def damping_force(overlap, y, closing, bond):
    """Damping force [N] on grain 1 along n at the rate dδ/dt = closing [m/s]: (c + (c/a) a) dδ/dt."""
    return (bond.damping + bond.damping_per_radius * contact_radius(overlap, y, bond)) * closing


@formula
def contact_load(pose, overlap, y, r1, r2, bond):
    """Force on grain 1 [N] and torques on both grains [N m]; the force on grain 2 is the opposite.

        F1 = F_JKR n + k_s ((d·n)/D) ζ
        M1 = −r1 k_s n1×ζ − R² k_r n1×n2 − k_t φ n
        M2 = +r2 k_s n2×ζ − R² k_r n2×n1 + k_t φ n

    The factor (d·n)/D makes M1 + M2 + (x1−x2)×F1 = 0 exact.

    Parameters
    ----------
    y
        √(a/a₀) of this overlap, from `jkr.root` or `root_in_reach`.
    bond
        with the stiffnesses in force, see `stiffened`.
    """
    zeta, along = tangential.sliding(pose.n1, pose.n2, pose.n, r1, r2)
    normal = normal_force(overlap, y, bond)
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
    return Strain(overlap, zeta, tangential.rolling(pose.n1, pose.n2, bond.reduced_radius), pose.twist)


@formula
def beyond_limits(strain, n, bond):
    """True where the contact must move or break."""
    xi = across(strain.roll, n)
    return (
        (strain.overlap < -bond.break_overlap)
        | (dot(strain.slide, strain.slide) > bond.slide_limit * bond.slide_limit)
        | (dot(xi, xi) > bond.roll_limit * bond.roll_limit)
        | (abs(strain.twist) > bond.twist_limit)
    )


@formula
def _yielded(size, limit, release):
    """Factor that takes a displacement of this size to where the limit leaves it."""
    if size <= limit:
        return 1.0
    return 0.0 if release else limit / size


@formula
def yielded(strain, n, bond, release):
    """The displacements after the contact has moved: clamped to the limit, or released to 0 (paper, A.6).

    What `roll` has left is the tangential ξ' that the pointers are then made for.
    """
    xi = across(strain.roll, n)
    slides = _yielded(math.sqrt(dot(strain.slide, strain.slide)), bond.slide_limit, release)
    rolls = _yielded(math.sqrt(dot(xi, xi)), bond.roll_limit, release)
    twists = _yielded(abs(strain.twist), bond.twist_limit, release)
    return Strain(strain.overlap, scale(slides, strain.slide), scale(rolls, xi), twists * strain.twist)


@formula
def normal_energy(overlap, y, bond):
    """Energy [J] of the normal mode: JKR, or Hertz (2/5)·(4/3) E* √R δ^(5/2); 0 for surfaces apart."""
    pressed = max(overlap, 0.0)
    stored = jkr.energy_at(y, bond.pull_off_force, bond.pull_off_overlap)
    return stored + 0.4 * bond.hertz * pressed * pressed * math.sqrt(pressed)


@formula
def normal_stiffness_at(overlap, y, bond):
    """dF/dδ [N/m] of the normal mode: JKR, or Hertz (3/2)·(4/3) E* √(R δ); 0 for surfaces apart."""
    stiffness = jkr.stiffness_at(y, bond.pull_off_force, bond.pull_off_overlap)
    return stiffness + 1.5 * bond.hertz * math.sqrt(max(overlap, 0.0))


@formula
def energies(pose, overlap, y, r1, r2, bond):
    """Stored energy [J] of the modes: normal, sliding, rolling, twisting.

    The rolling energy uses all of n1 + n2, of which the torque −R² k_r n1×n2 is the exact gradient.
    """
    zeta, _ = tangential.sliding(pose.n1, pose.n2, pose.n, r1, r2)
    xi = tangential.rolling(pose.n1, pose.n2, bond.reduced_radius)
    return (
        normal_energy(overlap, y, bond),
        0.5 * bond.slide_stiffness * dot(zeta, zeta),
        0.5 * bond.roll_stiffness * dot(xi, xi),
        0.5 * bond.twist_stiffness * pose.twist * pose.twist,
    )


@formula
def lost_by_yielding(before, reached, left, bond):
    """Energy [J] lost in a step by sliding, rolling, twisting: ½k (q_before + q_left)·(q_reached − q_left).

    It is the work of the mode's force over the step less what stays stored, so that with trapezoidal work
    (velocity Verlet) nothing is lost from the books.  A broken contact leaves q = 0.  For rolling, q is all of
    R (n1 + n2), as in the torque and the energy: its normal part matters where ξ_c is not small against r.
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
def lost_to_stiffness(before, reached, earlier, bond):
    """Energy [J] that changing stiffnesses take out of the springs in a step: ½ (k_before − k) q_before·q_reached.

    Zero for frozen stiffnesses.  Negative where the springs stiffen: "dt97" is not conservative, and this is
    what it makes or destroys.

    Parameters
    ----------
    earlier
        the bond with the stiffnesses at the start of the step.
    bond
        the bond with those at its end.
    """
    slide = (earlier.slide_stiffness - bond.slide_stiffness) * dot(before.slide, reached.slide)
    roll = (earlier.roll_stiffness - bond.roll_stiffness) * dot(before.roll, reached.roll)
    twist = (earlier.twist_stiffness - bond.twist_stiffness) * before.twist * reached.twist
    return 0.5 * (slide + roll + twist)


@formula
def forming(bond):
    """Energy [J] lost at first touch, where U jumps from 0 to −0.846614 F_c δ_c; 0 without adhesion."""
    return -jkr.energy_at(jkr.ROOT_AT_TOUCH, bond.pull_off_force, bond.pull_off_overlap)


@formula
def breaking(bond):
    """Energy [J] lost where the neck snaps, (4/45) F_c δ_c, and the force just before, −(5/9) F_c [N]."""
    y = jkr.ROOT_AT_BREAK
    lost = jkr.energy_at(y, bond.pull_off_force, bond.pull_off_overlap)
    return lost, jkr.force_at(y, bond.pull_off_force)


@formula
def speed_gained(overlap, closing, reduced, bond, dt):
    """w' − w [m/s]: closing speed that the contact adds between first touch and this overlap; 0 if not closing.

    ½ m̄ w'² + U(δ) + dt² (k w'²/12 − F²/(24 m̄)) = ½ m̄ w² + U(0), k = dF/dδ: on the left is what velocity Verlet
    keeps in the contact (Hairer, Lubich & Wanner 2006, IX.1).  Without the terms in dt² the mean energy of the ringing
    that follows is (ω dt)²/8 too low.  Where no speed is left (no adhesion, a graze) the pair has none.
    """
    if not closing > 0.0:
        return 0.0
    y = jkr.root(jkr.stretch(overlap, bond.pull_off_overlap))
    work = -forming(bond) - normal_energy(overlap, y, bond)
    force = normal_force(overlap, y, bond) * dt / reduced
    stiffer = normal_stiffness_at(overlap, y, bond) * dt * dt / reduced
    square = (closing * closing + 2.0 * work / reduced + force * force / 12.0) / (1.0 + stiffer / 6.0)
    return math.sqrt(max(square, 0.0)) - closing
