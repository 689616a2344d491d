"""Clusters against brute force."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from sand.analysis.clusters import cluster_labels, cluster_sizes, mean_cluster_size, unwrapped
from sand.core.box import Box


@pytest.mark.parametrize("seed", range(5))
def test_labels_are_the_connected_components(seed):
    """Against SciPy's graph search."""
    rng = np.random.default_rng(seed)
    n, pairs = 200, rng.integers(0, 200, size=(90, 2))
    graph = coo_array((np.ones(90), pairs.T), shape=(n, n))
    count, theirs = connected_components(graph, directed=False)
    ours = cluster_labels(n, pairs)
    assert ours.max() + 1 == count
    assert len({(a, b) for a, b in zip(ours, theirs, strict=True)}) == count


def test_two_contacts_are_two_rows():
    """Exactly two contacts: (2, 2) rows are contacts, never columns."""
    assert cluster_labels(4, np.array([[0, 1], [2, 3]])).tolist() == [0, 0, 1, 1]


def test_mean_cluster_size():
    """Eq. 17 by hand: sizes 3, 1, 1 give (9+1+1)/5; nobody touching gives 1."""
    labels = cluster_labels(5, np.array([[0, 1], [1, 2]]))
    assert cluster_sizes(labels).tolist() == [3, 1, 1]
    assert mean_cluster_size(labels) == pytest.approx(11 / 5, rel=1e-6, abs=0.0)
    assert mean_cluster_size(cluster_labels(4, np.zeros((0, 2), int))) == 1.0


def test_clusters_are_made_whole():
    """A chain across a face comes out straight."""
    box = Box.periodic(10.0)
    chain = np.array([[3.5, 0, 0], [4.5, 0, 0], [5.5, 0, 0], [6.5, 0, 0]])
    cut = box.wrap(chain)
    assert cut[2, 0] < 0
    whole = unwrapped(cut, np.array([[0, 1], [1, 2], [2, 3]]), box)
    assert whole == pytest.approx(chain, rel=1e-6, abs=0.0)
