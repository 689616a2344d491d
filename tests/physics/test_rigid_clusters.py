"""Runs with rigid clusters: motion of bodies, conservation, rest and waking, restart, and what is refused."""

import dataclasses
import itertools
import json
import math
import warnings

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import sand
from sand.analysis.body_motion import internal_kinetic_energy
from sand.analysis.clusters import cluster_labels
from sand.basics.constants import BOLTZMANN, MAGNETIC
from sand.basics.state import BODIES, CONTACT_STEPS, LATE, MADE, QUIETING, RESTED, SLIPPED, SOME_AWAKE, WOKEN
from sand.cli.main import main
from sand.engine.rigid.resting import rest_as_body
from sand.io.frame_chunks import code_of
from sand.simulation.ledger import kinetic_energies

from .setups import different, momenta, rest_distance

KT = BOLTZMANN * 100.0
PITCH = rest_distance(sand.IRON, 1e-8, 1e-8)


OSCILLATING = sand.Field([0, 0, 0], shape="oscillating", amplitude="5 mT", frequency="20 MHz")


def contact(**options):
    return sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns", **options)


def gas(stepping=None, number=30, box="0.5 um", forces=None, seed=2, **options):
    """A magnetic gas in which several contacts form within 100 ns."""
    extent = "0.5 um" if box is None else None
    grains = sand.setup.gas(
        number, box, extent=extent, radius="10 nm", material="iron", moment="200 A m^2/kg", temperature="100 K",
        seed=seed,
    )  # fmt: skip
    forces = [contact(), sand.Dipoles()] if forces is None else forces
    options = {"frame_every": 1.0, "box": box} | options
    return sand.Simulation(grains, forces, stepping=stepping or sand.RigidClusters(), **options)


class Resting(sand.Observer):
    """What is at rest at each output: at its time, and after the last regular step."""

    def __init__(self):
        self.both = []

    def see(self, simulation, row):
        states = simulation.state, simulation.regular_state
        self.both.append(tuple(state.at_rest.tolist() for state in states))


def two_chains(**options):
    """Two crooked chains of three magnetic grains, at rest in themselves, in open space."""
    corner = np.array([[0.0, 0.0, 0.0], [PITCH, 0.0, 0.0], [PITCH, PITCH, 0.0]])
    position = np.vstack([corner, corner[:, [2, 0, 1]] + [0.2e-7, 1.2e-7, 0.1e-7]])
    mass = sand.Grains(position, 1e-8, "iron").mass[0]
    spin = np.repeat([[2e7, -1e7, 3e7], [-1e7, 2e7, 1e7]], 3, axis=0)
    centre = np.repeat([position[:3].mean(axis=0), position[3:].mean(axis=0)], 3, axis=0)
    velocity = np.cross(spin, position - centre) + np.repeat([[0.0, 0.4, 0.0], [0.1, -0.4, 0.0]], 3, axis=0)
    moment = 2e2 * mass * np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, -1], [0, 1, 0]])
    grains = sand.Grains(position, 1e-8, "iron", velocity=velocity, spin=spin, moment=moment)
    forces = [contact(), sand.Dipoles(), *options.pop("forces", [])]
    return sand.Simulation(grains, forces, stepping=sand.RigidClusters(**options), frame_every=1.0)


def rigid_motion(grains, bodies, time, field):
    """Two rigid bodies by DOP853 from Newton's and Euler's equations, without SAND: positions (N, 3) after `time`.

    Ẋ = P/M, q̇ = ½ q∘(Ω, 0), Ṗ = ΣF, L̇ = Σ(s×F + μ×B) in the laboratory frame, Ω = R I⁻¹ Rᵀ L, with all dipole pairs of
    different bodies and an external flux density B(t).
    """
    mass, inertia = grains.mass, grains.inertia
    data, start = [], []
    for own in bodies:
        m = mass[own][:, None]
        centre = (m * grains.position[own]).sum(axis=0) / m.sum()
        s = grains.position[own] - centre
        momentum = (m * grains.velocity[own]).sum(axis=0)
        u = grains.velocity[own] - momentum / m.sum()
        angular = (m * np.cross(s, u) + inertia[own][:, None] * grains.spin[own]).sum(axis=0)
        tensor = ((m * s**2).sum() + inertia[own].sum()) * np.eye(3) - (m * s).T @ s
        data.append((own, m.sum(), s, tensor, grains.moment[own].copy()))
        start += [centre / 1e-8, momentum / (m.sum() * 1.0), [0.0, 0.0, 0.0, 1.0], angular / 1e-25]
    k = MAGNETIC

    def placed(y):
        x, mu, parts = np.zeros((len(mass), 3)), np.zeros((len(mass), 3)), []
        for b, (own, _, s, _, moment) in enumerate(data):
            part = y[13 * b : 13 * b + 13]
            turn = Rotation.from_quat(part[6:10])
            x[own], mu[own] = part[:3] * 1e-8 + turn.apply(s), turn.apply(moment)
            parts.append((turn, part))
        return x, mu, parts

    def rates(t, y):
        x, mu, parts = placed(y)
        force, torque = np.zeros_like(x), np.cross(mu, field(t))
        for i in data[0][0]:
            for j in data[1][0]:
                r = x[i] - x[j]
                d = np.linalg.norm(r)
                n = r / d
                a, b = mu[i], mu[j]
                f = 3 * k / d**4 * ((a @ n) * b + (b @ n) * a + (a @ b) * n - 5 * (a @ n) * (b @ n) * n)
                force[i] += f
                force[j] -= f
                torque[i] += np.cross(a, k / d**3 * (3 * n * (b @ n) - b))
                torque[j] += np.cross(b, k / d**3 * (3 * n * (a @ n) - a))
        out = []
        for (own, total, s, tensor, _), (turn, part) in zip(data, parts, strict=True):
            arm = turn.apply(s)
            matrix = turn.as_matrix() @ tensor @ turn.as_matrix().T
            spin = np.linalg.solve(matrix, part[10:] * 1e-25)
            q = part[6:10]
            dq = 0.5 * np.array([*(spin * q[3] + np.cross(spin, q[:3])), -spin @ q[:3]])
            rate = (torque[own] + np.cross(arm, force[own])).sum(axis=0)
            out += [part[3:6] / 1e-8, force[own].sum(axis=0) / total, dq, rate / 1e-25]
        return np.concatenate(out)

    done = solve_ivp(rates, (0.0, time), np.concatenate(start), method="DOP853", rtol=1e-11, atol=1e-12)
    return placed(done.y[:, -1])[0]


