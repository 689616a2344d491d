"""When fragments hold together: expected breaks, relative motion about bridges, and the end of a collision."""

import math

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

import sand
from sand.analysis.body_motion import rigid_motion
from sand.analysis.bridges import SpanningTrees
from sand.analysis.clusters import cluster_labels
from sand.basics.state import BROKEN, CHANGED, MADE, SLID
from sand.contact.jkr import LAW
from sand.contact.law import contact_strength
from sand.experiments.collision import Ending, approach, collide, latest_end, prepare, run_to_end
from sand.experiments.settled import are_settled, expected_breaks, modes_of, springs_of, swing_time, swings
from sand.setup import bpca, chain, grain
from sand.theory import contact

R = 1e-7


def test_strength_of_a_contact():
    """E_break = 1.542585 F_c δ_c and the smaller of the moments 4 F_c ξ_c and k_t φ_c, as in `theory.contact`."""
    numbers, pairing = contact("ice", R, other_radius=3 * R), sand.Contact().pairing(sand.ICE, sand.ICE)
    found = contact_strength(LAW, pairing, R, 3 * R)
    assert found.breaking == pytest.approx(numbers.break_energy, rel=1e-9, abs=0.0)
    assert found.turning == pytest.approx(min(numbers.roll_moment, numbers.twist_moment), rel=1e-9, abs=0.0)


def test_energy_shared_by_modes_at_random():
    """(1 − E_b/E)^(s−1) is the share of the simplex Σ e_k = E on which e_1 > E_b: 10⁶ points, five standard errors."""
    rng, modes, energy = np.random.default_rng(1), 6, 2.5
    first = energy * rng.dirichlet(np.ones(modes), 10**6)[:, 0]
    share = float(expected_breaks(np.array([energy]), np.array([1.0]), np.array([modes]), np.array([1.0]))[0])
    assert share == pytest.approx((first > 1.0).mean(), abs=5 * math.sqrt(share / 10**6))
    # less energy than a contact needs, a pair of grains whose single mode has more, and a single grain
    assert expected_breaks(
        np.array([0.9, 1.1, 0.0]), np.ones(3), np.array([12, 1, 0]), np.array([7, 7, 0])
    ).tolist() == [
        0.0,
        7.0,
        0.0,
    ]


def test_modes_are_at_most_as_many_as_springs():
    """6N − 6 with all springs; 3N − 6 = 6 of a tetrahedron of grains without friction; 1 of a pair."""
    grains, contacts = np.array([1, 2, 4, 5]), np.array([0, 1, 6, 4])
    assert modes_of(grains, contacts, springs_of(sand.Contact())).tolist() == [0, 1, 18, 24]
    smooth = sand.Contact(slide_factor=0, roll_factor=0, twist_factor=0)
    assert modes_of(grains, contacts, springs_of(smooth)).tolist() == [0, 1, 6, 4]
    assert springs_of(sand.Contact(roll_factor=0)) == 4


def at_contact(position, contact, velocity=(0.0, 0.0, 0.0)):
    """Silica grains that touch, a few steps after the start."""
    sim = sand.Simulation(sand.Grains(position, R, "silica", velocity=velocity), [contact])
    sim.run(steps=3)
    assert (cluster_labels(len(position), sim.contacts["pair"]) == 0).all()
    return sim


