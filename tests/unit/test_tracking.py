"""Names of clusters: they stay while clusters grow, and do not depend on what was asked for before."""

import gc
import time
import weakref

import numpy as np
import pytest

from sand.analysis import tracking as lineage
from sand.analysis.clusters import cluster_labels
from sand.analysis.tracking import SINGLE, Lineage, inherit_names
from sand.errors import BadInput


def names_of(before, count, pairs):
    """Names from contacts."""
    start = np.full(count, SINGLE, np.uint32) if before is None else before
    return inherit_names(start, cluster_labels(count, np.array(pairs).reshape(-1, 2)))


def referee(before, labels):
    """The same by words of the rule, cluster by cluster."""
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


def test_a_cluster_keeps_its_name_while_it_grows():
    """Born with the number of its lowest grain, it keeps that although a lower grain joins."""
    first = names_of(None, 5, [(2, 3)])
    assert first.tolist() == [SINGLE, SINGLE, 2, 2, SINGLE]
    second = names_of(first, 5, [(2, 3), (0, 3), (1, 4)])
    assert second.tolist() == [2, 1, 2, 2, 1]


def test_a_merger_has_the_larger_ones_name():
    """Three grains outvote two; of two that are as many the lower name wins."""
    first = names_of(None, 7, [(0, 1), (2, 3), (3, 4), (5, 6)])
    assert names_of(first, 7, [(0, 1), (2, 3), (3, 4), (1, 2)]).tolist() == [2] * 5 + [SINGLE] * 2
    assert names_of(first, 7, [(0, 1), (5, 6), (1, 5)]).tolist() == [0, 0, SINGLE, SINGLE, SINGLE, 0, 0]


def test_the_larger_part_keeps_the_name():
    """A cluster of five splits into two and three: the three keep its name, the two get one that nobody has or had."""
    first = names_of(None, 6, [(0, 1), (1, 2), (2, 3), (3, 4)])
    assert set(first[:5]) == {0}
    second = names_of(first, 6, [(0, 1), (2, 3), (3, 4)])
    assert second.tolist() == [1, 1, 0, 0, 0, SINGLE]  # 0 is taken: the lowest free number
    assert names_of(second, 6, []).tolist() == [SINGLE] * 6


@pytest.mark.parametrize("seed", range(6))
def test_as_the_rule_says(seed):
    """Random contacts that come and go: the same as cluster by cluster, names unique, random access as in order."""
    rng = np.random.default_rng(seed)
    count, pairs, frames = 40, np.zeros((0, 2), int), []
    for _ in range(60):
        pairs = pairs[rng.random(len(pairs)) > 0.15]
        pairs = np.concatenate([pairs, rng.integers(0, count, (rng.integers(0, 6), 2))])
        frames.append(pairs[pairs[:, 0] != pairs[:, 1]])
    names, expected = np.full(count, SINGLE, np.uint32), []
    for held in frames:
        labels = cluster_labels(count, held)
        want = referee(names, labels)
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


def test_frames_that_cannot_be_read_leave_names_as_they_were():
    """One that raises, and one of grains that are none; in whichever order names are asked for."""
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
    """With room for eight frames no more of the answers stay in memory, and the last one; names stay the same.

    No two frames in a row have the same contacts, so that each answer is an array of its own.
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


def test_unchanged_contacts_cost_nothing(monkeypatch):
    """Frames whose contacts are those of the frame before are not looked at again."""
    calls = []
    monkeypatch.setattr(lineage, "cluster_labels", lambda *a: calls.append(a) or cluster_labels(*a))
    Lineage(4, lambda k: np.array([(0, 1)])).names(50)
    assert len(calls) == 1


def test_many_grains_take_little_time():
    """A hundred thousand grains in a fraction of a second: nothing goes grain by grain."""
    rng = np.random.default_rng(3)
    count = 100_000
    labels = cluster_labels(count, rng.integers(0, count, (60_000, 2)))
    before = inherit_names(np.full(count, SINGLE, np.uint32), labels)
    labels = cluster_labels(count, rng.integers(0, count, (60_000, 2)))
    begun = time.perf_counter()
    inherit_names(before, labels)
    assert time.perf_counter() - begun < 0.5
