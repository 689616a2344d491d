"""Sums of long-range loads in blocks against sums in one loop, for several forces in any order."""

import itertools

import numpy as np
import pytest

import sand
from sand.basics.arrays import empty_long_range_arrays
from sand.compiler.jit import formula, kernel
from sand.compiler.program import Program
from sand.forces.pair import dipole_loops as dipoles
from sand.forces.pair import generic_loops
from sand.forces.pair import long_range_loops as loops
from sand.integrate.force_calls import sum_pair_forces
from sand.integrate.force_stages import PAIR_STAGES, SUM, pair_force_stages
from sand.integrate.parts import ForceNumbers
from sand.integrate.stages import StageNumber
from sand.integrate.task_queue import SHARED, new_task_queue
from sand.neighbours.cell_list import build_verlet_list

from ...tables import table_of

pytestmark = pytest.mark.filterwarnings("ignore")


def cloud():
    """40 charged magnetic iron grains in open space."""
    rng = np.random.default_rng(6)
    moment = 6e-18 * rng.normal(size=(40, 3))
    charge = 1e-17 * rng.normal(size=40)
    return sand.Grains(2e-7 * rng.random((40, 3)), 1e-9, sand.IRON, moment=moment, charge=charge)


@pytest.mark.parametrize(
    "order",
    [p for name in ("listed dipoles", "dipoles") for p in itertools.permutations([name, "listed charges"])],
    ids=" then ".join,
)
def test_blocked_sums_of_several_forces(order, monkeypatch):
    """Shared blocks give the result of one block; both are the sum of the two forces: F, M, B to 1e-12 of the largest.

    The functions run as plain Python.  Charges have arrays of their own in `long_range`.  The blocks of large
    simulations are made for these 40 grains.
    """
    grains = cloud()
    forces = [sand.Dipoles(cutoff="0.1 um"), sand.Charges(cutoff="0.1 um")]
    sim = sand.Simulation(grains, forces, neighbours=sand.Neighbours("cells"))
    of_dipoles, of_charges = (force.numbers(grains, sim.box) for force in forces)
    search = sand.Neighbours("cells").choose(grains, sim.box, grains.radius.min(), [1e-7]).search
    numbers = {"listed dipoles": of_dipoles, "listed charges": of_charges, "dipoles": of_dipoles}
    sums = {
        "listed dipoles": dipoles.LISTED_PAIRS,
        "listed charges": forces[1].sums(sim.box, True),
        "dipoles": dipoles.ALL_PAIRS_CUT,
    }
    span = sim.box.span

    def loads(names, shared):
        arrays, far = sim.state.copy().grains.arrays, empty_long_range_arrays(40, 4000, loops.ALL_PAIRS_BLOCKS)
        count, queue = sim.state.count.copy(), new_task_queue(40, 0)
        queue.words[SHARED] = shared
        build_verlet_list(arrays, far, count, span, search)
        numbers_of = ForceNumbers(len(names), 0)
        parts = {
            "grains": arrays,
            "long_range": far,
            "span": span,
            "count": count,
            "queue": queue,
            "forces": numbers_of,
        }
        table = table_of(**parts, program=None)
        stages = {
            StageNumber.FIRST_FORCE + PAIR_STAGES * k + SUM: (pair_force_stages(sums[name], False)[SUM], numbers[name])
            for k, name in enumerate(names)
        }
        program = Program(table, stages, StageNumber.FIRST_FORCE + PAIR_STAGES * len(names))
        far.force[...] = far.torque[...] = 1.0  # of an earlier sum
        table.set("program", program)
        sum_pair_forces(table)
        return far.force, far.torque, arrays.field

    once, alone = loads(order, False), [loads([name], False) for name in order]
    monkeypatch.setattr(loops, "PARALLEL_FROM", 1)
    for module in (loops, generic_loops, dipoles):
        monkeypatch.setattr(module, "ROWS_PER_BLOCK", 16)
    for whole, blocks, *parts in zip(once, loads(order, True), *alone, strict=True):
        assert np.abs(whole).max() > 0.0
        assert np.abs(whole - blocks).max() < 1e-12 * np.abs(whole).max()
        assert np.abs(whole - sum(parts)).max() < 1e-12 * np.abs(whole).max()


@pytest.mark.compiled("dipoles")
def test_forces_of_contacts_are_those_of_the_contact_law():
    """Two magnetic grains head to tail in contact: the table has F = F_JKR n, without the dipole attraction.

    The attraction acts along n and is at least a thousandth of the contact force: it would show at 1e-9.
    """
    grains = sand.Grains([[0, 0, 0], [1.985e-8, 0, 0]], 1e-8, sand.IRON, moment=[[6e-18, 0, 0]] * 2)
    sim = sand.Simulation(grains, [sand.Contact(), sand.Dipoles(cutoff="1 mm")])
    sim.run(steps=30)
    force, normal = sim.contacts["force"][0], sim.contacts["normal_force"][0]
    assert abs(np.linalg.norm(force) - abs(normal)) < 1e-9 * abs(normal)


@pytest.mark.compiled("small")
def test_a_registered_formula_may_print(capfd):
    """Formulas that users register are compiled by plain numba and may use its runtime environment."""

    @formula
    def printing_formula(x):
        print("x is", x)
        return 2.0 * x

    def call(x):
        return printing_formula(x)

    assert kernel(call, cached=False)(1.5) == 3.0
    assert "x is 1.5" in capfd.readouterr().out
