"""Long-range forces in a run: cut-offs, and the energy exchanged with external forces and the gas."""

import numpy as np
import pytest

import sand
from sand.basics.constants import BOLTZMANN, COULOMB
from sand.basics.state import KICKED, STEP
from sand.forces.gas_drag import rotation_friction, translation_friction


def pair_crossing_the_cutoff(cut, step):
    """Two free dipoles that cross the cut-off on their way out of a close encounter."""
    moment = 6.6e-18 * np.array([[0.3, 0.9, 0.1], [-0.5, 0.7, 0.4]])
    grains = sand.Grains(
        [[0, 0, 0], [1.2e-7, 3e-8, 0]], 1e-8, sand.IRON, moment=moment, velocity=[[0, 0, 0], [-40.0, 0, 0]]
    )
    return sand.Simulation(
        grains,
        [sand.Contact(), sand.Dipoles(cutoff="0.1 um", cut=cut)],
        stepping=sand.Verlet(step=step),
        frame_every="5 ps",
    )


@pytest.mark.compiled("dipoles")
def test_energy_of_smooth_and_sharp_cutoffs():
    """Smooth: the drift falls as dt².  Sharp: E jumps by U(r_c) at each crossing, for any dt.

    U(r_c) = k [μ1·μ2 − 3 (μ1·n)(μ2·n)]/r_c³ when the pair crosses; the jumps agree with those of the energy column to
    5 %, the change of U along the path between two frames.
    """
    changes = {}
    for cut, step in (("smooth", 4e-12), ("smooth", 2e-12), ("sharp", 4e-12), ("sharp", 2e-12)):
        sim = pair_crossing_the_cutoff(cut, step)
        sim.run(until="6 ns")
        total = sim.ledger["total"]
        changes[cut, step] = np.abs(total - total[0]).max()
        jumps = np.abs(np.diff(sim.ledger["magnetic"]))
    scale = np.abs(sim.ledger["magnetic"]).max()
    assert 3.5 < changes["smooth", 4e-12] / changes["smooth", 2e-12] < 4.5
    assert changes["smooth", 2e-12] < 1e-4 * scale
    assert changes["sharp", 2e-12] > 100 * changes["smooth", 2e-12]
    assert changes["sharp", 2e-12] == pytest.approx(changes["sharp", 4e-12], rel=0.1, abs=0.0)
    assert changes["sharp", 2e-12] == pytest.approx(jumps.max(), rel=0.1, abs=0.0)


def grains_in_changing_field(field, step, **options):
    """Three free magnetic grains in a field that changes with time."""
    rng = np.random.default_rng(4)
    grains = sand.Grains(
        2e-7 * rng.normal(size=(3, 3)), 1e-8, sand.IRON, moment=6.6e-18 * rng.normal(size=(3, 3)), **options
    )
    return sand.Simulation(
        grains, [sand.Contact(), sand.Dipoles(cutoff="1 mm"), field], stepping=sand.Verlet(step=step)
    )


@pytest.mark.compiled("fields")
@pytest.mark.parametrize(
    "field",
    [
        sand.Field("5 mT", shape="oscillating", amplitude=[3e-3, 0, 0], frequency="20 MHz"),
        sand.Field(0, shape="rotating", amplitude=[5e-3, 0, 0], frequency="30 MHz", axis=[0, 0, 1]),
        sand.Field("5 mT", shape="ramp", final=[0, -5e-3, 0], end="40 ns"),
    ],
    ids=["oscillating", "rotating", "ramp"],
)
def test_work_of_a_changing_field(field):
    """d(−μ·B)/dt at rest is −μ·Ḃ: with this work in `lost_outside` the total is constant; the error falls as dt².

    The work is a hundred times the remaining error.
    """
    left = []
    for step in (4e-11, 2e-11):
        sim = grains_in_changing_field(field, step)
        sim.run(until="60 ns")
        total = sim.ledger["total"]
        left.append(np.abs(total - total[0]).max())
        work = np.abs(sim.ledger["lost_outside"]).max()
    assert work > 100 * left[1] > 0.0
    assert 3.0 < left[0] / left[1] < 5.0


