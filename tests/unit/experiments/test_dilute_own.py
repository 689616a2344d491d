"""Dilute dust whose bodies keep their motion: rates, phases of free rotation, orbits of charges, momenta."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import sand
from sand.basics.constants import BOLTZMANN, COULOMB
from sand.experiments.dilute_body import NO_CONTACTS, Motion, body_of, in_space, momenta_of
from sand.experiments.dilute_encounters import pieces_of
from sand.experiments.dilute_hits import Stick
from sand.experiments.dilute_majorant import Approach, Majorant
from sand.experiments.dilute_own import (
    OwnMajorant,
    angular_at,
    deflected,
    own_start,
    parted,
    pose_of,
    repulsion_of,
    thermal_body,
    turned_copy,
    velocity_far_away,
)
from sand.experiments.dilute_population import Population, sizes_of
from sand.experiments.scattering.event_draws import event_uniforms
from sand.experiments.scattering.two_aggregates import TURN1, TURN2
from tests.unit.experiments.test_dilute import DIMER, GRAIN, RADIUS, T, tree

HEAT = BOLTZMANN * T
CHARGE = 1.602176634e-19


def moving(body, number=0, seed=1):
    """A thermal body that keeps its motion."""
    return thermal_body(body, HEAT, seed, number)


def kinetic(body):
    """Energies ½mV² and ½ΣL²/I [J]; the latter from L in space and the pose that the frame of the body has."""
    return 0.5 * body.mass * float(body.motion.velocity @ body.motion.velocity), body.rotation


SHAPES = {
    "asymmetric": (1.0, 1.7, 2.3),
    "nearly prolate": (1.0, 2.0, 2.01),
    "prolate": (0.5, 2.0, 2.0),
    "oblate": (1.5, 1.5, 2.0),
    "sphere": (2.0, 2.0, 2.0),
}


def free_rotation(own, inertia):
    """L in the frame of a body at 64 equal times of one period of dL/dt = L × ω, ω_k = L_k/I_k, (64, 3).

    A period ends where L passes the plane across its curve at the start, in the same direction.
    """
    size, (p, q, r) = np.linalg.norm(own), (1.0 / each for each in inertia)

    def rate(_, y):
        a, b, c = y
        return np.array([b * c * (r - q), c * a * (p - r), a * b * (q - p)])

    onward = rate(0.0, own)

    def plane(_, y):
        return float((y - own) @ onward)

    plane.terminal, plane.direction = True, 1.0
    how = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12 * size}
    begin = 0.01 * min(inertia) / size
    first = solve_ivp(rate, (0.0, begin), own, **how).y[:, -1]
    run = solve_ivp(rate, (begin, 1e6 * begin), first, events=plane, dense_output=True, **how)
    period, last = run.t_events[0][0], run.y_events[0][0]
    assert last == pytest.approx(own, abs=1e-8 * size) and period > 64.0 * begin
    return np.vstack([own, run.sol(period * np.arange(1, 64) / 64.0).T])


@pytest.mark.parametrize("name", SHAPES)
def test_a_phase_of_free_rotation_is_a_point_of_the_motion_of_its_body(name):
    """|L|² and Σ L_k²/I_k at all phases are those of the start, to 1e-10; L keeps its sign along the axis it circles.

    This is the third axis if Σ L_k²/I_k < |L|²/I₂, and the first one otherwise.
    """
    inertia = np.array(SHAPES[name])
    for own in np.random.default_rng(1).normal(size=(20, 3)):
        along = 2 if (own**2 / inertia).sum() < own @ own / inertia[1] else 0
        for phase in (0.0, 0.1, 0.37, 0.62, 0.999):
            found = angular_at(own, SHAPES[name], phase)
            assert found @ found == pytest.approx(own @ own, rel=1e-10, abs=0.0)
            assert (found**2 / inertia).sum() == pytest.approx((own**2 / inertia).sum(), rel=1e-10, abs=0.0)
            assert found[along] * own[along] > 0.0


@pytest.mark.parametrize("name", ["asymmetric", "nearly prolate", "prolate", "oblate"])
def test_phases_of_free_rotation_are_uniform_in_time(name):
    """Phases 0 … 1 are one period of Euler's equations: L at equal phases is L at equal times, and all of the curve.

    From the L of phase 0, integrated forwards or backwards, to 1e-7 |L|.  So means are those over time: of the
    components that circle they are 0.  From L itself, at another time of the same curve, the means of L_k, L_jL_k and
    L_k⁴ over 64 times are equal to 1e-7: sums over equal parts of a period converge as exp(−64 × K′/K).
    """
    for own in np.random.default_rng(2).normal(size=(6, 3)):
        size = np.linalg.norm(own)
        found = np.array([angular_at(own, SHAPES[name], k / 64) for k in range(64)])
        forwards = free_rotation(found[0], SHAPES[name])
        backwards = np.roll(forwards[::-1], 1, axis=0)
        assert min(np.abs(found - run).max() for run in (forwards, backwards)) < 1e-7 * size
        run = free_rotation(own, SHAPES[name])
        for moment in (lambda y: y, lambda y: y[:, :, None] * y[:, None], lambda y: y**4):
            both = moment(found / size).mean(axis=0), moment(run / size).mean(axis=0)
            assert both[0] == pytest.approx(both[1], abs=1e-7)
        along = int(np.argmax(np.abs(found.mean(axis=0))))
        assert np.delete(found.mean(axis=0), along) == pytest.approx(np.zeros(2), abs=1e-9 * size)


def angle_about(axis, vectors):
    """Angle [turns, 0 … 1] of vectors (n, 3) about an axis."""
    first = np.cross(axis, [0.0, 0.0, 1.0])
    second = np.cross(axis, first) / np.linalg.norm(axis)
    return np.arctan2(vectors @ second, vectors @ first) / (2.0 * math.pi) % 1.0


def assert_uniform(*angles):
    """Angles φ (n,) [turns] are uniform and independent: n |⟨exp 2πi Σ kφ⟩|² < 12 for all k = −2 … 2 but 0.

    This is Rayleigh's test: the number has an exponential distribution, and exceeds 12 with a probability of 6e-6.
    """
    for factors in itertools.product(range(-2, 3), repeat=len(angles)):
        combined = sum(factor * angle for factor, angle in zip(factors, angles, strict=True))
        if any(factors):
            assert abs(np.exp(2.0j * math.pi * combined).mean()) ** 2 * len(angles[0]) < 12.0, factors


def test_before_a_flight_a_body_has_its_angular_momentum_and_random_phases():
    """L in space stays: q L_body = L with L_body on its curve, on the same side of the axis that it circles.

    Its phase on the curve, the time of free rotation in periods, and the angle of the body about L are uniform, and
    independent of each other.  The phase is that of Euler's equations at the same angle about the axis.
    """
    body = moving(tree(7, 1))
    own, inertia = body.motion.own, np.array(body.flying.inertia)
    along = 2 if (own**2 / inertia).sum() < own @ own / inertia[1] else 0
    poses = np.array([pose_of(body, event_uniforms(3, event)[:3]) for event in range(2000)])
    inside = np.einsum("nji,j->ni", poses, body.motion.angular)
    assert (inside**2 / inertia).sum(axis=1) == pytest.approx(np.full(2000, 2.0 * body.rotation), rel=1e-9, abs=0.0)
    assert (inside[:, along] * own[along] > 0.0).all()
    times = np.resize(free_rotation(own, inertia), (64, 3))
    axis = np.eye(3)[along]
    phases = np.sort(angle_about(axis, times))
    found = angle_about(axis, inside)
    share = np.interp(found, np.concatenate([phases[-1:] - 1.0, phases, phases[:1] + 1.0]), np.arange(66) - 0.5)
    assert_uniform(share / 64.0 % 1.0, angle_about(body.motion.angular, poses[:, :, 1]))


def test_flights_begin_at_random_azimuths_and_independent_orientations():
    """The azimuth of b about v and the angles of both bodies about their L are uniform and independent; 2000 events."""
    a, b = moving(tree(7, 1), 1), moving(tree(5, 2), 2)
    relative = a.motion.velocity - b.motion.velocity
    speed = float(np.linalg.norm(relative))
    states = np.array([own_start(a, b, Approach(speed, 5e-8, 6e-8), 4e-7, (1, k)) for k in range(2000)])
    azimuth, angles = angle_about(relative, states[:, :3]), []
    for body, turn in ((a, TURN1), (b, TURN2)):
        axes = Rotation.from_quat(states[:, turn : turn + 4]).as_matrix()[:, :, 1]
        angles.append(angle_about(body.motion.angular, axes))
    assert_uniform(azimuth, *angles)


def test_a_body_at_rest_has_a_random_orientation():
    """Without angular momentum the axes of 400 poses average to 0 in all directions, within 4 standard errors."""
    body = moving(DIMER)
    none = np.zeros(3)
    body = dataclasses.replace(body, motion=Motion(body.motion.velocity, none, none))
    axes = np.array([pose_of(body, event_uniforms(4, k)[:3]) for k in range(400)])
    assert np.abs(axes.mean(axis=0)).max() < 4.0 * math.sqrt(1.0 / 3.0 / 400)


def test_thermal_bodies_have_the_energies_of_equilibrium():
    """½mV² and ½ΣL²/I average to 3/2 k_BT, and L in space is that in the body turned; 4 standard errors of 400."""
    bodies = [moving(DIMER, k) for k in range(400)]
    for energies in np.array([kinetic(body) for body in bodies]).T / HEAT:
        assert abs(energies.mean() - 1.5) < 4.0 * math.sqrt(1.5 / 400)
    lengths = [np.linalg.norm(each) for body in bodies for each in body.motion[1:]]
    assert lengths[::2] == pytest.approx(lengths[1::2], rel=1e-12, abs=0.0)
    angular = np.array([body.motion.angular / np.linalg.norm(body.motion.angular) for body in bodies])
    assert np.abs(angular.mean(axis=0)).max() < 4.0 * math.sqrt(1.0 / 3.0 / 400)


@pytest.mark.parametrize("pair", [(GRAIN, GRAIN), (DIMER, tree(12))])
def test_the_mean_rate_of_thermal_bodies_is_the_thermal_one(pair):
    """⟨π b̂²(v) v⟩ over the velocities of 600 thermal pairs is K̂ of Maxwell's distribution; 4 standard errors."""
    majorant, rates = OwnMajorant(T), []
    for k in range(600):
        a, b = (moving(each, 2 * k + n) for n, each in enumerate(pair))
        rates.append(float(majorant.kernel(sizes_of(a), sizes_of(b))))
        if k < 20:
            speed = np.linalg.norm(a.motion.velocity - b.motion.velocity)
            drawn = majorant.draw(sizes_of(a), sizes_of(b), (0.1, 0.2, 0.3))
            assert drawn.speed == pytest.approx(speed, rel=1e-12, abs=0.0)
            assert drawn.impact_parameter**2 == pytest.approx(0.3 * drawn.bound**2, rel=1e-12, abs=0.0)
            assert rates[-1] == pytest.approx(math.pi * drawn.bound**2 * speed, rel=1e-12, abs=0.0)
    expected = Majorant(T).kernel(*map(sizes_of, pair))
    assert abs(np.mean(rates) - expected) < 4.0 * np.std(rates) / math.sqrt(600)


