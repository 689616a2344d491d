"""Runs in which parameters of forces are ramps: energies, motion, and the same bits after interruptions."""

import math

import numpy as np
import pytest

import sand
from sand.basics.constants import COULOMB
from sand.basics.state import BREAKING, OUTSIDE

RADIUS = 1e-7
BOTH = sand.Contact().pairing(sand.SILICA, sand.SILICA)
REST = (9.0 * math.pi * BOTH.surface_energy * (RADIUS / 2) ** 2 / BOTH.modulus) ** (2 / 3) / (3 * RADIUS / 2)
"""Overlap of two silica grains at rest, δ0 = a0²/3R."""


def pair(overlap, speed=0.0, **grains):
    """Two silica grains with an overlap [m], closing at `speed`."""
    x = RADIUS - 0.5 * overlap
    velocity = [[0.5 * speed, 0, 0], [-0.5 * speed, 0, 0]]
    return sand.Grains([[-x, 0, 0], [x, 0, 0]], RADIUS, sand.SILICA, velocity=velocity, **grains)


def normal_energy(overlap, factor):
    """U and F_c δ_c [J] of a JKR contact of the pair with γ times a factor, by bisection of δ(y), y = √(a/a0)."""
    gamma, reduced = factor * BOTH.surface_energy, 0.5 * RADIUS
    a0 = (9.0 * math.pi * gamma * reduced**2 / BOTH.modulus) ** (1 / 3)
    force, at_break = 3.0 * math.pi * gamma * reduced, 0.5 * a0**2 / (6.0 ** (1 / 3) * reduced)
    low, high = (1 / 6) ** (1 / 3), 5.0
    for _ in range(100):
        y = 0.5 * (low + high)
        if at_break * 6 ** (1 / 3) * (2 * y**4 - 4 / 3 * y) < overlap:
            low = y
        else:
            high = y
    return force * at_break * 4 * 6 ** (1 / 3) * (0.8 * y**10 - 4 / 3 * y**7 + y**4 / 3), force * at_break


@pytest.mark.compiled("contacts")
def test_the_energy_of_a_contact_is_that_of_the_new_surface_energy():
    """U(δ; γ) = F_c δ_c 4·6^(1/3) (4/5 y¹⁰ − 4/3 y⁷ + 1/3 y⁴) after γ → γ/2, and the difference is work of the user.

    One step after the jump; the overlap of that time is used.  The total is constant but for the motion of this step.
    """
    contact = sand.Contact(surface_energy_factor=sand.Ramp([1.0, 0.5], ["1 ns", "1 ns"]))
    sim = sand.Simulation(pair(REST), [contact])
    sim.run(until="0.99 ns")
    before = sim._log_row()
    assert before["normal"] == pytest.approx(normal_energy(REST, 1.0)[0], rel=1e-9, abs=0.0)
    while not sim.state.lost[OUTSIDE] and sim.time < 1.1e-9:
        sim.run(steps=1)
    after = sim._log_row()
    overlap = sim.contacts["overlap"][0]
    assert after["normal"] == pytest.approx(normal_energy(overlap, 0.5)[0], rel=1e-9, abs=0.0)
    assert overlap == pytest.approx(REST, rel=1e-6, abs=0.0)
    work = normal_energy(REST, 0.5)[0] - normal_energy(REST, 1.0)[0]
    assert work > 0.0 and -after["lost_outside"] == pytest.approx(work, rel=1e-6, abs=0.0)
    assert after["total"] == pytest.approx(before["total"], abs=1e-12 * abs(before["normal"]))
    assert sim.run(until="5 ns").drift < (2.0 * math.pi / 25) ** 2 / 8  # vibrates now: the error of 25 steps per period


@pytest.mark.compiled("contacts")
def test_a_contact_beyond_its_new_limit_breaks_with_the_energy_of_the_law():
    """Stretched by more than δ_c′ when γ → γ/10: it breaks at once, lost_breaking = (4/45) F_c′ δ_c′, the total stays.

    F_c δ_c ∝ γ^(5/3) and δ_c ∝ γ^(2/3).  1.4 F_c δ_c of the 1.54 that breaking takes stretch the contact far enough.
    The error of 25 steps per period, (2π/25)²/8, is that of the vibration before.
    """
    speed = math.sqrt(2.0 * 1.4 * normal_energy(0.0, 1.0)[1] / (0.5 * pair(0.0).mass[0]))
    free = sand.Simulation(pair(REST, -speed), [sand.Contact()])
    while free.grains.velocity[0, 0] < -0.1 * speed:
        free.run(steps=5)
    jump = sand.Contact(surface_energy_factor=sand.Ramp([1.0, 0.1], [free.time, free.time]))
    sim = sand.Simulation(pair(REST, -speed), [jump])
    end = sim.run(until=2.0 * free.time)
    assert free.contacts["stretch_share"][0] > 0.3 and end.steps > free.steps
    row = sim._log_row()
    assert row["broken"] == 1
    assert row["lost_breaking"] == pytest.approx(4.0 / 45.0 * normal_energy(0.0, 0.1)[1], rel=1e-9, abs=0.0)
    assert row["total"] == pytest.approx(sim.ledger["total"][0], abs=8e-3 * normal_energy(0.0, 1.0)[1])


