"""Bodies of dilute dust that keep momentum and spin from one encounter to the next: growth without a gas.

A body has a velocity V, an angular momentum L, and the part of it along its principal axes.  Two of them meet at the
rate π b̂²(v) v/V with their own relative speed v = |V − V′|, so that slow and fast bodies, hot and cold rotors differ.
Between two encounters a body turns freely, in thin dust many thousands of times: L stays, and the phases of the motion
are forgotten.  That motion has two of them: L circles on a closed curve in the frame of the body, and the body turns
about L.  Before a flight both are uniform, the mean over a long time: L in the body is drawn on its curve, with the
time of free rotation as its measure, and the body has a random angle about L.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk, ndtri

from ..basics.constants import COULOMB
from .dilute_body import Body, Motion
from .dilute_flight import start_radius
from .dilute_majorant import Approach, Majorant, Sizes
from .dilute_population import sizes_of
from .dilute_start import direction, rotation_onto
from .scattering.event_draws import event_uniforms
from .scattering.initial_conditions import R, U
from .scattering.two_aggregates import ANGULAR1, TURN1, TURN2

FLIGHT_BLOCK, START_BLOCK, COPY_BLOCK = 4, 5, 7
"""Blocks of the random numbers of flights, of bodies at the start (two), and of copies, one more for each doubling."""
OWN_START = 4.0
"""Distance at which flights start, in units of b̂; of charges see `start_distance`.  The interaction U there is left
out of the energy that bodies keep, which heats them by half its variance over k_BT in each encounter: 5e-4 k_BT from
2 b̂, 64 times less from here."""
MOST_MODULUS = 1.0 - 1e-12
"""Largest modulus m of the elliptic functions; at 1 the period of the free motion is infinite."""


class OwnMajorant(Majorant):
    """The rate of encounters of two bodies at their own relative speed."""

    def kernel(self, a: Sizes, b: Sizes) -> Any:
        """π b̂²(v) v [m³/s]; 0 for bodies at rest to each other, which never meet."""
        speed = relative_speed(a, b)
        moving = np.where(speed > 0.0, speed, 1.0)
        return np.where(speed > 0.0, math.pi * self.bound(a, b, moving) ** 2 * moving, 0.0)

    def draw(self, a: Sizes, b: Sizes, uniforms: tuple[float, ...]) -> Approach:
        """Their own speed, and b² uniform up to b̂²."""
        speed = float(relative_speed(a, b))
        bound = float(self.bound(a, b, speed))
        return Approach(speed, bound * math.sqrt(uniforms[2]), bound)


def relative_speed(a: Sizes, b: Sizes) -> Any:
    """|V − V′| [m/s]."""
    return np.sqrt((a.vx - b.vx) ** 2 + (a.vy - b.vy) ** 2 + (a.vz - b.vz) ** 2)


def thermal_body(body: Body, heat: float, seed: int, number: int) -> Body:
    """A body with thermal momentum and spin, k_BT = `heat` [J], of a seed and its number."""
    normal = ndtri(np.array(event_uniforms(seed, number, START_BLOCK)))
    own = np.sqrt(heat * np.array(body.flying.inertia)) * normal[3:6]
    pose = random_rotation(event_uniforms(seed, number, START_BLOCK + 1)[:3])
    return dataclasses.replace(body, motion=Motion(math.sqrt(heat / body.mass) * normal[:3], pose @ own, own))


def turned_copy(body: Body, seed: int, number: int) -> Body:
    """A body whose velocity and angular momentum are turned by a random rotation, or it would not meet its original."""
    turn = random_rotation(event_uniforms(seed, number, COPY_BLOCK + body.copy)[:3])
    moving = motion_of(body)
    return dataclasses.replace(body, motion=Motion(turn @ moving.velocity, turn @ moving.angular, moving.own))


def motion_of(body: Body) -> Motion:
    """The motion of a body that has one."""
    assert body.motion is not None
    return body.motion


def random_rotation(uniforms: tuple[float, ...]) -> np.ndarray:
    """Uniformly random rotation (3, 3), from three uniform deviates."""
    pole = np.array([0.0, 0.0, 1.0])
    return rotation_onto(pole, direction(2.0 * uniforms[0] - 1.0, uniforms[1], pole), uniforms[2])


def angular_at(own: np.ndarray, inertia: tuple[float, float, float], phase: float) -> np.ndarray:
    """Angular momentum in the frame of a body at a phase 0 … 1 of its free rotation, uniform in time.

    Euler's equations keep |L|² and Σ L_k²/I_k.  With ρ = I₁(I₃ − I₂)/I₂(I₃ − I₁), σ = 1 − ρ, A₁² = L₁² + ρ L₂² and
    A₃² = L₃² + σ L₂² the curve is, with Jacobi's elliptic functions of the modulus m = σA₁²/ρA₃² < 1,

        L = (A₁ cn u, A₁ sn u/√ρ, ± A₃ dn u),  u = 4 K(m) × phase

    (Landau & Lifshitz, Mechanics, § 37), about the third axis; if σA₁² > ρA₃², axes 1 and 3, ρ and σ change places.
    A body with three equal moments of inertia keeps L.
    """
    i1, i2, i3 = inertia
    if i1 == i3:
        return own
    share = i1 * (i3 - i2) / (i2 * (i3 - i1))
    squares = own[0] ** 2 + share * own[1] ** 2, own[2] ** 2 + (1.0 - share) * own[1] ** 2
    circling, along, part = 0, 2, share  # of the components that L circles in and about
    if (1.0 - share) * squares[0] >= share * squares[1]:
        circling, along, part = 2, 0, 1.0 - share
        squares = squares[::-1]
    most = part * squares[1]
    modulus = min((1.0 - part) * squares[0] / most, MOST_MODULUS) if most > 0.0 else 0.0
    sn, cn, dn, _ = ellipj(4.0 * ellipk(modulus) * phase, modulus)
    found = np.empty(3)
    found[circling] = math.sqrt(squares[0]) * cn
    found[1] = math.sqrt(squares[0] / part) * sn if part > 0.0 else 0.0
    found[along] = math.copysign(math.sqrt(squares[1]), own[along]) * dn
    return found


def pose_of(body: Body, uniforms: tuple[float, ...]) -> np.ndarray:
    """Rotation (3, 3) of a body that has turned freely for a long time, from three uniform deviates.

    At rest its orientation is random.
    """
    moving = motion_of(body)
    if not moving.angular.any():
        return random_rotation(uniforms)
    own = angular_at(moving.own, body.flying.inertia, uniforms[0])
    return rotation_onto(own / np.linalg.norm(own), moving.angular / np.linalg.norm(moving.angular), uniforms[1])


def own_start(a: Body, b: Body, approach: Approach, distance: float, event: tuple[int, int]) -> np.ndarray | None:
    """State (20,) of two bodies at a distance [m] before their encounter, of an event (seed, number).

    The azimuth of the impact parameter is random; charges have brought the bodies there on their Kepler orbit.  None
    if bodies with charges never come so near.
    """
    (speed, impact, _), repulsion = approach, repulsion_of(a, b)
    radius = start_radius(a, b, distance, impact)
    across = impact * speed / radius
    square = speed**2 - 2.0 * repulsion / radius - across**2
    angle = angle_from_infinity(speed, impact, radius, repulsion)
    if square <= 0.0 or angle is None:
        return None
    uniforms = event_uniforms(*event, FLIGHT_BLOCK)
    along, side = directions(a, b, uniforms[0])
    outward = math.sin(angle) * side - math.cos(angle) * along
    onward = math.cos(angle) * side + math.sin(angle) * along
    radial = math.sqrt(square)
    poses = [pose_of(body, part) for body, part in ((a, uniforms[1:4]), (b, uniforms[4:7]))]
    turns = [Rotation.from_matrix(pose).as_quat() for pose in poses]
    angular = motion_of(a).angular, motion_of(b).angular
    return np.concatenate([radius * outward, across * onward - radial * outward, *turns, *angular])


def directions(a: Body, b: Body, uniform: float) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors of the relative velocity of two bodies and of the impact parameter, at a random azimuth."""
    relative = motion_of(a).velocity - motion_of(b).velocity
    along = relative / np.linalg.norm(relative)
    return along, direction(0.0, uniform, along)