def at_rest(sim, most=200):
    """Run until every cluster is at rest; returns the simulation."""
    for _ in range(most):
        sim.run(steps=1)
        if sim.regular_state.bodies.asleep.all():
            return sim
    raise AssertionError("no rest")


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize(
    "forces", [[], [sand.Field([0, 0, 0], shape="oscillating", amplitude="5 mT", frequency="20 MHz")]]
)
def test_two_bodies_follow_the_equations_of_motion(forces):
    """Two chains at rest, from the same state: positions after 20 ns against DOP853, without and with B(t).

    Errors fall by 4 ± 5 % per halved step (order 2), and to 1e-6 of the distance flown, about 10 nm.
    """
    begun = at_rest(two_chains(forces=forces))
    time = begun.time
    bodies = [np.arange(3), np.arange(3, 6)]
    start = begun.regular_state.grains

    def field(t):
        return np.array([0.0, 0.0, 5e-3 * math.cos(2 * math.pi * 20e6 * (time + t))]) if forces else np.zeros(3)

    exact = rigid_motion(start, bodies, 2e-8, field)
    errors = []
    for step in (2e-10, 1e-10, 5e-11, 5e-12):
        sim = begun.copy()
        limits = sim._engine.parameters.flight_limits._replace(step_fraction=0.2, longest_step=step)
        sim._engine.set_parameters(flight_limits=limits)
        sim.run(until=time + 2e-8)
        assert sim.regular_state.count[MADE] == 0 and sim.regular_state.bodies.asleep.all()
        errors.append(np.linalg.norm(sim.grains.position - exact, axis=1).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05, abs=0.0)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.05, abs=0.0)
    assert errors[3] < 1e-6 * 1e-8


@pytest.mark.compiled("dipoles")
def test_momentum_and_angular_momentum_are_those_of_the_start():
    """A gas in open space with touches: P to 1e-12 of Σ m v, L to 1e-12 of Σ |L| of the grains, over all steps.

    Bodies and awake clusters are kicked as rigid bodies by forces whose sum and total torque vanish.
    """
    sim = gas(box=None, number=30)
    start = sim.grains.copy()
    sim.run(until="150 ns")
    grains, count = sim.regular_state.grains, sim.regular_state.count
    assert count[MADE] >= 3 and count[WOKEN] >= 6 and count[RESTED] >= 3
    m, inertia = start.mass[:, None], start.inertia[:, None]
    momentum, before = m * grains.velocity, m * start.velocity
    assert np.abs((momentum - before).sum(axis=0)).max() < 1e-12 * np.abs(before).sum()
    angular = np.cross(grains.position, momentum) + inertia * grains.spin
    old = np.cross(start.position, before) + inertia * start.spin
    assert np.abs((angular - old).sum(axis=0)).max() < 1e-12 * np.abs(old).sum()


@pytest.mark.compiled("dipoles")
def test_flights_and_touches_are_those_of_grain_by_grain():
    """Positions with rigid clusters tend to those of `sand.Verlet`: errors fall by 4 (± 30 %) per halved step.

    At 60 ns a first contact has formed, in both; η = 0.025 is within 0.01 nm of the grains, with the same energy lost
    by damping to 1e-3: the two contact integrations begin at different phases of a step.
    """
    exact = gas(sand.Verlet(), number=100, box="1.2 um", seed=1)
    exact.run(until="60 ns")
    lost = [exact.ledger["lost_damping_normal"][-1]]
    errors = []
    for fraction in (0.1, 0.05, 0.025):
        sim = gas(sand.RigidClusters(step_fraction=fraction), number=100, box="1.2 um", seed=1)
        sim.run(until="60 ns")
        apart = sim.box.nearest(sim.grains.position - exact.grains.position)
        errors.append(np.linalg.norm(apart, axis=1).max())
        lost.append(sim.ledger["lost_damping_normal"][-1])
        assert sim.state.count[MADE] == exact.state.count[MADE] == 1
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3, abs=0.0)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.3, abs=0.0)
    assert errors[2] < 1e-11
    assert lost[1:] == pytest.approx(lost[:1] * 3, rel=1e-3, abs=0.0)


@pytest.mark.compiled("dipoles")
def test_a_cluster_at_rest_has_the_momenta_and_bits_that_it_had_awake():
    """Coming to rest changes velocities and spins only, keeps P and L, and the energy removed is `lost_quieting`.

    Waking changes nothing at all.
    """
    sim = two_chains(longest_step="0.2 ns")
    sim.run(steps=2)
    engine, state = sim._engine, sim.regular_state
    steps = engine.stepper
    assert not state.bodies.asleep.any()
    before, arrays = state.copy(), state.grains.arrays
    awake = steps.awake
    awake.sort_members(state)
    awake.take(engine, state)
    awake.measure()
    _, own, offset = next(awake.clusters(np.ones(6, bool)))
    rest_as_body(engine, own, offset, awake.measures.strain[0], awake.measures.strength[:, 0])
    assert state.bodies.asleep.tolist() == [1, 1, 1, 0, 0, 0]
    old = before.grains.arrays
    for name in ("position", "orientation", "moment"):
        assert getattr(arrays, name).tobytes() == getattr(old, name).tobytes()
    own = slice(0, 3)
    m, inertia = old.mass[own], old.inertia[own]

    def momenta(given):
        v, w, x = given.velocity[:, own], given.spin[:, own], given.position[:, own]
        return (m * v).sum(axis=1), (m * np.cross(x, v, axis=0) + inertia * w).sum(axis=1)

    for one, other in zip(momenta(old), momenta(arrays), strict=True):
        assert np.allclose(one, other, rtol=1e-13, atol=0.0)

    def kinetic(given):
        return 0.5 * (m * given.velocity[:, own] ** 2).sum() + 0.5 * (inertia * given.spin[:, own] ** 2).sum()

    removed = state.lost[QUIETING] - before.lost[QUIETING]
    assert removed == pytest.approx(kinetic(old) - kinetic(arrays), rel=1e-9, abs=1e-14 * kinetic(old))
    assert removed == pytest.approx(awake.measures.vibration[0], rel=1e-6, abs=1e-14 * kinetic(old))
    at_rest_state = state.copy()
    state.bodies.near[0] = 3
    steps._wake(engine)
    for name, array in at_rest_state.grains.arrays._asdict().items():
        assert array.tobytes() == getattr(state.grains.arrays, name).tobytes()
    assert not state.bodies.asleep.any()


