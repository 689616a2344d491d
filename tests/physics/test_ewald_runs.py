"""Runs with the Ewald sums of dipoles and charges: energy balance with contacts, resumed runs, threads, copies."""

import copy

import numpy as np
import pytest

import sand
from sand.engine import assemble

from .setups import random_aggregate

pytestmark = pytest.mark.filterwarnings("ignore:contacts of iron")
BOX = (0.3e-6, 0.4e-6, 0.35e-6)


@pytest.fixture(autouse=True)
def default_threads(monkeypatch):
    """Restore the default number of threads; loops are those of many grains, which tests of the sums compile, too."""
    monkeypatch.setattr(assemble, "WIDE_FROM", 1)
    yield
    sand.set_threads(None)


FORCES = {
    "dipoles": sand.Dipoles(periodic="ewald", reciprocal="direct"),
    "dipoles with a mesh": sand.Dipoles(periodic="ewald", reciprocal="mesh"),
    "charges": sand.Charges(periodic="ewald", reciprocal="direct"),
    "charges with a mesh": sand.Charges(periodic="ewald", reciprocal="mesh"),
}
EACH = pytest.mark.parametrize("name", FORCES)


def aggregate(name, **options):
    """A vibrating aggregate of 12 iron grains, with moments or with charges, in a small box, whose images act on it."""
    given = {"charge": 3e-18 * (-1.0) ** np.arange(12)} if "charges" in name else {"moment": "200 A m^2/kg"}
    grains = random_aggregate(12, 4, material=sand.IRON, **given)
    return sand.Simulation(grains, [sand.Contact(), FORCES[name]], box=BOX, **options)


def state(sim):
    """All arrays of the state, as bytes."""
    return {name: array.tobytes() for name, array in sim.state.to_arrays().items()}


@EACH
@pytest.mark.compiled("dipoles")
def test_the_energy_error_is_of_second_order_in_the_step(name):
    """Grains in contact, dipoles or charges, all images, 1 ns: the total energy is kept to O(Δt²), also in cycles.

    The largest change of the total energy falls by 4 per halved step (to 30 %: few periods); forces that were not the
    gradient of the energy would leave a change that does not fall with the step.  Verlet's error of a vibration of 25
    steps per period is (2π/25)²/8 = 0.8 % of its energy.
    """
    errors = []
    for number in (25, 50):
        sim = aggregate(name, stepping=sand.Verlet(steps_per_period=number), frame_every="20 ps")
        before = sim.grains.velocity.copy()
        sim.run(until="1 ns")
        assert sim.ledger["contacts"][-1] == 11 and np.ptp(sim.ledger[FORCES[name].column]) > 0.0
        total = sim.ledger["total"]
        errors.append(np.abs(total - total[0]).max())
    assert 2.8 < errors[0] / errors[1] < 6.0
    assert errors[0] < 8e-3 * sim.ledger["translation"].max()
    momentum = np.abs((sim.grains.mass[:, None] * (sim.grains.velocity - before)).sum(axis=0)).max()
    assert momentum < 1e-12 * (sim.grains.mass * np.linalg.norm(sim.grains.velocity, axis=1)).sum()


@EACH
@pytest.mark.compiled("dipoles")
def test_a_resumed_run_has_the_same_bits(name, tmp_path):
    """A run in two parts from a checkpoint, and a deep copy: the bits of one run."""
    whole = aggregate(name)
    whole.run(steps=400)
    parts = aggregate(name, out=tmp_path / "run")
    parts.run(steps=150)
    first = aggregate(name)
    first.run(steps=150)
    other = copy.deepcopy(first)
    resumed = sand.resume(tmp_path / "run")
    for sim in (resumed, other):
        sim.run(steps=250)
        assert state(sim) == state(whole)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.validate if name == "charges" else ()) for name in FORCES]
)
@pytest.mark.compiled("threads")
@pytest.mark.parametrize("search", ["all pairs", pytest.param("cells", marks=pytest.mark.validate)])
def test_the_number_of_threads_changes_no_bit(search, name):
    """20 steps of 1100 grains in contact, with 1 and 2 threads: pairs, waves and planes are shared in fixed blocks."""
    grid = np.stack(np.meshgrid(*map(np.arange, (11, 10, 10)), indexing="ij"), -1).reshape(-1, 3)
    rng = np.random.default_rng(4)
    position = (grid - [5, 4.5, 4.5]) * 1.985e-8
    moment, charge = 6e-18 * rng.normal(size=grid.shape), 1e-17 * (-1.0) ** grid.sum(axis=1)
    grains = sand.Grains(position, 1e-8, sand.IRON, moment=moment, charge=charge)
    ends = []
    for threads in (1, 2):
        sand.set_threads(threads)
        sim = sand.Simulation(grains, [sand.Contact(), FORCES[name]], box=0.3e-6, neighbours=sand.Neighbours(search))
        sim.run(steps=20)
        ends.append(state(sim))
    assert ends[0] == ends[1]
