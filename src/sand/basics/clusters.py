"""Connected components of the contact graph, and how they lie across the faces of a box."""

from __future__ import annotations

import numpy as np

from .box import Box

FEW = 200
"""Grains plus contacts up to which a disjoint-set forest in Python is faster than SciPy's graph (130 µs)."""


def labels_of(count: int, ends: np.ndarray) -> np.ndarray:
    """The cluster of each grain (N,), numbered by their lowest grains; pairs (C, 2) are int64, and need no check."""
    if not len(ends):
        return np.arange(count)  # avoids the slow import of SciPy's graphs
    if count + len(ends) <= FEW:
        return _disjoint_sets(count, ends)

    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _disjoint_sets(count: int, ends: np.ndarray) -> np.ndarray:
    """The same with a disjoint-set forest whose roots are the lowest grains."""
    parent = list(range(count))

    def root(grain: int) -> int:
        while parent[grain] != grain:
            grain = parent[grain]
        return grain

    for one, other in ends.tolist():
        a, b = root(one), root(other)
        parent[max(a, b)] = min(a, b)
    labels: dict[int, int] = {}
    return np.array([labels.setdefault(root(grain), len(labels)) for grain in range(count)], dtype=np.int64)


def closes_through_boundary(whole: np.ndarray, pairs: np.ndarray, box: Box) -> np.ndarray:
    """Contacts (C,) whose grains, in clusters that are in one piece, touch across a periodic boundary all the same."""
    return np.asarray(box.image(whole[pairs[:, 1]] - whole[pairs[:, 0]]).any(axis=1))


def in_one_piece(whole: np.ndarray, pairs: np.ndarray, box: Box, labels: np.ndarray | None = None) -> np.ndarray:
    """Positions (N, 3) with every cluster in one piece, in place; labels of the clusters if they are known.

    The lowest grain of each cluster keeps its image; pairs (C, 2) are int64, and need no check.
    """
    count = len(whole)
    apart = whole[pairs[:, 1]] - whole[pairs[:, 0]]
    crosses = (box.nearest(apart) != apart).any(axis=1)
    if not crosses.any():
        return whole
    labels = labels_of(count, pairs) if labels is None else labels
    divided = np.isin(labels, labels[pairs[crosses, 0]])  # grains of clusters that cross a boundary
    neighbours: list[list[int]] = [[] for _ in range(count)]
    for a, b in pairs[divided[pairs[:, 0]]].tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    seen = np.zeros(count, dtype=bool)
    for start in np.flatnonzero(divided).tolist():
        if seen[start]:
            continue
        seen[start] = True
        queue = [start]
        while queue:
            i = queue.pop()
            for j in neighbours[i]:
                if not seen[j]:
                    seen[j] = True
                    whole[j] = whole[i] + box.nearest(whole[j] - whole[i])
                    queue.append(j)
    return whole