@pytest.mark.compiled("dipoles")
def test_output_and_restarts_change_no_bit(tmp_path):
    """Frames at any interval, copies, and resumed runs, stopped at times with and without awake clusters."""
    whole = gas()
    whole.run(until="120 ns")
    often = gas(frame_every="0.7 ns")
    often.run(until="120 ns")
    assert different(whole, often) == []
    assert whole.regular_state.count[MADE] >= 2
    stopped, awake = gas(out=tmp_path / "run"), set()
    for part in range(1, 14):
        stopped.run(until=120e-9 * part / 13.3)
        awake.add(bool(stopped.regular_state.bodies.asleep.all()))
        stopped = sand.resume(tmp_path / "run")
    stopped.run(until="120 ns")
    assert different(whole, stopped) == []
    assert len(awake) == 2


@pytest.mark.compiled("dipoles")
def test_frames_say_which_clusters_are_at_rest(tmp_path):
    """Grains of a cluster at rest have velocities and spins of one rigid motion, those of a cluster after a touch not.

    Frames are in single precision: offsets from the centre are known to 6e-8 of the box, 25 radii, which is 1e-6 of a
    radius, and 1e-12 in energy; 1e-10 of the cluster's kinetic energy is allowed.  One frame is in a step of bodies in
    which a cluster comes to rest: what is at rest is that of the frame, not of the step before.  The ledger counts
    awake grains, and a run resumed at frames with and without awake clusters writes the same frames and rows.
    """
    seen = Resting()
    whole = gas(out=tmp_path / "whole", frame_every="0.7 ns", observers=[seen])
    whole.run(until="120 ns")
    assert any(now != before for now, before in seen.both)
    run, vibrating = sand.open(tmp_path / "whole"), []
    assert [frame.at_rest.tolist() for frame in run.frames] == [now for now, _ in seen.both]
    for frame in run.frames:
        labels = cluster_labels(len(frame), frame.pair)
        grains = whole.grains.copy()
        for name in ("position", "velocity", "spin"):
            getattr(grains.arrays, name)[...] = np.asarray(getattr(frame, name), float).T
        internal, _ = internal_kinetic_energy(grains, frame.pair, frame.box)
        kinetic = np.bincount(labels, weights=np.add(*kinetic_energies(grains)))
        for k in range(labels.max() + 1):
            (rest,) = set(frame.at_rest[labels == k].tolist())
            if rest:
                assert internal[k] < 1e-10 * kinetic[k]
            else:
                vibrating.append(internal[k] / kinetic[k])
    assert max(vibrating) > 0.1
    awake = [int((~frame.at_rest).sum()) for frame in run.frames]
    assert run.ledger["awake"].tolist() == awake
    assert 0 in awake and max(awake) > 3
    count = len(run.frames)
    sim = gas(out=tmp_path / "parts", frame_every="0.7 ns")
    for k in sorted({*np.flatnonzero(awake)[1::12].tolist(), 40, count - 1}):
        sim.run(until=run.frames[k].time)
        sim = sand.resume(tmp_path / "parts")
    files = [tmp_path / name / "ledger.csv" for name in ("whole", "parts")]
    assert files[0].read_bytes() == files[1].read_bytes()
    parts = sand.open(tmp_path / "parts").frames
    assert len(parts) == count
    assert [code_of(run.frames.stored(k)) for k in range(count)] == [code_of(parts.stored(k)) for k in range(count)]
    assert (np.asarray(parts.at_rest) == np.asarray(run.frames.at_rest)).all()
    assert (run.to_xarray()["at_rest"].to_numpy() == np.asarray(run.frames.at_rest)).all()


@pytest.mark.compiled("dipoles")
def test_the_ledger_closes():
    """The total changes by less than 1e-3 of the energy dissipated, as grain by grain; quieting takes 1e-5 of it."""
    sim = gas()
    sim.run(until="120 ns")
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    assert abs(last["total"] - first["total"]) < 1e-3 * sim.ledger.dissipated
    assert 0.0 <= last["lost_quieting"] < 1e-5 * sim.ledger.dissipated
    assert sim.regular_state.count[LATE] == 0
    assert 0.0 < sim.regular_state.clock[SOME_AWAKE] < sim.time


@pytest.mark.compiled("dipoles")
def test_no_touch_is_missed():
    """A fast gas without long-range forces: bodies wake before all of some hundred touches, none in vain.

    Each touch wakes at most two bodies; a pair that overlapped before its bodies woke would be counted as late.
    """
    grains = sand.setup.gas(120, "0.35 um", radius="10 nm", material="silica", temperature="2000 K", seed=4)
    sim = sand.Simulation(grains, [contact()], box="0.35 um", stepping=sand.RigidClusters(), frame_every=1.0)
    sim.run(until="150 ns")
    count = sim.regular_state.count
    assert count[MADE] > 60 and count[LATE] == 0
    assert count[WOKEN] <= 3 * count[MADE]


AXES = {"twist": ([0.0, 1.0, 0.0], 1e-18), "roll": ([0.0, 0.0, 1.0], 1e-16)}
"""Direction of the field, and magnetic moment [A m²], that load a pair along z with moments along ±x in one mode."""


def loaded_pair(mode, flux, **options):
    """Two grains along z with opposite moments along ±x in a field [T]: torques ±μB twist, or roll, their contact."""
    position = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, PITCH]])
    axis, moment = AXES[mode]
    grains = sand.Grains(position, 1e-8, "iron", moment=[[moment, 0.0, 0.0], [-moment, 0.0, 0.0]])
    options = {name: np.multiply(axis, value) if name == "final" else value for name, value in options.items()}
    forces = [contact(), sand.Field(np.multiply(axis, flux), **options)]
    return sand.Simulation(grains, forces, stepping=sand.RigidClusters(), frame_every=1.0)


def field_at_limit(mode):
    """Flux density [T] at which the contact twists, at G′a₀³/3π, or rolls, at 4 F_c ξ_c (Dominik & Tielens 1997)."""
    numbers = sand.theory.contact(sand.IRON, "10 nm")
    return (numbers.twist_moment if mode == "twist" else numbers.roll_moment) / AXES[mode][1]


@pytest.mark.filterwarnings("ignore:field. a flux density")  # as strong as the limit of a contact needs
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("share", [0.3, 0.9, 1.1])
def test_a_strained_pair_rests_and_a_twisting_one_does_not(share):
    """Twisted by a field to 0.3 or 0.9 of its limit, a pair rests with this strain; beyond the limit it twists on."""
    final = share * field_at_limit("twist")
    sim = loaded_pair("twist", 0.0, shape="ramp", final=final, start=0.0, end="0.6 ns")
    sim.run(until="10 ns")
    assert sim.contacts["twist_share"][0] == pytest.approx(min(share, 1.0), rel=0.02, abs=0.0)
    assert bool(sim.regular_state.bodies.asleep.all()) == (share < 1.0)
    assert (sim.regular_state.count[SLIPPED] > 0) == (share > 1.0)


