"""Bodies that miss each other: when they cannot touch any more."""

import math

import numpy as np
import pytest

import sand
from sand.basics.constants import MAGNETIC
from sand.experiments.collision import collide
from sand.experiments.parting import cannot_touch
from sand.setup import bpca, grain

R = 1e-7


def pair(position, velocity, forces=(), moment=0.0, **options):
    """Two silica grains, the first at rest at the origin."""
    grains = sand.Grains([[0, 0, 0], position], R, "silica", velocity=[[0, 0, 0], velocity], moment=[moment, 0, 0])
    return sand.Simulation(grains, [sand.Contact(), *forces], **options)


@pytest.mark.parametrize(
    ("position", "velocity", "parts"),
    [
        ([4 * R, 3 * R, 0], [-1, 0, 0], True),  # they pass at 3 r, beyond 2 r
        ([4 * R, 1.5 * R, 0], [-1, 0, 0], False),  # they pass at 1.5 r
        ([4 * R, 0, 0], [1, 0, 0], True),  # they recede
        ([4 * R, 0, 0], [0, 0, 0], True),  # at rest apart
        ([2.01 * R, 0, 0], [1, 0, 0], False),  # within the allowance for vibrations
    ],
)
def test_straight_paths(position, velocity, parts):
    """Without other forces: touch is possible only if the distance of closest approach is below 1.01 (r₁ + r₂)."""
    assert bool(cannot_touch(pair(position, velocity), np.arange(2))) == parts


def test_attraction_may_bring_bodies_back():
    """Receding dipoles part for ever only with ½ m̄ v_r² > 2kμ²/d³, the work of the largest force 6kμ²/r⁴ from d."""
    mass, distance, moment = float(grain(radius=R, material="silica").mass[0]), 6 * R, 1e-16
    work = 2.0 * MAGNETIC * moment**2 / distance**3
    # its derivative is the largest force between two dipoles, that of aligned ones
    force = 6.0 * MAGNETIC * moment**2 / distance**4
    near, far = (2.0 * MAGNETIC * moment**2 / (distance + h) ** 3 for h in (1e-12, -1e-12))
    assert (far - near) / 2e-12 == pytest.approx(force, rel=1e-6, abs=0.0)
    speed = math.sqrt(2.0 * work / (0.5 * mass))
    for factor, parts in ((0.99, False), (1.01, True)):
        one = pair([distance, 0, 0], [factor * speed, 0, 0], [sand.Dipoles()], moment)
        assert bool(cannot_touch(one, np.arange(2))) == parts
    # motion across the line of centres does not count, and bodies that approach may touch whatever their energy
    for velocity in ([0.99 * speed, 9.0 * speed, 0], [-2.0 * speed, 9.0 * speed, 0], [0, 9.0 * speed, 0]):
        assert not cannot_touch(pair([distance, 0, 0], velocity, [sand.Dipoles()], moment), np.arange(2))


def test_other_forces_and_boxes_tell_nothing():
    """Fields, a gas, forces of the user, walls or a periodic box may bring bodies together again."""
    away = [4 * R, 0, 0], [1, 0, 0]
    gas = sand.Gas(temperature="300 K", pressure="1 Pa", cross_section="2e-19 m^2")
    for forces in ([sand.Gravity([0, 0, -9.8])], [gas]):
        assert not cannot_touch(pair(*away, forces), np.arange(2))
    assert not cannot_touch(pair(*away, box="10 um"), np.arange(2))
    assert cannot_touch(pair(*away), np.arange(2))


@pytest.mark.compiled("contacts")
def test_a_miss_ends_and_says_why():
    """Aggregates that pass each other: the run ends at the first look, and nothing touches if it goes on."""
    bodies = [bpca(8, radius=R, material="silica", seed=seed) for seed in (1, 2)]
    result, sim = collide(*bodies, speed=1.0, impact_parameter="1.05 b")
    assert (result.outcome, result.end) == ("miss", "the paths of the bodies are straight and do not meet")
    assert result.quiet and len(sim.ledger) < 20
    extent = float(np.ptp(sim.grains.position, axis=0).max())
    sim.run(until=sim.time + 4.0 * extent / 1.0)
    assert sim.ledger["made"][-1] == 0
    hit, _ = collide(*bodies, speed=0.3, impact_parameter="0.1 b")  # slow: they stick
    assert (hit.outcome, hit.end) == ("stick", "one body is left and holds together")
