"""Threads: the same bits for any number of them, and the same numbers as without blocks but for rounding."""

import copy
import time

import numpy as np
import pytest

import sand
from sand import threads
from sand.errors import BadInput
from sand.integrate.task_queue import ACTIVE, QUIT, TASK, WORD, new_task_queue, uses_task_queue, worker_loops
from sand.simulation import assemble as translate
from sand.simulation import engine
from sand.state.state import CONTACTS, OUTSIDE, SLIPPED

pytestmark = pytest.mark.filterwarnings("ignore:contacts of iron")


@pytest.fixture(autouse=True)
def as_before():
    """Leave the number of threads as it was."""
    yield
    sand.set_threads(None)


def shaken_lattice(cutoff, size=(11, 10, 10)):
    """Iron grains in touch, shaken so that contacts move, enough for a crew; magnetic, or with contacts alone."""
    grid = np.stack(np.meshgrid(*map(np.arange, size), indexing="ij"), -1).reshape(-1, 3)
    rng = np.random.default_rng(4)
    moment = rng.normal(size=grid.shape)
    moment *= 6e-18 / np.linalg.norm(moment, axis=1)[:, None]
    spin, velocity = 5e9 * rng.normal(size=grid.shape), 3.0 * rng.normal(size=grid.shape)
    grains = sand.Grains(grid * 1.985e-8, 1e-8, sand.IRON, moment=moment, velocity=velocity, spin=spin)
    return sand.Simulation(grains, [sand.Contact(), *([] if cutoff == "bare" else [sand.Dipoles(cutoff=cutoff)])])


def state(sim):
    """All numbers of the world, as bytes."""
    return {name: array.tobytes() for name, array in sim.state.to_arrays().items()}


@pytest.mark.compiled("threads")
@pytest.mark.parametrize(
    ("cutoff", "size"),
    [
        (None, (11, 10, 10)),
        pytest.param("0.05 um", (11, 10, 10), marks=pytest.mark.validate),
        pytest.param("bare", (17, 16, 16), marks=pytest.mark.validate),
    ],
)
def test_threads_change_no_bit(cutoff, size):
    """60 steps, run in two pieces, with 1, 2 and 3 threads; contacts move and break.

    All pairs and listed ones; contacts alone, whose loads kick at once, in several blocks of grains that take turns.
    """
    ends = []
    for number in (1, 2, 3):
        sand.set_threads(number)
        sim = shaken_lattice(cutoff, size)
        assert sim._engine._kernel_spec.queue and sim._engine._kernel_spec.contacts_only is (cutoff == "bare")
        sim.run(steps=25)
        sim.run(steps=35)
        ends.append(state(sim))
    assert sim.state.count[CONTACTS] > 2000
    assert sim.state.count[SLIPPED] > 100
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.validate
def test_blocks_change_only_rounding(monkeypatch):
    """One step in blocks and one without part by less than 1e-12 of what they changed.

    Sums over 1100 grains in another order differ by √1100 ε = 7e-15 of their size.
    """
    sim = {}
    for large in (True, False):
        monkeypatch.setattr(translate, "uses_task_queue", lambda grains, large=large: large)
        sim[large] = shaken_lattice(None)
        assert sim[large]._engine._kernel_spec.queue is large
        sim[large].run(steps=1)
    for name in ("force", "torque", "velocity", "spin", "position"):
        one, other = (getattr(sim[large].state.grains.arrays, name) for large in (True, False))
        assert np.abs(one - other).max() < 1e-12 * np.abs(one).max(), name


@pytest.mark.validate
def test_walls_are_crossed_alike_in_blocks_and_without(monkeypatch):
    """Gravity in a periodic box, whose jumps of energy are booked by one thread after the drift that all share.

    Places, velocities and what the walls took, after 60 steps in blocks and 60 without: one sum over 1100 grains is
    in another order, 1e-12.
    """
    found = []
    for large in (True, False):
        monkeypatch.setattr(translate, "uses_task_queue", lambda grains, large=large: large)
        grains = sand.setup.gas(1100, "1 um", radius="10 nm", material=sand.SILICA, temperature="3e4 K", seed=2)
        forces, stepping = [sand.Contact(), sand.Gravity("1e12 m/s^2")], sand.Verlet(step="10 ps")
        sim = sand.Simulation(grains, forces, box="1 um", stepping=stepping)
        sim.run(steps=60)
        found.append((sim.grains.position, sim.grains.velocity, sim.state.lost))
    for one, other in zip(*found, strict=True):
        assert np.abs(one - other).max() < 1e-12 * np.abs(one).max()
    assert found[0][2][OUTSIDE] != 0.0


