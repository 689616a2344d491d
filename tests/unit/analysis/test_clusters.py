"""Clusters against brute force."""

import numpy as np
import pytest

from sand.analysis.clusters import cluster_labels, cluster_sizes, mean_cluster_size, unwrapped
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
