"""Steps of fourth order: convergence with spins, bounded energy error, work of fields, first contact, same bits."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import sand
from sand.basics.constants import COULOMB
from sand.basics.state import CONTACTS, FLIGHT, LONG_RANGE_SUMS, MADE, REJECTED, STEPS
from sand.errors import BadInput
from sand.integrate.adaptive_driver import MAX_ATTEMPTS

from .test_adaptive import (
    SIZE,
    SPEED,
    R,
    adaptive_run,
    approaching,
    bits,
    four_grains,
    hot_gas,
    reference_solution,
    run_in_rotating_field,
    scattering_pair,
    state_of,
)


@pytest.mark.compiled("adaptive")
def test_the_error_of_two_spinning_dipoles_is_of_fourth_order():
    """Halving the step divides the error in x, v, μ and ω by 2⁴: 16 ± 15 %; four sums of the forces per step.

    The reference is SciPy's DOP853 (order 8, accurate to 1e-13), with moments as vectors; the smallest error is 2e-11.
    """
    end, errors = 2e-8, []
    for steps in (400, 800, 1600):
        sim = adaptive_run(scattering_pair(), sand.ForestRuth(step=end / steps))
        sim.run(steps=steps)
        assert sim.time == pytest.approx(end, rel=1e-12, abs=0.0)
        assert sim.state.count[LONG_RANGE_SUMS] == 4 * steps
        errors.append(np.abs(state_of(sim.grains) - reference_solution(sim.start, sim.time)).max())
    assert errors[0] < 1e-5
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 16, rtol=0.15)


@pytest.mark.compiled("adaptive")
@pytest.mark.parametrize("accuracy", [1e-4, 1e-6, 1e-8])
def test_the_accuracy_bounds_the_energy_error(accuracy):
    """Fly-by of two spinning dipoles: error of the energy below `accuracy` times their largest interaction energy."""
    sim = adaptive_run(scattering_pair(), sand.ForestRuth(accuracy=accuracy), frame_every="0.1 ns")
    sim.run(until="20 ns")
    total = sim.ledger["total"]
    assert np.abs(total - total[0]).max() < accuracy * np.abs(sim.ledger["magnetic"]).max() + 1e-14 * total[0]
    momentum = sim.grains.mass @ (sim.grains.velocity - sim.start.velocity)
    assert np.abs(momentum).max() < 1e-13 * sim.grains.mass[0] * SPEED
    angular = np.array([sim.ledger[f"angular_momentum_{axis}"] for axis in "xyz"])
    assert np.abs(angular - angular[:, :1]).max() < 1e-13 * sim.grains.mass[0] * SPEED * 2e-7


def bound_pair():
    """Two oppositely charged, spinning magnetic grains in an elliptical orbit; also its energy [J] and period [s]."""
    coulomb, apart = 1e-7 * SIZE**2 / (2 * R) ** 3 * 2 * R, 8 * R
    charge = math.sqrt(coulomb / COULOMB)
    mass = sand.Grains([[0, 0, 0]], R, sand.IRON).mass[0]
    speed = 0.85 * math.sqrt(coulomb / apart / (2 * mass))
    grains = sand.Grains(
        [[-apart / 2, 0, 0], [apart / 2, 0, 0]], R, sand.IRON, velocity=[[0, speed, 0], [0, -speed, 0]],
        charge=[charge, -charge], moment=0.15 * SIZE * np.eye(3)[1:],
        spin=3e7 * np.random.default_rng(2).normal(size=(2, 3)),
    )  # fmt: skip
    # major axis 2a from E/m = v²/2 − GM/r, with the relative velocity: a = r/(2 − rv²/GM)
    major = apart / (2 - 0.85**2)
    return grains, coulomb / apart, 2 * math.pi * math.sqrt(major**3 * mass / (2 * coulomb))


@pytest.mark.compiled("adaptive")
def test_the_energy_error_of_a_bound_orbit_does_not_grow():
    """40 periods with equal steps: error of the last ten periods at most 1.5 times that of the first ten.

    That of Adaptive, with as many sums of the forces, grows in proportion to time, fourfold, and exceeds it by far.
    """
    grains, energy, period = bound_pair()
    forces, errors, sums = [sand.Charges(), sand.Dipoles()], [], []
    for stepping in (sand.ForestRuth(step=period / 50), sand.Adaptive(tolerance=1e-6)):
        sim = sand.Simulation(grains, forces, stepping=stepping, frame_every=period / 7.3)
        sim.run(until=40 * period)
        change = np.abs(sim.ledger["total"] - sim.ledger["total"][0]).reshape(-1)[1:] / energy
        errors.append([part.max() for part in np.array_split(change, 4)])
        sums.append(sim.state.count[LONG_RANGE_SUMS])
    equal, adaptive = errors
    assert sums[0] < 1.1 * sums[1]
    assert equal[-1] < 1.5 * equal[0]
    assert adaptive[-1] > 3 * adaptive[0]
    assert adaptive[-1] > 5 * equal[-1]


@pytest.mark.compiled("adaptive")
def test_work_of_an_oscillating_and_of_a_ramped_field():
    """One grain, I ω̇ = μ×B, μ̇ = ω×μ, Ẇ = −μ·Ḃ by DOP853: W = −lost_outside and μ to 1e-8; total to rounding.

    The kicks change the kinetic energy by exactly the recorded work of the field, so the total is constant to 1e-13 of
    μB for any step, also where a ramp ends.
    """
    scale = 0.02 * SIZE
    grains = sand.Grains([[0, 0, 0]], R, sand.IRON, moment=[[SIZE, 0, SIZE]], spin=[[1e7, 2e7, 0]])
    omega, unit, inertia = 2 * math.pi * 2e7, 1e-8, grains.inertia[0]
    oscillating = sand.Field([0, 0, "1 mT"], shape="oscillating", amplitude=["20 mT", 0, 0], frequency="20 MHz")
    ramped = sand.Field(["5 mT", 0, 0], shape="ramp", final=["25 mT", 0, 0], start="5 ns", end="42 ns")
    for field, rates_of in (
        (oscillating, lambda t: ([0.02 * math.cos(omega * t), 0, 1e-3], [-0.02 * omega * math.sin(omega * t), 0, 0])),
        (ramped, None),
    ):
        sim = sand.Simulation(grains, [field], stepping=sand.ForestRuth())
        sim.run(until="60 ns")
        row, total = sim.ledger.rows[-1], sim.ledger["total"]
        assert np.abs(total - total[0]).max() < 1e-13 * scale
        assert abs(row["lost_outside"]) > 0.1 * scale
        if rates_of is None:
            continue

        def rates(t, y, rates_of=rates_of):
            b, b_rate = rates_of(t * unit)
            torque, work = SIZE * np.cross(y[:3], b), -SIZE * unit * y[:3] @ b_rate
            return [*np.cross(y[3:6], y[:3]), *(torque / inertia * unit**2), work / scale]

        start = [1, 0, 1, *(unit * grains.spin[0]), 0.0]
        done = solve_ivp(rates, (0, sim.time / unit), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
        assert np.abs(sim.grains.moment[0] / SIZE - done[:3]).max() < 1e-8
        assert row["lost_outside"] == pytest.approx(-scale * done[6], abs=1e-8 * scale)


@pytest.mark.compiled("adaptive")
@pytest.mark.parametrize("part", [0.0, 0.9, 1 - 1e-4])
def test_first_contact_of_a_straight_flight(part):
    """Impact parameter b = part (r1 + r2): contact at t = (L − √((r1 + r2)² − b²))/v, to 1e-9; steps of 20 radii."""
    reach = 2.7e-8
    grains = approaching(part * reach)
    sim = sand.Simulation(grains, [sand.Contact()], stepping=sand.ForestRuth(step=3e-8))
    sim.run(until="140 ns")
    assert sim.state.count[MADE] == 1
    assert sim.state.contacts.formed[0] == pytest.approx(
        (1.3e-6 - reach * math.sqrt(1 - part**2)) / SPEED, rel=1e-9, abs=0.0
    )


@pytest.mark.compiled("adaptive")
def test_grazing_contact_within_a_long_step():
    """b = (1 ∓ 1e-6)(r1 + r2), a passage of 4e-5 of one step: contact for −, none for +."""
    for side, made in ((-1, 1), (1, 0)):
        grains = approaching(2.7e-8 * (1 + side * 1e-6))
        sim = sand.Simulation(grains, [sand.Contact()], stepping=sand.ForestRuth(step=1.7e-7))
        sim.run(until="200 ns")
        assert sim.state.count[MADE] == made


@pytest.mark.compiled("adaptive")
@pytest.mark.parametrize(("part", "made"), [(1 - 1e-3, 1), (1 + 1e-3, 0)])
def test_grazing_contact_on_a_curved_path(part, made):
    """Kepler ellipse with the pericentre r_p = part (r1 + r2) in the middle of a step: contact only for part < 1.

    From the apocentre r with r v²/(k/m_reduced) = 2 r_p/(r + r_p), e = 0.6. The grains overlap for half a step, at no
    end of a step; the errors of r_p and of the interpolated path are below 1e-4, those of h⁴ for 101 steps per period.
    """
    far, near, k = 8 * R, part * 2 * R, 1e-26
    mass, charge = sand.Grains([[0, 0, 0]], R, sand.IRON).mass[0], math.sqrt(k / COULOMB)
    speed = math.sqrt(2 * near / (far + near) * k / (far * mass / 2))
    grains = sand.Grains(
        [[0, 0, 0], [far, 0, 0]],
        R,
        sand.IRON,
        charge=[charge, -charge],
        velocity=[[0, speed / 2, 0], [0, -speed / 2, 0]],
    )
    period = 2 * math.pi * math.sqrt(((far + near) / 2) ** 3 * (mass / 2) / k)
    sim = sand.Simulation(grains, [sand.Contact(), sand.Charges()], stepping=sand.ForestRuth(step=period / 101))
    sim.run(until=0.55 * period)
    assert sim.state.count[MADE] == made
    if made:
        assert sim.state.contacts.formed[0] == pytest.approx(period / 2, rel=0.01, abs=0.0)


@pytest.mark.compiled("adaptive")
def test_first_contact_is_that_of_adaptive():
    """Attracting dipoles: the time of contact is that of Adaptive to 1e-6; few steps are repeated."""
    formed = []
    for stepping in (sand.Adaptive(tolerance=1e-12), sand.ForestRuth()):
        sim = adaptive_run(four_grains(), stepping)
        while sim.state.count[MADE] == 0:
            sim.run(steps=1)
        formed.append(sim.state.contacts.formed[0])
        assert sim.state.count[LONG_RANGE_SUMS] < 4 * sim.state.count[STEPS] + 4 * MAX_ATTEMPTS or not formed[1:]
    assert formed[1] == pytest.approx(formed[0], rel=1e-6, abs=0.0)
    sim.run(steps=2000)
    assert sim.ledger.drift < 1e-3


@pytest.mark.compiled("adaptive")
def test_split_runs_and_frame_interval_change_no_bit():
    """One run, a split run and a run with many frames give the same state, through flight, contact and Verlet."""
    ends = []
    for pieces, every in (((900,), "1 s"), ((1, 2, 3, 894), "1 s"), ((900,), "0.01 ns")):
        sim = adaptive_run(four_grains(), sand.ForestRuth(accuracy=1e-6), frame_every=every)
        for steps in pieces:
            sim.run(steps=steps)
        assert sim.state.count[CONTACTS] > 0
        ends.append(bits(sim))
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.compiled("adaptive")
@pytest.mark.parametrize("stop", [20, 700])
def test_resume_is_bit_for_bit(tmp_path, stop):
    """Stopped in free flight or with a contact: the resumed run ends in the same bits."""
    stepping = sand.ForestRuth(accuracy=1e-6)
    whole = adaptive_run(four_grains(), stepping, frame_every="1 ns")
    whole.run(steps=900)
    adaptive_run(four_grains(), stepping, out=tmp_path / "run", frame_every="1 ns").run(steps=stop)
    rest = sand.resume(tmp_path / "run")
    assert (rest.state.count[CONTACTS] > 0) == (stop > 100)
    assert rest.stepping == whole.stepping
    rest.run(steps=int(900 - rest.state.steps))  # the first run stopped at the end of an r-RESPA cycle
    assert bits(rest) == bits(whole)


@pytest.mark.compiled("adaptive")
def test_loads_are_those_of_the_present_positions():
    """Forces after a run, also with a frame in between, are those of a new simulation of the same grains, to 1e-12."""
    sim = adaptive_run(scattering_pair(), sand.ForestRuth())
    sim.run(steps=30)
    g = sim.grains
    again = adaptive_run(sand.Grains(g.position, R, sand.IRON, moment=g.moment, velocity=g.velocity)).loads()
    np.testing.assert_allclose(g.force, again["force"], rtol=0, atol=1e-12 * np.abs(again["force"]).max())
    np.testing.assert_allclose(g.torque, again["torque"], rtol=0, atol=1e-12 * np.abs(again["torque"]).max())


@pytest.mark.compiled("adaptive")
def test_work_of_gravity_at_periodic_boundaries():
    """A falling grain in a periodic box: −mgL is recorded per crossing; ½mv² + lost_outside + mgz constant, 1e-12."""
    grains = sand.Grains([[0, 0, 0]], R, sand.IRON, velocity=[[0, 0, -1.0]])
    sim = sand.Simulation(
        grains, [sand.Gravity("1e9 m/s^2")], box="0.2 um", stepping=sand.ForestRuth(step="3 ns"), frame_every="10 ns"
    )
    sim.run(until="150 ns")
    crossings = sim.ledger.rows[-1]["lost_outside"] / (grains.mass[0] * 1e9 * 2e-7)
    total = sim.ledger["total"]
    assert abs(crossings) > 10
    assert crossings == pytest.approx(round(crossings), abs=1e-9)
    assert np.abs(total - total[0]).max() < 1e-12 * sim.ledger["translation"][-1]


@pytest.mark.compiled("adaptive")
def test_a_step_that_moves_a_grain_too_far_is_divided():
    """A fixed step in which a grain would leave the validity of the lists: repeated with 2^-k of it, and counted."""
    sim = run_in_rotating_field(scattering_pair(), sand.ForestRuth(step="20 ns"), margin="20 nm")
    sim.run(steps=1)
    assert sim.state.count[REJECTED] > 1
    assert sim.time * 2 ** int(sim.state.count[REJECTED]) == pytest.approx(2e-8, rel=1e-6, abs=0.0)
    assert np.linalg.norm(sim.grains.velocity, axis=1).max() * sim.time < 5e-9
    assert sim.state.clock[FLIGHT] == 2e-8


@pytest.mark.validate
def test_pair_lists_miss_no_pair():
    """64 fast grains with list margins of 20 and 60 nm: the same first contact, positions equal to 1e-6 r."""
    ends = []
    for margin in ("20 nm", "60 nm"):
        sim = run_in_rotating_field(hot_gas(), sand.ForestRuth(), margin=margin)
        while sim.state.count[MADE] == 0:
            sim.run(steps=1)
        ends.append(sim)
    a, b = ends
    assert a.state.contacts.pair[:, 0].tolist() == b.state.contacts.pair[:, 0].tolist()
    assert a.time == pytest.approx(b.time, rel=1e-8, abs=0.0)
    apart = np.array([sand.Box.periodic("0.6 um").nearest(x) for x in a.grains.position - b.grains.position])
    assert np.abs(apart).max() < 1e-6 * R


def test_wrong_settings_have_a_line_each():
    """Each wrong setting is reported in one line."""
    with pytest.raises(BadInput) as caught:
        sand.ForestRuth(accuracy=1, step="0 s", contact_stepping=3)
    assert len(caught.value.problems) == 3
    for key, line in zip(("accuracy", "step", "contact_stepping"), caught.value.problems, strict=True):
        assert f"stepping: {key}" in line
