"""Magnetic moments in fields: frequencies, energies, and the order of the integrator."""

import math

import numpy as np
import pytest

import sand
from sand.basics.constants import MAGNETIC

from .setups import rest_distance


def constant_field(flux_density):
    """A constant field, computed by the formula of time-dependent fields."""
    return sand.Field(flux_density, shape="ramp", final=flux_density, end="1 s")


def period_of(signal, time):
    """Mean time between downward zero crossings, each by linear interpolation."""
    down = np.flatnonzero((signal[:-1] > 0) & (signal[1:] <= 0))
    crossings = time[down] + signal[down] / (signal[down] - signal[down + 1]) * (time[down + 1] - time[down])
    assert len(crossings) > 3
    return np.diff(crossings).mean()


class Recorder(sand.Observer):
    """Records one number per frame."""

    def __init__(self, what):
        self.what, self.time, self.value = what, [], []

    def see(self, simulation, row):
        self.time.append(simulation.time)
        self.value.append(self.what(simulation))


def measured_period(grains, forces, what, period, periods=6.2, **options):
    """Period of `what`, recorded with 400 frames per expected period."""
    recorder = Recorder(what)
    sim = sand.Simulation(grains, forces, observers=[recorder], frame_every=period / 400, **options)
    sim.run(until=periods * period)
    return period_of(np.array(recorder.value), np.array(recorder.time)), sim


@pytest.mark.validates("closed form", "A grain in a magnetic field oscillates with √(μB/I)")
@pytest.mark.validate
def test_oscillation_of_one_grain_in_a_field(record_bound):
    """ω = √(μB/I) for small angles; pendulum correction θ²/16 (1e-5) and Verlet's (ω dt)²/24 stay below 1e-4."""
    tilt = 0.01
    size = 200 * sand.IRON.density * 4 / 3 * math.pi * 1e-24
    moment = [[size * math.sin(tilt), 0.0, size * math.cos(tilt)]]
    grains = sand.Grains([[0, 0, 0]], 1e-8, sand.IRON, moment=moment)
    expected = 2 * math.pi / math.sqrt(size * 1e-3 / grains.inertia[0])
    found, sim = measured_period(grains, [sand.Field("1 mT")], lambda s: s.grains.moment[0, 0], expected)
    record_bound("frequency of a grain in a field over the closed form", found / expected, least=0.9999, most=1.0001)
    assert sim.ledger.drift < 1e-4


@pytest.mark.validates("closed form", "Two distant dipoles oscillate with the two frequencies of their couplings")
@pytest.mark.compiled("dipoles")
def test_oscillation_of_two_distant_dipoles(record_bound):
    """Head to tail, same tilt: I θ¨ = −3 (kμ²/D³) θ; opposite tilt: −1; at D = 1e4 r the forces are negligible."""
    r, tilt = 1e-8, 0.01
    size = 200 * sand.IRON.density * 4 / 3 * math.pi * r**3
    apart = 10_000 * r
    for sign, factor in ((1, 3.0), (-1, 1.0)):
        moment = size * np.array([[math.cos(tilt), math.sin(tilt), 0], [math.cos(tilt), sign * math.sin(tilt), 0]])
        grains = sand.Grains([[0, 0, 0], [apart, 0, 0]], r, sand.IRON, moment=moment)
        expected = 2 * math.pi / math.sqrt(factor * MAGNETIC * size**2 / apart**3 / grains.inertia[0])
        found, _ = measured_period(
            grains,
            [sand.Contact(), sand.Dipoles(cutoff="1 cm")],
            lambda s: s.grains.moment[0, 1],
            expected,
            periods=4.2,
        )
        record_bound(
            "frequency of two distant dipoles over the closed form", found / expected, least=0.9999, most=1.0001
        )


@pytest.mark.validates("closed form", "A bound pair in a magnetic field oscillates as a rigid body, √(2μB/I)")
@pytest.mark.compiled("fields")
def test_oscillation_of_a_bound_pair_in_a_field(record_bound):
    """Two grains in contact, moments along the axis, as a rigid body: ω = √(2μB/I), I = 2 (2/5 m r² + m (D/2)²).

    The contact bends by (ω/ω_roll)² ~ 1e-9.  Contact steps are 1e4 times shorter than the period: one case only.
    """
    r, m, tilt = 1e-8, sand.IRON, 0.02
    d = rest_distance(m, r, r)
    axis = np.array([math.cos(tilt), math.sin(tilt), 0.0])
    size = 200 * m.density * 4 / 3 * math.pi * r**3
    field = 0.2
    # the pair vibrates along its axis, as the start is not exactly the equilibrium and nothing damps it:
    # measure the oscillation of the axis, which this vibration does not affect
    grains = sand.Grains([-0.5 * d * axis, 0.5 * d * axis], r, m, moment=size * np.array([axis, axis]))
    inertia = 2 * (grains.inertia[0] + grains.mass[0] * (d / 2) ** 2)
    expected = 2 * math.pi / math.sqrt(2 * size * field / inertia)

    def angle(sim):
        x = sim.grains.position
        return math.atan2(x[1, 1] - x[0, 1], x[1, 0] - x[0, 0])

    found, _ = measured_period(
        grains,
        [sand.Contact(), sand.Dipoles(cutoff="1 um"), constant_field([field, 0, 0])],
        angle,
        expected,
        periods=4.2,
    )
    # dipole attraction shortens D by a fraction of ~1e-5; pendulum correction: tilt²/16 = 2.5e-5
    record_bound(
        "frequency of a bound pair in a field over the closed form", found / expected, least=0.9999, most=1.0001
    )


