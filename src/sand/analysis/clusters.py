"""Clusters, the connected components of the contact graph."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..basics.arguments import MOST_GRAINS, checked
from ..basics.box import Box
from ..basics.clusters import closes_through_boundary, in_one_piece, labels_of
from ..basics.errors import BadInput, shown
from ..basics.units import whole_number


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
    if found.shape == (0,):
        return found.astype(np.int64)
    whole = found.ndim == 1 and found.dtype.kind in "iu" and found.min() >= 0
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
    return labels_of(count, checked_pairs(count, pairs))


@checked
def cluster_sizes(labels: np.ndarray) -> np.ndarray:
    """Number of grains of each cluster (K,)."""
    return np.bincount(checked_labels(labels))


@checked
def mean_cluster_size(labels: np.ndarray) -> float:
    """Mass-weighted mean cluster size S = Σ s² n_s / Σ s n_s (Dominik & Nübold 2002, Eq. 17).

    It is the expected size of the cluster of a randomly chosen grain.

    Raises
    ------
    BadInput
        If `labels` are not whole numbers from 0, or there are none.
    """
    sizes = cluster_sizes(labels)
    if not sizes.size:
        raise BadInput("labels = [] has no grain, and no grains have no mean cluster size")
    return mean_size(sizes)


def mean_size(sizes: np.ndarray) -> float:
    """The same from the number of grains of each cluster (K,)."""
    numbers = sizes.astype(np.float64)
    return float((numbers**2).sum() / numbers.sum())


@checked
def unwrapped(position: np.ndarray, pairs: np.ndarray, box: Box, refuse_percolating: bool = False) -> np.ndarray:
    """Positions (N, 3) [m] with every cluster in one piece across periodic boundaries.

    Parameters
    ----------
    position : ndarray
        (N, 3) [m].
    pairs : ndarray
        Contacts (C, 2).
    box : Box
        Boundary conditions.
    refuse_percolating : bool, optional
        Refuse percolating clusters: these have no extent, and `gyration_radius` of their positions means nothing.

    Returns
    -------
    ndarray
        Positions; the lowest grain of each cluster keeps its image.

    Raises
    ------
    BadInput
        If a cluster percolates and `refuse_percolating` is given.
    """
    whole = np.array(position, dtype=np.float64)
    if whole.ndim != 2 or whole.shape[1] != 3:
        raise BadInput(f"position has shape {whole.shape} but must be (N, 3)")
    ends = checked_pairs(len(whole), pairs)
    whole = in_one_piece(whole, ends, box)
    if refuse_percolating and (found := closes_through_boundary(whole, ends, box)).any():
        grain = ends[found][0, 0]
        raise BadInput(
            f"the cluster of grain {grain} touches its own periodic image: it has no size, radius of gyration or "
            "fractal dimension"
        )
    return whole


@checked
def percolating_clusters(position: np.ndarray, pairs: np.ndarray, box: Box) -> np.ndarray:
    """Which clusters (K,) percolate: a path along contacts leads from a grain to its own periodic image.

    Such a cluster is infinite in the periodic lattice of boxes, so that it has no radius of gyration.
    `percolation_axes` has the parameters, and says along which axes.
    """
    return np.asarray(percolation_axes(position, pairs, box).any(axis=1))


@checked
def percolation_axes(position: np.ndarray, pairs: np.ndarray, box: Box) -> np.ndarray:
    """Axes (K, 3) along which each cluster percolates, as True and False.

    True where a path along contacts leads from a grain to an image of itself that is displaced along this axis. On a
    path that closes within the box the separations of neighbours (nearest images) add up to 0, on one that percolates
    to multiples of the sides of the box.

    Parameters
    ----------
    position : ndarray
        (N, 3) [m].
    pairs : ndarray
        Contacts (C, 2).
    box : Box
        Boundary conditions.
    """
    ends = checked_pairs(len(position), pairs)
    labels = labels_of(len(position), ends)
    found = np.zeros((labels.max(initial=-1) + 1, 3), dtype=bool)
    crossed = box.image(np.asarray(position)[ends[:, 1]] - np.asarray(position)[ends[:, 0]])
    if crossed.any():
        image = _images(len(position), ends, crossed)
        np.logical_or.at(found, labels[ends[:, 0]], image[ends[:, 0]] - crossed != image[ends[:, 1]])
    return found


def _images(count: int, ends: np.ndarray, crossed: np.ndarray) -> np.ndarray:
    """Images (N, 3) by which grains make their clusters whole, from the lengths (C, 3) by which contacts cross."""
    neighbours: list[list[tuple[int, int, int]]] = [[] for _ in range(count)]
    for k, (a, b) in enumerate(ends.tolist()):
        neighbours[a].append((b, k, -1))
        neighbours[b].append((a, k, 1))
    image, seen, steps = [[0, 0, 0] for _ in range(count)], [False] * count, crossed.tolist()
    for start in range(count):
        queue = [] if seen[start] else [start]
        seen[start] = True
        while queue:
            i = queue.pop()
            for j, k, sign in neighbours[i]:
                if not seen[j]:
                    seen[j], image[j] = True, [n + sign * step for n, step in zip(image[i], steps[k], strict=True)]
                    queue.append(j)
    return np.array(image)


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