def test_sums_of_rates_follow_encounters_and_copies():
    """Sums that are changed in O(n) by misses, joining and turned copies equal those of all pairs, to rounding."""
    bodies = [moving(tree(count, k), k) for k, count in enumerate([1, 1, 2, 3, 5, 8, 1, 2])]
    population = Population(bodies, 1.0, OwnMajorant(T))
    for k in range(6):
        i, j, _ = population.draw(*event_uniforms(6, k)[:2])
        a, b = population.bodies[i], population.bodies[j]
        new = [moving(a, 20 + k), moving(b, 30 + k)] if k % 2 else [moving(tree(len(a) + len(b), k), 40 + k)]
        population.replace(i, j, new)
    population.double(lambda body, place: turned_copy(body, 1, place))
    fresh = Population(population.bodies, population.volume, OwnMajorant(T))
    assert population.sums == pytest.approx(fresh.sums, rel=1e-11, abs=0.0)
    assert population.temperatures == pytest.approx(fresh.temperatures, rel=1e-13, abs=0.0)
    motion, rotation = np.mean([kinetic(body) for body in population.bodies], axis=0) / HEAT
    assert population.temperatures == pytest.approx((motion, rotation), rel=1e-12, abs=0.0)


def test_copies_are_turned_as_a_whole():
    """|V|, |L|, their angle, and the energy of rotation stay; the rate of a body with its copy is not 0."""
    body = moving(tree(5, 2))
    copies = [turned_copy(body, seed, 3) for seed in range(200)]
    for copy in copies[:5]:
        for of in (
            lambda m: m.velocity @ m.velocity,
            lambda m: m.angular @ m.angular,
            lambda m: m.velocity @ m.angular,
        ):
            assert of(copy.motion) == pytest.approx(of(body.motion), rel=1e-12, abs=0.0)
        assert copy.rotation == body.rotation
        assert float(OwnMajorant(T).kernel(sizes_of(body), sizes_of(copy))) > 0.0
    directions = np.array([copy.motion.velocity for copy in copies]) / np.linalg.norm(body.motion.velocity)
    assert np.abs(directions.mean(axis=0)).max() < 4.0 * math.sqrt(1.0 / 3.0 / 200)


