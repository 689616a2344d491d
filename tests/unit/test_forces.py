"""External forces written by users, and the uniform field."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import sand
from sand.compiler.jit import COMPILED, cache_folder, formula
from sand.forces.base import compose
from sand.forces.external.formulas import GrainState, nothing, uniform_field
from sand.forces.external.loops import is_builtin
from sand.integrate.driver import driver_for
from sand.integrate.kernel_spec import KernelSpec


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


def test_compiled_code_with_a_users_formula_is_not_cached():
    """The digest of SAND's sources does not cover its edits: a cached copy would be outdated."""
    assert is_builtin(uniform_field)
    assert not is_builtin(weight)
    if not COMPILED:
        pytest.skip("the compiler is off")
    theirs, ours = (compose([force])[0] for force in (Gravity(), sand.Field(0.5)))
    assert driver_for(KernelSpec(external=theirs, keep=False)).stats.cache_path is None
    assert Path(driver_for(KernelSpec(external=ours)).stats.cache_path).is_relative_to(cache_folder())


def test_composed_forces_add_up():
    """Two forces in one formula: sums of force, torque and energy, each with its own parameters."""
    field = sand.Field([0.0, 0.0, 0.5])
    both, numbers = compose([Gravity(), field])
    grain = GrainState((0.0, 0.0, 2.0), (0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0), 1.0, 3.0, 0.0)
    force, torque, energy = both(0.0, grain, numbers)
    assert force == pytest.approx((0, 0, -3 * 9.81), rel=1e-6, abs=0.0)
    assert torque == pytest.approx((0, -0.5, 0), rel=1e-6, abs=0.0)
    assert energy == pytest.approx(3 * 9.81 * 2, rel=1e-6, abs=0.0)
    assert compose([]) == (nothing, ())


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