@pytest.mark.compiled("fields")
def test_a_field_that_is_switched_off_does_the_work_of_the_exact_ramp():
    """A turning moment in B(t): 1000 changes follow the line to second order, as the field that is exact at every step.

    The grain's spin 1e6 rad/s and ω² = μB/I = (8e6 rad/s)² over 1 μs: a change every ns is 1e-2 of a radian, and the
    error of the mid-interval staircase (1e-2)²/24 of the torque.  A change comes up to a step late, by half a step in
    the mean, which changes the work by at most ½ ω Δt = 2e-3.
    """
    grains = sand.Grains([[0, 0, 0]], RADIUS, sand.IRON, moment=[[1e-18, 0, 0]], spin=[[0, 1e6, 0]])
    staircase = sand.Field(sand.Ramp(["10 mT", "0 T"], ["0.2 us", "1.2 us"]))
    exact = sand.Field("10 mT", "ramp", final="0 T", start="0.2 us", end="1.2 us")
    rows = []
    for field in (staircase, exact):
        sim = sand.Simulation(grains, [field], stepping=sand.Verlet(step="0.5 ns"))
        sim.run(until="1.5 us")
        rows.append(sim._log_row() | {"direction": sim.grains.moment[0] / 1e-18})
    assert rows[0]["field"] == rows[1]["field"] == 0.0
    assert np.allclose(rows[0]["direction"], rows[1]["direction"], atol=1e-4)
    assert rows[0]["lost_outside"] == pytest.approx(rows[1]["lost_outside"], rel=2e-3, abs=0.0)
    assert abs(rows[0]["lost_outside"]) > 0.1 * rows[0]["rotation"]


@pytest.mark.compiled("small")
def test_drag_follows_the_pressure():
    """v(t) = v0 exp(−∫ dt/τ), 1/τ ∝ p: for p from 0.1 to 0.3 Pa the mean rate is that of 0.2 Pa, all else equal.

    The gas acts at ends of steps about every τ/20, with the pressure of that time: an error of the order of 1/40 of one
    such interval's change of pressure, below 1e-2 of the exponent.
    """
    grains = sand.Grains([[0, 0, 0]], RADIUS, sand.SILICA, velocity=[[1.0, 0, 0]])
    steady = sand.Gas(300.0, pressure=20.0, brownian=False)
    duration = steady.shortest_time(grains)
    ramp = sand.Gas(300.0, pressure=sand.Ramp([10.0, 30.0], [0.0, duration]), brownian=False)
    speeds = []
    for gas in (steady, ramp):
        sim = sand.Simulation(grains, [gas])
        sim.run(until=duration)
        speeds.append(math.log(sim.grains.velocity[0, 0]))
        assert sim.ledger.drift < 1e-12
    assert speeds[1] == pytest.approx(speeds[0], rel=2e-2, abs=0.0) and speeds[1] != speeds[0]


@pytest.mark.compiled("small")
def test_the_screening_length_changes_the_energy_of_a_pair():
    """U = q²/(4πε0 r) exp(−r/λ) with the new λ; the total of two heavy charges stays."""
    charges = sand.Grains([[-1e-6, 0, 0], [1e-6, 0, 0]], RADIUS, sand.SILICA, charge=[1e-18, 1e-18])
    length = sand.Ramp(["1 um", "2 um"], ["1 us", "3 us"], steps=100)
    sim = sand.Simulation(charges, [sand.ScreenedCharges(length, cutoff=None)], stepping=sand.Verlet(step="10 ns"))
    sim.run(until="4 us")
    row = sim._log_row()
    distance = np.linalg.norm(np.diff(sim.grains.position, axis=0))
    assert row["yukawa"] == pytest.approx(COULOMB * 1e-36 / distance * math.exp(-distance / 2e-6), rel=1e-12, abs=0.0)
    assert row["lost_outside"] == pytest.approx(-row["yukawa"] * (1.0 - math.exp(-1.0)), rel=0.1, abs=0.0)
    assert sim.ledger.drift < 1e-7


def warm_gas(**options):
    """Magnetic grains that form contacts within some nanoseconds, while field and surface energy change."""
    grains = sand.setup.gas(
        20, "0.25 um", radius="10 nm", material="iron", moment="200 A m^2/kg", temperature="100 K", seed=11
    )
    contact = sand.Contact(
        damping="critical", damping_ratio=0.2,
        bath_temperature=sand.Ramp(["100 K", "50 K"], ["8 ns", "12 ns"], steps=40),
        surface_energy_factor=sand.Ramp([1.0, 0.2], ["7 ns", "12 ns"], steps=77)
    )  # fmt: skip
    field = sand.Field(sand.Ramp(["10 mT", "0 T"], ["5 ns", "10 ns"], steps=53))
    forces = [contact, sand.Dipoles(cutoff="90 nm"), field]
    return sand.Simulation(grains, forces, box="0.25 um", seed=4, **options)


@pytest.mark.filterwarnings("ignore:dipoles. the cut-off, .* ends an interaction")
@pytest.mark.compiled("dipoles")
def test_the_same_bits_with_interruptions_other_output_and_copies(tmp_path):
    """Copied, resumed from files, or with other times of output, in the middle of ramps: all end with the same bits."""
    whole, stopped = warm_gas(frame_every="4 ns"), warm_gas(frame_every="0.37 ns", out=tmp_path / "run")
    whole.run(until="9 ns")
    copied = whole.copy()
    for sim in (whole, copied):
        sim.run(until="13 ns")
    stopped.run(until="8.3 ns")
    stopped.run(steps=101)
    again = sand.resume(tmp_path / "run")
    again.run(until="13 ns")
    assert len(whole.contacts["pair"]) > 0 and whole.state.lost[OUTSIDE] != 0.0 == whole.state.lost[BREAKING]
    arrays = [sim.regular_state.to_arrays() for sim in (whole, copied, again)]
    for other in arrays[1:]:
        assert [name for name in arrays[0] if arrays[0][name].tobytes() != other[name].tobytes()] == []
    assert again.forces == whole.forces