def charged(number, k):
    """A moving grain with so many elementary charges."""
    grains = sand.Grains([[0.0, 0.0, 0.0]], RADIUS, "iron", charge=number * CHARGE)
    return moving(body_of(grains.arrays, NO_CONTACTS, k)[0], k)


@pytest.mark.parametrize("charges", [(0, 0), (1, -1), (1, 1), (3, -2)])
@pytest.mark.parametrize("factor", [0.01, 0.5, 1.0])
def test_flights_start_on_the_orbit_of_their_charges(charges, factor):
    """½u² + k/r = ½v² and |r × u| = b v, and the orbit backwards comes from −∞ along v, to 1e-9; k = qq′/4πε₀m̄.

    The azimuth is random: r × u is perpendicular to v.
    """
    a, b = (charged(number, k) for k, number in enumerate(charges))
    relative = a.motion.velocity - b.motion.velocity
    speed = float(np.linalg.norm(relative))
    impact, k = factor * 6e-8, repulsion_of(a, b)
    assert k == pytest.approx(COULOMB * charges[0] * charges[1] * CHARGE**2 / (0.5 * a.mass), rel=1e-12, abs=0.0)
    state = own_start(a, b, Approach(speed, impact, 6e-8), 4e-7, (1, 5))
    r, u = state[:3], state[3:6]
    assert np.linalg.norm(r) == pytest.approx(4e-7 if any(charges) else math.hypot(4e-7, impact), rel=1e-12, abs=0.0)
    assert 0.5 * u @ u + k / np.linalg.norm(r) == pytest.approx(0.5 * speed**2, rel=1e-10, abs=0.0)
    assert np.linalg.norm(np.cross(r, u)) == pytest.approx(impact * speed, rel=1e-9, abs=0.0)
    assert np.cross(r, u) @ relative == pytest.approx(0.0, abs=1e-9 * impact * speed**2)
    assert r @ u < 0.0
    back = velocity_far_away(r, -u, k)
    assert back == pytest.approx(-relative, abs=1e-8 * speed)


