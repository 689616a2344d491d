"""Reproducibility: the same bits for any output interval, split, restart, thread count and array size."""

import copy
import os
import subprocess
import sys

import numpy as np
import pytest

import sand
from sand.basics.state import BROKEN, CONTACTS, CYCLE, LISTED, LONG_RANGE_SUMS, SLIPPED
from sand.basics.threads import set_threads

from ..plugins import STEPPINGS
from .setups import random_aggregate, rest_distance, struck_chain


def gas_simulation(**options):
    box = sand.Box.periodic("0.25 um")
    grains = sand.setup.gas(
        20, box, radius="10 nm", material=sand.IRON, moment="200 A m^2/kg", temperature="100 K", seed=11
    )
    damping = "critical" if isinstance(options.get("stepping"), sand.RigidClusters) else "none"
    return sand.Simulation(grains, [sand.Contact(damping=damping), sand.Dipoles()], box=box, **options)


def state(sim):
    """All arrays of the state, as bytes."""
    return {name: array.tobytes() for name, array in sim.state.to_arrays().items()}


@pytest.mark.compiled("dipoles")
def test_the_frame_interval_changes_no_bit():
    """Frames every 0.1 ns, every 7 ns and none: the same bits after 20,000 steps, contacts included."""
    ends = []
    for every in ("0.1 ns", "7 ns", "1 s"):
        sim = gas_simulation(frame_every=every)
        sim.run(steps=20_000)
        ends.append(state(sim))
    assert sim.state.count[CONTACTS] > 0
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.filterwarnings("ignore:without settling_time in")
@pytest.mark.compiled("dipoles", "flights")
@pytest.mark.parametrize("stepping", [each() for each in STEPPINGS.values()], ids=lambda each: each.name)
def test_a_deep_copy_goes_on_with_the_same_bits(stepping):
    """A copy made after 200 steps and the original, each run further, are independent and equal to the last bit."""
    sim = gas_simulation(stepping=stepping)
    sim.run(steps=200)
    other = copy.deepcopy(sim)
    at_copy = state(other)
    sim.run(steps=100)
    assert state(other) == at_copy != state(sim)
    other.run(steps=100)
    assert state(other) == state(sim)


@pytest.mark.compiled("dipoles")
def test_split_runs_and_observers_change_no_bit():
    """One run equals many short runs with an observer that reads loads, contacts and grains.

    Each run ends at the end of an r-RESPA cycle; so does the last short run.
    """

    class Reader(sand.Observer):
        def see(self, simulation, row):
            simulation.loads()
            simulation.contacts["overlap"].sum()
            simulation.grains.position.sum()

    whole, pieces = gas_simulation(), gas_simulation(observers=[Reader()], frame_every="1 ns")
    for steps in (1, 2, 997, 4000, 5000, 10_000):
        pieces.run(steps=steps)
    whole.run(steps=int(pieces.state.steps))
    assert whole.state.count[CONTACTS] > 0
    assert whole.state.count[LONG_RANGE_SUMS] < 0.7 * whole.state.steps
    assert state(whole) == state(pieces)


@pytest.mark.filterwarnings("ignore:gas. temperature = .* no material is solid")
@pytest.mark.compiled("listed")
def test_restart_with_an_old_pair_list_is_bit_for_bit():
    """A restart between two list builds gives the same bits: lists are rebuilt from saved anchor positions.

    A list whose arrays must grow first gives the same bits, too.
    """

    def start(**options):
        grains = sand.setup.gas(
            80, "1.2 um", radius="10 nm", material=sand.IRON, moment="200 A m^2/kg", temperature="3e5 K", seed=2
        )
        grains.arrays.charge[...] = 1e-19
        forces = [
            sand.Contact(),
            sand.Dipoles(cutoff="0.25 um"),
            sand.Charges(cutoff="0.25 um"),
            sand.Gas("3e5 K", pressure="1 mbar"),
        ]
        options |= {"neighbours": sand.Neighbours(margin="20 nm")}
        return sand.Simulation(grains, forces, box="1.2 um", seed=2, **options)

    whole, small_arrays = start(), start()
    small_arrays.state.long_range = small_arrays.state.long_range._replace(neighbour=np.zeros(16, np.uint32))
    assert whole._engine.parameters.search.listed
    whole.run(steps=3000)
    saved = {name: array.copy() for name, array in whole.state.to_arrays().items()}
    lists = whole.state.count[LISTED]
    whole.run(steps=6000)
    assert whole.state.count[LISTED] > lists > 1
    again = start(restart=(saved, {"temperature": 3e5, "wall_seconds": 0.0}))
    again.run(steps=6000)
    assert state(whole) == state(again)
    small_arrays.run(steps=9000)
    assert state(whole) == state(small_arrays)


