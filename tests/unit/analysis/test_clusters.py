"""Clusters against brute force."""

import itertools

import numpy as np
import pytest

from sand.analysis.clusters import cluster_labels, cluster_sizes, mean_cluster_size, percolation_axes, unwrapped
from sand.basics.box import Box
from sand.basics.clusters import FEW


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("n", "contacts"), [(200, 90), (3, 2), (40, 12), (40, 35), (110, FEW - 110), (110, FEW - 109)])
def test_labels_against_flood_fill(seed, n, contacts):
    """Flood fill from each grain; clusters are labelled by their lowest grain."""
    rng = np.random.default_rng(seed)
    pairs = rng.integers(0, n, size=(contacts, 2))
    labels, number = np.full(n, -1), 0
    for start in range(n):
        if labels[start] < 0:
            flooded = {start}
            while True:
                wet = {b for a, b in pairs.tolist() if a in flooded} | {a for a, b in pairs.tolist() if b in flooded}
                if wet <= flooded:
                    break
                flooded |= wet
            labels[list(flooded)] = number
            number += 1
    assert cluster_labels(n, pairs).tolist() == labels.tolist()


def test_two_contacts_are_two_rows():
    """Exactly two contacts: the (2, 2) array is rows of contacts, never columns."""
    assert cluster_labels(4, np.array([[0, 1], [2, 3]])).tolist() == [0, 0, 1, 1]


def test_mean_cluster_size():
    """Eq. 17 by hand: sizes 3, 1, 1 give (9+1+1)/5; without contacts 1."""
    labels = cluster_labels(5, np.array([[0, 1], [1, 2]]))
    assert cluster_sizes(labels).tolist() == [3, 1, 1]
    assert mean_cluster_size(labels) == pytest.approx(11 / 5, rel=1e-6, abs=0.0)
    assert mean_cluster_size(cluster_labels(4, np.zeros((0, 2), int))) == 1.0


def test_clusters_are_made_whole():
    """A chain across a periodic face becomes straight."""
    box = Box.periodic(10.0)
    chain = np.array([[3.5, 0, 0], [4.5, 0, 0], [5.5, 0, 0], [6.5, 0, 0]])
    cut = box.wrap(chain)
    assert cut[2, 0] < 0
    whole = unwrapped(cut, np.array([[0, 1], [1, 2], [2, 3]]), box)
    assert whole == pytest.approx(chain, rel=1e-6, abs=0.0)


def inverse(lengths):
    """1/L of each axis, 0 of an open one, whose length is 0."""
    return np.divide(1.0, lengths, out=np.zeros(3), where=lengths > 0)


def axes_by_images(position, pairs, lengths, reach=2):
    """Axes (N, 3) along which each grain is connected to an image of itself, by a flood over images of the box."""
    count = len(position)
    shift = np.rint((position[pairs[:, 1]] - position[pairs[:, 0]]) * inverse(lengths)).astype(int)
    links = {grain: [] for grain in range(count)}
    for (i, j), (a, b, c) in zip(pairs.tolist(), shift.tolist(), strict=True):
        links[i].append((j, (-a, -b, -c)))  # the image of j that is nearest to i lies by −shift
        links[j].append((i, (a, b, c)))
    found = np.zeros((count, 3), bool)
    for start in range(count):
        seen, queue = {(start, (0, 0, 0))}, [(start, (0, 0, 0))]
        while queue:
            grain, image = queue.pop()
            for other, step in links[grain]:
                reached = other, tuple(k + d for k, d in zip(image, step, strict=True))
                if max(map(abs, reached[1])) <= reach and reached not in seen:
                    seen.add(reached)
                    queue.append(reached)
        for grain, image in seen:
            if grain == start:
                found[start] |= np.array(image) != 0
    return found


def axes_by_union_find(position, pairs, lengths):
    """The same by a disjoint-set forest in which each grain knows the image in which it is connected to its root."""
    parent, image = list(range(len(position))), [np.zeros(3, int) for _ in position]

    def root(grain):
        if parent[grain] == grain:
            return grain, np.zeros(3, int)
        top, offset = root(parent[grain])
        return top, offset + image[grain]

    shift = np.rint((position[pairs[:, 1]] - position[pairs[:, 0]]) * inverse(lengths)).astype(int)
    closed = []
    for (i, j), step in zip(pairs.tolist(), -shift, strict=True):
        (a, of_i), (b, of_j) = root(i), root(j)
        if a == b:
            closed.append((a, of_i + step - of_j))
        else:  # j in the image of_i + step of the cell of i
            parent[b], image[b] = a, of_i + step - of_j
    found = np.zeros((len(position), 3), bool)
    for top, winding in closed:
        members = [grain for grain in range(len(position)) if root(grain)[0] == root(top)[0]]
        found[members] |= winding != 0
    return found


@pytest.mark.parametrize("lengths", [(10.0, 7.0, 8.0), (10.0, 7.0, None), (7.0, None, None)])
def test_percolation_axes_by_two_roads(lengths):
    """A cluster percolates along an axis if a grain is connected to an image of itself displaced along it.

    Once by a flood over images of the box, once by a union–find whose sets know by which image their grains are
    connected; both follow the definition, and neither makes clusters whole as the function does.
    """
    rng, seen = np.random.default_rng(3), []
    box, sides = Box.periodic(*lengths), np.array([length or 0.0 for length in lengths])
    for _ in range(25):
        position = rng.uniform(-0.5, 0.5, (14, 3)) * np.where(sides > 0, sides, 3.0)
        pairs = box.close_pairs(position, rng.uniform(2.0, 3.4))
        found = percolation_axes(position, pairs, box)[cluster_labels(14, pairs)]
        assert found.tolist() == axes_by_images(position, pairs, sides).tolist()
        assert found.tolist() == axes_by_union_find(position, pairs, sides).tolist()
        seen += found.any(axis=0).tolist()
    periodic = sum(length is not None for length in lengths)
    assert 3 < sum(seen) < 25 * periodic


def test_a_rod_percolates_along_its_axis():
    """Rods through the box along each axis, and one along a diagonal, which percolates along both its axes."""
    along = np.arange(-4.0, 5.0, 2.0)
    ring = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [4, 0]])
    for axis, diagonal in itertools.product(range(3), (False, True)):
        rod = np.zeros((5, 3))
        rod[:, axis] = along
        if diagonal:
            rod[:, (axis + 1) % 3] = along
        expected = [k == axis or (diagonal and k == (axis + 1) % 3) for k in range(3)]
        assert percolation_axes(rod, ring, Box.periodic(10.0)).tolist() == [expected]
        assert percolation_axes(rod, ring[:4], Box.periodic(10.0)).tolist() == [[False] * 3]
        assert percolation_axes(rod, ring, Box.open()).tolist() == [[False] * 3]