@pytest.mark.parametrize("number", [20, -1], ids=["equal", "opposite"])
def test_charges_that_pass_far_away_are_deflected_as_rutherford_found(number):
    """The deflection of an integrated orbit with k/r², from 1e3 distances to 1e3 away, to 1e-2; energy and P stay.

    Equal charges turn around before they come to 0.3 µm, opposite ones pass at 16 nm.  Bodies that repel each other are
    deflected to the side on which they are, others to the opposite one.
    """
    a, b = charged(20, 0), charged(number, 1)
    relative = a.motion.velocity - b.motion.velocity
    speed, impact = float(np.linalg.norm(relative)), 2e-7
    approach = Approach(speed, impact, 3e-7)
    assert own_start(a, b, approach, 3e-7 if number > 0 else 1e-8, (1, 5)) is None
    one, two = deflected(a, b, approach, (1, 5))
    found = one.motion.velocity - two.motion.velocity
    start = own_start(a, b, approach, 1e-3, (1, 5))[:3]
    assert (found @ start - (found @ relative) * (start @ relative) / speed**2) * number > 0.0
    assert np.linalg.norm(found) == pytest.approx(speed, rel=1e-12, abs=0.0)
    total = a.mass * (a.motion.velocity + b.motion.velocity)
    assert a.mass * (one.motion.velocity + two.motion.velocity) == pytest.approx(total, rel=1e-9, abs=1e-12 * a.mass)
    k = repulsion_of(a, b) / (impact * speed**2)  # in units of b and v
    start = [-1e4, 1.0, math.sqrt(1.0 - 2.0 * k / 1e4), 0.0]
    run = solve_ivp(
        lambda _, y: [y[2], y[3], *(k * y[:2] / np.hypot(*y[:2]) ** 3)], (0.0, 2e4), start, "DOP853", rtol=1e-10
    ).y[:, -1]
    cosine = run[2] / np.hypot(*run[2:])
    assert found @ relative / speed**2 == pytest.approx(cosine, abs=1e-2)


