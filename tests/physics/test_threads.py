"""Threads: the same bits for any number of threads; parallel and serial loops agree to rounding."""

import copy
import subprocess
import sys
import time

import numpy as np
import pytest

import sand
from sand.basics import threads
from sand.basics.errors import BadInput
from sand.basics.state import CONTACTS, OUTSIDE, SLIPPED
from sand.engine import compiled_state
from sand.integrate import task_queue
from sand.integrate.task_queue import (
    ACTIVE,
    QUIT,
    SHARED,
    TASK,
    WORD,
    new_task_queue,
    take_blocks,
    uses_task_queue,
)

pytestmark = pytest.mark.filterwarnings("ignore:contacts of iron")


@pytest.fixture(autouse=True)
def default_threads():
    """Restore the default number of threads."""
    yield
    sand.set_threads(None)


def vibrating_lattice(cutoff, size=(11, 10, 10)):
    """Vibrating iron grains in contact, enough for worker threads; with dipoles unless `cutoff` is "bare"."""
    grid = np.stack(np.meshgrid(*map(np.arange, size), indexing="ij"), -1).reshape(-1, 3)
    rng = np.random.default_rng(4)
    moment = rng.normal(size=grid.shape)
    moment *= 6e-18 / np.linalg.norm(moment, axis=1)[:, None]
    spin, velocity = 5e9 * rng.normal(size=grid.shape), 3.0 * rng.normal(size=grid.shape)
    grains = sand.Grains(grid * 1.985e-8, 1e-8, sand.IRON, moment=moment, velocity=velocity, spin=spin)
    return sand.Simulation(grains, [sand.Contact(), *([] if cutoff == "bare" else [sand.Dipoles(cutoff=cutoff)])])


def share_blocks_if(monkeypatch, shared):
    """Make simulations divide their loops among threads, or not, whatever their size."""
    for module in (task_queue, compiled_state):
        monkeypatch.setattr(module, "uses_task_queue", lambda grains: shared)
    assert new_task_queue(1, 1).words[SHARED] == shared


def state(sim):
    """All arrays of the state, as bytes."""
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
def test_the_number_of_threads_changes_no_bit(cutoff, size):
    """60 steps, in two runs, with 1, 2 and 3 threads; contacts slip and break.

    Dipoles over all pairs and over a list; contacts alone, where the gather also kicks, in several blocks of grains.
    """
    ends = []
    for number in (1, 2, 3):
        sand.set_threads(number)
        sim = vibrating_lattice(cutoff, size)
        assert sim._engine.workers is not None
        assert bool(sim._engine.content.pair_forces) is (cutoff != "bare")
        sim.run(steps=25)
        sim.run(steps=35)
        ends.append(state(sim))
    assert sim.state.count[CONTACTS] > 2000
    assert sim.state.count[SLIPPED] > 100
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.validate
def test_parallel_and_serial_loops_agree(monkeypatch):
    """20 steps with shared blocks and with the same blocks one after the other: the same bits."""
    sim = {}
    for large in (True, False):
        share_blocks_if(monkeypatch, large)
        sim[large] = vibrating_lattice(None)
        assert (sim[large]._engine.workers is not None) is large
        sim[large].run(steps=20)
    assert state(sim[True]) == state(sim[False])


@pytest.mark.validate
def test_work_at_periodic_walls_in_parallel_and_serial_loops(monkeypatch):
    """Gravity in a periodic box: drift is shared by threads, the energy jumps at the walls are recorded by one thread.

    Positions, velocities and `lost` after 60 steps agree to 1e-12: a sum over 1100 grains in another order.
    """
    found = []
    for large in (True, False):
        share_blocks_if(monkeypatch, large)
        grains = sand.setup.gas(1100, "1 um", radius="10 nm", material=sand.SILICA, temperature="3e4 K", seed=2)
        forces, stepping = [sand.Contact(), sand.Gravity("1e12 m/s^2")], sand.Verlet(step="10 ps")
        sim = sand.Simulation(grains, forces, box="1 um", stepping=stepping)
        sim.run(steps=60)
        found.append((sim.grains.position, sim.grains.velocity, sim.state.lost))
    for one, other in zip(*found, strict=True):
        assert np.abs(one - other).max() < 1e-12 * np.abs(one).max()
    assert found[0][2][OUTSIDE] != 0.0


@pytest.mark.compiled("threads")
def test_a_late_worker_changes_nothing():
    """A worker that finds QUIT in the task queue returns; no worker is counted as active and the state is unchanged."""
    sim = vibrating_lattice(None)
    sim.run(steps=1)
    before, system = state(sim), sim.state
    queue = new_task_queue(len(system.grains), system.contacts.flag.size)
    queue.words[WORD] = QUIT << TASK
    table = sim._engine.table_of(system)
    table.set("queue", queue)
    take_blocks.run(table)
    assert queue.words[ACTIVE] == 0
    assert state(sim) == before


