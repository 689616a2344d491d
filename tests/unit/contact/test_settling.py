"""Settling: the motion of grains relative to the rigid motion of their cluster decays, momenta are kept."""

import math

import numpy as np
import pytest

import sand
from sand.analysis.body_motion import internal_kinetic_energy
from sand.analysis.clusters import cluster_labels, unwrapped
from sand.basics.arrays import cluster_arrays, empty_contact_arrays
from sand.basics.box import Box
from sand.basics.state import CONTACTS, COUNT
from sand.contact.gather import resort_contacts_by_grain
from sand.contact.settling import settle_clusters, solve_symmetric

BOX = Box.periodic(1e-6)
RING = [(0, 1), (1, 2), (2, 3), (3, 4), (5, 4), (5, 0)]
TREE = [(6, 7), (8, 7), (7, 9), (9, 10), (10, 11), (12, 9)]
PAIRS = np.array([*RING, *TREE, (14, 15)])
"""A ring, a branched cluster, a single grain 13 and a pair."""
COUNT_OF_GRAINS = 16


def moving_clusters(seed=2):
    """Unequal grains across the boundaries, with random velocities and spins, and a common velocity of 30 m/s."""
    rng = np.random.default_rng(seed)
    angle = np.arange(6) * math.pi / 3
    ring = 2e-8 * np.array([np.cos(angle), np.sin(angle), 0.3 * np.cos(3 * angle)]).T + [0.5e-6, 0.49e-6, 0.0]
    directions = {7: (6, [1, 0, 0]), 8: (7, [0, 1, 0.2]), 9: (7, [0.9, -0.3, 0.3]), 10: (9, [0.8, 0, 0.6])}
    directions |= {11: (10, [1, 0, 0]), 12: (9, [0, -1, 0])}
    position = np.concatenate([ring, np.tile([0.47e-6, -0.2e-6, 0.49e-6], (10, 1))])
    for j, (i, direction) in directions.items():
        position[j] = position[i] + 2e-8 * np.array(direction)
    position[13:] = [[0, 0, 0], [0, 0.2e-6, 0.495e-6], [0, 0.2e-6, 0.515e-6]]
    velocity, spin = 30.0 + rng.normal(size=(COUNT_OF_GRAINS, 3)), 1e8 * rng.normal(size=(COUNT_OF_GRAINS, 3))
    radius = rng.uniform(0.8e-8, 1.2e-8, COUNT_OF_GRAINS)
    return sand.Grains(BOX.wrap(position), radius, sand.IRON, velocity=velocity, spin=spin)


def settled(grains, part, *, pairs=PAIRS, formed=0.0, since=0.0):
    """Grains after one application, and the energy removed [J]."""
    after = grains.copy()
    contacts, count = empty_contact_arrays(COUNT_OF_GRAINS, len(pairs), 15), np.zeros(len(COUNT), np.int64)
    contacts.pair[:, : len(pairs)], count[CONTACTS], contacts.formed[: len(pairs)] = pairs.T, len(pairs), formed
    resort_contacts_by_grain.function(after.arrays, contacts, count)
    memory = cluster_arrays(COUNT_OF_GRAINS)
    return after, settle_clusters(after.arrays, contacts, memory, BOX.span, since, part)


def momenta_of(grains, pairs=PAIRS):
    """Momentum and angular momentum about its first grain of each cluster, spins included."""
    labels, position = cluster_labels(len(grains), pairs), unwrapped(grains.position, pairs, BOX)
    rows = []
    for k in range(labels.max() + 1):
        of = labels == k
        p, s = grains.mass[of, None] * grains.velocity[of], position[of] - position[of][0]
        rows.append([p.sum(axis=0), (np.cross(s, p) + grains.inertia[of, None] * grains.spin[of]).sum(axis=0)])
    return np.array(rows)