@pytest.mark.filterwarnings("ignore:field. a flux density")  # as strong as the limit of a contact needs
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize(
    ("mode", "start", "wakes"),
    [
        *[("twist", 0.2, 0.7), ("roll", 0.9, 0.92)],
        *[pytest.param(*each, marks=pytest.mark.validate) for each in (("roll", 0.2, 0.7), ("twist", 0.9, 0.92))],
    ],
)
def test_a_pair_in_a_growing_field_wakes_before_its_contact_yields_at_the_limit(mode, start, wakes):
    """At rest in a share of the field that twists or rolls its contact, which then grows: it wakes before the limit.

    A pair comes to rest again below the limit, and wakes when its load has changed by 1 to 2 % of it: the first slip is
    late by at most 2 %, and early by 1 % of vibration.
    """
    limit = field_at_limit(mode)
    ramp = {"shape": "ramp", "final": np.multiply(AXES[mode][0], 1.5 * limit), "start": "30 ns", "end": "330 ns"}
    sim = loaded_pair(mode, 0.0, shape="ramp", final=start * limit, start=0.0, end="0.6 ns")
    sim.run(until="30 ns")
    assert sim.regular_state.bodies.asleep.all()
    with sim.change() as change:
        change.replace(sand.Field(np.multiply(AXES[mode][0], start * limit), **ramp))
    sim.run(until="35 ns")
    woken = None
    while sim.regular_state.count[SLIPPED] == 0 and sim.time < 3.3e-7:
        sim.run(until=sim.time + 5e-10)
        now = start + (1.5 - start) * (sim.time - 3e-8) / 3e-7
        if woken is None and not sim.regular_state.bodies.asleep.all():
            woken = now
    assert start < woken < wakes
    assert now == pytest.approx(1.005, abs=0.015)