def repulsion_of(a: Body, b: Body) -> float:
    """q q′/4πε₀m̄ [m³/s²] of the net charges; positive if they repel each other."""
    return COULOMB * a.charge * b.charge * (a.mass + b.mass) / (a.mass * b.mass)


def angle_from_infinity(speed: float, impact: float, radius: float, repulsion: float) -> float | None:
    """Angle [rad] at which a Kepler orbit is at a radius [m], from the direction in which it came; None if it never is.

    With Q/m̄ = k: b²v²/r = b v² sin φ − k (1 − cos φ); sin φ = b/r without charges.
    """
    size = math.hypot(repulsion, impact * speed**2)
    cosine = (impact**2 * speed**2 / radius + repulsion) / size
    return math.atan2(impact * speed**2, repulsion) - math.acos(cosine) if abs(cosine) <= 1.0 else None


def velocity_far_away(r: np.ndarray, u: np.ndarray, repulsion: float) -> np.ndarray | None:
    """Relative velocity (3,) [m/s] of receding charges at an infinite distance; None if they come back."""
    if repulsion == 0.0:
        return u
    radius = float(np.linalg.norm(r))
    outward = r / radius
    aside = u - (u @ outward) * outward
    across, square = float(np.linalg.norm(aside)), float(u @ u) + 2.0 * repulsion / radius
    if square <= 0.0:
        return None
    speed = math.sqrt(square)
    # the orbit backwards comes from there
    angle = angle_from_infinity(speed, radius * across / speed, radius, repulsion)
    if angle is None or across == 0.0:
        return speed * outward
    return speed * (math.cos(angle) * outward + math.sin(angle) / across * aside)