def test_momenta_of_every_cluster_are_kept_to_rounding():
    """P and L of ring, tree and pair across boundaries change by less than 1e-14 of Σ m|v| and of 3e-8 m times it.

    One application leaves rounding of some 1e-16 of each grain's momentum; 16 grains and six operations each.
    """
    grains = moving_clusters()
    before, after = momenta_of(grains), momenta_of(settled(grains, 0.3)[0])
    scale = (grains.mass * np.linalg.norm(grains.velocity, axis=1)).sum()
    assert np.abs(after - before)[:, 0].max() < 1e-14 * scale
    assert np.abs(after - before)[:, 1].max() < 1e-14 * 3e-8 * scale


def test_the_energy_removed_is_the_internal_energy_times_its_decay():
    """K_int falls by e^(−2t/τ) = (1 − part)²; what is removed is K_int [1 − (1 − part)²].

    Rounding: 1e-16 of the kinetic energy of a common velocity of 50 m/s, some 1e3 times the internal one.
    """
    grains = moving_clusters()
    internal, _ = internal_kinetic_energy(grains, PAIRS, BOX)
    assert np.count_nonzero(internal) == 3
    for part in (0.05, 0.5, 1.0):
        after, removed = settled(grains, part)
        left, _ = internal_kinetic_energy(after, PAIRS, BOX)
        assert left == pytest.approx((1 - part) ** 2 * internal, rel=1e-9, abs=1e-12 * internal.max())
        assert removed == pytest.approx((1 - (1 - part) ** 2) * internal.sum(), rel=1e-9, abs=0.0)


def test_rigid_motion_and_single_grains_do_not_change():
    """v = V + Ω×x, ω = Ω: changes below 1e-13 of the speeds; the single grain keeps every bit; nothing is removed."""
    grains = moving_clusters()
    after, _ = settled(grains, 0.5)
    assert (after.velocity[13] == grains.velocity[13]).all() and (after.spin[13] == grains.spin[13]).all()
    turning, whole = 1e8 * np.array([1.0, -2.0, 0.5]), unwrapped(grains.position, PAIRS, BOX)
    rigid = sand.Grains(
        grains.position, grains.radius, sand.IRON,
        velocity=np.array([3.0, -1.0, 2.0]) + np.cross(turning, whole), spin=np.tile(turning, (COUNT_OF_GRAINS, 1)),
    )  # fmt: skip
    after, removed = settled(rigid, 0.5)
    assert np.abs(after.velocity - rigid.velocity).max() < 1e-13 * np.abs(rigid.velocity).max()
    assert np.abs(after.spin - rigid.spin).max() < 1e-13 * 2e8
    assert abs(removed) < 1e-13 * 0.5 * (grains.mass * (rigid.velocity**2).sum(axis=1)).sum()


def test_contacts_that_formed_since_the_last_application_do_not_connect():
    """With the contact 1–2 of the ring and 9–10 of the tree younger than the last time: as without them."""
    grains, young = moving_clusters(), np.isin(np.arange(len(PAIRS)), [1, 9])
    after, removed = settled(grains, 0.4, formed=np.where(young, 2e-9, 1e-9), since=1e-9)
    expected, without = settled(grains, 0.4, pairs=PAIRS[~young])
    assert after.velocity == pytest.approx(expected.velocity, rel=1e-13, abs=0.0)
    assert removed == pytest.approx(without, rel=1e-12, abs=0.0)
    assert removed < 0.999 * settled(grains, 0.4)[1]  # the pair of grains 10 and 11 no longer moves with the tree


def test_symmetric_equations():
    """A x = b as by NumPy, for tensors of inertia; of a chain with moments of 1 : 1e8 : 1e8 the residual is 1e-15 b."""
    rng = np.random.default_rng(5)
    for slender in (1.0, 1e4):
        s = rng.normal(size=(20, 3)) * [1.0, 1.0 / slender, 1.0 / slender] @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
        a = sum((one @ one) * np.eye(3) - np.outer(one, one) for one in s)
        b = rng.normal(size=3)
        x = np.array(solve_symmetric((a[0, 0], a[1, 1], a[2, 2], a[0, 1], a[0, 2], a[1, 2]), tuple(b)))
        scale = np.linalg.norm(a) * np.linalg.norm(x)
        assert np.abs(a @ x - b).max() < 1e-15 * scale
        if slender == 1.0:
            assert x == pytest.approx(np.linalg.solve(a, b), rel=1e-12, abs=0.0)
