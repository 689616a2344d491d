"""Sums of long-range loads in blocks against sums in one loop, for combined forces in any order."""

import itertools

import numpy as np
import pytest

import sand
from sand.compiler.jit import formula, kernel
from sand.forces.base import compose_long_range
from sand.forces.pair import dipole_loops as dipoles
from sand.integrate.respa import clear_long_range_loads
from sand.neighbours.cell_list import build_verlet_list
from sand.state.arrays import empty_long_range_arrays

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
def test_blocked_sums_of_combined_forces(order):
    """begin, blocks and end give the result of `loads`: F, M and B to 1e-12 of the largest.

    The functions run as plain Python.  Charges have arrays of their own in `long_range`.
    """
    grains = cloud()
    forces = [sand.Dipoles(cutoff="0.1 um"), sand.Charges(cutoff="0.1 um")]
    sim = sand.Simulation(grains, forces, neighbours=sand.Neighbours("cells"))
    of_dipoles, (of_charges, _) = sim._engine.parameters.long_range
    numbers = {"listed dipoles": of_dipoles, "listed charges": of_charges, "dipoles": of_dipoles}
    loops = {
        "listed dipoles": dipoles.LISTED_PAIRS,
        "listed charges": forces[1].sums(sim.box, True),
        "dipoles": dipoles.ALL_PAIRS_CUT,
    }
    sums, own = compose_long_range([loops[name] for name in order], [numbers[name] for name in order])
    span, found = sim._engine.parameters.span, []
    for loop in ("at once", "in blocks"):
        arrays, far = sim.state.copy().grains.arrays, empty_long_range_arrays(40, 4000)
        build_verlet_list(arrays, far, sim.state.count.copy(), span, sim._engine.parameters.search)
        clear_long_range_loads(far)
        if loop == "at once":
            sums.loads(arrays, far, span, own)
        else:
            sums.blocked.begin(arrays, far, span, own)
            for b in range(sums.blocked.blocks(arrays)):
                sums.blocked.block(arrays, far, span, own, b)
            sums.blocked.end(arrays, far, span, own)
        found.append((far.force, far.torque, arrays.field))
    for once, blocks in zip(*found, strict=True):
        assert np.abs(once).max() > 0.0
        assert np.abs(once - blocks).max() < 1e-12 * np.abs(once).max()


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