def tumbling_pairs(seed, count):
    """Pairs of crooked trimers that fly at each other and tumble, 3 µm from the next pair; 2 `count` bodies."""
    rng = np.random.default_rng(seed)
    corner = np.array([[0.0, 0.0, 0.0], [PITCH, 0.0, 0.0], [PITCH, PITCH, 0.0]])
    corner -= corner.mean(axis=0)
    places, velocities, spins = [], [], []
    for k in range(count):
        at = 3e-6 * np.array([k % 8, (k // 8) % 8, k // 64])
        apart = rng.normal(size=3)
        apart *= 1.5e-7 / np.linalg.norm(apart)
        for side in (-0.5, 0.5):
            shape = corner @ Rotation.random(random_state=rng).as_matrix()
            spin = rng.normal(size=3) * 5e7
            velocity = -side * 2.0 * apart / 1.5e-7 + rng.normal(size=3) * 0.3
            places.append(at + side * apart + shape)
            velocities.append(velocity + np.cross(spin, shape))
            spins.append(np.tile(spin, (3, 1)))
    position, velocity, spin = (np.concatenate(each) for each in (places, velocities, spins))
    return sand.Grains(position, 1e-8, "iron", velocity=velocity, spin=spin)


def free_flights(grains, step, steps):
    """Positions (trimers, 3, 3) of trimers in free flight at the start of each step, by brute force.

    All are free tops: q̇ = ½ (Ω, 0)∘q, Ω = R I⁻¹ Rᵀ L with L constant, by the classical Runge–Kutta method of fourth
    order, whose error per step is (Ω step)⁵/120 ≈ 1e-12.
    """
    m, bodies = grains.mass[0], len(grains) // 3
    centre, velocity = (x.reshape(bodies, 3, 3).mean(axis=1) for x in (grains.position, grains.velocity))
    s = grains.position.reshape(bodies, 3, 3) - centre[:, None]
    tensor = m * ((s**2).sum(axis=(1, 2))[:, None, None] * np.eye(3) - np.einsum("bki,bkj->bij", s, s))
    tensor += 3.0 * grains.inertia[0] * np.eye(3)
    inverse = np.linalg.inv(tensor)
    angular = np.einsum("bij,bj->bi", tensor, grains.spin[::3])
    turn = np.tile(np.eye(3), (bodies, 1, 1))  # rotation matrices: dR/dt = Ω×R

    def rate(turn):
        spin = np.einsum("bij,bjk,blk,bl->bi", turn, inverse, turn, angular, optimize=True)
        return np.cross(spin[:, :, None], turn, axis=1)

    for k in range(steps):
        yield centre[:, None] + (velocity * (k * step))[:, None] + np.einsum("bij,bkj->bki", turn, s)
        k1 = rate(turn)
        k2 = rate(turn + 0.5 * step * k1)
        k3 = rate(turn + 0.5 * step * k2)
        k4 = rate(turn + step * k3)
        turn = turn + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def gaps(grains, step, steps):
    """Gap between the trimers of each pair in free flight: (steps, pairs)."""
    flights = free_flights(grains, step, steps)
    return np.array([np.linalg.norm(x[::2, :, None] - x[1::2, None], axis=-1).min(axis=(1, 2)) - 2e-8 for x in flights])


def compare_first_touches(seed, count):
    """Number of pairs that touch: all those whose gap closes, when it closes, to 0.02 nm.

    The rotor errs by less than 0.1²/12 of the angle turned, here up to 5 rad, times β I₂, 0.2 for trimers
    (`test_errors_of_a_tumbling_body_…`): 8e-4 rad of 2e-8 m, 0.02 nm.  Those that only graze each other, by less than
    this, may touch or not.
    In the step of the brute force in which they touch bodies close by at most 6 m/s · 0.05 ns, 0.3 nm.
    """
    grains, step, error, closed = tumbling_pairs(seed, count), 5e-11, 2e-11, 3e-10
    gap = gaps(grains, step, 1600)
    sim = sand.Simulation(grains, [contact()], stepping=sand.RigidClusters(), frame_every=1.0)
    sim.run(until=8e-8)
    assert sim.regular_state.count[LATE] == 0
    table = sim.contacts
    found = np.full(count, np.inf)
    between = table["pair"][:, 0] // 3 != table["pair"][:, 1] // 3
    np.minimum.at(found, table["pair"][between, 0] // 6, table["formed"][between])
    touched = np.isfinite(found)
    for pair in range(count):
        before = gap[: math.ceil(found[pair] / step) if touched[pair] else len(gap), pair]
        assert before.min() > -error
        if touched[pair]:
            assert before[-1] < closed
    return touched.sum()


@pytest.mark.compiled("contacts")
def test_tumbling_pairs_touch_first_where_brute_force_has_it():
    """40 pairs of tumbling trimers, 80 ns: no touch is missed or invented, and all are where free tops have them."""
    assert compare_first_touches(1, 40) > 10


@pytest.mark.compiled("contacts")
def test_errors_of_a_tumbling_cluster_fall_with_the_square_of_the_step_fraction():
    """An L of six grains, near its intermediate axis, turns 9.5 times at rest; the exact rotor: Euler's equations.

    Steps of 24 ns, 0.083 in units of the time in which motions about the second axis part, are one piece with η = 0.2
    and 0.1, two with 0.05 and four with 0.025: errors fall by four, ± 10 %.  As in `test_errors_of_a_tumbling_body_…`
    the largest is 0.081·0.83² rad; near the second axis, where L₁ and L₃ are small for most of the time, a tenth of it.
    """
    corner = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [0, 1, 0], [0, 2, 0]], float)
    s = rest_distance(sand.IRON, 1e-8, 1e-8) * (corner - corner.mean(axis=0))
    axes = np.linalg.eigh((s**2).sum() * np.eye(3) - s.T @ s)[1]
    spin = 5e6 * axes @ [0.01, 1.0, 0.01]
    errors = []
    for fraction in (0.2, 0.1, 0.05, 0.025):
        grains = sand.Grains(s, 1e-8, "iron", velocity=np.cross(spin, s), spin=[spin] * 6)
        stepping = sand.RigidClusters(step_fraction=fraction)
        sim = sand.Simulation(grains, [contact()], stepping=stepping, frame_every=1.0)
        at_rest(sim)
        start, began, bodies = sim.grains.position.copy(), sim.time, sim.regular_state.bodies
        inertia = bodies.inertia[:, 0]
        frame = Rotation.from_quat(bodies.orientation[:, 0])

        def rate(_, y, inertia=inertia):
            angular, turn = y[:3], y[3:].reshape(3, 3)
            return np.concatenate([np.cross(angular, angular / inertia), (np.cross(turn, angular / inertia)).ravel()])

        begin = np.concatenate([bodies.angular_momentum[:, 0].copy(), frame.as_matrix().ravel()])
        sim.run(until=began + 12e-6)
        found = solve_ivp(rate, (0.0, sim.time - began), begin, method="DOP853", rtol=1e-12, atol=1e-40)
        turn = found.y[3:, -1].reshape(3, 3) @ frame.as_matrix().T
        centre = start.mean(axis=0)
        exact = (start - centre) @ turn.T + centre
        errors.append(np.linalg.norm(sim.grains.position - exact, axis=1).max() / 6e-8)
    assert errors[0] < 6e-3
    for coarse, fine in itertools.pairwise(errors[1:]):
        assert coarse / fine == pytest.approx(4.0, rel=0.1, abs=0.0)


@pytest.mark.validate
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("seed", range(20))
def test_ten_thousand_tumbling_pairs(seed):
    """As `test_tumbling_pairs_touch_first_where_brute_force_has_it`, 20 times 500 pairs."""
    assert compare_first_touches(100 + seed, 500) > 100


@pytest.mark.validate
@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize(("steps", "bound"), [(100_000, 1e-11), (1_000_000, 4e-11)])
def test_momenta_over_many_mixed_steps(steps, bound):
    """An open gas: P and L after many steps of bodies and contacts are those of the start, by Σ|m v| and Σ|L_i|.

    Rounding of the forces within clusters, some hundred times those between them, adds about 2e-15 of Σ|m v| per step
    of bodies, at random while orientations last, some hundred steps: 2e-15 √(steps·100), of which the bounds are twice.
    """
    sim = gas(box=None, number=30, forces=[contact(), sand.Dipoles(cutoff=None)])
    sim.run(steps=1)
    start = momenta(sim)
    while sim.steps + sim.regular_state.count[CONTACT_STEPS] < steps:
        sim.run(steps=1000)
    assert sim.regular_state.count[MADE] > 10 and sim.regular_state.count[CONTACT_STEPS] > 50_000
    for before, after in zip(start, momenta(sim), strict=True):
        size = np.linalg.norm(before, axis=1).sum() + np.linalg.norm(after, axis=1).sum()
        assert np.linalg.norm((after - before).sum(axis=0)) < bound * size


@pytest.mark.compiled("contacts")
def test_a_touch_in_the_first_step_of_an_awake_cluster_is_seen():
    """A grain that is 1 nm from a pair, which is awake at the start, closes at 10 m/s: it touches within 0.1 ns."""
    position = [[0.0, 0.0, 0.0], [PITCH, 0.0, 0.0], [PITCH + 2.1e-8, 0.0, 0.0]]
    grains = sand.Grains(position, 1e-8, "iron", velocity=[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-10.0, 0.0, 0.0]])
    sim = sand.Simulation(grains, [contact()], stepping=sand.RigidClusters(), frame_every=1.0)
    sim.run(until="0.5 ns")
    assert np.sort(sim.contacts["pair"]).tolist() == [[0, 1], [1, 2]] and sim.regular_state.count[LATE] == 0
    assert sim.contacts["formed"][1] == pytest.approx(1e-10, rel=0.1, abs=0.0)


@pytest.mark.compiled("dipoles")
def test_a_condition_is_checked_in_every_step_of_bodies():
    """The run ends at the step in which the first contact forms: the one before has none."""
    sim = gas()
    result = sim.run(until="120 ns", stop="contacts >= 1")
    assert result.condition == "contacts >= 1" and sim.regular_state.count[MADE] == 1
    before = gas()
    before.run(steps=sim.steps - 1)
    assert before.regular_state.count[MADE] == 0


def test_warnings_of_parts_reach_the_user():
    """Engines of quick bodies, also those of a copy, write into the list of warnings of the whole simulation."""
    sim = gas()
    for engine in (sim._engine, sim.copy()._engine):
        quick = engine.stepper.quick.part
        assert quick.prototype.warnings is engine.warnings
        assert quick.anew().prototype.warnings is engine.warnings


@pytest.mark.filterwarnings("ignore:a cluster spans half of the box")
@pytest.mark.compiled("contacts")
def test_a_run_that_is_awake_most_of_the_time_says_so(monkeypatch):
    """A chain that spans half of the box is awake all the time: after many contact steps there is a warning."""
    monkeypatch.setattr("sand.simulation.run_writer.LONG_RUN", 1000)
    grains = sand.Grains(PITCH * np.array([[k - 2.5, 0.0, 0.0] for k in range(6)]), 1e-8, "iron")
    sim = sand.Simulation(grains, [contact()], box="180 nm", stepping=sand.RigidClusters(), frame_every=1.0)
    with pytest.warns(UserWarning, match="awake most of the time: clusters = 'grains'"):
        sim.run(until="2 ns")


@pytest.mark.compiled("dipoles")
def test_changes_form_no_contact_twice():
    """A run with many small changes: every pair has one contact, as grain by grain."""
    sim = gas()
    for k in range(1, 31):
        sim.run(until=k * 5e-9)
        with sim.change() as change:
            change.velocity[0] *= 1.0000001
    pairs = np.sort(sim.contacts["pair"], axis=1)
    assert len(pairs) > 5 and len(np.unique(pairs, axis=0)) == len(pairs)


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("speed", [30.0, 100.0])
def test_a_fast_awake_cluster_does_not_pass_through_a_grain(speed):
    """A pair, awake at the start, flies at a resting grain at many times the thermal speed: a contact forms in time."""
    for gap in (2e-8, 5e-8, 9e-8):
        position = [[0.0, 0.0, 0.0], [PITCH, 0.0, 0.0], [PITCH + 2e-8 + gap, 0.0, 0.0]]
        velocity = [[speed, 0.0, 0.0], [speed, 0.0, 0.0], [0.0, 0.0, 0.0]]
        grains = sand.Grains(position, 1e-8, "iron", velocity=velocity)
        sim = sand.Simulation(grains, [contact()], stepping=sand.RigidClusters(), frame_every=1.0)
        sim.run(until=1.5 * gap / speed + 1e-10)
        assert sim.regular_state.count[MADE] + sim.state.count[MADE] >= 1 and sim.state.count[LATE] == 0
        assert sim.ledger.drift < 3e-3  # grain by grain: 7e-4


@pytest.mark.filterwarnings("ignore:dipoles. from .* half the box")
@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("dipoles", [sand.Dipoles(), sand.Dipoles(periodic="ewald")], ids=["cut-off", "ewald"])
def test_restart_in_a_wide_box_changes_no_bit(tmp_path, dipoles):
    """A box wider than twice the cut-off, which follows the clusters: resumed while clusters are awake."""
    runs = [
        gas(number=40, box="2 um", forces=[contact(), dipoles], seed=3, out=tmp_path / k) for k in ("whole", "parts")
    ]
    for sim in runs:  # closer together than in a gas of this box
        with sim.change() as change:
            change.velocity[:] -= 3e6 * sim.grains.position
    runs[0].run(until="300 ns")
    parts = runs[1]
    for k in range(1, 6):
        parts.run(until=k * 5e-8 + 1e-9)
        parts = sand.resume(tmp_path / "parts")
    parts.run(until="300 ns")
    assert different(runs[0], parts) == [] and parts.regular_state.count[MADE] > 2


@pytest.mark.filterwarnings("ignore:grains overlap too deeply", "ignore:impacts are too fast for elastic grains")
@pytest.mark.compiled("contacts")
def test_a_stop_within_contact_steps_leaves_the_state_before_the_step():
    """A head-on impact so fast that the contact is compressed beyond reason, and a grain that flies elsewhere.

    The run stops with the grains named; all grains are where they were at the time of the state.
    """
    position = [[0.0, 0.0, 0.0], [2.2e-8, 0.0, 0.0], [0.0, 3e-7, 0.0]]
    velocity = [[2e4, 0.0, 0.0], [-2e4, 0.0, 0.0], [0.0, 1.0, 0.0]]
    grains = sand.Grains(position, 1e-8, "iron", velocity=velocity)
    sim = sand.Simulation(grains, [contact()], stepping=sand.RigidClusters(longest_step="0.1 ns"), frame_every=1.0)
    result = sim.run(until="1 ns")
    assert result.outcome.is_physics and set(result.grains) <= {0, 1} and result.grains
    state = sim.regular_state
    flown = state.grains.position - np.array(position)
    assert np.abs(flown[2] - [0.0, state.time * 1.0, 0.0]).max() < 1e-18
    assert np.abs(flown[0] - [2e4 * state.time, 0.0, 0.0]).max() < 1e-10  # its contact pulls


@pytest.mark.compiled("contacts")
def test_a_cluster_that_spans_half_of_the_box_stays_awake_and_says_so():
    """A straight chain of six, 97 nm from centre to centre, in a box of 180 nm and of 250 nm: awake, with a warning."""
    grains = sand.Grains(PITCH * np.array([[k - 2.5, 0.0, 0.0] for k in range(6)]), 1e-8, "iron")
    for side, rests in ((1.8e-7, False), (2.5e-7, True)):
        sim = sand.Simulation(grains, [contact()], box=side, stepping=sand.RigidClusters(), frame_every=1.0)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            sim.run(until="10 ns")
        said = [str(one.message) for one in caught if "spans half of the box or more" in str(one.message)]
        assert len(said) == (not rests) and all(text.endswith("use a larger box") for text in said)
        assert sim.regular_state.bodies.asleep.all() == rests


def swing(moment, mass, distance, normal, slide):
    """Angle after 2 ns of a dimer that swings in a field: dL/dt = 2 μ B(t) cos φ with L = I ω, by DOP853.

    I = m (4/5 r² + D²/2), with the contact stretched by the centrifugal force, D = D₀ + m ω² D₀/2k_n.  The field turns
    the grains, and sliding springs the pair: the grains lead the angle θ = ∫ω dt by D²/2 m/I of m α/2k_s.  B = 0.3 T
    after 0.2 ns, linear before.
    """
    spin, orbit = mass * 0.8e-16, 0.5 * mass * distance**2

    def rates(t, y):
        flux = 0.3 * min(t / 2e-10, 1.0)
        omega = y[1] / (spin + orbit)
        for _ in range(5):
            omega = y[1] / (spin + orbit * (1.0 + mass * omega**2 / (2.0 * normal)) ** 2)
        angular = 2.0 * moment * flux * math.cos(y[0]) / (spin + orbit)
        lead = orbit / (spin + orbit) * mass * angular / (2.0 * slide)
        return omega, 2.0 * moment * flux * math.cos(y[0] + lead)

    options = {"method": "DOP853", "rtol": 1e-12, "atol": (1e-14, 1e-40), "max_step": 1e-10}
    return solve_ivp(rates, (0.0, 2e-9), (0.0, 0.0), **options).y[0, -1]


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("factor", [1.0, pytest.param(4.0, marks=pytest.mark.validate), 16.0])
def test_an_elastic_dimer_lags_behind_a_rigid_one_in_proportion_to_its_compliance(factor):
    """A dimer swings in a field, from rest: grain by grain its contact stretches, its moment of inertia grows.

    The angle is that of spins and orbit together, θ = L-weighted mean of both.  Grain by grain it lags behind the rigid
    one as `swing` with and without stiffness, ∝ 1/k; to 3 %, since its vibrations, excited by the field's 0.2 ns, are
    damped, or 1e-7 rad, the error (ωh)²/24 of the steps of 1 ps.
    """
    iron = dataclasses.replace(sand.IRON, young_modulus=factor * sand.IRON.young_modulus, name=f"iron {factor:g}")
    pitch = rest_distance(iron, 1e-8, 1e-8)
    grains = sand.Grains([[0.0, 0.0, 0.0], [pitch, 0.0, 0.0]], 1e-8, iron, moment=[[6e-18, 0.0, 0.0]] * 2)
    field = sand.Field([0.0, 0.0, 0.0], shape="ramp", final=[0.0, 0.3, 0.0], start="2 ns", end="2.2 ns")
    ends = []
    for stepping in (sand.RigidClusters(longest_step="1 ps"), sand.Verlet(steps_per_period=50)):
        sim = sand.Simulation(grains, [contact(), field], stepping=stepping, frame_every=1.0)
        sim.run(until="4 ns")
        ends.append(math.atan2(*sim.grains.moment[0, 1::-1]) * 0.8e-16)
        ends[-1] += math.atan2(*(sim.grains.position[1] - sim.grains.position[0])[1::-1]) * 0.5 * pitch**2
        ends[-1] /= 0.8e-16 + 0.5 * pitch**2
        asleep = sim.regular_state.bodies.asleep
        assert asleep.size == 0 or asleep.all()
    numbers = sand.theory.contact(iron, 1e-8)
    stiffnesses = ((math.inf, math.inf), (numbers.normal_stiffness, numbers.slide_stiffness))
    rigid, elastic = (swing(6e-18, grains.mass[0], pitch, *k) for k in stiffnesses)
    assert ends[0] == pytest.approx(rigid, rel=1e-6, abs=0.0)
    assert ends[0] - ends[1] == pytest.approx(rigid - elastic, rel=0.03, abs=1e-7)


@pytest.mark.compiled("dipoles")
def test_grains_are_added_and_removed():
    """A change wakes all clusters; the run goes on and its ledger closes."""
    sim = gas()
    sim.run(until="60 ns")
    with sim.change() as change:
        change.remove([0])
    sim.run(until="90 ns")
    assert len(sim.grains) == 29 and sim.regular_state.count[BODIES] <= 29
    rows = sim.ledger.rows
    assert abs(rows[-1]["total"] - rows[0]["total"]) < 1e-3 * sim.ledger.dissipated


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize(
    "forces",
    [
        [sand.Dipoles(periodic="ewald")],
        [sand.Charges(), sand.Dipoles()],
        [sand.Dipoles(), sand.Gravity(1e5)],
    ],
    ids=["ewald", "charges", "gravity"],
)
def test_other_forces(forces):
    """Positions as grain by grain, to 1 nm after 40 ns, and an energy error below 1e-3 of what is dissipated."""
    grains = sand.setup.gas(
        20, "0.4 um", radius=["10 nm", "13 nm"] * 10, material=["iron", "silica"] * 10, moment="2e-18 A m^2",
        temperature="100 K", charge=[1.6e-19, -1.6e-19] * 10, seed=5,
    )  # fmt: skip
    ends = []
    for stepping in (sand.RigidClusters(), sand.Verlet()):
        sim = sand.Simulation(grains, [contact(), *forces], box="0.4 um", stepping=stepping, frame_every=1.0)
        sim.run(until="40 ns")
        first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
        scale = sim.ledger.dissipated + max(row["translation"] + row["rotation"] for row in sim.ledger.rows)
        assert abs(last["total"] - first["total"]) < 1e-3 * scale
        ends.append(sim)
    apart = ends[0].box.nearest(ends[0].grains.position - ends[1].grains.position)
    assert np.linalg.norm(apart, axis=1).max() < 1e-9
    assert ends[0].steps < 0.1 * ends[1].steps


@pytest.mark.compiled("dipoles")
def test_work_of_a_changing_field_on_awake_clusters():
    """While two chains are awake, a field that oscillates does the same work on them as grain by grain, to 1e-3."""
    ends = []
    for stepping in (sand.RigidClusters(), sand.Verlet()):
        begun = two_chains(forces=[OSCILLATING])
        sim = sand.Simulation(begun.grains, begun.forces, stepping=stepping, frame_every=1.0)
        sim.run(until="0.7 ns")
        ends.append(sim.ledger["lost_outside"][-1])
    assert ends[0] != 0.0 and ends[0] == pytest.approx(ends[1], rel=1e-3, abs=0.0)


@pytest.mark.compiled("contacts")
def test_settling_of_an_awake_cluster():
    """A bent chain of eight loses to settling what it loses grain by grain, in 4 ns, to 3 %: τ/20 of 5 ns is 5 %."""
    position = np.column_stack([PITCH * np.arange(8), np.zeros((8, 2))])
    shape = np.cosh(np.linspace(-2.0, 2.0, 8))
    velocity = np.column_stack([np.zeros(8), 0.3 * (shape - shape.mean()), np.zeros(8)])
    grains, ends = sand.Grains(position, 1e-8, "iron", velocity=velocity), []
    for stepping in (sand.RigidClusters(vibration=1e-6), sand.Verlet()):
        sim = sand.Simulation(grains, [contact()], stepping=stepping, frame_every=1.0)
        sim.run(until="4 ns")
        ends.append(sim.ledger["lost_settling"][-1])
    assert ends[0] > 0.1 * sim.ledger["translation"][0]
    assert ends[0] == pytest.approx(ends[1], rel=0.03, abs=0.0)


RAMPED = sand.Field(sand.Ramp([[0, 0, 0], [0, "20 mT", "40 mT"]], ["8 ns", "28 ns"], steps=60))


@pytest.mark.filterwarnings("ignore:dipoles. the cut-off")
@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("vibration", [0.01, 1e-40], ids=["at rest", "awake"])
def test_a_cluster_turns_in_a_field_with_a_ramp_as_grain_by_grain(vibration):
    """Motion, and the work of the source −Σ ∫ μ·dB, against `sand.Verlet`; the cluster is at rest, or kept awake.

    A change of the field waits for the end of a step of h = 0.1 ns: the ramp of 20 ns is late by h/2, 0.25 % of its
    length, and so is the angle of 2 to 4 rad by which it turns the grains at 1.4e-8 m from the centre: 1e-10 m.
    """
    corner = np.array([[0.0, 0.0, 0.0], [PITCH, 0.0, 0.0], [PITCH, PITCH, 0.0]])
    mass = sand.Grains(corner, 1e-8, "iron").mass[0]
    ends = []
    for stepping in (sand.RigidClusters(longest_step="0.1 ns", vibration=vibration), sand.Verlet()):
        grains = sand.Grains(corner, 1e-8, "iron", moment=2e2 * mass * np.array([[1, 0, 0], [0, 1, 0], [0, 1, 0]]))
        sim = sand.Simulation(grains, [contact(), sand.Dipoles(cutoff=None), RAMPED], stepping=stepping)
        sim.run(until="36 ns")
        ends.append(sim)
    one, other = ends
    assert one.state.at_rest.all() == (vibration == 0.01) == (one.regular_state.clock[SOME_AWAKE] < 0.1 * one.time)
    np.testing.assert_allclose(one.grains.position, other.grains.position, rtol=0.0, atol=2e-10)
    row, exact = one._log_row(), other._log_row()
    assert row["field"] == pytest.approx(exact["field"], rel=1e-2, abs=0.0)
    assert row["lost_outside"] == pytest.approx(exact["lost_outside"], rel=1e-2, abs=0.0) != 0.0
    for sim in ends:
        assert sim.ledger["total"][-1] == pytest.approx(sim.ledger["total"][0], abs=5e-3 * abs(exact["lost_outside"]))


@pytest.mark.compiled("dipoles")
def test_friction_of_a_cluster_at_rest_follows_a_ramp_of_the_gas():
    """Without noise a pair at rest slows down as v exp(−∫ Γ dt), Γ = f_t/m with the pressure of each interval.

    f_t is proportional to the pressure p at a constant temperature: v(t) = v(0) (v₁/v(0))^(∫ p dt/p₀t₁), with v₁ of a
    run at p₀.  Friction is exact; the jump of p waits for the end of a step of at most 0.5 ns, 1/280 of the integral.
    """
    ends = []
    for pressure in ("1 bar", sand.Ramp(["1 bar", "1 bar", "3 bar", "3 bar"], ["0 ns", "20 ns", "20 ns", "60 ns"])):
        grains = sand.Grains([[0, 0, 0], [PITCH, 0, 0]], 1e-8, "iron", velocity=[0, 1.0, 0])
        forces = [contact(), sand.Gas("300 K", pressure=pressure, brownian=False)]
        sim = sand.Simulation(grains, forces, stepping=sand.RigidClusters(longest_step="0.5 ns"), frame_every=1.0)
        sim.run(until="60 ns")
        ends.append(math.log(sim.grains.velocity[0, 1]))
        assert sim.state.at_rest.all()
    assert ends[1] / ends[0] == pytest.approx((20.0 + 3.0 * 40.0) / 60.0, rel=1e-2, abs=0.0)


@pytest.mark.filterwarnings("ignore:dipoles. the cut-off")
@pytest.mark.compiled("dipoles")
def test_output_and_restarts_change_no_bit_with_ramps(tmp_path):
    """A magnetic gas in a growing field and a gas that becomes hotter, in one run and stopped within the ramps."""
    thermal = sand.Gas(sand.Ramp(["100 K", "300 K"], ["5 ns", "25 ns"], steps=10), pressure="1 bar")
    forces = [contact(), sand.Dipoles(cutoff="0.15 um"), RAMPED, thermal]
    whole, often = gas(forces=forces), gas(forces=forces, frame_every="3 ns")
    stopped = gas(forces=forces, out=tmp_path / "run")
    whole.run(until="40 ns")
    often.run(until="40 ns")
    stopped.run(until="17.3 ns")
    again = sand.resume(tmp_path / "run")
    again.run(until="40 ns")
    assert whole.regular_state.count[RESTED] > 0 and whole.ledger.drift < 5e-3
    assert different(whole, often) == different(whole, again) == []


def test_long_chains_without_settling_are_warned_of():
    """They vibrate for long, so that clusters seldom come to rest."""
    with pytest.warns(
        UserWarning, match="without settling_time in .forces.contact. .sand.Contact. long chains vibrate"
    ):
        gas(forces=[sand.Contact(damping="critical")], number=4)


@pytest.mark.compiled("dipoles")
def test_a_case_file_and_the_summary(tmp_path, capsys):
    """`clusters = "rigid"` is `sand.RigidClusters`; summary.json says how long clusters were awake; it is resumed."""
    case = tmp_path / "case.toml"
    case.write_text(
        """
        run = { until = "80 ns", seed = 2 }
        box = { periodic = "0.5 um" }
        grains = { number = 30, radius = "10 nm", material = "iron", moment = "200 A m^2/kg", temperature = "100 K" }
        stepping = { clusters = "rigid", step_fraction = 0.05 }
        [forces]
        contact = { damping = "critical", settling_time = "5 ns" }
        dipoles = {}
        """,
        "utf-8",
    )
    assert main(["run", str(case), "--out", str(tmp_path / "run")]) == 0
    capsys.readouterr()
    found = json.loads((tmp_path / "run" / "summary.json").read_text("utf-8"))["rigid_clusters"]
    assert 0.0 < found["time_awake"] < 1.0 and 0.0 < found["grains_awake"] < found["time_awake"]
    assert found["contact_steps"] > found["steps_of_bodies"] > 0
    assert found["woken"] >= found["came_to_rest"] > 0 and found["touches_seen_late"] == 0
    assert 0.0 <= found["quieting_per_dissipated"] < 1e-4 and 0.0 < found["largest_load_at_rest"] < 0.75
    again = sand.resume(tmp_path / "run")
    assert again.stepping == sand.RigidClusters(step_fraction=0.05)


@pytest.mark.filterwarnings("ignore:without settling_time")
@pytest.mark.compiled("contacts")
def test_a_copy_follows_a_change_of_a_ramp_that_awake_clusters_have_not_seen():
    """Gravity g sets in at 5 ns, while no cluster is awake; two grains touch after the copy, and fall with g t."""
    grains = sand.Grains([[0, 0, 0], [5e-8, 0, 0]], 1e-8, "iron", velocity=[[1, 0, 0], [-1, 0, 0]])
    gravity = sand.Gravity(sand.Ramp(values=[[0, 0, 0], [0, 0, 1e8]], times=["5 ns", "5 ns"], steps=1))
    forces = [sand.Contact(damping="critical", damping_ratio=0.2), gravity]
    sim = sand.Simulation(grains, forces, stepping=sand.RigidClusters(longest_step="1 ns"), frame_every=1.0)
    sim.run(until="7 ns")
    copied = sim.copy()
    for each in (sim, copied):
        each.run(until="18 ns")
    assert len(sim.contacts["pair"]) == 1
    assert different(sim, copied) == []
    np.testing.assert_allclose(sim.grains.velocity[:, 2], 1e8 * 13e-9, rtol=1e-9, atol=0.0)
