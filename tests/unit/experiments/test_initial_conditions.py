"""Random initial conditions of scattering trajectories have the right distributions (plain Python, no compiler)."""

import numpy as np
import pytest

import sand
from sand.basics.constants import BOLTZMANN
from sand.experiments.scattering import flight
from sand.experiments.scattering.initial_conditions import R, U, draw_path
from sand.experiments.scattering.two_aggregates import ANGULAR1, TURN1, draw_rigid_pose
from sand.experiments.scattering.two_spheres import DIRECTION1, DIRECTION2, SPIN1, SPIN2, draw_sphere_pose
from sand.numerics.quaternion import turned_back

COUNT = 1500
HEAT = BOLTZMANN * 100.0


def sampled(pair, pose, low=0.0, high=1e-12):
    """Impact parameters (K,) and states (K, size) of many sampled starts."""
    model, rules = pair.pair()
    start, states, b = pair.start(), np.zeros((COUNT, model.size)), np.zeros(COUNT)
    for k in range(COUNT):
        address = (np.uint64(5), np.uint64(2), np.uint64(k))
        b[k] = draw_path(states[k], address, low, high, start)
        pose(states[k], address, start, rules)
    return b, states


@pytest.mark.parametrize(("spin", "part"), [("kT/2", 0.5), ("equipartition", 1.5)])
def test_spheres(spin, part):
    """⟨½Iω²⟩ = kT/2 or 3kT/2, moments isotropic, b² uniform, all to 4σ; b perpendicular to the velocity."""
    one, two = (sand.Grains([[0, 0, 0]], r, sand.IRON, moment=[[1e-18, 0, 0]]) for r in (1e-8, 2e-8))
    pair = flight(projectile=one, target=two, temperature="100 K", speed=0.3, spin=spin, start="3 um")
    b, y = sampled(pair, draw_sphere_pose)
    for grains, row in ((one, SPIN1), (two, SPIN2)):
        energy = 0.5 * grains.inertia[0] * (y[:, row : row + 3] ** 2).sum(axis=1)
        assert energy.mean() / (part * HEAT) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 3 / COUNT))
    for row in (DIRECTION1, DIRECTION2):
        axis = y[:, row : row + 3]
        assert np.abs((axis**2).sum(axis=1) - 1.0).max() < 1e-12
        assert np.abs(axis.mean(axis=0)).max() < 4 / np.sqrt(3 * COUNT)
        assert np.abs((axis**2).mean(axis=0) - 1 / 3).max() < 4 * np.sqrt(4 / 45 / COUNT)
    assert (b**2).mean() / 1e-12 == pytest.approx(0.5, abs=4 / np.sqrt(12 * COUNT))
    assert np.linalg.norm(y[:, R + 1 : R + 3], axis=1) == pytest.approx(b, rel=1e-9, abs=0)
    assert (y[:, R] == -pair.distance).all()
    assert (y[:, U] == 0.3).all()


def test_aggregates():
    """A chain of three: a third of the rotational energy about each principal axis, to 4σ."""
    chain = sand.setup.aggregates.chain(3, radius="10 nm", material=sand.IRON, moment="1e-18 A m^2")
    pair = flight(projectile=chain, temperature="100 K", speed=0.3, spin="equipartition", start="3 um")
    _, y = sampled(pair, draw_rigid_pose)
    _, rules = pair.pair()
    inertia = np.array(rules.first.inertia)
    own = np.array([turned_back(tuple(one[TURN1 : TURN1 + 4]), tuple(one[ANGULAR1 : ANGULAR1 + 3])) for one in y])
    energies = 0.5 * own**2 / inertia
    assert energies.mean(axis=0) / (0.5 * HEAT) == pytest.approx(np.ones(3), abs=4 * np.sqrt(2 / COUNT))
    assert inertia[0] == pytest.approx(chain.inertia.sum(), rel=1e-9, abs=0)
    assert inertia[1] > 2 * inertia[0]
