"""Runs with a settling time: decay of a slow bending mode, energy balance, momenta, restart."""

import math

import numpy as np
import pytest

import sand
from sand.basics.state import SETTLED

from .setups import random_aggregate

BENDING_PERIOD = 7.8e-9
"""Period [s] of the slowest bending mode of `bending_chain`: twice that of its rolling energy in a run."""


def bending_chain(settling_time):
    """Eight silica grains of 10 nm in a chain with velocities of the shape x² − ⟨x²⟩ across, as the slowest bending."""
    chain = sand.setup.aggregates.chain(8, radius="10 nm", material="silica")
    shape = (chain.position[:, 0] / chain.position[-1, 0]) ** 2
    velocity = 0.02 * np.outer(shape - shape.mean(), [0, 1, 0])
    grains = sand.Grains(chain.position, chain.radius, sand.SILICA, velocity=velocity)
    return sand.Simulation(grains, [sand.Contact(settling_time=settling_time)], frame_every="0.2 ns")


@pytest.mark.compiled("contacts")
def test_a_slow_bending_mode_decays_with_the_settling_time():
    """x¨ + x˙/τ + ω²x = 0: the energy is E₀ e^(−t/τ) (1 + b), |b| ≤ 1/(2ωτ).

    With τ = 20 ns and ω = 2π/7.8 ns the bound is 0.031. The rate, a fit over 1.5 τ, is then 1/τ within
    2 × 0.031/1.5 = 4 %.
    """
    tau = 20e-9
    sim = bending_chain(tau)
    sim.run(until=1.5 * tau)
    start = sim.ledger["translation"][0]
    assert 1.0 / (2.0 * 2.0 * math.pi / BENDING_PERIOD * tau) < 0.032
    slope = np.polyfit(sim.ledger["time"], np.log(1.0 - sim.ledger["lost_settling"] / start), 1)[0]
    assert -slope * tau == pytest.approx(1.0, abs=0.04)
    # slipping takes nothing, and the balance closes: what is left is the energy of the mode
    assert sim.ledger["moved"][-1] == 0
    assert abs(sim.ledger["total"][-1] - sim.ledger["total"][0]) < 0.01 * start


@pytest.mark.validates("self-consistency", "The energy balance with settling closes")
@pytest.mark.filterwarnings("ignore:contact. settling_time = .* is below the period")
@pytest.mark.compiled("contacts")
def test_momenta_are_kept_and_the_balance_closes(record_bound):
    """An aggregate of unequal grains that turns and vibrates in a periodic box.

    P to 1e-12 of Σ m|v|, L in an open box to 1e-11 of Σ |x×mv|: rounding of some 1e-16 in each of 1e4 steps. The
    energy error is below 1e-4 of the energies dissipated and moving, as without settling, which takes a tenth or more.
    """
    grains = random_aggregate(12, 4, radii=(5e-8, 1e-7))
    sim = sand.Simulation(grains, [sand.Contact(settling_time="4 ns")], box=sand.Box.periodic("2 um"))
    sim.run(until="20 ns")
    assert sim.ledger["lost_settling"][-1] > 0.1 * sim.ledger["internal"][0]
    record_bound("drift of the ledger", sim.ledger.drift, most=1e-4)
    for axis in "xyz":
        p = sim.ledger[f"momentum_{axis}"]
        assert abs(p[-1] - p[0]) < 1e-12 * (grains.mass * np.linalg.norm(grains.velocity, axis=1)).sum()
    sim = sand.Simulation(grains, [sand.Contact(settling_time="4 ns")])
    sim.run(until="20 ns")
    size = np.linalg.norm(np.cross(grains.position, grains.velocity), axis=1) * grains.mass
    for axis in "xyz":
        spin = sim.ledger[f"angular_momentum_{axis}"]
        assert abs(spin[-1] - spin[0]) < 1e-11 * size.sum()
    assert sim.state.clock[SETTLED] > 0.95 * sim.time


@pytest.mark.filterwarnings("ignore:grains in contact vibrate")
@pytest.mark.compiled("dipoles")
def test_resume_is_bit_for_bit(tmp_path):
    """A growing gas with settling, in r-RESPA cycles: stopped between two applications and resumed, the same bits."""
    box = sand.Box.periodic("0.25 um")

    def start(name):
        grains = sand.setup.gas(
            20, box, radius="10 nm", material=sand.IRON, moment="200 A m^2/kg", temperature="100 K", seed=11
        )
        forces = [sand.Contact(settling_time="1 ns"), sand.Dipoles()]
        return sand.Simulation(grains, forces, box=box, out=tmp_path / name, frame_every="5 ns")

    def bits(sim):
        return {name: array.tobytes() for name, array in sim.state.to_arrays().items()}

    whole, first = start("whole"), start("parts")
    whole.run(until="40 ns")
    first.run(steps=7000)
    assert first.state.clock[SETTLED] < first.time
    assert first.ledger["lost_settling"][-1] > 0.0
    del first
    second = sand.resume(tmp_path / "parts")
    second.run(until="40 ns")
    assert bits(second) == bits(whole)