def deflected(a: Body, b: Body, approach: Approach, event: tuple[int, int]) -> list[Body]:
    """Both bodies after net charges have deflected them far from each other, by Rutherford's angle; spins stay."""
    along, side = directions(a, b, event_uniforms(*event, FLIGHT_BLOCK)[0])
    speed, impact, _ = approach
    angle = 2.0 * math.atan2(impact * speed**2, repulsion_of(a, b))  # between the directions in which r comes and goes
    velocity = speed * (math.sin(angle) * side - math.cos(angle) * along)
    return with_velocities(a, b, velocity)


def parted(a: Body, b: Body, state: np.ndarray, majorant: Majorant) -> list[Body]:
    """Both bodies after an encounter without a touch, from the state of the pair.

    They are unchanged if the encounter has no reverse (`has_reverse`).
    """
    r, u, momenta = state[R : R + 3], state[U : U + 3], state[ANGULAR1:].reshape(2, 3).copy()
    velocity = velocity_far_away(r, u, repulsion_of(a, b))
    if velocity is None or not has_reverse(a, b, np.cross(r, u), velocity, majorant):
        return [a, b]
    found = []
    for body, turn, lab in zip(with_velocities(a, b, velocity), (TURN1, TURN2), momenta, strict=True):
        own = Rotation.from_quat(state[turn : turn + 4]).inv().apply(lab)
        found.append(dataclasses.replace(body, motion=Motion(motion_of(body).velocity, lab, own)))
    return found


def has_reverse(a: Body, b: Body, orbit: np.ndarray, velocity: np.ndarray, majorant: Majorant) -> bool:
    """Whether b′ ≤ b̂(v′) for two bodies that have parted, from r × u (3,) and their velocity v′ far away.

    Encounters are drawn up to b̂, so that the reverse of one with b′ > b̂(v′) never happens.  With such ones translation
    and rotation would not keep equal temperatures.
    """
    speed = float(np.linalg.norm(velocity))
    return bool(np.linalg.norm(orbit) <= speed * majorant.bound(sizes_of(a), sizes_of(b), speed))


def with_velocities(a: Body, b: Body, relative: np.ndarray) -> list[Body]:
    """Both bodies with another relative velocity V − V′ [m/s] and their total momentum."""
    centre, found = centre_velocity(a, b), []
    for body, other, sign in ((a, b, 1.0), (b, a, -1.0)):
        share = sign * other.mass / (a.mass + b.mass)
        found.append(dataclasses.replace(body, motion=motion_of(body)._replace(velocity=centre + share * relative)))
    return found


def centre_velocity(a: Body, b: Body) -> np.ndarray:
    """Velocity of the centre of mass of two bodies (3,) [m/s]."""
    return np.asarray((a.mass * motion_of(a).velocity + b.mass * motion_of(b).velocity) / (a.mass + b.mass))