def final_state(step, system):
    """Positions and moments after a fixed time with a fixed step."""
    grains, forces, end = system
    sim = sand.Simulation(grains, forces, stepping=sand.Verlet(step=step))
    sim.run(steps=round(end / step))
    return np.concatenate([sim.grains.position.ravel() / 1e-8, sim.grains.orientation.ravel()])


def free_pair():
    rng = np.random.default_rng(2)
    grains = sand.Grains(
        [[0, 0, 0], [1e-7, 2e-8, 0]],
        1e-8,
        sand.IRON,
        moment=6.6e-18 * np.eye(3)[:2],
        spin=1e7 * rng.normal(size=(2, 3)),
    )
    return grains, [sand.Contact(), sand.Dipoles(cutoff="1 um"), constant_field([0, 0, 0.01])], 3.2e-8


def vibrating_pair():
    d = rest_distance(sand.SILICA, 1e-7, 1e-7)
    grains = sand.Grains(
        [[0, 0, 0], [d, 0, 0]], 1e-7, sand.SILICA,
        velocity=[[0.01, 0.002, 0], [0, 0, 0]], spin=[[1e4, 0, 2e4], [0, 3e4, 0]],
    )  # fmt: skip
    return grains, [sand.Contact()], 6.4e-9


@pytest.mark.compiled("fields", "contacts")
@pytest.mark.parametrize(("system", "step"), [(free_pair, 8e-11), (vibrating_pair, 2e-12)])
def test_the_integrator_is_of_order_two(system, step):
    """Halving a fixed step quarters the error against a step 16 times shorter: order 1.8 … 2.2."""
    exact = final_state(step / 16, system())
    errors = [np.abs(final_state(step / n, system()) - exact).max() for n in (1, 2)]
    # the error of the reference is 1/256 and 1/64 of the two errors
    assert 1.8 < math.log2(errors[0] / errors[1]) < 2.2


@pytest.mark.filterwarnings("ignore:dipoles. the cut-off, .* ends an interaction")
@pytest.mark.compiled("dipoles", "small")
def test_loads_against_brute_force_with_images():
    """Periodic box with a cut-off: forces, torques, energy against a double loop in NumPy."""
    box = sand.Box.periodic("0.3 um", "0.25 um", None)
    rng = np.random.default_rng(9)
    position = rng.uniform(-0.12e-6, 0.12e-6, size=(25, 3))
    moment = 6e-18 * rng.normal(size=(25, 3))
    grains = sand.Grains(position, 1e-10, sand.IRON, moment=moment)
    sim = sand.Simulation(grains, [sand.Contact(), sand.Dipoles(cutoff="0.1 um")], box=box)
    loads = sim.loads()
    rc, rs = 1e-7, 0.8e-7
    force, torque, energy = np.zeros((25, 3)), np.zeros((25, 3)), 0.0
    for i in range(25):
        for j in range(25):
            if i == j:
                continue
            r = box.nearest(position[i] - position[j])
            d = np.linalg.norm(r)
            t = np.clip((rc**2 - d**2) / (rc**2 - rs**2), 0, 1)
            weight = t**3 * (10 - 15 * t + 6 * t**2)
            slope = 30 * t**2 * (1 - t) ** 2 * (-2 * d) / (rc**2 - rs**2)
            mi, mj, n = moment[i], moment[j], r / d
            b = MAGNETIC / d**3 * (3 * n * (mj @ n) - mj)
            u = -mi @ b
            f = 3 * MAGNETIC / d**4 * ((mi @ n) * mj + (mj @ n) * mi + (mi @ mj - 5 * (mi @ n) * (mj @ n)) * n)
            force[i] += weight * f - u * slope * n
            torque[i] += weight * np.cross(mi, b)
            energy += 0.5 * weight * u
    assert loads["force"] == pytest.approx(force, abs=1e-12 * np.abs(force).max())
    assert loads["torque"] == pytest.approx(torque, abs=1e-12 * np.abs(torque).max())
    assert loads["energy"]["magnetic"] == pytest.approx(energy, rel=1e-11, abs=0.0)
    assert np.abs(loads["force"].sum(axis=0)).max() < 1e-12 * np.abs(force).sum()