@pytest.mark.compiled("threads")
def test_a_helper_that_comes_too_late_touches_nothing():
    """It finds QUIT on its board and goes, with nobody counted inside."""
    sim = shaken_lattice(None)
    sim.run(steps=1)
    before, world = state(sim), sim.state
    crew = new_task_queue(len(world.grains), world.contacts.flag.size)
    crew.words[WORD] = QUIT << TASK
    rules = sim._engine.parameters._replace(queue=crew)
    worker_loops(sim._engine._kernel_spec)[1](world.grains.arrays, world.contacts, world.long_range, world.count, rules)
    assert crew.words[ACTIVE] == 0
    assert state(sim) == before


@pytest.mark.compiled("threads")
def test_helpers_leave_a_driver_that_fails(monkeypatch):
    """Ctrl-C while it compiles, or an error in a formula: nobody is left at work; copies have their own."""
    boards = []

    def watched(grains, contacts):
        boards.append(new_task_queue(grains, contacts))
        return boards[-1]

    def fails(*arguments):
        raise RuntimeError("broken")

    sand.set_threads(2)
    sim = shaken_lattice(None)
    sim.run(steps=1)
    monkeypatch.setattr(engine, "new_task_queue", watched)
    works = sim._engine._advance
    sim._engine._advance = fails
    with pytest.raises(RuntimeError, match="broken"):
        sim._engine.advance(1.0, 1)
    assert boards[-1].words[WORD] == QUIT << TASK
    assert boards[-1].words[ACTIVE] == 0
    sim._engine._advance = works
    sim.run(steps=1)
    assert copy.deepcopy(sim._engine._workers) is not sim._engine._workers


@pytest.mark.compiled("threads")
def test_helpers_go_home_with_their_simulation():
    """No thread of a crew outlives its simulation by more than a moment."""
    import threading

    others = set(threading.enumerate())

    def crew():
        return [t for t in threading.enumerate() if t.name == "sand-worker" and t not in others]

    sand.set_threads(2)
    sim = shaken_lattice(None)
    sim.run(steps=1)
    assert len(crew()) == 1
    del sim
    deadline = time.monotonic() + 10.0
    while crew() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not crew()


@pytest.mark.validate
@pytest.mark.parametrize(
    ("number", "forces", "helpers"),
    [(1000, [], 0), (4200, [], 1), (1000, [sand.Charges(cutoff="0.1 um")], 1), (1000, [sand.Dipoles("0.1 um")], 1)],
)
def test_helpers_come_where_they_save_time(number, forces, helpers):
    """1000 contacts are done before a helper has begun, 4200 are not; sums of pair forces are shared."""
    sand.set_threads(2)
    place = np.arange(number)[:, None] * [[1.9999e-8, 0.0, 0.0]]
    chain = sand.Grains(place, 1e-8, sand.SILICA, charge=1e-20, moment="1e-22 A m^2")
    sim = sand.Simulation(chain, [sand.Contact(), *forces])
    sim.run(steps=1)
    assert sim._engine._kernel_spec.queue
    assert sim.state.count[CONTACTS] == number - 1
    assert len(sim._engine._workers._inboxes) == helpers


def test_small_simulations_have_no_crew():
    """Below a thousand grains."""
    assert uses_task_queue(1000)
    assert not uses_task_queue(999)


def test_how_many(monkeypatch):
    """What is set goes before the environment, and that before the number of cores."""
    monkeypatch.setenv("SAND_THREADS", "3")
    assert threads.threads() == 3
    sand.set_threads(5)
    assert threads.threads() == 5
    sand.set_threads(None)
    monkeypatch.delenv("SAND_THREADS")
    assert threads.threads() == threads.cores()
    for wrong in (0, -1, 1.5, "many"):
        with pytest.raises(BadInput, match="whole number"):
            sand.set_threads(wrong)
    monkeypatch.setenv("SAND_THREADS", "two")
    with pytest.raises(BadInput, match="SAND_THREADS = 'two'"):
        threads.threads()