@pytest.mark.compiled("contacts")
def test_fewer_modes_have_more_energy_each():
    """A tetrahedron that swells with 1.5 E_b holds together as 18 modes share this, not as six of them do."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / math.sqrt(3.0)
    numbers = contact("silica", R)
    edge = math.sqrt(8.0 / 3.0)  # of corners at distance 1
    position = corners * (2.0 * R - numbers.rest_overlap) / edge
    mass = float(grain(radius=R, material="silica").mass[0])
    velocity = corners * math.sqrt(2.0 * 1.5 * numbers.break_energy / (4.0 * mass))
    smooth = sand.Contact(slide_factor=0, roll_factor=0, twist_factor=0)
    for model, settled in ((sand.Contact(), True), (smooth, False)):
        assert are_settled(at_contact(position, model, velocity), np.zeros(4, int)) is settled


def test_time_of_a_swing():
    """Of dΩ/dt = −M/J: it stops at JΩ/M, after the angle E/M, or has turned by a radian at 1/Ω, whichever is first."""
    inertia, moment = 2.0, 3.0
    for energy in (1e-6, 0.3, 1.5, 40.0):
        speed = math.sqrt(2.0 * energy / inertia)
        expected = inertia * speed / moment if energy / moment < 0.5 else 1.0 / speed
        assert swing_time(inertia, energy, moment) == pytest.approx(expected, rel=1e-12, abs=0.0)
    assert swing_time(inertia, 0.5 * moment, moment) == pytest.approx(math.sqrt(inertia / moment), rel=1e-12, abs=0.0)
    assert swing_time(inertia, 0.0, moment) == 0.0


def moving(pairs, position, seed):
    """Grains of three sizes at positions with random velocities and spins."""
    rng = np.random.default_rng(seed)
    count = len(position)
    return sand.Grains(
        position,
        rng.choice([1.0, 1.5, 2.0], count) * 1e-7,
        "ice",
        velocity=rng.normal(size=(count, 3)),
        spin=1e6 * rng.normal(size=(count, 3)),
    )


def energy_of(grains, members, as_rigid):
    """Kinetic energy of some grains, or of the rigid motion with their momenta, by the full equations."""
    m, inertia = grains.mass[members], grains.inertia[members]
    x, v, w = (values[members] for values in (grains.position, grains.velocity, grains.spin))
    if not as_rigid:
        return 0.5 * float((m * (v**2).sum(axis=1)).sum() + (inertia * (w**2).sum(axis=1)).sum())
    centre, momentum = m @ x / m.sum(), m @ v
    s = x - centre
    angular = (m[:, None] * np.cross(s, v)).sum(axis=0) + inertia @ w
    tensor = sum((k * (a @ a) + i) * np.eye(3) - k * np.outer(a, a) for k, a, i in zip(m, s, inertia, strict=True))
    return 0.5 * float(momentum @ momentum / m.sum() + angular @ np.linalg.solve(tensor, angular))


@pytest.mark.compiled("contacts")
def test_motion_of_the_parts_on_both_sides_of_a_bridge():
    """Brute force: without a bridge a body falls in two; energies of the parts as rigid bodies, less that of all.

    K₁ + K₂ − K_rigid of the whole is the energy relative to its rigid motion, because that motion has the momenta of
    the whole: exact, 1e-9 for differences of energies of similar size.
    """
    body = bpca(40, radius=R, material="ice", seed=3)
    pairs = np.argwhere(np.triu(np.linalg.norm(body.position[:, None] - body.position[None], axis=2) < 2.3 * R, 1))
    position = np.vstack((body.position, [[1e-5, 0, 0], [1e-5, 2e-7, 0], [2e-5, 0, 0]]))
    pairs = np.vstack((pairs, [[40, 41]]))  # a pair and a single grain beside the body, which has rings
    grains = moving(pairs, position, 4)
    box = sand.Box.open()
    found = swings(grains, pairs, rigid_motion(grains, pairs, box, cluster_labels(len(grains), pairs)))
    expected = {}
    for c, (i, j) in enumerate(pairs):
        left = np.delete(pairs, c, axis=0)
        graph = coo_array((np.ones(len(left)), (left[:, 0], left[:, 1])), shape=(43, 43))
        label = connected_components(graph, directed=False)[1]
        if label[i] == label[j]:
            continue
        parts = [np.flatnonzero(label == label[k]) for k in (i, j)]
        energy = sum(energy_of(grains, part, True) for part in parts) - energy_of(grains, np.concatenate(parts), True)
        at = position[i] + grains.radius[i] / (grains.radius[i] + grains.radius[j]) * (position[j] - position[i])
        about = [
            float((grains.mass[p] * ((position[p] - at) ** 2).sum(axis=1) + grains.inertia[p]).sum()) for p in parts
        ]
        expected[c] = (about[0] * about[1] / sum(about), energy)
    assert 0 < len(expected) < len(pairs) and sorted(found.contact.tolist()) == sorted(expected)
    for c, inertia, energy in zip(found.contact, found.inertia, found.energy, strict=True):
        assert (inertia, energy) == pytest.approx(expected[int(c)], rel=1e-9, abs=0.0)


def test_bridges_of_random_bodies():
    """Removing a bridge, and no other contact, parts its body; sums below a node are those of the part without its top.

    200 graphs of up to 13 grains in several bodies, by removing each contact in turn.
    """
    rng = np.random.default_rng(1)
    for _ in range(200):
        count = int(rng.integers(1, 14))
        every = np.array([(i, j) for i in range(count) for j in range(i + 1, count)]).reshape(-1, 2)
        pairs = every[rng.permutation(len(every))[: rng.integers(0, count + 3)]]

        def labels(pairs, count=count):
            graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
            return connected_components(graph, directed=False)

        bodies, label = labels(pairs)
        tops = np.array([rng.choice(np.flatnonzero(label == k)) for k in range(bodies)])
        trees = SpanningTrees(count, pairs, tops)
        masses, expected = rng.random(count), {}
        below = trees.over_subtrees(np.add, trees.at_nodes(masses))
        for c in range(len(pairs)):
            parts, apart = labels(np.delete(pairs, c, axis=0))
            if parts > bodies:
                top = tops[label[pairs[c, 0]]]
                end = next(g for g in pairs[c] if apart[g] != apart[top])
                expected[c] = masses[apart == apart[end]].sum()
        found = trees.bridges()
        assert sorted(trees.contact[found].tolist()) == sorted(expected)
        for node in found:
            assert below[node] == pytest.approx(expected[int(trees.contact[node])], rel=1e-12, abs=0.0)


@pytest.mark.compiled("contacts")
def test_times_of_the_last_events():
    """`State.clock` has the time of the last step in which a contact formed or broke, and in which one slipped."""
    start = approach(
        *(chain(n, radius=R, material="silica") for n in (6, 1)), speed=8.0, impact_parameter=0.0, along="y", seed=None
    )
    sim, counts, changed, slid = prepare(start), (0, 0), 0.0, 0.0
    moved = 0
    for _ in range(900):
        sim.run(steps=1)
        state = sim.regular_state
        now = int(state.count[MADE]), int(state.count[BROKEN])
        changed, counts = (sim.time, now) if now != counts else (changed, counts)
        row = int(sim.ledger.rows[-1]["moved"])
        slid, moved = (sim.time, row) if row != moved else (slid, moved)
        assert (state.clock[CHANGED], state.clock[SLID]) == (changed, slid)
    assert 0.0 < changed < sim.time and moved > 0


CHAIN = {"speed": 30.0, "along": "y"}


@pytest.mark.compiled("contacts")
def test_the_end_depends_on_neither_output_nor_interruption():
    """One frame or 500, in one run or in several: the same step, bits and outcome."""
    bodies = bpca(9, radius=R, material="ice", seed=1), bpca(5, radius=R, material="ice", seed=2)
    one, first = collide(*bodies, speed=20.0, impact_parameter="0.3 b", seed=3, frames=1)
    many, second = collide(*bodies, speed=20.0, impact_parameter="0.3 b", seed=3, frames=500)
    assert one.to_dict() == many.to_dict() | {"drift": one.drift}
    assert one.quiet and one.made > 1
    start = approach(*bodies, speed=20.0, impact_parameter="0.3 b", along="x", seed=3)
    third = prepare(start)
    for steps in (170, 333, 1000):
        third.run(steps=steps)
    assert run_to_end(start, third, Ending(frames=7)).fragments == one.fragments
    for other in (second, third):
        assert other.steps == first.steps
        assert other.grains.position.tobytes() == first.grains.position.tobytes()


@pytest.mark.compiled("contacts")
def test_words_and_times_of_the_end():
    """At rest no contact has slipped for long; a run ends at a time given; `frames` sets the number of rows."""
    bodies = chain(7, radius=R, material="silica"), grain(radius=R, material="silica")
    given = CHAIN | {"forces": [sand.Contact(damping="critical")]}
    early, _ = collide(*bodies, **given, frames=30)
    late, _ = collide(*bodies, **given, end="rest")
    assert (early.end, late.end) == ("the fragments are apart and hold together", "contacts no longer change")
    assert early.fragments == late.fragments
    short, sim = collide(*bodies, **CHAIN, end="2 ns", frames=20)
    assert short.time == 2e-9 and not short.quiet and short.end == "stopped before the outcome was decided"
    assert len(sim.ledger) == 21
    start = approach(*bodies, **CHAIN, impact_parameter=0.0, seed=None)
    assert early.time < latest_end(start) and latest_end(start, Ending("2 ns")) == 2e-9


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"end": "soon"}, "end = 'soon' is not a quantity in s.*or give 'outcome' or 'rest'"),
        ({"end": -1.0}, "end = -1.0.*above 0.*or give 'outcome' or 'rest'"),
        ({"frames": 0}, "frames = 0 must be .*1"),
        ({"frames": 2.5}, "frames = 2.5"),
    ],
)
def test_wrong_ends(given, message):
    """One line with the name, before anything runs."""
    with pytest.raises(sand.BadInput, match=message):
        collide(*(grain(radius=R, material="ice") for _ in range(2)), speed=1.0, **given)
