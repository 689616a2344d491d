"""Every registered contact law: forces and torques are exact gradients of the energy, for any radii."""

import math
import warnings
from collections import namedtuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sand
from sand.basics.errors import BadInput
from sand.basics.material import ICE, IRON, SILICA
from sand.compiler.jit import formula
from sand.compiler.user_code import code_digest
from sand.contact import jkr, mechanics, tangential
from sand.contact.damping import NONE
from sand.contact.law import LAWS, ContactLaw, contact_constants, register, ringing_energy
from sand.contact.measure import contacts_stage, energies_stage
from sand.contact.model import Contact
from sand.contact.update import PassVariant
from sand.integrate.stages import contact_event_stages, contact_pass_stage, pair_list_stage
from sand.numerics.quaternion import turn, turned
from sand.numerics.vec import add, cross, dot, scale, sub

ALL_LAWS = st.sampled_from(sorted(LAWS))
RATIOS = st.sampled_from([1.0, 0.5, 0.2, 0.05])
SMALL = st.floats(-1.0, 1.0)
TRIPLE = st.tuples(SMALL, SMALL, SMALL)


UP = (0.0, 0.0, 1.0)


def unit(v):
    return scale(1.0 / math.sqrt(dot(v, v)), v)


def contact_of(ratio, materials=(SILICA, ICE), law="jkr"):
    """Two grains of radii r and ratio·r and the constants of their contact."""
    r1, r2 = 1e-7, ratio * 1e-7
    a, b = materials
    masses = [m.density * 4 / 3 * math.pi * r**3 for m, r in zip(materials, (r1, r2), strict=True)]
    return r1, r2, contact_constants(LAWS[law])(Contact().pairing(a, b), r1, r2, *masses)


class Pair:
    """Two grains near their equilibrium distance, whose positions and orientations a test can change.

    The contact pointers are fixed to the grains.
    """

    def __init__(self, ratio, push, turn1, turn2, twist=0.3, law="jkr"):
        self.law: ContactLaw = LAWS[law]
        self.r1, self.r2, self.constants = contact_of(ratio, law=law)
        self.n0 = unit((0.6, -0.3, 0.74))
        pairing = Contact().pairing(SILICA, ICE)
        self.mode = self.law.normal_mode(pairing.surface_energy, pairing.modulus, self.constants.reduced_radius)
        self.force_scale = self.mode.stiffness * self.mode.rest_overlap
        rest = self.r1 + self.r2 - self.mode.rest_overlap
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
        n1 = turned(self.q1, scale(-1.0, self.n0))
        n2 = turned(self.q2, self.n0)
        return mechanics.pose_of(apart, n1, n2, self.twist)

    def overlap(self):
        return self.r1 + self.r2 - self.pose().distance

    def energies(self):
        normal = self.law.energy(self.overlap(), self.y(), self.constants)
        return np.array(mechanics.energies(self.pose(), normal, self.r1, self.r2, self.constants))

    def y(self):
        return self.law.radius_root(self.overlap(), self.constants)

    def normal_force(self):
        return self.law.force(self.overlap(), self.y(), self.constants)

    def load(self):
        return mechanics.contact_load(self.pose(), self.normal_force(), self.r1, self.r2, self.constants)


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
@given(ALL_LAWS, RATIOS, TRIPLE, TRIPLE, TRIPLE)
def test_the_force_is_minus_the_gradient(law, ratio, push, turn1, turn2):
    """F1 = −∂U/∂x1 of normal, sliding and rolling energy together.

    Twist is held constant (its energy depends on the history of the spins, not on positions).  Central differences with
    a step of 1e-3 δc and one Richardson step: truncation 1e-12, rounding 1e-16·U/h, below 1e-8 of k_s ζ_c.
    """
    pair = Pair(ratio, push, turn1, turn2, law=law)
    h = 1e-3 * pair.mode.rest_overlap
    scale_of_force = pair.constants.slide_stiffness * pair.constants.slide_limit + pair.force_scale
    force, _, _ = pair.load()
    for axis, e in enumerate(np.eye(3)):

        def move(t, e=tuple(e)):
            pair.x1 = add(pair.x1, scale(t, e))

        assert -slope(pair, move, h).sum() == pytest.approx(force[axis], abs=1e-7 * scale_of_force)


