"""Bodies that miss each other: when they cannot touch any more."""

import math
import tracemalloc

import numpy as np
import pytest

import sand
from sand.basics.constants import COULOMB, MAGNETIC
from sand.experiments.collision import collide
from sand.experiments.parting import MARGIN, bodies_of, cannot_touch
from sand.experiments.scattering.free_bodies import recede_for_ever, stay_apart
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


def cloud(count, seed, towards):
    """Single grains at random places within 30 r, which move at random and away from the centre, or towards it."""
    rng = np.random.default_rng(seed)
    position, velocity, moment = rng.normal(size=(3, count, 3))
    position *= (30.0 * R * np.cbrt(rng.random(count)) / np.linalg.norm(position, axis=1))[:, None]
    velocity += (-10.0 if towards else 1.0) * position / (30.0 * R)
    grains = sand.Grains(position, R, "silica", velocity=velocity, moment=1e-17 * moment)
    return grains, bodies_of(grains, np.arange(count), [sand.Dipoles()])


CLOUDS = [cloud(8, seed, seed % 2 == 0) for seed in range(20)]
SPEEDS = (0.003, 0.01, 0.03, 0.1, 0.3)


def receding(bodies, speed):
    """The bodies with velocities that grow with the distance from the origin, to `speed` at 30 r."""
    return bodies._replace(velocity=bodies.centre / (30.0 * R) * speed)


def ever(bodies):
    """`recede_for_ever` with new momenta, which it has to set itself."""
    return recede_for_ever(bodies, np.full(len(bodies.mass), 1e9), MARGIN)


@pytest.mark.parametrize("number", range(20))
def test_loops_over_pairs_are_those_of_arrays(number):
    """Paths and attraction of eight bodies against all pairs at once, by the formulas of the module's text.

    The least distance on straight paths is the minimum over 200,001 times until 24 µs: with d² = d₀² + v²(t − t₀)² it
    is at most (v Δt)²/8d₀ too large.  No cloud is that near to the limit, and all least distances come before 12 µs.
    """
    grains, bodies = CLOUDS[number]
    one, other = np.triu_indices(8, 1)
    x, v = grains.position[one] - grains.position[other], grains.velocity[one] - grains.velocity[other]
    times = np.linspace(0.0, 24e-6, 200_001)
    paths = np.array([np.linalg.norm(a + times[:, None] * b, axis=1) for a, b in zip(x, v, strict=True)])
    least, reach = paths.min(axis=1), 2.0 * R * (1.0 + MARGIN)
    assert times[paths.argmin(axis=1)].max() < 12e-6
    assert not ((least > reach) & (least - ((times[1] * v) ** 2).sum(axis=1) / (8.0 * reach) < reach)).any()
    assert stay_apart(bodies, MARGIN) == bool((least > reach).all())
    moment = np.linalg.norm(grains.moment, axis=1)
    work = 2.0 * MAGNETIC * moment[one] * moment[other] / np.linalg.norm(x, axis=1) ** 3
    for speed in SPEEDS:
        recede = np.linalg.norm(x, axis=1) * speed / (30.0 * R)
        momentum = work / (math.cos(math.pi / 6.0) - 0.5) / recede
        given = np.array([momentum[(one == k) | (other == k)].sum() for k in range(8)]) / grains.mass
        apart = (np.linalg.norm(x, axis=1) > reach).all()
        assert ever(receding(bodies, speed)) == bool(apart and (given[one] + given[other] <= 0.5 * recede).all())


def test_both_answers_occur():
    """The clouds of the test above decide both ways, by paths and by attraction."""
    assert 5 <= sum(stay_apart(bodies, MARGIN) for _, bodies in CLOUDS) <= 15
    assert 20 <= sum(ever(receding(bodies, speed)) for _, bodies in CLOUDS for speed in SPEEDS) <= 80


