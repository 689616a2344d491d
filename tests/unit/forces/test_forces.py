"""External forces written by users, and the uniform field."""

import math
from typing import NamedTuple

import numpy as np
import pytest

import sand
from sand.compiler.jit import formula
from sand.compiler.user_code import code_digest
from sand.engine.assemble import build_engine
from sand.forces.external_formulas import GrainState, uniform_field
from sand.forces.external_loops import external_energies_for
from sand.integrate.force_calls import add_external_loads, sum_external
from sand.integrate.force_stages import ENERGY, external_force_stages, pair_force_stages
from sand.integrate.parts import ExternalWork
from sand.integrate.stage_list import build_program


class Weight(NamedTuple):
    g: float


@formula
def weight(time, grain, parameters):
    """Uniform gravity along −z."""
    force = (0.0, 0.0, -grain.mass * parameters.g)
    return force, (0.0, 0.0, 0.0), grain.mass * parameters.g * grain.position[2]


class Gravity:
    """A force as users write it in a script."""

    name = "gravity"
    references = "Galileo 1638"
    formula = staticmethod(weight)

    def parameters(self):
        return {}

    def check(self, grains, box):
        return []

    def numbers(self):
        return Weight(9.81)

    def flux_density_size(self):
        return 0.0


@pytest.mark.validate
def test_a_users_force():
    """Free fall, z = z0 − g t²/2 exactly (Verlet is exact for it); its energy has a column and the balance closes."""
    grains = sand.Grains([[0, 0, 1e-3], [1e-6, 0, 0]], 1e-8, sand.SILICA)
    sim = sand.Simulation(grains, [Gravity()], frame_every="1 us")
    sim.run(until="10 us")
    fall = 0.5 * 9.81 * sim.time**2
    assert sim.grains.position[:, 2] == pytest.approx([1e-3 - fall, -fall], rel=1e-9, abs=0.0)
    assert sim.ledger["gravity"][0] == pytest.approx(grains.mass[0] * 9.81 * 1e-3, rel=1e-6, abs=0.0)
    change = np.ptp(sim.ledger["total"])
    assert change < 1e-9 * sim.ledger["translation"][-1] + 1e-15 * sim.ledger["gravity"][0]


def test_stages_of_other_formulas_have_other_digests():
    """All stages of two forces, made by the same functions of other formulas; made again they have the same digests."""

    def stages():
        for sums in (sand.Charges().sums(sand.Box.open(), False), own_charges().sums(sand.Box.open(), False)):
            yield from pair_force_stages(sums, False).values()
        for one in (sand.Field(0.5).formula, weight):
            yield from external_force_stages(one).values()
            yield external_energies_for(one)

    found = {each: code_digest(each.function) for each in stages()}
    digests = list(found.values())
    assert len(digests) > 6 and None not in digests and len(set(digests)) == len(digests)


SOURCE = """
from numba import njit
from sand.compiler.jit import formula
import math
import numpy as np
from enum import IntEnum
class Power(IntEnum):
    SQUARE = 2
FACTOR = 2.0
AXIS = (0.0, 1.0)
WEIGHTS = np.array([0.25, 0.5])
def half(x):
    return WEIGHTS[1] * x**Power.SQUARE + math.sin(x - AXIS[0])
@formula
def force(x):
    return FACTOR * half(x)
"""
"""A module of the user."""