@settings(max_examples=60, deadline=None)
@given(ALL_LAWS, RATIOS, TRIPLE, TRIPLE, TRIPLE, st.sampled_from([1, 2]))
def test_the_torque_is_minus_the_gradient(law, ratio, push, turn1, turn2, which):
    """M = −∂U/∂θ for sliding and rolling, and for twisting dφ = (dθ1 − dθ2)·n; tolerance as for the force."""
    pair = Pair(ratio, push, turn1, turn2, law=law)
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
@given(ALL_LAWS, RATIOS, TRIPLE, TRIPLE, TRIPLE)
def test_energy_of_each_mode(law, ratio, push, turn1, turn2):
    """−dU_mode equals the work of the mode for a random small motion: each spring separately, not only the sum."""
    pair = Pair(ratio, push, turn1, turn2, law=law)
    b, pose = pair.constants, pair.pose()
    zeta, along = tangential.sliding(pose.n1, pose.n2, pose.n, pair.r1, pair.r2)
    dx, d1, d2 = (0.3, -0.5, 0.2), (0.1, 0.7, -0.2), (-0.4, 0.2, 0.6)
    h = 1e-3 * b.slide_limit

    def move(t):
        pair.x1 = add(pair.x1, scale(t, dx))
        pair.q1 = turn(pair.q1, scale(t / pair.r1, d1))
        pair.q2 = turn(pair.q2, scale(t / pair.r1, d2))
        pair.twist += t / pair.r1 * dot(sub(d1, d2), pose.n)

    bend = scale(b.reduced_radius**2 * b.roll_stiffness, cross(pose.n1, pose.n2))
    works = (
        pair.normal_force() * dot(pose.n, dx),
        b.slide_stiffness * along / pose.distance * dot(zeta, dx)
        - b.slide_stiffness * dot(cross(pose.n1, zeta), d1)
        + b.slide_stiffness * pair.r2 / pair.r1 * dot(cross(pose.n2, zeta), d2),
        (dot(bend, d2) - dot(bend, d1)) / pair.r1,
        -b.twist_stiffness * pose.twist * dot(sub(d1, d2), pose.n) / pair.r1,
    )
    size = (
        pair.force_scale,
        b.slide_stiffness * b.slide_limit,
        b.roll_stiffness * b.slide_limit,
        b.twist_stiffness * b.twist_limit / pair.r1,
    )
    for found, work, unit_ in zip(-slope(pair, move, h), works, size, strict=True):
        assert found == pytest.approx(work, abs=1e-7 * unit_)


@given(ALL_LAWS, RATIOS, TRIPLE, TRIPLE, TRIPLE)
def test_angular_momentum_is_conserved(law, ratio, push, turn1, turn2):
    """M1 + M2 + (x1−x2)×F1 = 0 to rounding, for unequal radii too."""
    pair = Pair(ratio, push, turn1, turn2, law=law)
    force, torque1, torque2 = pair.load()
    total = np.array(add(add(torque1, torque2), cross(sub(pair.x1, pair.x2), force)))
    b = pair.constants
    size = b.slide_stiffness * b.slide_limit * pair.r1 + pair.force_scale * pair.r1
    assert np.abs(total).max() < 1e-13 * size


@given(ALL_LAWS, RATIOS, TRIPLE, TRIPLE, TRIPLE)
def test_swapping_the_grains_swaps_the_loads(law, ratio, push, turn1, turn2):
    """The order of the grains does not matter: F → −F, M1 ↔ M2; φ is the same number."""
    pair = Pair(ratio, push, turn1, turn2, law=law)
    force, torque1, torque2 = pair.load()
    p = pair.pose()
    swapped = mechanics.pose_of(scale(-p.distance, p.n), p.n2, p.n1, p.twist)
    back, other1, other2 = mechanics.contact_load(swapped, pair.normal_force(), pair.r2, pair.r1, pair.constants)
    assert back == pytest.approx(scale(-1.0, force), rel=1e-9, abs=1e-22)
    assert other1 == pytest.approx(torque2, rel=1e-9, abs=1e-29)
    assert other2 == pytest.approx(torque1, rel=1e-9, abs=1e-29)