@pytest.mark.compiled("threads")
def test_workers_stop_when_a_driver_raises(monkeypatch):
    """An exception in the driver makes all workers quit; a copy of a simulation has its own workers."""
    queues = []

    def recording_queue(grains, contacts):
        queues.append(new_task_queue(grains, contacts))
        return queues[-1]

    def fails(*arguments):
        raise RuntimeError("broken")

    sand.set_threads(2)
    sim = vibrating_lattice(None)
    sim.run(steps=1)
    monkeypatch.setattr(compiled_state, "new_task_queue", recording_queue)
    with monkeypatch.context() as patched:
        patched.setattr(sim._engine.program, "run", fails)
        with pytest.raises(RuntimeError, match="broken"):
            sim._engine.advance(1.0, 1)
    assert queues[-1].words[WORD] == QUIT << TASK
    assert queues[-1].words[ACTIVE] == 0
    sim.run(steps=1)
    assert copy.deepcopy(sim._engine.workers) is not sim._engine.workers


RAISES = """
import sys, warnings
warnings.simplefilter("ignore")
import numpy as np
import sand
from sand.compiler.jit import formula

@formula
def raising(apart, a, b, parameters):
    if a.charge > 0.5 and apart[0] ** 2 + apart[1] ** 2 + apart[2] ** 2 < parameters[0]:
        raise ValueError("these grains are too close")
    return (0.0, 0.0, 0.0), 0.0

class Raising(sand.Charges):
    formula, rate = staticmethod(raising), None
    def constants(self):
        return (4.45e-8**2,)

sand.set_threads(2)
grid = np.stack(np.meshgrid(*[np.arange(11)] * 3, indexing="ij"), -1).reshape(-1, 3)[:1100]
position, velocity, charge = 5e-8 * grid, np.zeros(grid.shape), np.full(1100, 0.1)
if sys.argv[1] == "every block":
    position, charge[:] = 0.5 * position, 1.0
else:  # after 55 steps, in the last block only
    velocity[-1, 2], charge[-1] = -100.0, 1.0
grains = sand.Grains(position, 1e-8, sand.SILICA, velocity=velocity, charge=charge)
sim = sand.Simulation(grains, [Raising()], stepping=sand.Verlet(step="1 ps"))
try:
    sim.run(steps=200)
except ValueError as error:
    print("raised", error, sim.steps > 0)
"""
"""Charges with a formula that raises an exception in some blocks of 1100 grains, shared by two threads."""


@pytest.mark.slow
@pytest.mark.parametrize("where", ["every block", pytest.param("last block", marks=pytest.mark.validate)])
def test_an_exception_in_a_block_ends_the_run(where):
    """In the block of the worker or of the driver: the exception is raised with its message, and no thread waits.

    A process of its own, which takes some 10 s; one in which a thread waits for another is ended after 2 min.
    """
    words = [sys.executable, "-c", RAISES, where]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert (done.stdout, done.stderr) == (f"raised these grains are too close {where == 'last block'}\n", "")


@pytest.mark.compiled("threads")
def test_worker_threads_end_with_their_simulation():
    """Within 10 s after a simulation is deleted its worker threads have ended."""
    import threading

    others = set(threading.enumerate())

    def worker_threads():
        return [t for t in threading.enumerate() if t.name == "sand-worker" and t not in others]

    sand.set_threads(2)
    sim = vibrating_lattice(None)
    sim.run(steps=1)
    assert len(worker_threads()) == 1
    del sim
    deadline = time.monotonic() + 10.0
    while worker_threads() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not worker_threads()


@pytest.mark.validate
@pytest.mark.parametrize(
    ("number", "forces", "workers"),
    [(1000, [], 0), (4200, [], 1), (1000, [sand.Charges(cutoff="0.1 um")], 1), (1000, [sand.Dipoles("0.1 um")], 1)],
)
def test_workers_are_used_where_they_save_time(number, forces, workers):
    """1000 contacts take less time than waking a worker, 4200 take more; sums of pair forces are shared."""
    sand.set_threads(2)
    positions = np.arange(number)[:, None] * [[1.9999e-8, 0.0, 0.0]]
    chain = sand.Grains(positions, 1e-8, sand.SILICA, charge=1e-20, moment="1e-22 A m^2")
    sim = sand.Simulation(chain, [sand.Contact(), *forces])
    sim.run(steps=1)
    assert sim._engine.workers is not None
    assert sim.state.count[CONTACTS] == number - 1
    assert len(sim._engine.workers._inboxes) == workers


def test_small_simulations_have_no_task_queue():
    """Below a thousand grains."""
    assert uses_task_queue(1000)
    assert not uses_task_queue(999)


def test_the_number_of_threads_to_use(monkeypatch):
    """`set_threads` overrides SAND_THREADS, which overrides the number of cores; other values are refused."""
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
