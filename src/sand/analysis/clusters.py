"""Clusters, the connected components of the contact graph."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arguments import MOST_GRAINS, checked
from ..box import Box
from ..errors import BadInput, shown
from ..units import whole_number

FEW = 200
"""Grains plus contacts up to which a disjoint-set forest in Python is faster than SciPy's graph (130 µs)."""


def checked_pairs(count: int, pairs: Any) -> np.ndarray:
    """Contacts (C, 2) as whole numbers.  Raises BadInput for another shape, and for numbers that are no grain's."""
    ends = np.asarray(pairs)
    if ends.size % 2:
        raise BadInput(f"pairs has shape {ends.shape} but must be (C, 2): two grains for each contact")
    ends = ends.reshape(-1, 2)
    if len(ends) and not 0 <= ends.min() <= ends.max() < count:
        raise BadInput(f"pairs name grains from {ends.min()} to {ends.max()}; there are {count}, 0 to {count - 1}")
    return ends.astype(np.int64, copy=False)


def checked_labels(labels: Any) -> np.ndarray:
    """Cluster of each grain (N,) as whole numbers.  Raises BadInput for anything else."""
    found = np.asarray(labels)
    whole = found.ndim == 1 and found.size and found.dtype.kind in "iu" and found.min() >= 0
    if not whole or found.max() >= MOST_GRAINS:
        raise BadInput(f"labels = {shown(labels)} must be whole numbers (N,) from 0, the cluster of each grain")
    return found


@checked
def cluster_labels(count: int, pairs: np.ndarray) -> np.ndarray:
    """Label the cluster of each grain; clusters are numbered by their lowest grain.

    Parameters
    ----------
    count : int
        Number of grains N.
    pairs : ndarray
        Contacts (C, 2), indices of grains.

    Returns
    -------
    ndarray
        Labels (N,), integers 0…K−1.

    Raises
    ------
    BadInput
        If `pairs` is not (C, 2) or has indices outside 0 … N−1.
    """
    whole_number(count, "count", 0, MOST_GRAINS)
    ends = checked_pairs(count, pairs)
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


@checked
def cluster_sizes(labels: np.ndarray) -> np.ndarray:
    """Number of grains of each cluster (K,)."""
    return np.bincount(checked_labels(labels))


@checked
def mean_cluster_size(labels: np.ndarray) -> float:
    """Mass-weighted mean cluster size S = Σ s² n_s / Σ s n_s (Dominik & Nübold 2002, Eq. 17).

    It is the expected size of the cluster of a randomly chosen grain.
    """
    sizes = cluster_sizes(labels).astype(np.float64)
    return float((sizes**2).sum() / sizes.sum())


@checked
def unwrapped(position: np.ndarray, pairs: np.ndarray, box: Box) -> np.ndarray:
    """Positions (N, 3) [m] with every cluster in one piece across periodic boundaries.

    Parameters
    ----------
    position : ndarray
        (N, 3) [m].
    pairs : ndarray
        Contacts (C, 2).
    box : Box
        Boundary conditions.

    Returns
    -------
    ndarray
        Positions; the lowest grain of each cluster keeps its image.
    """
    whole = np.array(position, dtype=np.float64)
    if whole.ndim != 2 or whole.shape[1] != 3:
        raise BadInput(f"position has shape {whole.shape} but must be (N, 3)")
    count, pairs = len(whole), checked_pairs(len(whole), pairs)
    apart = whole[pairs[:, 1]] - whole[pairs[:, 0]]
    crosses = (box.nearest(apart) != apart).any(axis=1)
    if not crosses.any():
        return whole
    labels = cluster_labels(count, pairs)
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


@checked
def aggregate_moments(moment: np.ndarray, labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Total moment and alignment of each cluster.

    Parameters
    ----------
    moment : ndarray
        (N, 3) [A m²].
    labels : ndarray
        Cluster of each grain (N,), 0…K−1.

    Returns
    -------
    sums : ndarray
        Σμ of each cluster (K, 3) [A m²].
    alignment : ndarray
        |Σμ|/Σ|μ| of each cluster (K,), 0 without moments.
    """
    mu, labels = np.asarray(moment, float), checked_labels(labels)
    if mu.shape != (len(labels), 3):
        raise BadInput(f"moment has shape {mu.shape} but must be (N, 3), with N = {len(labels)} as labels")
    sums = np.column_stack([np.bincount(labels, mu[:, axis]) for axis in range(3)])
    sizes = np.bincount(labels, np.linalg.norm(mu, axis=1))
    with np.errstate(invalid="ignore"):
        return sums, np.where(sizes > 0.0, np.linalg.norm(sums, axis=1) / sizes, 0.0)