@given(RATIOS, TRIPLE, TRIPLE)
def test_pointers_for_given_displacements(ratio, slide, roll):
    """n1, n2 made for (ζ', ξ') have these displacements, to 1e-12 of them, radii 1:1 to 1:20."""
    r1, r2, constants = contact_of(ratio)
    n = unit((0.2, 0.5, -0.8))
    size = constants.slide_limit
    wish_slide = scale(size, sub(slide, scale(dot(slide, n), n)))
    wish_roll = scale(size, sub(roll, scale(dot(roll, n), n)))
    n1, n2 = tangential.pointers_for(wish_slide, wish_roll, n, r1, r2)
    pose = mechanics.pose_of(scale(r1 + r2, n), n1, n2, 0.0)
    strain = mechanics.displacements_of(pose, 0.0, r1, r2, constants)
    across_n = sub(strain.roll, scale(dot(strain.roll, n), n))
    # rounding: coordinates of size r1 are subtracted
    assert strain.slide == pytest.approx(wish_slide, abs=1e-12 * size + 4e-16 * r1)
    assert across_n == pytest.approx(wish_roll, abs=1e-12 * size + 4e-16 * r1)
    assert dot(n1, n1) == pytest.approx(1.0, abs=1e-15)
    assert dot(n2, n2) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("reset", [False, True])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_limits_hold_on_both_sides(reset, sign):
    """slip="clamp" leaves a displacement at its limit, "reset" at 0; both signs of the twist."""
    _, _, constants = contact_of(1.0)
    over = mechanics.Displacements(
        0.0,
        (0.0, sign * 2 * constants.slide_limit, 0.0),
        (3 * constants.roll_limit, 0.0, 0.0),
        sign * 2 * constants.twist_limit,
    )
    assert mechanics.exceeds_limits(over, UP, constants)
    left = mechanics.after_slip(over, UP, constants, reset)
    part = 0.0 if reset else 1.0
    assert left.slide[1] == pytest.approx(part * sign * constants.slide_limit, rel=1e-6, abs=0.0)
    assert left.roll[0] == pytest.approx(part * constants.roll_limit, rel=1e-6, abs=0.0)
    assert left.twist == pytest.approx(part * sign * constants.twist_limit, rel=1e-6, abs=0.0)
    zero = (0.0, 0.0, 0.0)
    alone = (
        mechanics.Displacements(0.0, zero, zero, sign * 1.1 * constants.twist_limit),
        mechanics.Displacements(0.0, (0.0, sign * 1.1 * constants.slide_limit, 0.0), zero, 0.0),
        mechanics.Displacements(0.0, zero, (sign * 1.1 * constants.roll_limit, 0.0, 0.0), 0.0),
        mechanics.Displacements(-1.01 * constants.normal.pull_off_overlap, zero, zero, 0.0),
    )
    assert all(mechanics.exceeds_limits(strain, UP, constants) for strain in alone)
    within = mechanics.Displacements(
        0.0, (0.0, 0.9 * constants.slide_limit, 0.0), (0.0, 0.0, 0.0), sign * 0.9 * constants.twist_limit
    )
    assert not mechanics.exceeds_limits(within, UP, constants)
    assert mechanics.after_slip(within, UP, constants, reset) == within


def test_dissipation_of_slip():
    """½k(q_before + q_left)·(q_reached − q_left): clamp at the limit k q_c (|q| − q_c), reset ½k q_before·q."""
    _, _, b = contact_of(1.0)
    c = b.slide_limit
    zero = (0.0, 0.0, 0.0)
    before = mechanics.Displacements(0.0, (c, 0.0, 0.0), zero, 0.0)
    reached = mechanics.Displacements(0.0, (1.1 * c, 0.0, 0.0), zero, 0.0)
    clamped = mechanics.slip_losses(before, reached, mechanics.after_slip(reached, UP, b, False), b)
    assert clamped[0] == pytest.approx(b.slide_stiffness * c * 0.1 * c, rel=1e-12, abs=0.0)
    reset = mechanics.slip_losses(before, reached, mechanics.after_slip(reached, UP, b, True), b)
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
    assert torque == pytest.approx(4 * b.normal.pull_off_force * 1e-9, rel=1e-6, abs=0.0)
    assert b.twist_stiffness == pytest.approx(16 / 3 * (g / 2) * a0**3, rel=1e-6, abs=0.0)
    assert b.twist_stiffness * b.twist_limit == pytest.approx((g / 2) * a0**3 / (3 * math.pi), rel=1e-6, abs=0.0)


