"""Forces and torques of a contact are exact gradients of its energy, for any radii."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sand.contact import jkr, law, tangential
from sand.contact.model import Contact
from sand.material import ICE, IRON, SILICA
from sand.numerics.quaternion import turn, turned
from sand.numerics.vec import add, cross, dot, scale, sub

RATIOS = st.sampled_from([1.0, 0.5, 0.2, 0.05])
SMALL = st.floats(-1.0, 1.0)
TRIPLE = st.tuples(SMALL, SMALL, SMALL)


UP = (0.0, 0.0, 1.0)


def unit(v):
    return scale(1.0 / math.sqrt(dot(v, v)), v)


def contact_of(ratio, materials=(SILICA, ICE)):
    """Two grains of radii r and ratio·r and the constants of their contact."""
    r1, r2 = 1e-7, ratio * 1e-7
    a, b = materials
    masses = [m.density * 4 / 3 * math.pi * r**3 for m, r in zip(materials, (r1, r2), strict=True)]
    return r1, r2, law.contact_constants(Contact().pairing(a, b), r1, r2, *masses)


class Pair:
    """Two grains that can be pushed and turned by hand; the pointers stay in their bodies."""

    def __init__(self, ratio, push, turn1, turn2, twist=0.3):
        self.r1, self.r2, self.constants = contact_of(ratio)
        self.n0 = unit((0.6, -0.3, 0.74))
        rest = self.r1 + self.r2 - 0.5 * self.constants.pull_off_overlap
        size = self.constants.slide_limit
        self.x1 = add(scale(rest, self.n0), scale(size, push))
        self.x2 = (0.0, 0.0, 0.0)
        identity = (0.0, 0.0, 0.0, 1.0)
        angle = self.constants.slide_limit / self.r1
        self.q1 = turn(identity, scale(angle, turn1))
        self.q2 = turn(identity, scale(angle, turn2))
        self.twist = twist * self.constants.twist_limit

    def pose(self):
        apart = sub(self.x1, self.x2)
        distance = math.sqrt(dot(apart, apart))
        n1 = turned(self.q1, scale(-1.0, self.n0))
        n2 = turned(self.q2, self.n0)
        return law.Pose(scale(1.0 / distance, apart), distance, n1, n2, self.twist)

    def overlap(self):
        return self.r1 + self.r2 - self.pose().distance

    def energies(self):
        return np.array(law.energies(self.pose(), self.overlap(), self.y(), self.r1, self.r2, self.constants))

    def y(self):
        return jkr.root(jkr.stretch(self.overlap(), self.constants.pull_off_overlap))

    def load(self):
        return law.contact_load(self.pose(), self.overlap(), self.y(), self.r1, self.r2, self.constants)


def slope(pair, change, h):
    """dU/dh of the modes along a small change, by central differences with one Richardson step."""

    def at(t):
        change(t)
        u = pair.energies()
        change(-t)
        return u

    coarse = (at(h) - at(-h)) / (2 * h)
    fine = (at(h / 2) - at(-h / 2)) / h
    return (4 * fine - coarse) / 3


@settings(max_examples=60, deadline=None)
@given(RATIOS, TRIPLE, TRIPLE, TRIPLE)
def test_the_force_is_minus_the_gradient(ratio, push, turn1, turn2):
    """F1 = −∂U/∂x1 of normal, sliding and rolling energy together.

    Twist is held (its energy depends on the spins' history, not on places).  Central differences with a
    step of 1e-3 δc and one Richardson step: truncation 1e-12, rounding 1e-16·U/h·… below 1e-8 of k_s ζ_c.
    """
    pair = Pair(ratio, push, turn1, turn2)
    h = 1e-3 * pair.constants.pull_off_overlap
    scale_of_force = pair.constants.slide_stiffness * pair.constants.slide_limit + pair.constants.pull_off_force
    force, _, _ = pair.load()
    for axis, e in enumerate(np.eye(3)):

        def move(t, e=tuple(e)):
            pair.x1 = add(pair.x1, scale(t, e))

        assert -slope(pair, move, h).sum() == pytest.approx(force[axis], abs=1e-7 * scale_of_force)


@settings(max_examples=60, deadline=None)
@given(RATIOS, TRIPLE, TRIPLE, TRIPLE, st.sampled_from([1, 2]))
def test_the_torque_is_minus_the_gradient(ratio, push, turn1, turn2, which):
    """M = −∂U/∂θ for sliding and rolling, and for twisting dφ = (dθ1 − dθ2)·n; tolerance as for the force."""
    pair = Pair(ratio, push, turn1, turn2)
    torque = pair.load()[which]
    sign = 1.0 if which == 1 else -1.0
    n, name = pair.pose().n, f"q{which}"
    h = 1e-3 * pair.constants.slide_limit / pair.r1
    size = pair.constants.slide_stiffness * pair.constants.slide_limit * pair.r1
    size += pair.constants.twist_stiffness * pair.constants.twist_limit
    for axis, e in enumerate(np.eye(3)):

        def move(t, e=tuple(e)):
            setattr(pair, name, turn(getattr(pair, name), scale(t, e)))
            pair.twist += sign * t * dot(e, n)

        assert -slope(pair, move, h).sum() == pytest.approx(torque[axis], abs=1e-7 * size)


@settings(max_examples=60, deadline=None)
@given(RATIOS, TRIPLE, TRIPLE, TRIPLE)
def test_each_mode_alone(ratio, push, turn1, turn2):
    """−dU_mode equals the mode's own work for a random small motion: every spring alone, not only their sum."""
    pair = Pair(ratio, push, turn1, turn2)
    b, pose = pair.constants, pair.pose()
    zeta, along = tangential.sliding(pose.n1, pose.n2, pose.n, pair.r1, pair.r2)
    dx, d1, d2 = (0.3, -0.5, 0.2), (0.1, 0.7, -0.2), (-0.4, 0.2, 0.6)
    h = 1e-3 * b.slide_limit

    def move(t):
        pair.x1 = add(pair.x1, scale(t, dx))
        pair.q1 = turn(pair.q1, scale(t / pair.r1, d1))
        pair.q2 = turn(pair.q2, scale(t / pair.r1, d2))
        pair.twist += t / pair.r1 * dot(sub(d1, d2), pose.n)

    y = jkr.root(jkr.stretch(pair.overlap(), b.pull_off_overlap))
    bend = scale(b.reduced_radius**2 * b.roll_stiffness, cross(pose.n1, pose.n2))
    works = (
        jkr.force_at(y, b.pull_off_force) * dot(pose.n, dx),
        b.slide_stiffness * along / pose.distance * dot(zeta, dx)
        - b.slide_stiffness * dot(cross(pose.n1, zeta), d1)
        + b.slide_stiffness * pair.r2 / pair.r1 * dot(cross(pose.n2, zeta), d2),
        (dot(bend, d2) - dot(bend, d1)) / pair.r1,
        -b.twist_stiffness * pose.twist * dot(sub(d1, d2), pose.n) / pair.r1,
    )
    size = (
        b.pull_off_force,
        b.slide_stiffness * b.slide_limit,
        b.roll_stiffness * b.slide_limit,
        b.twist_stiffness * b.twist_limit / pair.r1,
    )
    for found, work, unit_ in zip(-slope(pair, move, h), works, size, strict=True):
        assert found == pytest.approx(work, abs=1e-7 * unit_)


@given(RATIOS, TRIPLE, TRIPLE, TRIPLE)
def test_no_contact_spins_itself_up(ratio, push, turn1, turn2):
    """M1 + M2 + (x1−x2)×F1 = 0 to rounding, for unequal radii too: angular momentum."""
    pair = Pair(ratio, push, turn1, turn2)
    force, torque1, torque2 = pair.load()
    total = np.array(add(add(torque1, torque2), cross(sub(pair.x1, pair.x2), force)))
    b = pair.constants
    size = b.slide_stiffness * b.slide_limit * pair.r1 + b.pull_off_force * pair.r1
    assert np.abs(total).max() < 1e-13 * size


@given(RATIOS, TRIPLE, TRIPLE, TRIPLE)
def test_swapping_the_grains_swaps_the_loads(ratio, push, turn1, turn2):
    """Which grain is called 1 is nobody's business: F → −F, M1 ↔ M2; φ is the same number."""
    pair = Pair(ratio, push, turn1, turn2)
    force, torque1, torque2 = pair.load()
    p = pair.pose()
    swapped = law.Pose(scale(-1.0, p.n), p.distance, p.n2, p.n1, p.twist)
    y = jkr.root(jkr.stretch(pair.overlap(), pair.constants.pull_off_overlap))
    back, other1, other2 = law.contact_load(swapped, pair.overlap(), y, pair.r2, pair.r1, pair.constants)
    assert back == pytest.approx(scale(-1.0, force), rel=1e-9, abs=1e-22)
    assert other1 == pytest.approx(torque2, rel=1e-9, abs=1e-29)
    assert other2 == pytest.approx(torque1, rel=1e-9, abs=1e-29)


@given(RATIOS, TRIPLE, TRIPLE)
def test_pointers_land_on_their_target(ratio, slide, roll):
    """n1, n2 made for (ζ', ξ') have just these displacements, to 1e-12 of them, radii 1:1 to 1:20."""
    r1, r2, constants = contact_of(ratio)
    n = unit((0.2, 0.5, -0.8))
    size = constants.slide_limit
    wish_slide = scale(size, sub(slide, scale(dot(slide, n), n)))
    wish_roll = scale(size, sub(roll, scale(dot(roll, n), n)))
    n1, n2 = tangential.pointers_for(wish_slide, wish_roll, n, r1, r2)
    pose = law.Pose(n, r1 + r2, n1, n2, 0.0)
    strain = law.displacements_of(pose, 0.0, r1, r2, constants)
    across_n = sub(strain.roll, scale(dot(strain.roll, n), n))
    # rounding: coordinates of size r1 are subtracted
    assert strain.slide == pytest.approx(wish_slide, abs=1e-12 * size + 4e-16 * r1)
    assert across_n == pytest.approx(wish_roll, abs=1e-12 * size + 4e-16 * r1)
    assert dot(n1, n1) == pytest.approx(1.0, abs=1e-15)
    assert dot(n2, n2) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("reset", [False, True])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_limits_hold_on_both_sides(reset, sign):
    """Clamp leaves a displacement at its limit, reset at 0; both signs of the twist."""
    _, _, constants = contact_of(1.0)
    over = law.Displacements(
        0.0,
        (0.0, sign * 2 * constants.slide_limit, 0.0),
        (3 * constants.roll_limit, 0.0, 0.0),
        sign * 2 * constants.twist_limit,
    )
    assert law.exceeds_limits(over, UP, constants)
    left = law.after_slip(over, UP, constants, reset)
    part = 0.0 if reset else 1.0
    assert left.slide[1] == pytest.approx(part * sign * constants.slide_limit, rel=1e-6, abs=0.0)
    assert left.roll[0] == pytest.approx(part * constants.roll_limit, rel=1e-6, abs=0.0)
    assert left.twist == pytest.approx(part * sign * constants.twist_limit, rel=1e-6, abs=0.0)
    zero = (0.0, 0.0, 0.0)
    alone = (
        law.Displacements(0.0, zero, zero, sign * 1.1 * constants.twist_limit),
        law.Displacements(0.0, (0.0, sign * 1.1 * constants.slide_limit, 0.0), zero, 0.0),
        law.Displacements(0.0, zero, (sign * 1.1 * constants.roll_limit, 0.0, 0.0), 0.0),
        law.Displacements(-1.01 * constants.pull_off_overlap, zero, zero, 0.0),
    )
    assert all(law.exceeds_limits(strain, UP, constants) for strain in alone)
    within = law.Displacements(
        0.0, (0.0, 0.9 * constants.slide_limit, 0.0), (0.0, 0.0, 0.0), sign * 0.9 * constants.twist_limit
    )
    assert not law.exceeds_limits(within, UP, constants)
    assert law.after_slip(within, UP, constants, reset) == within


def test_what_yielding_dissipates():
    """½k(q_before + q_left)·(q_reached − q_left): clamped on the limit k q_c (|q| − q_c); reset ½k q_before·q."""
    _, _, b = contact_of(1.0)
    c = b.slide_limit
    zero = (0.0, 0.0, 0.0)
    before = law.Displacements(0.0, (c, 0.0, 0.0), zero, 0.0)
    reached = law.Displacements(0.0, (1.1 * c, 0.0, 0.0), zero, 0.0)
    clamped = law.slip_losses(before, reached, law.after_slip(reached, UP, b, False), b)
    assert clamped[0] == pytest.approx(b.slide_stiffness * c * 0.1 * c, rel=1e-12, abs=0.0)
    reset = law.slip_losses(before, reached, law.after_slip(reached, UP, b, True), b)
    assert reset[0] == pytest.approx(0.5 * b.slide_stiffness * c * 1.1 * c, rel=1e-12, abs=0.0)


def test_constants_of_equal_grains():
    """k_s = 8G*a0, ζ_c = (2−ν)a0/(16π), critical force G a0²/(4π)·…; k_r = 12πγ; M_c = 4Fcξ_c; k_t, φ_c."""
    r1, _, b = contact_of(1.0, (IRON, IRON))
    g, nu, gamma = IRON.shear_modulus, IRON.poisson_ratio, IRON.surface_energy
    same = Contact().pairing(IRON, IRON)
    a0 = jkr.rest_radius(same.surface_energy, r1 / 2, same.modulus)
    assert b.slide_stiffness == pytest.approx(8 * a0 * g / (2 * (2 - nu)), rel=1e-6, abs=0.0)
    assert b.slide_limit == pytest.approx((2 - nu) * a0 / (16 * math.pi), rel=1e-6, abs=0.0)
    assert b.slide_stiffness * b.slide_limit == pytest.approx(g * a0**2 / (4 * math.pi), rel=1e-6, abs=0.0)
    assert b.roll_stiffness == pytest.approx(12 * math.pi * gamma, rel=1e-6, abs=0.0)
    torque = b.roll_stiffness * b.reduced_radius * b.roll_limit
    assert torque == pytest.approx(4 * b.pull_off_force * 1e-9, rel=1e-6, abs=0.0)
    assert b.twist_stiffness == pytest.approx(16 / 3 * (g / 2) * a0**3, rel=1e-6, abs=0.0)
    assert b.twist_stiffness * b.twist_limit == pytest.approx((g / 2) * a0**3 / (3 * math.pi), rel=1e-6, abs=0.0)


def test_periods_of_20_nm_iron():
    """T_slide = 1.9e-11 s and T_n = 4.3e-11 s for 20 nm (diameter) iron: ω² = 7k_s/m and 2k_n/m."""
    r = 1e-8
    mass = IRON.density * 4 / 3 * math.pi * r**3
    b = law.contact_constants(Contact().pairing(IRON, IRON), r, r, mass, mass)
    assert 2 * math.pi / math.sqrt(b.max_squared_frequency) == pytest.approx(1.9e-11, rel=0.02, abs=0.0)
    assert b.max_squared_frequency == pytest.approx(7 * b.slide_stiffness / mass, rel=1e-6, abs=0.0)
    same = Contact().pairing(IRON, IRON)
    a0 = jkr.rest_radius(same.surface_energy, r / 2, same.modulus)
    k_n = jkr.normal_stiffness(a0, same.modulus)
    assert 2 * math.pi / math.sqrt(2 * k_n / mass) == pytest.approx(4.3e-11, rel=0.02, abs=0.0)
    assert a0 / (r / 2) == pytest.approx(0.53, rel=1e-6, abs=0.005)
