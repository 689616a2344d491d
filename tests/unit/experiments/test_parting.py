"""Bodies that miss each other: when they cannot touch any more."""

import math
import tracemalloc

import numpy as np
import pytest

import sand
from sand.basics.constants import MAGNETIC
from sand.experiments.collision import collide
from sand.experiments.parting import MARGIN, bodies_of, cannot_touch
from sand.experiments.scattering.free_bodies import FreeBodies, recede_for_ever, stay_apart
from sand.setup import bpca, grain

pytestmark = pytest.mark.compiled("contacts")
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
    # within the allowance for vibrations, however fast they recede
    assert not cannot_touch(pair([2.01 * R, 0, 0], [1e6 * speed, 0, 0], [sand.Dipoles()], moment), np.arange(2))
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


def cloud(count, seed, speed=1.0):
    """Single bodies of one grain each, at random places in a sphere of 30 r, which fly apart (or together, < 0)."""
    rng = np.random.default_rng(seed)
    position = (
        30.0
        * R
        * np.cbrt(rng.random((count, 1)))
        * (lambda u: u / np.linalg.norm(u, axis=1)[:, None])(rng.normal(size=(count, 3)))
    )
    velocity = speed * (0.3 * position / (30.0 * R) + rng.normal(size=(count, 3)))
    grains = sand.Grains(position, R, "silica", velocity=velocity, moment=rng.normal(size=(count, 3)) * 1e-17)
    return bodies_of(grains, np.arange(count), [sand.Dipoles()])


@pytest.mark.parametrize("seed", range(20))
def test_loops_over_pairs_are_those_of_arrays(seed):
    """Paths and attraction of several bodies against all pairs at once, by the formulas of the module's text.

    The least distance on straight paths is the minimum over 200,001 times, to 24 µs, which is
    at most (relative speed × interval) above the true one; no cloud is that near to the limit.
    """
    few = cloud(8, seed)
    one, other = np.triu_indices(8, 1)
    x, v = few.centre.T[one] - few.centre.T[other], few.velocity.T[one] - few.velocity.T[other]
    reach = (1.0 + MARGIN) * (few.radius[one] + few.radius[other])
    times = np.linspace(0.0, 24e-6, 200_001)
    least = np.array([np.linalg.norm(a + times[:, None] * b, axis=1).min() for a, b in zip(x, v, strict=True)])
    steps = times[1] * np.linalg.norm(v, axis=1)
    assert not ((least > reach) & (least - steps < reach)).any()
    assert stay_apart(few, MARGIN) == bool((least > reach).all())
    for speed in (0.003, 0.01, 0.03, 0.1, 0.3):
        few = few._replace(velocity=few.centre / (30.0 * R) * speed)
        x, v = few.centre.T[one] - few.centre.T[other], few.velocity.T[one] - few.velocity.T[other]
        distance = np.linalg.norm(x, axis=1)
        recede = (x * v).sum(axis=1) / distance
        moment = few.strength[0] / math.sqrt(2.0 * MAGNETIC)
        nearest = distance - (1.0 + MARGIN) * (few.distance[one] + few.distance[other])
        momentum = 2.0 * (2.0 * MAGNETIC * moment[one] * moment[other] / nearest**3) / recede
        given = np.array([momentum[(one == k) | (other == k)].sum() for k in range(8)]) / few.mass
        apart = (recede > 0.0).all() and (distance > reach).all()
        expected = bool(apart and (given[one] + given[other] <= 0.5 * recede).all())
        assert recede_for_ever(few, MARGIN) == expected


def test_both_answers_occur():
    """The clouds of the test above decide both ways, by paths and by attraction."""
    clouds = [cloud(8, seed) for seed in range(20)]
    assert 2 <= sum(stay_apart(each, MARGIN) for each in clouds) <= 18
    moving = [each._replace(velocity=each.centre / (30.0 * R) * speed) for each in clouds for speed in (0.003, 0.3)]
    assert 5 <= sum(recede_for_ever(each, MARGIN) for each in moving) <= 35


def test_bodies_of_several_grains():
    """Work of two rods of three grains, against a double sum, decides at 0.99 and 1.01 of the speed that it allows."""
    line = np.arange(3)[:, None] * [2.0 * R, 0.0, 0.0]
    position = np.concatenate([line, line + np.array([0.0, 12.0 * R, 3.0 * R])])[[0, 3, 1, 4, 2, 5]]
    moment = np.outer([1e-16, 3e-16, 2e-16, 0.0, 1e-16, 5e-16], [0, 0, 1])
    labels = np.array([0, 1, 0, 1, 0, 1])
    grains = sand.Grains(position, R, "silica", moment=moment)
    found = bodies_of(grains, labels, [sand.Dipoles()])
    apart = found.centre[:, 1] - found.centre[:, 0]
    distance = float(np.linalg.norm(apart))
    far = [abs(k - 1) * 2.0 * R for k in range(3)]
    size = np.linalg.norm(moment, axis=1)
    work = sum(
        2.0
        * MAGNETIC
        * size[labels == 0][i]
        * size[labels == 1][j]
        / (distance - (1.0 + MARGIN) * (far[i] + far[j])) ** 3
        for i in range(3)
        for j in range(3)
    )
    speed = math.sqrt(2.0 * work * (1.0 / found.mass[0] + 1.0 / found.mass[1]))
    for factor, parts in ((0.99, False), (1.01, True)):
        velocity = np.transpose([np.zeros(3), factor * speed * apart / distance])
        assert recede_for_ever(found._replace(velocity=velocity), MARGIN) == parts


def test_memory_does_not_grow_with_pairs():
    """Six thousand fragments that all stay apart, 18 million pairs: the loops allocate less than a byte per pair."""
    count = 6000
    centre = 4.0 * R * np.stack(np.meshgrid(*[np.arange(20.0)] * 3)).reshape(3, -1)[:, :count]
    ones, none = np.ones(count), np.zeros((1, count))
    bodies = FreeBodies(
        ones,
        centre,
        centre - centre.mean(1, keepdims=True),
        R * ones,
        np.arange(count + 1),
        0.0 * ones,
        none,
        ones[:1],
        0.0 * ones,
    )
    stay_apart(bodies._replace(centre=centre[:, :2], mass=ones[:2]), MARGIN)
    recede_for_ever(bodies._replace(centre=centre[:, :2], mass=ones[:2]), MARGIN)
    tracemalloc.start()
    assert stay_apart(bodies, MARGIN) and recede_for_ever(bodies, MARGIN)
    assert tracemalloc.get_traced_memory()[1] < 1e6
    tracemalloc.stop()


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