@pytest.mark.validate
def test_energy_of_grains_falling_through_periodic_walls():
    """Gravity and an electric field in a periodic box: each crossing is recorded, E + lost is constant to rounding.

    Verlet is exact for a constant force; the grains cross the box of 1 µm many times.
    """
    rng = np.random.default_rng(1)
    grains = sand.Grains(4e-7 * rng.random((4, 3)), 1e-8, sand.SILICA, charge=[1e-18, -1e-18, 2e-18, 0])
    forces = [sand.Gravity("1e9 m/s^2"), sand.ElectricField([1e6, 0, 0])]
    sim = sand.Simulation(grains, forces, box="1 um", stepping=sand.Verlet(step="20 ps"))
    sim.run(until="0.3 us")
    total = sim.ledger["total"]
    fall = 0.5e9 * sim.time**2
    assert fall > 10e-6
    assert sim.ledger["translation"][-1] == pytest.approx(-sim.ledger["lost_outside"][-1], rel=0.2, abs=0.0)
    assert np.abs(total - total[0]).max() < 1e-10 * sim.ledger["translation"][-1]
    assert sim.grains.velocity[3, 2] == pytest.approx(-1e9 * sim.time, rel=1e-10, abs=0.0)


@pytest.mark.validates("closed form", "Two opposite charges keep a circular orbit for ten turns")
@pytest.mark.validate
def test_kepler_orbit_of_two_charges(record_bound):
    """Two opposite charges on a circular orbit, m v²/(r/2) = k q²/r²: ten turns, radius to 1e-4, E to 1e-6.

    Verlet at 2000 steps per turn has a phase error of (2π/2000)²/24 ~ 4e-7.
    """
    q, r = 1e-17, 2e-7
    mass = sand.Grains([[0, 0, 0]], 1e-8, sand.SILICA).mass[0]
    speed = np.sqrt(COULOMB * q**2 / (2.0 * mass * r))  # distance of each from the centre: r/2
    grains = sand.Grains(
        [[r / 2, 0, 0], [-r / 2, 0, 0]], 1e-8, sand.SILICA, charge=[q, -q], velocity=[[0, speed, 0], [0, -speed, 0]]
    )
    period = np.pi * r / speed
    sim = sand.Simulation(grains, [sand.Charges()], stepping=sand.Verlet(step=float(period / 2000)))
    sim.run(until=float(10 * period))
    apart = np.linalg.norm(sim.grains.position[0] - sim.grains.position[1])
    assert apart == pytest.approx(r, rel=1e-4, abs=0.0)
    total = sim.ledger["total"]
    record_bound("energy error of ten orbits", np.abs(total / total[0] - 1.0).max(), most=1e-6)


def brownian_grains(count, temperature="300 K", seed=1, **options):
    """Free silica grains at rest in a gas, in open space."""
    gas = sand.Gas(temperature, pressure="10 kPa", **options)
    grains = sand.Grains(np.zeros((count, 3)), 1e-7, sand.SILICA)
    sim = sand.Simulation(grains, [gas], seed=seed)
    return sim, gas, gas.shortest_time(sim.grains)


@pytest.mark.validate
def test_brownian_motion():
    """⟨x²⟩ = 2 (kT/m) τ² (t/τ − 1 + e^(−t/τ)) per axis, ⟨v(0)v(t)⟩ = (kT/m) e^(−t/τ), energies (3/2)kT each.

    Tolerance 3σ for 4000 grains × 3 axes: σ of a variance is √(2/12000) = 1.3 %, of the autocorrelation √(1/12000).
    Kicks every τ/20 increase the diffusion by (h/τ)²/12 = 2e-4 to 4e-4, which is less.
    """
    count = 4000
    sim, gas, _ = brownian_grains(count)
    grains = sim.grains
    rules = gas.numbers()
    numbers = (rules.density, rules.mean_speed, rules.accommodation)
    tau = grains.mass[0] / translation_friction(1e-7, *numbers)
    tau_spin = grains.arrays.inertia[0] / rotation_friction(1e-7, *numbers)
    sim.run(until=float(8 * max(tau, tau_spin)))
    x0, v0, w0, t0 = grains.position.copy(), grains.velocity.copy(), grains.spin.copy(), sim.time
    heat, inertia = BOLTZMANN * 300.0, grains.arrays.inertia[0]
    sigma = np.sqrt(2.0 / (3 * count))
    assert (grains.mass[0] * v0**2).mean() / heat == pytest.approx(1.0, abs=3 * sigma)
    assert (inertia * w0**2).mean() / heat == pytest.approx(1.0, abs=3 * sigma)
    for part in (0.5, 1.5, 6.0):
        sim.run(until=float(t0 + part * tau))
        t = (sim.time - t0) / tau
        expected = 2.0 * heat / grains.mass[0] * tau**2 * (t - 1.0 + np.exp(-t))
        assert ((grains.position - x0) ** 2).mean() / expected == pytest.approx(1.0, abs=3 * sigma)
        kept = (grains.velocity * v0).mean() / (v0**2).mean()
        assert kept == pytest.approx(np.exp(-t), abs=3 / np.sqrt(3 * count))
        spun = (grains.spin * w0).mean() / (w0**2).mean()
        assert spun == pytest.approx(np.exp(-t * tau / tau_spin), abs=3 / np.sqrt(3 * count))