def test_periods_of_20_nm_iron():
    """T_slide = 1.9e-11 s and T_n = 4.3e-11 s for 20 nm (diameter) iron: ω² = 7k_s/m and 2k_n/m."""
    r = 1e-8
    mass = IRON.density * 4 / 3 * math.pi * r**3
    b = contact_constants(jkr.LAW)(Contact().pairing(IRON, IRON), r, r, mass, mass)
    assert 2 * math.pi / math.sqrt(b.max_squared_frequency) == pytest.approx(1.9e-11, rel=0.02, abs=0.0)
    assert b.max_squared_frequency == pytest.approx(7 * b.slide_stiffness / mass, rel=1e-6, abs=0.0)
    same = Contact().pairing(IRON, IRON)
    a0 = jkr.rest_radius(same.surface_energy, r / 2, same.modulus)
    k_n = jkr.normal_stiffness(a0, same.modulus)
    assert 2 * math.pi / math.sqrt(2 * k_n / mass) == pytest.approx(4.3e-11, rel=0.02, abs=0.0)
    assert a0 / (r / 2) == pytest.approx(0.53, rel=1e-6, abs=0.005)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("share", [0.01, 0.3, 1.0, 3.0, 30.0])
def test_the_normal_force_and_stiffness_are_derivatives_of_the_energy(law, share):
    """F = dU/dδ and k = dF/dδ at overlaps of 0.01 … 30 δ₀, by central differences with one Richardson step.

    With h = 1e-3 δ the truncation error is 1e-12, and rounding leaves 1e-16/1e-3: below 1e-8 in relation to U/δ, k δ.
    """
    _, _, c = contact_of(0.5, law=law)
    own, pairing = LAWS[law], Contact().pairing(SILICA, ICE)
    overlap = share * own.normal_mode(pairing.surface_energy, pairing.modulus, c.reduced_radius).rest_overlap

    def derivative(formula):
        h = 1e-3 * overlap
        at = {k: formula(overlap + k * h, own.radius_root(overlap + k * h, c), c) for k in (-1, -0.5, 0.5, 1)}
        return (8 * (at[0.5] - at[-0.5]) - (at[1] - at[-1])) / (6 * h)

    y = own.radius_root(overlap, c)
    force, stiffness = own.force(overlap, y, c), own.stiffness(overlap, y, c)
    assert derivative(own.energy) == pytest.approx(force, rel=1e-8, abs=1e-8 * abs(own.energy(overlap, y, c)) / overlap)
    assert derivative(own.force) == pytest.approx(stiffness, rel=1e-8, abs=1e-8 * stiffness)


