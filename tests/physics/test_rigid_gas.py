"""Rigid clusters in a gas: friction and noise of bodies, of awake grains, rest, energies, restart, wind."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import sand
from sand.basics.arrays import body_arrays
from sand.basics.constants import BOLTZMANN
from sand.basics.state import KICKED, LATE, MADE, RESTED, SOME_AWAKE, TIME, WOKEN
from sand.integrate.rigid import body_friction
from sand.integrate.rigid.body_friction import friction_modes, kick_body

from .setups import different, rest_distance

KT = BOLTZMANN * 100.0
PITCH = rest_distance(sand.IRON, 1e-8, 1e-8)
MASS = float(sand.Grains(np.zeros((1, 3)), 1e-8, "iron").mass[0])

UNITS = np.array([1.0, 1.0, 1.0, 1e-8, 1e-8, 1e-8])
"""Of momentum and angular momentum: SI with lengths in 10 nm, so that numbers of one matrix are of one size."""

pytestmark = pytest.mark.filterwarnings(
    "ignore:gas. the mean free path is", "ignore:contacts of iron", "ignore:dipoles. from"
)


def contact(**options):
    return sand.Contact(damping="critical", damping_ratio=0.2, **({"settling_time": "5 ns"} | options))


def gas(tau, **options):
    """A gas at 100 K in which iron grains of 10 nm have the stopping time m/f_t = τ."""
    unit = sand.Gas(100.0, density=1.0)
    numbers = unit.numbers()
    friction = body_friction.translation_friction(1e-8, numbers.density, numbers.mean_speed, numbers.accommodation)
    return sand.Gas(100.0, density=MASS / (friction * tau), **options)


def chains(length, number, apart=1e-6, **options):
    """Straight chains of iron grains along x, far from each other in y and z."""
    side = math.ceil(math.sqrt(number))
    position = np.zeros((number, length, 3))
    position[:, :, 0] = PITCH * np.arange(length)
    position[:, :, 1] = apart * (np.arange(number) % side)[:, None]
    position[:, :, 2] = apart * (np.arange(number) // side)[:, None]
    position -= position.mean(axis=(0, 1))
    return sand.Grains(position.reshape(-1, 3), 1e-8, "iron", **options)


def of_bodies(grains, length):
    """Centres (n, 3), velocities (n, 3), and kinetic energies (n,) of translation and rotation of equal chains."""
    m = grains.mass.reshape(-1, length, 1)
    total = m.sum(axis=1)
    centre = (m * grains.position.reshape(-1, length, 3)).sum(axis=1) / total
    velocity = (m * grains.velocity.reshape(-1, length, 3)).sum(axis=1) / total
    kinetic = grains.mass * (grains.velocity**2).sum(axis=1) + grains.inertia * (grains.spin**2).sum(axis=1)
    kinetic = 0.5 * kinetic.reshape(-1, length).sum(axis=1)
    moving = 0.5 * total[:, 0] * (velocity**2).sum(axis=1)
    return centre, velocity, moving, kinetic - moving


def orientation(sim):
    """Rotations of the first grains of the chains of four."""
    return Rotation.from_quat(sim.state.grains.arrays.orientation[:, ::4].T)


class Arrays:
    """Named arrays, as a stage takes them."""

    def __init__(self, **arrays):
        self.__dict__.update(arrays)


def crooked_body(numbers):
    """A crooked cluster of five unequal grains as a body in the gas: its arrays, and Γ and D of brute force.

    Γ has the columns −(F, T) of Σ −f_i (V + Ω×s_i) and Σ s_i×F_i − f_r,i Ω for the six unit motions (V, Ω).
    """
    rng = np.random.default_rng(3)
    radius = np.array([8.0, 10.0, 14.0, 9.0, 11.0]) * 1e-9
    mass = 4.0 / 3.0 * math.pi * radius**3 * 7874.0
    spin_inertia = 0.4 * mass * radius**2
    step = rng.normal(size=(5, 3))
    position = 2e-8 * np.cumsum(step / np.linalg.norm(step, axis=1)[:, None], axis=0)
    s = position - (mass[:, None] * position).sum(axis=0) / mass.sum()
    tensor = ((mass[:, None] * s**2).sum() + spin_inertia.sum()) * np.eye(3) - (mass[:, None] * s).T @ s
    principal, axes = np.linalg.eigh(tensor)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    s = s @ axes
    friction = [body_friction.translation_friction(r, *numbers) for r in radius]
    spinning = [body_friction.rotation_friction(r, *numbers) for r in radius]
    matrix = np.zeros((6, 6))
    for k, w in enumerate(np.eye(6)):
        force = [-f * (w[:3] + np.cross(w[3:], x)) for f, x in zip(friction, s, strict=True)]
        torque = [np.cross(x, f) - c * w[3:] for x, f, c in zip(s, force, spinning, strict=True)]
        matrix[:, k] = -np.concatenate([np.sum(force, axis=0), np.sum(torque, axis=0)])
    bodies = body_arrays(5, in_gas=True)
    bodies.member[:], bodies.start[1:] = np.arange(5), 5
    bodies.mass[0], bodies.inertia[:, 0], bodies.offset[...] = mass.sum(), principal, s.T
    bodies.orientation[:, 0] = Rotation.random(random_state=1).as_quat()
    rates, modes = friction_modes(radius, s.T, mass.sum(), principal, numbers)
    bodies.decay[:, 0], bodies.mode[:, 0] = rates, modes.T.ravel()
    grains = Arrays(radius=radius, id=np.arange(5, dtype=np.uint32))
    inertia = np.diag([mass.sum()] * 3 + principal.tolist())
    return grains, bodies, matrix / np.outer(UNITS, UNITS), inertia / np.outer(UNITS, UNITS)


def momenta_in_body(bodies, wind):
    """(P − M u, L) in the frame of the body, with lengths in 10 nm."""
    turn = Rotation.from_quat(bodies.orientation[:, 0])
    linear = turn.inv().apply(bodies.momentum[:, 0] - bodies.mass[0] * np.array(wind))
    return np.concatenate([linear, bodies.angular_momentum[:, 0]]) / UNITS


def test_friction_of_a_body_is_the_matrix_exponential():
    """p = (P − M u, L) → exp(−Γ D⁻¹ t) p: scipy's `expm` to 1e-12 of its size, and the energy handed over likewise.

    Γ is the brute-force sum over the grains, with wind, in any orientation; rounding is some 1e-15 of each mode.
    """
    numbers = gas(1e-8).numbers()._replace(temperature_energy=0.0, wind_x=1.0, wind_y=-2.0, wind_z=0.5)
    grains, bodies, matrix, inertia = crooked_body((numbers.density, numbers.mean_speed, numbers.accommodation))
    wind = (1.0, -2.0, 0.5)
    bodies.momentum[:, 0] = bodies.mass[0] * np.array([2.0, 3.0, -1.0])
    bodies.angular_momentum[:, 0] = 1e8 * bodies.inertia[:, 0] * np.array([1.0, -2.0, 0.3])
    before = momenta_in_body(bodies, wind)

    def kinetic():
        moving = (bodies.momentum[:, 0] ** 2).sum() / bodies.mass[0]
        return 0.5 * (moving + (bodies.angular_momentum[:, 0] ** 2 / bodies.inertia[:, 0]).sum())

    energy = kinetic()
    for elapsed in (1e-10, 1e-8, 3e-8):
        bodies.momentum[:, 0] = bodies.mass[0] * np.array([2.0, 3.0, -1.0])
        bodies.angular_momentum[:, 0] = 1e8 * bodies.inertia[:, 0] * np.array([1.0, -2.0, 0.3])
        given = kick_body(grains, bodies, 0, 1, 1, elapsed, numbers)
        exact = expm(-elapsed * matrix @ np.linalg.inv(inertia)) @ before
        found = momenta_in_body(bodies, wind)
        for part in (slice(0, 3), slice(3, 6)):
            assert np.abs(found[part] - exact[part]).max() < 1e-12 * np.abs(before[part]).max()
        assert given == pytest.approx(energy - kinetic(), rel=1e-9, abs=0.0)


def test_noise_of_a_body_has_the_covariance_of_the_lyapunov_equation(monkeypatch):
    """With six unit deviates in turn the changes S of p give S Sᵀ = k_B T (D − e^(−A t) D e^(−Aᵀ t)), A = Γ D⁻¹.

    This solves Ċ = −A C − C Aᵀ + 2 k_B T Γ, C(0) = 0; to 1e-12 of the diagonal.
    """
    numbers = gas(1e-8).numbers()
    grains, bodies, matrix, inertia = crooked_body((numbers.density, numbers.mean_speed, numbers.accommodation))
    rate = matrix @ np.linalg.inv(inertia)
    for elapsed in (1e-10, 1e-8):
        columns = []
        for k in range(6):
            unit = np.eye(6)[k].reshape(2, 3)
            monkeypatch.setattr(
                body_friction,
                "normal_vector",
                lambda seed, number, grain, stream, unit=unit: tuple(unit[stream - body_friction.STREAM1]),
            )
            bodies.momentum[:, 0] = bodies.angular_momentum[:, 0] = 0.0
            kick_body(grains, bodies, 0, 1, 1, elapsed, numbers)
            columns.append(momenta_in_body(bodies, (0.0, 0.0, 0.0)))
        spread = np.array(columns).T
        decay = expm(-elapsed * rate)
        exact = KT * (inertia - decay @ inertia @ decay.T)
        size = np.sqrt(np.diag(exact))
        assert np.abs((spread @ spread.T - exact) / np.outer(size, size)).max() < 1e-12


def test_noise_does_not_depend_on_the_axes_across_a_straight_chain():
    """Two frames of principal axes of a chain, turned about it by 1 rad: the same ΔP and ΔL in the laboratory frame.

    To 1e-12 of their size: rates and axes across the chain are equal, and their choice is one of rounding.
    """
    numbers = gas(1e-8).numbers()
    given = numbers.density, numbers.mean_speed, numbers.accommodation
    x = PITCH * (np.arange(4) - 1.5)
    inertia, found = 0.4 * MASS * 1e-16, []
    for about in (0.0, 1.0):
        bodies, turn = body_arrays(4, in_gas=True), Rotation.from_rotvec([0.3, -1.1, 0.4])
        turn = turn * Rotation.from_rotvec([about, 0.0, 0.0])
        bodies.member[:], bodies.start[1:], bodies.mass[0] = np.arange(4), 4, 4 * MASS
        bodies.inertia[:, 0] = 4 * inertia, *[4 * inertia + MASS * (x**2).sum()] * 2
        bodies.offset[0], bodies.orientation[:, 0] = x, turn.as_quat()
        rates, modes = friction_modes(np.full(4, 1e-8), bodies.offset, 4 * MASS, bodies.inertia[:, 0], given)
        bodies.decay[:, 0], bodies.mode[:, 0] = rates, modes.T.ravel()
        grains = Arrays(radius=np.full(4, 1e-8), id=np.arange(4, dtype=np.uint32))
        kick_body(grains, bodies, 0, 1, 1, 3e-9, numbers)
        found.append([bodies.momentum[:, 0], turn.apply(bodies.angular_momentum[:, 0])])
    for one, other in zip(*found, strict=True):
        assert np.abs(one - other).max() < 1e-12 * np.abs(one).max()


@pytest.mark.parametrize("length", [2, 5])
def test_friction_of_a_straight_chain(length):
    """Rates of n equal spheres: f/m of translation, f_r/I about the axis, (n f_r + f Σs²)/(n I + m Σs²) across it.

    So that D = k_B T/(n f) along and across, and rotational diffusion k_B T/(n f_r) and
    k_B T/(n f_r + f Σs²); to rounding.
    """
    numbers = gas(1e-8).numbers()
    given = numbers.density, numbers.mean_speed, numbers.accommodation
    radius, s = np.full(length, 1e-8), PITCH * (np.arange(length) - (length - 1) / 2)
    friction, spinning = body_friction.translation_friction(1e-8, *given), body_friction.rotation_friction(1e-8, *given)
    inertia = 0.4 * MASS * 1e-16
    principal = np.array([length * inertia, *[length * inertia + MASS * (s**2).sum()] * 2])
    offset = np.array([s, 0.0 * s, 0.0 * s])
    rates, modes = friction_modes(radius, offset, length * MASS, principal, given)
    across = (length * spinning + friction * (s**2).sum()) / principal[1]
    exact = np.sort([friction / MASS] * 3 + [spinning / inertia] + [across] * 2)
    assert rates == pytest.approx(exact, rel=1e-12, abs=0.0)
    diag = np.diag([length * MASS] * 3 + principal.tolist())
    size = np.sqrt(np.diag(diag))
    assert np.abs((modes @ modes.T - diag) / np.outer(size, size)).max() < 1e-12


@pytest.mark.compiled("contacts")
def test_equipartition_and_diffusion_of_chains():
    """200 chains of four in a gas, τ = 5 ns, 20 samples 10 τ apart: energies, and mean-square displacements.

    3/2 k_B T of translation and of rotation: K has 3 degrees of freedom each, 200 × 20 × 3 = 12,000 independent samples
    (e^(−10) remains) of ½ k_B T χ²: the mean has a relative standard deviation √(2/12000) = 1.3 %. The displacement Δx
    in T = 10 τ is normal with variance 2 s, s = D (T − τ (1 − e^(−T/τ))), D = k_B T/(4 f), in each direction: along and
    across the chain 200 × 20 (× 2) samples, 2.2 % and 1.6 %. Steps of h ≤ 0.1 τ add h²/12τ² ≤ 0.08 %. The axis tilts
    by θ, ⟨sin²θ⟩ = ⅔ (1 − e^(−6 s)), and the chain turns about it by ⟨φ²⟩ = 2 s, with s of the rotational friction and
    its relaxation time, across and along; tilts of 0.13 rad change φ² by 1 %. Tolerances are four standard deviations.
    """
    tau, interval = 5e-9, 5e-8
    sim = sand.Simulation(chains(4, 200), [contact(), gas(tau)], stepping=sand.RigidClusters(), frame_every=1.0, seed=5)
    sim.run(until=interval)
    assert sim.regular_state.bodies.asleep.all() and sim.regular_state.count[RESTED] == 200
    moving, turning, squares = [], [], []
    before, turned = of_bodies(sim.grains, 4)[0], orientation(sim)
    for k in range(20):
        axis = sim.grains.position[3::4] - sim.grains.position[::4]
        axis /= np.linalg.norm(axis, axis=1)[:, None]
        sim.run(until=(k + 2) * interval)
        centre, _, one, other = of_bodies(sim.grains, 4)
        moving.append(one.mean())
        turning.append(other.mean())
        along = ((centre - before) * axis).sum(axis=1) ** 2
        new = sim.grains.position[3::4] - sim.grains.position[::4]
        tilt = 1.0 - (new * axis).sum(axis=1) ** 2 / (new**2).sum(axis=1)
        twist = ((orientation(sim) * turned.inv()).as_rotvec() * axis).sum(axis=1) ** 2
        across = (((centre - before) ** 2).sum(axis=1) - along) / 2
        squares.append([along.mean(), across.mean(), tilt.mean(), twist.mean()])
        before, turned = centre, orientation(sim)
    assert np.mean(moving) == pytest.approx(1.5 * KT, rel=0.052, abs=0.0)
    assert np.mean(turning) == pytest.approx(1.5 * KT, rel=0.052, abs=0.0)
    numbers = gas(tau).numbers()
    given = numbers.density, numbers.mean_speed, numbers.accommodation
    spinning, s = 4 * body_friction.rotation_friction(1e-8, *given), PITCH * np.array([-1.5, -0.5, 0.5, 1.5])
    inertia, arm = 4 * 0.4 * MASS * 1e-16, (s**2).sum()

    def spread(mass, friction):
        """D (T − τ (1 − e^(−T/τ))), D = k_B T/friction, τ = mass/friction."""
        return KT / friction * (interval - mass / friction * -math.expm1(-interval * friction / mass))

    along, across, tilt, twist = np.mean(squares, axis=0)
    assert along == pytest.approx(2.0 * spread(4 * MASS, 4 * MASS / tau), rel=0.09, abs=0.0)
    assert across == pytest.approx(2.0 * spread(4 * MASS, 4 * MASS / tau), rel=0.063, abs=0.0)
    exact = -2.0 / 3.0 * math.expm1(-6.0 * spread(inertia + MASS * arm, spinning + MASS / tau * arm))
    assert tilt == pytest.approx(exact, rel=0.063, abs=0.0)
    assert twist == pytest.approx(2.0 * spread(inertia, spinning), rel=0.11, abs=0.0)
    assert sim.regular_state.count[WOKEN] == 0


WIND = np.array([0.0, 2.0, 1.0])


def relaxing(stepping, until, tau=5e-9):
    """A chain of unequal grains that moves and turns in a gas without noise, with a wind across."""
    radius = np.array([8e-9, 10e-9, 13e-9, 9e-9])
    x = np.cumsum([0.0, *(rest_distance(sand.IRON, a, b) for a, b in itertools.pairwise(radius))])
    position = np.column_stack([x, 0.0 * x, 0.0 * x])
    mass = sand.Grains(position, radius, "iron").mass
    s = position - (mass[:, None] * position).sum(axis=0) / mass.sum()
    spin = np.array([1e7, 0.0, 3e7])
    velocity = np.array([1.0, 0.5, 0.0]) + np.cross(spin, s)
    grains = sand.Grains(position, radius, "iron", velocity=velocity, spin=[spin] * 4)
    forces = [contact(), gas(tau, brownian=False, wind=tuple(WIND))]
    sim = sand.Simulation(grains, forces, stepping=stepping, frame_every=1.0)
    sim.run(until=until)
    return sim


def relaxed(grains, numbers, time):
    """Positions (N, 3) of a rigid cluster after `time` in a gas, by DOP853 from the sums of its grains, without SAND.

    Ẋ = P/M, q̇ = ½ Ω∘q, Ṗ = −Σ f_i (V + Ω×s_i − u), L̇ = −Σ s_i×f_i (V + Ω×s_i − u) − Σ f_r,i Ω in the laboratory frame.
    """
    m, inertia = grains.mass[:, None], grains.inertia
    given = numbers.density, numbers.mean_speed, numbers.accommodation
    friction = body_friction.translation_friction(grains.radius, *given)[:, None]
    spinning = body_friction.rotation_friction(grains.radius, *given).sum()
    total, centre = m.sum(), (m * grains.position).sum(axis=0) / m.sum()
    arm = grains.position - centre
    velocity = (m * grains.velocity).sum(axis=0) / total
    angular = (m * np.cross(arm, grains.velocity - velocity) + inertia[:, None] * grains.spin).sum(axis=0)
    tensor = ((m * arm**2).sum() + inertia.sum()) * np.eye(3) - (m * arm).T @ arm

    def rates(_, y):
        turn = Rotation.from_quat(y[6:10])
        s, v = turn.apply(arm), y[3:6]
        matrix = turn.as_matrix() @ tensor @ turn.as_matrix().T
        spin = np.linalg.solve(matrix, y[10:] * 1e-25)
        force = -friction * (v + np.cross(spin, s) - WIND)
        q = y[6:10]
        dq = 0.5 * np.array([*(spin * q[3] + np.cross(spin, q[:3])), -spin @ q[:3]])
        torque = np.cross(s, force).sum(axis=0) - spinning * spin
        return np.concatenate([v / 1e-8, force.sum(axis=0) / total, dq, torque / 1e-25])

    start = np.concatenate([centre / 1e-8, velocity, [0.0, 0.0, 0.0, 1.0], angular / 1e-25])
    end = solve_ivp(rates, (0.0, time), start, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    return end[:3] * 1e-8 + Rotation.from_quat(end[6:10]).apply(arm)


@pytest.mark.validates("other program", "Rigid clusters with drag in a wind follow the trajectory of SciPy's DOP853")
@pytest.mark.compiled("contacts")
def test_drag_on_a_body_follows_the_equations_of_motion(record_bound):
    """A body of unequal grains with drag alone in a wind, from rest at 2 ns on, for 2 τ: against DOP853.

    Errors fall by 4 ± 10 % per halved step (order 2), to 1e-4 of the way of some 10 nm.
    """
    begun = relaxing(sand.RigidClusters(), 2e-9)
    assert begun.regular_state.bodies.asleep.all()
    time = begun.regular_state.time
    exact = relaxed(begun.regular_state.grains, gas(5e-9).numbers(), 1e-8)
    errors = []
    for step in (4e-10, 2e-10, 1e-10, 2.5e-11):
        sim = begun.copy()
        limits = sim._engine.parameters.flight_limits._replace(longest_step=step)
        sim._engine.set_parameters(flight_limits=limits)
        sim.run(until=time + 1e-8)
        errors.append(np.linalg.norm(sim.grains.position - exact, axis=1).max())
    for longer, shorter in (errors[0:2], errors[1:3]):
        record_bound("error over that of half the step, over 4", longer / shorter / 4.0, least=0.9, most=1.1)
    record_bound("error of positions over 10 nm, shortest steps", errors[3] / 1e-8, most=1e-4)


@pytest.mark.compiled("contacts")
def test_a_body_relaxes_as_grain_by_grain():
    """Drag alone on a turning chain of unequal grains in a wind, with `sand.Verlet`, after 2 τ, at one of its kicks.

    Velocities agree to 2e-3 of the wind: steps of 0.1 τ have errors of 0.1²/12, and the chain stretches as it turns.
    The kicks of Verlet are at the ends of intervals of 2/3 to 4/3 of τ/20, so that grains begin to slow down half of
    one later: 0.033 τ |Δv| of position.
    """
    other = relaxing(sand.Verlet(), 1e-8)
    while other.regular_state.clock[KICKED] != other.regular_state.clock[TIME]:
        other.run(steps=1)
    one = relaxing(sand.RigidClusters(), other.time)
    assert one.regular_state.bodies.asleep.all() and one.steps < 0.05 * other.steps
    assert np.abs(one.grains.velocity - other.grains.velocity).max() < 2e-3 * 2.0
    assert np.abs(one.grains.position - other.grains.position).max() < 0.033 * 5e-9 * 2.0
    assert one.ledger["lost_gas"][-1] == pytest.approx(other.ledger["lost_gas"][-1], rel=2e-3, abs=0.0)


@pytest.mark.compiled("contacts")
def test_drag_of_awake_grains_acts_over_all_of_the_time():
    """A pair that flies along a wind of 0 is awake for the first nanosecond: its velocity is v e^(−t/τ) to 1e-9.

    Every kick is exact in time, so that no time may be left out or taken twice between the steps of bodies.
    """
    position = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, PITCH]])
    grains = sand.Grains(position, 1e-8, "iron", velocity=[[0.0, 0.0, 1.0]] * 2)
    forces = [contact(), gas(5e-9, brownian=False)]
    sim = sand.Simulation(grains, forces, stepping=sand.RigidClusters(), frame_every=1.0)
    for until in (0.13e-9, 0.31e-9, 0.77e-9):
        sim.run(until=until)
        assert not sim.regular_state.bodies.asleep.any()
        mean = sim.grains.velocity[:, 2].mean()
        assert mean == pytest.approx(math.exp(-sim.time / 5e-9), rel=1e-9, abs=0.0)


@pytest.mark.filterwarnings("ignore:a cluster spans half of the box")
@pytest.mark.compiled("contacts")
def test_noise_of_awake_grains_differs_from_step_to_step():
    """36 chains of four that span half of the box, and stay awake: 3/2 k_B T of translation each.

    τ = 1 ns, 12 samples 2 τ apart from 6 τ on: 36 × 12 × 3 values with correlations e^(−2) of the velocity, e^(−4) of
    the energy: √(2/1296 × 1.04) = 4 %, tolerance four of them. Noise that repeats in each step of the bodies would be a
    constant force, and the energy a multiple.
    """
    box = sand.Box.periodic(5.5 * PITCH, "1 um", "1 um")
    sim = sand.Simulation(
        chains(4, 36, 1.5e-7), [contact(), gas(1e-9)], box=box, stepping=sand.RigidClusters(), frame_every=1.0, seed=2
    )
    sim.run(until="6 ns")
    moving = []
    for k in range(12):
        sim.run(until=(8 + 2 * k) * 1e-9)
        moving.append((0.5 * 4 * MASS * of_bodies(sim.grains, 4)[1] ** 2).sum(axis=1).mean())
    assert sim.regular_state.count[RESTED] == 0
    assert np.mean(moving) == pytest.approx(1.5 * KT, rel=0.16, abs=0.0)


def magnetic(number=30, box="0.5 um", seed=2, tau=5e-8, forces=None, **options):
    """A magnetic gas of grains in a gas, in which several contacts form within 100 ns."""
    grains = sand.setup.gas(
        number, box, radius="10 nm", material="iron", moment="200 A m^2/kg", temperature="100 K", seed=seed
    )
    forces = [contact(), sand.Dipoles(), gas(tau)] if forces is None else forces
    options = {"frame_every": 1.0, "box": box, "seed": 7, "stepping": sand.RigidClusters()} | options
    return sand.Simulation(grains, forces, **options)


@pytest.mark.compiled("dipoles")
def test_output_and_restarts_change_no_bit(tmp_path):
    """Frames at any interval, and resumed runs, stopped at times with and without awake clusters."""
    whole = magnetic()
    whole.run(until="120 ns")
    often = magnetic(frame_every="0.7 ns")
    often.run(until="120 ns")
    assert different(whole, often) == []
    count = whole.regular_state.count
    assert count[MADE] >= 2 and count[RESTED] >= 2
    stopped, awake = magnetic(out=tmp_path / "run"), set()
    for part in range(1, 14):
        stopped.run(until=120e-9 * part / 13.3)
        awake.add(bool(stopped.regular_state.bodies.asleep.all()))
        stopped = sand.resume(tmp_path / "run")
    stopped.run(until="120 ns")
    assert different(whole, stopped) == []
    assert len(awake) == 2


@pytest.mark.compiled("dipoles")
def test_the_ledger_closes():
    """Touches in a gas: the total changes by less than 1e-3 of the energy dissipated, as without gas."""
    sim = magnetic()
    sim.run(until="120 ns")
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    assert last["lost_gas"] != 0.0
    assert abs(last["total"] - first["total"]) < 1e-3 * sim.ledger.dissipated
    assert 0.0 <= last["lost_quieting"] < 1e-4 * sim.ledger.dissipated
    assert sim.regular_state.count[LATE] == 0
    assert 0.0 < sim.regular_state.clock[SOME_AWAKE] < 0.5 * sim.time


@pytest.mark.compiled("contacts")
def test_the_ledger_of_bodies_alone_closes():
    """Chains at rest without other forces exchange energy with the gas alone.

    K + lost_gas of 64 bodies then changes by rounding alone, as free rotation of straight chains is exact: five times
    1e-16 of the kinetic energy in the wind, ½ M u² = 430 k_B T, in each of some 200 steps, 3e-11 of 3/2 k_B T if of one
    sign.  The bound leaves room for chains that are bent by less than 1e-4.
    """
    sim = sand.Simulation(
        chains(4, 64), [contact(), gas(5e-9, wind=(3.0, 0.0, 0.0))], stepping=sand.RigidClusters(), frame_every=1.0
    )
    sim.run(until="10 ns")
    assert sim.regular_state.bodies.asleep.all()
    before = sim.ledger.rows[-1]
    sim.run(until="200 ns")
    after = sim.ledger.rows[-1]
    assert sim.regular_state.count[WOKEN] == 0
    assert abs(after["lost_gas"] - before["lost_gas"]) > KT
    assert abs(after["total"] - before["total"]) < 1e-9 * 64 * 1.5 * KT


@pytest.mark.compiled("contacts")
def test_a_body_drifts_with_the_wind():
    """Chains from rest in a wind u: the mean velocity is u (1 − e^(−t/τ)), without noise to 1e-10.

    64 chains of mass 4 m, each component: √(k_B T/(4 m 64)); four standard deviations.
    """
    wind, tau = np.array([3.0, -1.0, 2.0]), 5e-9
    for brownian in (False, True):
        forces = [contact(), gas(tau, brownian=brownian, wind=tuple(wind))]
        sim = sand.Simulation(chains(4, 64), forces, stepping=sand.RigidClusters(), frame_every=1.0, seed=1)
        sim.run(until="20 ns")
        velocity = of_bodies(sim.grains, 4)[1].mean(axis=0)
        exact = wind * -math.expm1(-sim.time / tau)
        assert np.abs(velocity - exact).max() < (4 * math.sqrt(KT / (256 * MASS)) if brownian else 1e-10 * 3)


@pytest.mark.compiled("contacts")
def test_chains_come_to_rest_with_the_vibrations_that_noise_excites():
    """Chains of eight in a gas of 300 K, τ = 1 ns, where they vibrate with 3 k_B T or more, and ε ½ k q_c² is 2 k_B T.

    All rest after 3 ns, and what they lose is below 3 (n − 1) k_B T each, the mean in equilibrium without dashpots.
    """
    hot = sand.Gas(300.0, density=gas(1e-9).density / math.sqrt(3.0))
    sim = sand.Simulation(chains(8, 20), [contact(), hot], stepping=sand.RigidClusters(), frame_every=1.0)
    assert hot.shortest_time(sim.grains) == pytest.approx(1e-9, rel=1e-9, abs=0.0)
    sim.run(until="3 ns")
    assert sim.regular_state.bodies.asleep.all() and sim.regular_state.count[RESTED] == 20
    removed = sim.ledger["lost_quieting"][-1]
    assert 20 * 0.5 * 3.0 * KT < removed < 20 * 21.0 * 3.0 * KT


@pytest.mark.compiled("contacts")
@pytest.mark.filterwarnings("ignore:contacts of silica")
def test_clusters_stay_awake_whose_vibrations_could_move_a_contact():
    """Chains of eight 10 nm silica grains at 300 K, ½ k q_c² = 1.9 k_B T, where noise excites 3.4 k_B T, τ = 1 ns."""
    pitch = rest_distance(sand.SILICA, 1e-8, 1e-8)
    position = np.array([[k * pitch, y * 1e-6, 0.0] for y in range(20) for k in range(8)])
    grains = sand.Grains(position, 1e-8, "silica")
    forces = [contact(), sand.Gas(300.0, density=sand.Gas(300.0, density=1.0).shortest_time(grains) / 1e-9)]
    sim = sand.Simulation(grains, forces, stepping=sand.RigidClusters(), frame_every=1.0)
    sim.run(until="12 ns")
    assert sim.regular_state.bodies.asleep.mean() < 0.5


@pytest.mark.compiled("contacts")
def test_no_touch_is_missed_in_a_gas():
    """A hot gas, 1/e of each velocity is new after 5 ns: all bodies wake in time before some fifty touches.

    A pair that overlapped before its bodies woke would be counted as late; without the noise in the prediction, three
    are. A touch wakes at most two bodies; the bound of four standard deviations wakes as many again in vain.
    """
    grains = sand.setup.gas(120, "0.35 um", radius="10 nm", material="iron", temperature="2000 K", seed=4)
    forces = [contact(), sand.Gas(2000.0, density=sand.Gas(2000.0, density=1.0).shortest_time(grains) / 5e-9)]
    sim = sand.Simulation(grains, forces, box="0.35 um", stepping=sand.RigidClusters(), frame_every=1.0, seed=3)
    sim.run(until="300 ns")
    count = sim.regular_state.count
    assert count[MADE] > 30 and count[LATE] == 0
    assert count[WOKEN] <= 4 * count[MADE]


@pytest.mark.compiled("dipoles")
def test_threads_change_no_bit():
    """1100 grains, whose sums over pairs are shared, with one thread and with two."""
    ends = []
    for number in (1, 2):
        sand.set_threads(number)
        try:
            sim = magnetic(1100, "1.7 um", tau=2e-8)
            sim.run(steps=60)
        finally:
            sand.set_threads(None)
        ends.append(sim)
    assert ends[0].regular_state.count[WOKEN] > 0
    assert different(*ends) == []


@pytest.mark.compiled("contacts")
def test_a_change_of_the_gas():
    """Chains that fly with the wind at rest, then in a gas of another stopping time: v e^(−t/τ) with each, exact.

    A change wakes all clusters, and friction has acted up to its time exactly once.
    """
    grains = chains(4, 9, velocity=[[0.0, 1.0, 0.0]] * 36)
    forces = [contact(), gas(5e-9, brownian=False)]
    sim = sand.Simulation(grains, forces, stepping=sand.RigidClusters(), frame_every=1.0)
    sim.run(until="10 ns")
    assert sim.regular_state.bodies.asleep.all()
    with sim.change() as change:
        change.replace(gas(2e-9, brownian=False))
    sim.run(until="14 ns")
    assert sim.regular_state.bodies.asleep.all()
    assert np.abs(sim.grains.velocity[:, 1] / math.exp(-2.0 - 2.0) - 1.0).max() < 1e-9


@pytest.mark.validate
@pytest.mark.compiled("dipoles")
def test_growth_in_a_gas_is_that_of_grain_by_grain():
    """Contacts formed among 100 magnetic grains in 0.5 µs with τ = 20 ns, 16 seeds each way: equal means.

    Difference within three standard errors; measured were 22.0 ± 0.8 grain by grain and 22.2 ± 0.9 (24 seeds).
    """
    made = []
    for stepping in (sand.RigidClusters(), sand.Verlet()):
        own = []
        for seed in range(1, 17):
            sim = magnetic(100, "1.2 um", seed=seed, tau=2e-8, stepping=stepping)
            sim.run(until="0.5 us")
            own.append(int(sim.regular_state.count[MADE]))
        made.append(np.array(own))
    errors = [own.std(ddof=1) / 4.0 for own in made]
    assert abs(made[0].mean() - made[1].mean()) < 3.0 * math.hypot(*errors)