@pytest.mark.validate
def test_intervals_between_gas_kicks():
    """Kicks of the gas are 2/3 to 4/3 of the period apart, the mean within half a step of the period.

    The step is a power of two of a second, at most the period; kicks are applied at the step end nearest to the period.
    """
    sim, _, tau = brownian_grains(3)
    period = sim._engine.parameters.gas.period
    assert period == pytest.approx(tau / 20, rel=1e-12, abs=0.0)
    times = [0.0]
    for _ in range(300):
        sim.run(steps=1)
        if sim.state.clock[KICKED] > times[-1]:
            times.append(sim.state.clock[KICKED])
    apart = np.diff(times) / period
    assert len(apart) > 25
    assert apart.min() > 0.66 and apart.max() < 1.34
    assert abs(apart.mean() - 1.0) < 0.5 * sim.state.clock[STEP] / period + 1e-9


@pytest.mark.validate
def test_heat_exchanged_with_the_gas():
    """Kinetic energy + lost_gas is constant to rounding: the gas heats grains at rest and cools fast ones."""
    cold, _, tau = brownian_grains(50)
    cold.run(until=float(3 * tau))
    hot, _, _ = brownian_grains(50, brownian=False)
    hot.grains.arrays.velocity[...] = 3.0
    hot.run(until=float(3 * tau))
    for sim, sign in ((cold, -1), (hot, 1)):
        total, lost = sim.ledger["total"], sim.ledger["lost_gas"]
        assert sign * lost[-1] > 0.0
        assert np.abs(total - total[0]).max() < 1e-11 * np.abs(lost).max()


@pytest.mark.validate
def test_gas_noise_is_reproducible():
    """The same seed gives the same bits, in one run or several; another seed gives other numbers."""
    ends = []
    for seed, pieces in ((1, 1), (1, 7), (2, 1)):
        sim, _, tau = brownian_grains(20, seed=seed)
        for k in range(pieces):
            sim.run(until=float(5 * tau * (k + 1) / pieces))
        ends.append(sim.grains.position.copy())
    assert (ends[0] == ends[1]).all()
    assert not (ends[0] == ends[2]).any()


@pytest.mark.validates("self-consistency", "The energy balance of clusters with charges and dipoles closes")
@pytest.mark.validate
def test_momentum_and_energy_of_charged_clusters(record_bound):
    """16 sticking grains with dipoles and charges: P to rounding × steps, total to 1e-3 of the dissipated energy."""
    rng = np.random.default_rng(2)
    box = sand.Box.periodic("0.25 um")
    grains = sand.setup.gas(16, box, radius="10 nm", material=sand.IRON, moment="200 A m^2/kg", temperature="100 K")
    grains.arrays.charge[...] = 1.6e-19 * rng.integers(-2, 3, size=16)
    sim = sand.Simulation(grains, [sand.Contact(), sand.Dipoles(), sand.Charges()], box=box)
    sim.run(until="30 ns")
    assert sim.ledger["made"][-1] >= 3
    assert sim.ledger["coulomb"].any()
    moving = (sim.grains.mass[:, None] * np.abs(sim.grains.velocity)).sum()
    assert abs(sim.ledger["momentum_x"][-1] - sim.ledger["momentum_x"][0]) < 1e-10 * moving
    record_bound("drift of the ledger", sim.ledger.drift, most=1e-3)