@pytest.mark.filterwarnings("ignore:grains overlap too deeply")
@pytest.mark.compiled("contacts")
def test_array_sizes_change_no_bit():
    """Initial room for 16 or 4096 contacts and pairs, constants shared or per contact: the same bits."""
    from sand.basics.arrays import empty_contact_arrays, empty_pair_list
    from sand.contact.constants_table import constant_names
    from sand.contact.jkr import LAW

    ends, shared = [], ("constants", "step", "break_overlap")
    for room, uniform in ((16, True), (4096, True), (16, False), (4096, False)):
        sim = struck_chain(length=30, offset=0.2)
        n = len(sim.grains)
        sim.state.contacts = empty_contact_arrays(n, room, len(constant_names(LAW)), uniform_contacts=uniform)
        sim.state.pair_list, sim.state.uniform_contacts = empty_pair_list(n, room, uniform_contacts=uniform), uniform
        settings = sim._engine.parameters.settings._replace(uniform_contacts=uniform)
        sim._engine.set_parameters(settings=settings)
        sim.run(until=1e-9)
        ends.append({name: bits for name, bits in state(sim).items() if name.partition("/")[2] not in shared})
    assert sim.state.count[CONTACTS] > 16
    assert all(end == ends[0] for end in ends)


@pytest.mark.compiled("dipoles")
def test_times_are_met_to_the_last_bit():
    """Frames are at the multiples of their interval, the end of a run at `until`; both lie within a step or cycle."""
    sim = gas_simulation(frame_every="1 ns")
    for end in (7.3e-9, 7.3e-9 + 1e-14, 10e-9):  # two ends within one step
        sim.run(until=end)
        assert sim.time == end and sim.state.time == end
        assert sim.regular_state.time < end < sim.regular_state.time + 2 * sim.regular_state.clock[CYCLE]
    ends = [7.3e-9, 7.3e-9 + 1e-14]
    assert sorted({k * 1e-9 for k in range(10)} | {*ends, 10e-9}) == [row["time"] for row in sim.ledger.rows]


@pytest.mark.filterwarnings("ignore:without settling_time in")
@pytest.mark.compiled("dipoles", "flights")
@pytest.mark.parametrize("integrator", STEPPINGS)
def test_a_continued_run_has_the_bits_of_a_direct_one(integrator):
    """Ends of runs and frames are shown by a copy of the regular state: neither changes a regular step."""
    stepping = STEPPINGS[integrator]
    direct = gas_simulation(stepping=stepping())
    direct.run(until="10 ns")
    continued = gas_simulation(frame_every="0.37 ns", stepping=stepping())
    for end in ("3 ns", "3.0001 ns", "8 ns", "10 ns"):
        continued.run(until=end)
    assert state(direct) == state(continued)
    for regular in (direct.regular_state, continued.regular_state):
        assert regular.time < 10e-9
    arrays = [sim.regular_state.to_arrays() for sim in (direct, continued)]
    assert all((arrays[0][name] == arrays[1][name]).all() for name in arrays[0])


@pytest.mark.compiled("contacts")
def test_the_state_at_a_time_of_output():
    """Free grains move by v t: x(t) = x(0) + v t to rounding at times that no regular step meets."""
    grains = sand.Grains([[0, 0, 0], [0, 1e-6, 0]], "10 nm", "iron", velocity=[[1, 0, 0], [0, 2, 0]])
    sim = sand.Simulation(grains, [sand.Contact()], stepping=sand.Verlet(step="1 ns"))
    for time in (0.3e-9, 0.4e-9, 5e-9 + 1e-18, 17.77e-9, 40e-9):
        sim.run(until=time)
        assert sim.time == time and sim.steps == int(time / 1e-9 + 1e-6)
        assert np.allclose(sim.grains.position, grains.position + grains.velocity * time, rtol=1e-13, atol=0)


@pytest.mark.filterwarnings("ignore:grains in contact vibrate", "ignore:grains overlap too deeply")
@pytest.mark.compiled("dipoles")
def test_resume_is_bit_for_bit(tmp_path):
    """A run stopped after 7,000 steps and resumed equals the uninterrupted run: state, ledger, trajectory."""
    whole = gas_simulation(out=tmp_path / "whole", frame_every="5 ns")
    whole.run(until="60 ns")
    first = gas_simulation(out=tmp_path / "parts", frame_every="5 ns")
    first.run(steps=7000)
    del first
    second = sand.resume(tmp_path / "parts")
    assert second.state.steps == 7000
    second.run(until="60 ns")
    assert state(second) == state(whole)
    rows = [(tmp_path / name / "ledger.csv").read_text().splitlines() for name in ("whole", "parts")]
    assert set(rows[0]) <= set(rows[1])  # the end of the first run adds one row
    assert len(rows[1]) - len(rows[0]) <= 1


