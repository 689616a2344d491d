"""Cluster tracking: ids persist while clusters grow and do not depend on the order of requests."""

import gc
import time
import weakref

import numpy as np
import pytest

from sand.analysis import tracking as lineage
from sand.analysis.clusters import cluster_labels
from sand.analysis.tracking import SINGLE, Lineage, inherit_names
from sand.basics.errors import BadInput


def ids_of(before, count, pairs):
    """Cluster ids from contacts."""
    start = np.full(count, SINGLE, np.uint32) if before is None else before
    return inherit_names(start, cluster_labels(count, np.array(pairs).reshape(-1, 2)))


def reference_ids(before, labels):
    """The same rule applied cluster by cluster."""
    count, clusters = len(labels), {}
    for i, label in enumerate(labels):
        clusters.setdefault(int(label), []).append(i)
    claims = {}
    for label, grains in clusters.items():
        had = [int(before[i]) for i in grains if before[i] != SINGLE]
        if len(grains) > 1 and had:
            name = min(set(had), key=lambda n: (-had.count(n), n))
            claims.setdefault(name, []).append((-had.count(name), label))
    names = {min(who)[1]: name for name, who in claims.items()}
    used = {int(n) for n in before if n != SINGLE} | set(names.values())
    new = [label for label in sorted(clusters) if len(clusters[label]) > 1 and label not in names]
    late = []
    for label in new:
        if min(clusters[label]) in used:
            late.append(label)
        else:
            names[label] = min(clusters[label])
    used |= set(names.values())
    for label in late:
        names[label] = min(set(range(count)) - used)
        used.add(names[label])
    return np.array([names.get(int(label), SINGLE) for label in labels], np.uint32)


def test_a_growing_cluster_keeps_its_id():
    """Its first id is its lowest grain; it keeps that although a lower grain joins."""
    first = ids_of(None, 5, [(2, 3)])
    assert first.tolist() == [SINGLE, SINGLE, 2, 2, SINGLE]
    second = ids_of(first, 5, [(2, 3), (0, 3), (1, 4)])
    assert second.tolist() == [2, 1, 2, 2, 1]


def test_a_merger_has_the_id_of_the_larger_cluster():
    """Three grains against two: that of the three; of equal sizes the lower id."""
    first = ids_of(None, 7, [(0, 1), (2, 3), (3, 4), (5, 6)])
    assert ids_of(first, 7, [(0, 1), (2, 3), (3, 4), (1, 2)]).tolist() == [2] * 5 + [SINGLE] * 2
    assert ids_of(first, 7, [(0, 1), (5, 6), (1, 5)]).tolist() == [0, 0, SINGLE, SINGLE, SINGLE, 0, 0]


def test_after_a_split_the_larger_part_keeps_the_id():
    """A cluster of five splits into two and three: the three keep the id, the two get a new one."""
    first = ids_of(None, 6, [(0, 1), (1, 2), (2, 3), (3, 4)])
    assert set(first[:5]) == {0}
    second = ids_of(first, 6, [(0, 1), (2, 3), (3, 4)])
    assert second.tolist() == [1, 1, 0, 0, 0, SINGLE]  # 0 is taken: the lowest free number
    assert ids_of(second, 6, []).tolist() == [SINGLE] * 6


@pytest.mark.parametrize("seed", range(6))
def test_random_contacts_against_the_reference(seed):
    """Random contacts: equal to the rule applied cluster by cluster; ids unique; random access as in order."""
    rng = np.random.default_rng(seed)
    count, pairs, frames = 40, np.zeros((0, 2), int), []
    for _ in range(60):
        pairs = pairs[rng.random(len(pairs)) > 0.15]
        pairs = np.concatenate([pairs, rng.integers(0, count, (rng.integers(0, 6), 2))])
        frames.append(pairs[pairs[:, 0] != pairs[:, 1]])
    names, expected = np.full(count, SINGLE, np.uint32), []
    for held in frames:
        labels = cluster_labels(count, held)
        want = reference_ids(names, labels)
        names = inherit_names(names, labels)
        assert (names == want).all()
        bound = np.bincount(labels)[labels] > 1
        assert ((names != SINGLE) == bound).all()
        assert len(set(zip(labels[bound], names[bound], strict=True))) == len(set(names[bound]))
        assert (names[bound] < count).all()
        expected.append(names)
    walk = Lineage(count, frames.__getitem__)
    for k in [17, 3, 59, 0, 58, *rng.integers(0, 60, 20)]:
        assert (walk.names(int(k)) == expected[int(k)]).all()


def test_unreadable_frames_do_not_change_ids():
    """One frame raises, one has invalid grain indices; requests in any order."""
    bonds = {0: [(0, 1)], 2: [(0, 1), (2, 9)], 3: [(0, 1), (1, 2)]}

    def pairs(number):
        if number not in bonds:
            raise BadInput("damaged")
        return np.array(bonds[number])

    for order in ((0, 1, 2, 3), (3, 2, 1, 0)):
        walk = Lineage(4, pairs)
        names = {k: walk.names(k).tolist() for k in order}
        assert names[0] == names[1] == names[2] == [0, 0, SINGLE, SINGLE] and names[3] == [0, 0, 0, SINGLE]


@pytest.mark.slow
def test_memory_is_bounded(monkeypatch):
    """With room for eight frames no more results stay in memory, and the last one; ids stay the same.

    Contacts differ from frame to frame, so that each result is an array of its own.
    """
    frames = [np.array([(0, 1)] * (k % 2) + [(2, k % 3 + 3)]) for k in range(100)]
    full = Lineage(10, frames.__getitem__)
    monkeypatch.setattr(lineage, "CHECKPOINTS", 8 * 4 * 10)
    small = Lineage(10, frames.__getitem__)
    answers = {one: [weakref.ref(one.names(k)) for k in range(100)] for one in (full, small)}
    gc.collect()
    kept = {one: sum(answer() is not None for answer in answers[one]) for one in (full, small)}
    assert kept[small] <= 8 + 1 < kept[full] == 100
    for k in (99, 50, 98, 1, 75):
        assert (small.names(k) == full.names(k)).all()


def test_unchanged_contacts_are_not_processed_again(monkeypatch):
    """Frames with the contacts of the previous frame reuse its result."""
    calls = []
    monkeypatch.setattr(lineage, "cluster_labels", lambda *a: calls.append(a) or cluster_labels(*a))
    Lineage(4, lambda k: np.array([(0, 1)])).names(50)
    assert len(calls) == 1


def test_many_grains_are_processed_by_vectorised_code():
    """A hundred thousand grains in a fraction of a second."""
    rng = np.random.default_rng(3)
    count = 100_000
    labels = cluster_labels(count, rng.integers(0, count, (60_000, 2)))
    before = inherit_names(np.full(count, SINGLE, np.uint32), labels)
    labels = cluster_labels(count, rng.integers(0, count, (60_000, 2)))
    begun = time.perf_counter()
    inherit_names(before, labels)
    assert time.perf_counter() - begun < 0.5