@pytest.mark.parametrize(
    ("old", "new", "differs"),
    [
        ("FACTOR = 2.0", "FACTOR = 3.0", True),
        ("WEIGHTS[1] * x", "WEIGHTS[0] * x", True),
        ("[0.25, 0.5]", "[0.25, 1.5]", True),
        ("[0.25, 0.5]", "[0.25, 'half'], dtype=object", None),
        ("SQUARE = 2", "SQUARE = 3", True),
        ("def half", "@njit\ndef half", False),
        ("    return WEIGHTS", "    # half of it\n    return WEIGHTS", False),
        ("FACTOR *", "-FACTOR *", True),
        ("math.sin", "math.cos", True),
        ("x - AXIS[0]", "AXIS[0] - x", True),
        ("AXIS = (0.0, 1.0)", "AXIS = (0.5, 1.0)", True),
        ("FACTOR = 2.0", "FACTOR = object()", None),
    ],
)
def test_the_digest_changes_with_the_code_of_the_user(old, new, differs):
    """With the bytecode of a formula or of a function that it calls, and with globals; not with comments.

    None, so that nothing is cached, for an object whose value does not follow from its source.
    """

    def digest(text):
        scope = {"__name__": "users_module"}
        exec(text, scope)
        return code_digest(scope["force"])

    before, after = digest(SOURCE), digest(SOURCE.replace(old, new))
    assert len(before) == 16 and digest(SOURCE) == before
    assert after is None if differs is None else (after != before) is differs


@formula
def own_coulomb(apart, a, b, parameters):
    """Charges, as users write the formula in a script."""
    return (a.charge * b.charge * apart[0], 0.0, 0.0), 0.0


def own_charges():
    """A pair force with a formula from outside SAND."""

    class OwnCharges(sand.Charges):
        formula = staticmethod(own_coulomb)
        rate = None

    return OwnCharges()


def test_external_forces_add_up():
    """Two forces, each with its own parameters: sums of force, torque and energy; without forces nothing changes.

    In plain Python, with the loops over all forces and with their stages.
    """
    grains = sand.Grains([[0.0, 0.0, 2.0]], 1.0, sand.SILICA, mass=3.0, moment=[[1.0, 0.0, 0.0]])
    for forces, weighs, turns in (
        ([Gravity(), sand.Field([0.0, 0.0, 0.5])], 1.0, 1.0),
        ([sand.Field([0.0, 0.0, 0.5]), Gravity()], 1.0, 1.0),
        ([Gravity()], 1.0, 0.0),
        ([], 0.0, 0.0),
    ):
        engine = build_engine(grains, forces, sand.Box(), sand.Verlet(), sand.Neighbours())
        parameters = engine.parameters._replace(external_work=ExternalWork(True, False))
        table, own = engine.table_of(engine.state), engine.state.grains.arrays
        program = build_program(engine.content, parameters, table)
        own.force[...] = own.torque[...] = 0.0
        table.set("program", program)
        add_external_loads(table, 0.0)
        assert own.force[:, 0] == pytest.approx((0, 0, -3 * 9.81 * weighs), rel=1e-6, abs=0.0)
        assert own.torque[:, 0] == pytest.approx((0, -0.5 * turns, 0), rel=1e-6, abs=0.0)
        energy = sum_external(table, 0.0, ENERGY)
        assert energy == pytest.approx(3 * 9.81 * 2 * weighs, rel=1e-6, abs=0.0)


def test_torque_of_the_field_is_minus_the_gradient_of_its_energy():
    """Torque μ×B = −∂U/∂θ for U = −μ·B, by central differences, to 1e-9 (rounding)."""
    b, moment = np.array([0.3, -0.2, 0.9]), np.array([0.5, 1.0, -0.4])
    numbers = sand.Field(b).numbers()

    def energy(m):
        return uniform_field(0.0, GrainState((0.0,) * 3, (0.0,) * 3, (0.0,) * 3, tuple(m), 1.0, 1.0, 0.0), numbers)[2]

    one = GrainState((0.0,) * 3, (0.0,) * 3, (0.0,) * 3, tuple(moment), 1.0, 1.0, 0.0)
    torque = uniform_field(0.0, one, numbers)[1]
    h = 1e-6
    slope = [
        (energy(moment + h * np.cross(e, moment)) - energy(moment - h * np.cross(e, moment))) / (2 * h)
        for e in np.eye(3)
    ]
    assert torque == pytest.approx([-s for s in slope], abs=1e-9)
    assert sand.Field("1 mT").flux_density == (0.0, 0.0, 1e-3)
    assert sand.Field([3, 0, 4]).flux_density_size() == pytest.approx(5.0, rel=1e-6, abs=0.0)
    assert math.isclose(energy(moment), -moment @ b)