def test_bodies_part_with_their_total_momentum_and_energy():
    """P stays, V − V′ is u of the state; L of each body is that of the state, in space and in the body."""
    a, b = moving(tree(4, 1), 1), moving(tree(6, 2), 2)
    state = own_start(a, b, Approach(3.0, 5e-8, 1e-7), 4e-7, (1, 9))
    state[3:6] *= -0.7
    state[14:20] *= 1.3
    one, two = parted(a, b, state, Majorant(T))
    before, after = (x.mass * x.motion.velocity + y.mass * y.motion.velocity for x, y in ((a, b), (one, two)))
    assert after == pytest.approx(before, rel=1e-12, abs=1e-15 * a.mass)
    assert one.motion.velocity - two.motion.velocity == pytest.approx(state[3:6], rel=1e-10, abs=1e-12)
    for old, new in ((a, one), (b, two)):
        assert new.motion.angular == pytest.approx(1.3 * old.motion.angular, rel=1e-12, abs=0.0)
        assert new.rotation == pytest.approx(1.69 * old.rotation, rel=1e-9, abs=0.0)


@pytest.mark.parametrize("charges", [(0, 0), (1, -1)])
@pytest.mark.parametrize("widening", [1.0, 2.0])
def test_an_encounter_without_a_reverse_is_refused(charges, widening):
    """b′v′ = |r × u| at the end, v′ far away: bodies keep V and L if b′ > b̂(v′), and have new ones if not."""
    a, b = (charged(number, k) for k, number in enumerate(charges))
    majorant, k = Majorant(T, widening), repulsion_of(a, b)
    speed = 2.0 * float(np.linalg.norm(a.motion.velocity - b.motion.velocity))
    bound = float(majorant.bound(sizes_of(a), sizes_of(b), speed))
    for factor, is_refused in ((0.999, False), (1.001, True)):
        distance, across = 10.0 * bound, factor * bound * speed / (10.0 * bound)
        radial = math.sqrt(speed**2 - 2.0 * k / distance - across**2)
        state = np.concatenate([[0.0, distance, 0.0, across, radial, 0.0], [0.0, 0.0, 0.0, 1.0] * 2, [3e-33] * 6])
        for old, new in zip((a, b), parted(a, b, state, majorant), strict=True):
            assert (new is old) == is_refused and (new.motion.angular[0] == 3e-33) != is_refused


def test_a_body_that_forms_has_the_momenta_of_both():
    """P is the sum, L = r × m̄u + L₁ + L₂ at the touch, before the body is shifted; L in the body has the same size."""
    a, b = moving(tree(5, 3), 1), moving(tree(9, 4), 2)
    state = own_start(a, b, Approach(3.0, 5e-8, 1e-7), a.extent + b.extent + 1e-9, (1, 9))
    hit = Stick(sand.Contact(), (sand.IRON,))(a, b, state)
    (body,) = pieces_of(a, b, hit, [(7, 8, 0)])
    assert body.mass * body.motion.velocity == pytest.approx(
        a.mass * a.motion.velocity + b.mass * b.motion.velocity, rel=1e-10, abs=1e-14 * body.mass
    )
    reduced = a.mass * b.mass / (a.mass + b.mass)
    expected = reduced * np.cross(state[:3], state[3:6]) + a.motion.angular + b.motion.angular
    assert body.motion.angular == pytest.approx(expected, rel=1e-9, abs=1e-12 * np.linalg.norm(expected))
    assert np.linalg.norm(body.motion.own) == pytest.approx(np.linalg.norm(expected), rel=1e-12, abs=0.0)
    # ½L·I⁻¹L of the tensor in space, of the grains as they have joined
    grains, _ = hit.pieces[0]
    centre = momenta_of(grains)[0]
    arm = grains.position - centre[:, None]
    tensor = ((grains.mass * arm**2).sum() + grains.inertia.sum()) * np.eye(3) - (grains.mass * arm) @ arm.T
    assert body.rotation == pytest.approx(0.5 * expected @ np.linalg.solve(tensor, expected), rel=1e-9, abs=0.0)
    assert (body.number, body.born, body.copy) == (7, 8, 0)
    assert in_space(a, b, state)[0].mass.sum() == pytest.approx(body.mass, rel=1e-14, abs=0.0)