@pytest.mark.parametrize("law", LAWS)
def test_a_law_is_consistent_at_equilibrium_formation_and_breaking(law):
    """At δ₀ the force is 0 and the contact radius a₀ (y = 1); at formation and breaking U and F are those of the law.

    The fast root equals the exact one where it is valid.  Tolerance: 1e-9 in units of k δ₀ and k δ₀²; just before
    breaking y has an infinite slope, so that an overlap 1e-12 away changes it by 1e-6.
    """
    _, _, c = contact_of(0.5, law=law)
    own, pairing = LAWS[law], Contact().pairing(SILICA, ICE)
    mode = own.normal_mode(pairing.surface_energy, pairing.modulus, c.reduced_radius)
    force, energy = mode.stiffness * mode.rest_overlap, mode.stiffness * mode.rest_overlap**2
    y = own.radius_root(mode.rest_overlap, c)
    assert y == pytest.approx(1.0, rel=1e-9, abs=0.0)
    assert own.force(mode.rest_overlap, y, c) == pytest.approx(0.0, abs=1e-8 * force)
    assert own.contact_radius(mode.rest_overlap, y, c) == pytest.approx(mode.rest_radius, rel=1e-9, abs=0.0)
    assert own.stiffness(mode.rest_overlap, y, c) == pytest.approx(mode.stiffness, rel=1e-9, abs=0.0)
    assert own.energy(0.0, own.radius_root(0.0, c), c) == pytest.approx(own.at_touch(c), abs=1e-9 * energy)
    just_before = -mode.break_overlap * (1.0 - 1e-12)
    y = own.radius_root(just_before, c)
    assert own.energy(just_before, y, c) == pytest.approx(own.at_break(c)[0], abs=1e-5 * energy)
    assert own.force(just_before, y, c) == pytest.approx(own.at_break(c)[1], abs=1e-5 * force)
    for share in (-0.9, 0.0, 0.5, 1.0, 5.0):
        overlap = share * (mode.break_overlap if share < 0 else mode.rest_overlap)
        fast, valid = own.fast_radius_root(overlap, c)
        assert valid
        assert fast == pytest.approx(own.radius_root(overlap, c), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_the_time_step_resolves_the_stiffest_mode(law):
    """The squared frequency of a free pair is at least k/m̄ and 7/2 k_s (1/m1 + 1/m2) of its constants."""
    r1, r2, c = contact_of(0.5, law=law)
    masses = [m.density * 4 / 3 * math.pi * r**3 for m, r in ((SILICA, r1), (ICE, r2))]
    pairing = Contact().pairing(SILICA, ICE)
    mode = LAWS[law].normal_mode(pairing.surface_energy, pairing.modulus, c.reduced_radius)
    inverse = sum(1.0 / m for m in masses)
    assert c.max_squared_frequency >= mode.stiffness * inverse * (1.0 - 1e-12)
    assert c.max_squared_frequency >= 3.5 * c.slide_stiffness * inverse * (1.0 - 1e-12)


def test_without_adhesion_every_law_is_hertzian():
    """γ = 0: F = (4/3) E* √R δ^(3/2), U = (2/5) F δ, no springs."""
    bare = ICE.but(name="bare", surface_energy=0.0)
    for law, own in LAWS.items():
        _, _, c = contact_of(1.0, (bare, bare), law=law)
        pairing, overlap = Contact().pairing(bare, bare), 1e-10
        y = own.radius_root(overlap, c)
        hertz = 4 / 3 * pairing.modulus * math.sqrt(c.reduced_radius) * overlap**1.5
        assert own.force(overlap, y, c) == pytest.approx(hertz, rel=1e-12, abs=0.0), law
        assert own.energy(overlap, y, c) == pytest.approx(0.4 * hertz * overlap, rel=1e-12, abs=0.0), law
        assert (c.slide_stiffness, c.roll_stiffness, c.twist_stiffness) == (0.0, 0.0, 0.0)


def test_pull_off_force_and_tabor_parameter():
    """DMT 4πγR against JKR 3πγR; 20 nm iron has a Tabor parameter of about 1.5, where neither law is exact."""
    pairing, reduced = Contact().pairing(IRON, IRON), 5e-9
    forces = [LAWS[law].normal_mode(pairing.surface_energy, pairing.modulus, reduced) for law in ("dmt", "jkr")]
    dmt, jkr_ = (mode.constants.pull_off_force for mode in forces)
    assert dmt / jkr_ == pytest.approx(4 / 3, rel=1e-12, abs=0.0)
    from sand.contact.dmt import tabor_parameter

    assert tabor_parameter(pairing.surface_energy, pairing.modulus, reduced) == pytest.approx(1.5, rel=0.02, abs=0.0)
    assert "neither DMT nor JKR" in LAWS["dmt"].warning(pairing.surface_energy, pairing.modulus, reduced)


def test_code_with_a_formula_of_the_user_is_cached_by_its_source():
    """Stages of different laws have different digests; so have stages of a law with a formula from elsewhere.

    The warning is no part of compiled code.
    """

    def digests(law):
        stages = [
            *(contact_pass_stage(law, PassVariant(adhesive=adhesive), False) for adhesive in (False, True)),
            *contact_event_stages(law, NONE).values(),
            pair_list_stage(law, False),
        ]
        return {code_digest(stage.function) for stage in [*stages, energies_stage(law), contacts_stage(law)]}

    before = digests(jkr.LAW)
    assert None not in before and before == digests(jkr.LAW._replace())
    assert all(before.isdisjoint(digests(law)) for name, law in LAWS.items() if name != "jkr")
    formulas = [name for name, member in jkr.LAW._asdict().items() if callable(member) and name != "constants_type"]
    assert len(formulas) == 12
    for name in formulas:
        found = digests(jkr.LAW._replace(**{name: formula(lambda *numbers: 0.0)}))
        assert (found == before) is (name == "warning"), name


def test_code_with_constants_of_the_user_is_cached_by_their_order():
    """All stages that read constants: a law whose constants have the same names in another order has other digests."""
    fields = jkr.LAW.constants_type._fields
    digests = []
    for names in (fields, fields[::-1], fields):
        constants = namedtuple("Constants", names, module="users_module")
        law = jkr.LAW._replace(constants_type=constants)
        digests.append(
            [
                code_digest(each.function)
                for each in (contact_pass_stage(law, PassVariant(), False), energies_stage(law))
            ]
        )
    assert digests[0] == digests[2]
    assert all(one != other for one, other in zip(*digests[:2], strict=True))


@pytest.mark.parametrize("name", sorted(LAWS))
def test_the_energy_of_ringing_is_the_work_from_touch_to_rest(name):
    """U(0) − U(δ0) = −∫ F dδ from first touch to equilibrium; Gauss–Legendre with 40 points, smooth integrand in √δ."""
    law, (r1, r2, c) = LAWS[name], contact_of(0.5, law=name)
    pairing = Contact().pairing(SILICA, ICE)
    rest = law.normal_mode(pairing.surface_energy, pairing.modulus, c.reduced_radius).rest_overlap
    nodes, weights = np.polynomial.legendre.leggauss(40)
    root = 0.5 * (nodes + 1.0)  # δ = δ0 u², dδ = 2 δ0 u du
    overlaps = [rest * u * u for u in root]
    forces = np.array([law.force(d, law.radius_root(d, c), c) for d in overlaps])
    work = -float(np.sum(0.5 * weights * 2.0 * rest * root * forces))
    assert ringing_energy(law, pairing, r1, r2) == pytest.approx(work, rel=1e-9, abs=0.0)


def test_warnings_name_the_grains_for_which_a_law_is_inaccurate():
    """JKR is least accurate for the smallest radii (a0/R falls with R), DMT for the largest (μ_T rises with R)."""
    position = [[0, 0, 0], [1e-5, 0, 0]]
    with pytest.warns(UserWarning, match="silica grains of radius 1 um have Tabor parameter 0.73"):
        sand.Simulation(sand.Grains(position, [1e-9, 1e-6], "silica"), [sand.Contact(law="dmt")])
    with pytest.warns(UserWarning, match="iron grains of radius 10 nm have a0/R = 0.53"):
        sand.Simulation(sand.Grains(position, [1e-8, 1e-6], "iron"), [sand.Contact()])


def test_a_law_with_a_taken_name_or_without_a_member_is_refused():
    """One line that names the law and what is wrong."""
    with pytest.raises(BadInput, match="contact law 'jkr' exists already"):
        register(jkr.LAW._replace(references="mine"))
    with pytest.raises(BadInput, match="contact law 'mine' lacks stiffness, warning"):
        register(jkr.LAW._replace(name="mine", stiffness=None, warning=None))
    assert "mine" not in LAWS


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize(
    "law", [pytest.param(law, marks=() if law == "jkr" else pytest.mark.validate) for law in sorted(LAWS)]
)
def test_energy_balance_of_a_head_on_impact(law):
    """Two grains collide at three times the JKR sticking speed and rebound; total energy is conserved to 1e-3.

    DMT contacts dissipate nothing (they form and break at δ = 0, where U = 0); JKR contacts dissipate 0.9355 F_c δ_c.
    The error is that of velocity Verlet with 100 steps per period, (ω dt)²/24 = 1.6e-4 of the elastic energy.
    """
    numbers = sand.theory.contact("silica", "0.1 um")
    speed = 3.0 * numbers.sticking_speed
    position = [[0, 0, 0], [2.05e-7, 0, 0]]
    grains = sand.Grains(position, 1e-7, "silica", velocity=[[speed / 2, 0, 0], [-speed / 2, 0, 0]])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sim = sand.Simulation(grains, [sand.Contact(law=law)], stepping=sand.Verlet(steps_per_period=100))
    sim.run(until=2.5e-8 / speed * 2)
    first, last = sim.ledger["total"][0], sim.ledger["total"][-1]
    kinetic = 0.25 * grains.mass[0] * speed**2
    assert len(sim.contacts["pair"]) == 0
    assert sim.ledger["made"][-1] == sim.ledger["broken"][-1] == 1
    assert last - first == pytest.approx(0.0, abs=1e-3 * kinetic)
    lost = sim.ledger["lost_forming"][-1] + sim.ledger["lost_breaking"][-1]
    assert lost == pytest.approx(numbers.cycle_energy if law == "jkr" else 0.0, rel=1e-9, abs=1e-12 * kinetic)