PROGRAM = """
import sys, warnings; warnings.simplefilter("ignore")
import numpy as np
from tests.physics.setups import random_aggregate
import sand
fast = 8.0 * np.random.default_rng(3).normal(size=(5, 3))
grains = random_aggregate(5, 7, radii=(5e-9, 1e-8), moment="300 A m^2/kg", velocity=fast)
field = sand.Field("1 mT", shape="ramp", final="1 mT", end="1 s")
sim = sand.Simulation(grains, [sand.Contact(), sand.Dipoles(cutoff="1 um"), field])
sim.run(steps=120)
np.savez(sys.argv[1], position=sim.grains.position, spin=sim.grains.spin, lost=sim.state.lost, time=sim.time)
"""


@pytest.mark.slow
@pytest.mark.interpreted
def test_compiled_and_interpreted_runs_agree_to_rounding(tmp_path):
    """120 steps of an aggregate with breaking and rolling contacts, compiled and interpreted: equal to 1e-10.

    The tolerance is rounding (1e-16), amplified by the collisions.
    """
    ends = []
    for name, off in (("compiled", "0"), ("plain", "1")):
        env = os.environ | {"NUMBA_DISABLE_JIT": off}
        path = tmp_path / f"{name}.npz"
        subprocess.run([sys.executable, "-c", PROGRAM, str(path)], check=True, env=env, timeout=300)
        ends.append(np.load(path))
    for key in ("position", "spin", "lost", "time"):
        scale = np.abs(ends[0][key]).max()
        assert np.abs(ends[0][key] - ends[1][key]).max() <= 1e-10 * scale
    assert ends[0]["lost"].sum() > 0


@pytest.mark.compiled("contacts")
def test_kernels_against_plain_python_loops():
    """Pair list, contact loads and gather against double loops in NumPy, to 1e-9 of the largest load."""
    from sand.contact import jkr, mechanics
    from sand.contact.constants_table import column_loops

    grains = random_aggregate(40, 3, radii=(5e-9, 1.5e-8), velocity=5.0 * np.random.default_rng(1).normal(size=(40, 3)))
    sim = sand.Simulation(grains, [sand.Contact()])
    sim.run(steps=50)
    g, w = sim.grains, sim.state
    listed = {frozenset(p) for p in w.pair_list.pair[:, : w.count[3]].T.tolist()}
    in_contact = {
        frozenset((i, j))
        for i in range(40)
        for j in range(i)
        if np.linalg.norm(g.position[i] - g.position[j]) < g.radius[i] + g.radius[j]
    }
    assert in_contact <= listed
    force, torque = np.zeros((40, 3)), np.zeros((40, 3))
    for c in range(w.count[CONTACTS]):
        i, j = (int(k) for k in w.contacts.pair[:, c])
        constants = column_loops(jkr.LAW).load(w.contacts.constants, c)
        apart = g.position[i] - g.position[j]
        distance = np.linalg.norm(apart)
        from scipy.spatial.transform import Rotation

        n1 = Rotation.from_quat(g.orientation[i]).apply(w.contacts.pointer1[:, c])
        n2 = Rotation.from_quat(g.orientation[j]).apply(w.contacts.pointer2[:, c])
        pose = mechanics.pose_of(tuple(apart), tuple(n1), tuple(n2), w.contacts.twist[c])
        overlap = g.radius[i] + g.radius[j] - distance
        normal = jkr.LAW.force(overlap, jkr.LAW.radius_root(overlap, constants), constants)
        f, t1, t2 = mechanics.contact_load(pose, normal, g.radius[i], g.radius[j], constants)
        force[i] += f
        force[j] -= f
        torque[i] += t1
        torque[j] += t2
    assert g.force == pytest.approx(force, abs=1e-9 * np.abs(force).max())
    assert g.torque == pytest.approx(torque, abs=1e-9 * np.abs(torque).max())


@pytest.mark.validate
def test_the_number_of_threads_changes_no_bit():
    """A lattice of 1000 spinning grains with slipping and breaking contacts: the same bits with 1, 2 and 3 threads."""
    radius, rng = 1e-8, np.random.default_rng(5)
    positions = np.stack(np.meshgrid(*[np.arange(10)] * 3, indexing="ij"), -1).reshape(-1, 3)
    positions = rest_distance(sand.SILICA, radius, radius) * positions
    given = {"velocity": rng.normal(size=positions.shape), "spin": rng.normal(scale=3e9, size=positions.shape)}
    ends = []
    for number in (1, 2, 3):
        set_threads(number)
        sim = sand.Simulation(sand.Grains(positions, radius, sand.SILICA, **given), [sand.Contact()])
        try:
            sim.run(steps=200)
        finally:
            set_threads(None)
        ends.append(state(sim))
    count = sim.state.count
    assert count[BROKEN] > 0 and count[SLIPPED] > 0.5 * 200 * count[CONTACTS]
    assert ends[0] == ends[1] == ends[2]