def test_bodies_of_several_grains():
    """Work of two rods with moments and charges, by a double sum, decides at 1 ∓ 1e-6 of the speed that it allows.

    W = Σ (2 k_m μμ'/r³ + k_e |qq'|/r), both parts between a quarter and three quarters; rounding is below 1e-13.
    """
    line = np.arange(3)[:, None] * [2.0 * R, 0.0, 0.0]
    position = np.concatenate([line, line + np.array([0.0, 12.0 * R, 3.0 * R])])[[0, 3, 1, 4, 2, 5]]
    moment = np.outer([1e-16, 3e-16, 2e-16, 0.0, 1e-16, 5e-16], [0, 0, 1])
    charge = 1e-19 * np.array([30.0, -20.0, 10.0, -10.0, 0.0, 20.0])
    labels = np.array([0, 1, 0, 1, 0, 1])
    grains = sand.Grains(position, R, "silica", moment=moment, charge=charge)
    found = bodies_of(grains, labels, [sand.Dipoles(), sand.Charges()])
    apart = found.centre[:, 1] - found.centre[:, 0]
    distance = float(np.linalg.norm(apart))
    far = 2.0 * R * np.abs(np.arange(3) - 1)
    gaps = distance - (1.0 + MARGIN) * np.add.outer(far, far)
    (mu, mu2), (q, q2) = ([np.abs(each[labels == k]) for k in (0, 1)] for each in (moment[:, 2], charge))
    parts = (2.0 * MAGNETIC * np.outer(mu, mu2) / gaps**3).sum(), (COULOMB * np.outer(q, q2) / gaps).sum()
    assert 0.25 < parts[0] / sum(parts) < 0.75
    speed = math.sqrt(2.0 * sum(parts) * (1.0 / found.mass[0] + 1.0 / found.mass[1]))
    for factor, expected in ((1.0 - 1e-6, False), (1.0 + 1e-6, True)):
        velocity = np.transpose([np.zeros(3), factor * speed * apart / distance])
        assert ever(found._replace(velocity=velocity)) == expected


def test_pairs_recede_while_their_velocity_has_changed_by_half():
    """With |v(t) − v(0)| ≤ u/2 the distance grows at (cos 30° − ½) u at least.

    The formula of the module's text, for random first states and velocities that jump within that ball, which are
    drawn on its surface; and nearly reached if they point first to one side, at 30° to v, and then to the other.
    """
    rng = np.random.default_rng(1)
    slowest = math.cos(math.pi / 6.0) - 0.5
    for _ in range(300):
        x = np.array([rng.uniform(0.01, 1.0), 0.0, 0.0])
        v = np.array([1.0, *rng.normal(size=2) * rng.choice([0.0, 0.3, 3.0])])
        for _ in range(50):
            side = rng.normal(size=3)
            now = v + 0.5 * side / np.linalg.norm(side)
            for _ in range(3):
                assert now @ x / np.linalg.norm(x) >= slowest - 1e-12
                x = x + rng.exponential() * now
    first, last = np.array([0.75, math.sqrt(3.0) / 4.0]), np.array([1.0 - math.sqrt(3.0) / 4.0, -0.25])
    for velocity in (first, last):
        assert np.linalg.norm(velocity - np.array([1.0, 0.0])) == pytest.approx(0.5, rel=1e-12, abs=0.0)
    far = np.array([1.0, 0.0]) + 1e6 * first
    assert last @ far / np.linalg.norm(far) == pytest.approx(slowest, rel=1e-5, abs=0.0)


def test_states_that_are_no_numbers_decide_nothing():
    """NaN in a position or a velocity: bodies may touch."""
    for name in ("centre", "velocity"):
        bodies = receding(CLOUDS[1][1], 0.3)
        values = getattr(bodies, name).copy()
        values[1, 3] = math.nan
        assert stay_apart(bodies, MARGIN) and ever(bodies)
        bodies = bodies._replace(**{name: values})
        assert not stay_apart(bodies, MARGIN) and not ever(bodies)


def test_bodies_without_moments_move_on_straight_paths():
    """Dipoles among grains without moments exert no force: bodies that pass each other are apart."""
    with pytest.warns(UserWarning, match="no grain has a magnetic moment"):
        passing = pair([4 * R, 3 * R, 0], [-1, 0, 0], [sand.Dipoles()])
    assert cannot_touch(passing, np.arange(2)) == "the paths of the bodies are straight and do not meet"
    assert not cannot_touch(pair([4 * R, 3 * R, 0], [-1, 0, 0], [sand.Dipoles()], 1e-17), np.arange(2))


@pytest.mark.parametrize("forces", [[], [sand.Dipoles()]])
def test_memory_does_not_grow_with_pairs(forces):
    """Four thousand fragments that all recede: a fraction of a byte for each of the 8 million pairs."""
    count = 4000
    place = 4.0 * R * (np.stack(np.meshgrid(*[np.arange(16.0)] * 3), axis=-1).reshape(-1, 3)[:count] - 7.5)
    grains = sand.Grains(place, R, "silica", velocity=place / R, moment=[1e-20, 0, 0])
    simulation, labels = sand.Simulation(grains, [sand.Contact(), *forces]), np.arange(count)
    assert cannot_touch(simulation, labels)  # compiles
    tracemalloc.start()
    try:
        assert cannot_touch(simulation, labels)
        assert tracemalloc.get_traced_memory()[1] < 4e6
    finally:
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
