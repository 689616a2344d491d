"""Clusters: grains connected by contacts."""

from __future__ import annotations

import numpy as np

from ..arguments import checked
from ..box import Box
from ..errors import BadInput

FEW = 200
"""Grains and contacts together that are followed one by one sooner than SciPy makes its graph (130 µs)."""


@checked
def cluster_labels(count: int, pairs: np.ndarray) -> np.ndarray:
    """The cluster each grain belongs to, numbered by their lowest grain.

    Parameters
    ----------
    count : int
        number of grains N.
    pairs : ndarray
        contacts, (C, 2) grain numbers.

    Returns
    -------
    ndarray
        (N,) integers 0…K−1.
    """
    ends = np.asarray(pairs, dtype=np.int64)
    if ends.size % 2:
        raise BadInput(f"pairs has shape {ends.shape} but must be (C, 2): two grains for each contact")
    ends = ends.reshape(-1, 2)
    if len(ends) and not 0 <= ends.min() <= ends.max() < count:
        raise BadInput(f"pairs name grains from {ends.min()} to {ends.max()}; there are {count}, 0 to {count - 1}")
    if not len(ends):
        return np.arange(count)  # a gas need not wait for SciPy's graphs, which take long to load
    if count + len(ends) <= FEW:
        return _followed(count, ends)

    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _followed(count: int, ends: np.ndarray) -> np.ndarray:
    """The same, contact by contact: two clusters that meet go by the lowest grain of both."""
    lower = list(range(count))

    def lowest(grain: int) -> int:
        while lower[grain] != grain:
            grain = lower[grain]
        return grain

    for one, other in ends.tolist():
        a, b = lowest(one), lowest(other)
        lower[max(a, b)] = min(a, b)
    numbers: dict[int, int] = {}
    return np.array([numbers.setdefault(lowest(grain), len(numbers)) for grain in range(count)], dtype=np.int64)


@checked
def cluster_sizes(labels: np.ndarray) -> np.ndarray:
    """Number of grains of each cluster, (K,)."""
    return np.bincount(labels)


@checked
def mean_cluster_size(labels: np.ndarray) -> float:
    """S = Σ s² n_s / Σ s n_s (Eq. 17): the size of the cluster of a grain picked at random."""
    sizes = cluster_sizes(labels).astype(np.float64)
    return float((sizes**2).sum() / sizes.sum())


@checked
def unwrapped(position: np.ndarray, pairs: np.ndarray, box: Box) -> np.ndarray:
    """Positions (N, 3) [m] in which clusters are whole, not cut by the faces of a periodic box.

    Each cluster keeps the image of its lowest grain; the others follow along their contacts.
    """
    count = len(position)
    neighbours: list[list[int]] = [[] for _ in range(count)]
    for a, b in np.asarray(pairs, dtype=np.int64).reshape(-1, 2).tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    whole = np.array(position, dtype=np.float64)
    seen = np.zeros(count, dtype=bool)
    for start in range(count):
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


def aggregate_moments(moment: np.ndarray, labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vector sums (K, 3) [A m²] of the moments of each cluster, and their alignment |Σμ|/Σ|μ| (K,), 0 without moments.

    Parameters
    ----------
    moment : ndarray
        (N, 3) [A m²].
    labels : ndarray
        cluster of each grain (N,), 0…K−1.
    """
    mu = np.asarray(moment, float)
    sums = np.column_stack([np.bincount(labels, mu[:, axis]) for axis in range(3)])
    sizes = np.bincount(labels, np.linalg.norm(mu, axis=1))
    with np.errstate(invalid="ignore"):
        return sums, np.where(sizes > 0.0, np.linalg.norm(sums, axis=1) / sizes, 0.0)
