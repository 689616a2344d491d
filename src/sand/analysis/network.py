"""How grains hang together: ends, junctions, rings, chains."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from .clusters import cluster_labels
from .shape import coordination


class Network(NamedTuple):
    """Of one aggregate."""

    ends: int  # grains with one contact
    junctions: int  # grains with three or more
    rings: int  # independent closed loops, C − N + 1
    longest: int  # grains on the longest of all shortest ways from grain to grain
    chains: np.ndarray  # grains of each piece without junctions, ends and links included, largest first
    coordination: float  # mean number of contacts of a grain


def network(count: int, pairs: np.ndarray) -> Network:
    """Ends, junctions, rings and chains of one aggregate.

    Parameters
    ----------
    count : int
        grains N ≥ 1, all connected.
    pairs : ndarray
        contacts (C, 2), each once.

    `longest` is exact for trees, and the way between two far ends (found by two searches) where there are rings.
    """
    ends = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    held = coordination(count, ends)
    inside = (held[ends] <= 2).all(axis=1)
    pieces = cluster_labels(count, ends[inside])
    lengths = np.bincount(pieces[held <= 2], minlength=1)
    return Network(
        int((held == 1).sum()),
        int((held >= 3).sum()),
        int(len(ends) - count + connected_components(_graph(count, ends), directed=False)[0]),
        _longest(count, ends),
        np.sort(lengths[lengths > 0])[::-1],
        float(held.mean()),
    )


def _graph(count: int, ends: np.ndarray) -> coo_array:
    return coo_array((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(count, count)).tocsr()


def _longest(count: int, ends: np.ndarray) -> int:
    """The farthest grain from the farthest grain from any grain; in grains."""
    graph, at = _graph(count, ends), 0
    steps = np.zeros(count, dtype=int)
    for _ in range(2):
        order, before = breadth_first_order(graph, at, directed=False)
        steps[at] = 0
        for grain in order[1:]:
            steps[grain] = steps[before[grain]] + 1
        at = int(order[-1])
    return int(steps[at]) + 1
