"""Persistent names of clusters: a growing aggregate keeps its name from frame to frame."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..basics.errors import BadInput
from .clusters import cluster_labels

SINGLE = 0xFFFFFFFF
"""Name of a grain without contacts."""
CHECKPOINTS = 64 * 2**20
"""Approximate memory for the names kept by a `Lineage` [bytes]."""


def inherit_names(before: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Name the clusters of a frame after the names of their grains in the frame before.

    A cluster claims the most frequent name of its grains, the lower one in a tie. If several clusters claim a name,
    the one with most grains of that name keeps it, in a tie the one with the lowest grain. All others get a new name:
    the index of their lowest grain, or the lowest number that is not in use in either frame.

    Parameters
    ----------
    before : ndarray
        Names (N,) uint32, `SINGLE` for grains without contacts.
    labels : ndarray
        Cluster of each grain now (N,), 0…K−1, numbered by their lowest grain.

    Returns
    -------
    ndarray
        Names (N,) uint32 below N, `SINGLE` for grains without contacts.
    """
    count = len(labels)
    sizes = np.bincount(labels)
    of_cluster = np.full(len(sizes), SINGLE, dtype=np.int64)
    voting = (sizes[labels] > 1) & (before != SINGLE)
    if voting.any():
        keys, votes = np.unique(labels[voting].astype(np.int64) * count + before[voting], return_counts=True)
        cluster, name = keys // count, keys % count
        claims = _first(cluster, np.lexsort((name, -votes, cluster)))  # the name that each cluster claims
        cluster, name, votes = cluster[claims], name[claims], votes[claims]
        kept = _first(name, np.lexsort((cluster, -votes, name)))  # the cluster that keeps each name
        of_cluster[cluster[kept]] = name[kept]
    new = np.flatnonzero((sizes > 1) & (of_cluster == SINGLE))
    if new.size:
        of_cluster[new] = _new_names(before, labels, of_cluster, new)
    return of_cluster[labels].astype(np.uint32)


def _first(group: np.ndarray, order: np.ndarray) -> np.ndarray:
    """First element of each group, in an order that keeps groups contiguous."""
    head = np.ones(len(order), dtype=bool)
    head[1:] = group[order][1:] != group[order][:-1]
    return order[head]


def _new_names(before: np.ndarray, labels: np.ndarray, taken: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Unused names for the clusters `new`; they suffice, because both frames have at most N/2 clusters each."""
    count = len(labels)
    free = np.ones(count, dtype=bool)
    free[before[before != SINGLE]] = False
    free[taken[taken != SINGLE]] = False
    lowest = np.empty(len(taken), dtype=np.int64)
    lowest[labels[::-1]] = np.arange(count)[::-1]  # the last assignment, that of the lowest grain, remains
    names = lowest[new]
    others = ~free[names]
    free[names] = False
    names[others] = np.flatnonzero(free)[: others.sum()]
    return names


class Lineage:
    """Names of the clusters in each frame of a trajectory, propagated from the first frame on.

    Names of a frame depend only on the frames up to it, not on the order of access. They are kept for every m-th
    frame, and m doubles when they take more than `CHECKPOINTS` bytes.

    Parameters
    ----------
    count : int
        Number of grains N.
    pairs : callable
        Returns the contacts (C, 2) of a frame by its index. Frames for which it raises BadInput, or that have other
        grains, keep the names of the frame before.
    """

    def __init__(self, count: int, pairs: Callable[[int], np.ndarray]):
        self.count, self._pairs = count, pairs
        self._every = 1
        self._most = max(CHECKPOINTS // (4 * max(count, 1)), 4)
        self._kept: dict[int, np.ndarray] = {}
        self._at: tuple[int, np.ndarray, np.ndarray] | None = None  # index, contacts, names of the last frame read

    def names(self, frame: int) -> np.ndarray:
        """Names (N,) uint32 of the clusters in a frame ≥ 0, `SINGLE` for grains without contacts."""
        start, pairs, names = self._nearest(frame)
        for number in range(start + 1, frame + 1):
            now = self._readable(number)
            if now is not None and (pairs is None or not np.array_equal(now, pairs)):
                names = inherit_names(names, cluster_labels(self.count, now))
            pairs = pairs if now is None else now
            self._keep(number, names)
        if pairs is not None:
            self._at = (frame, pairs, names)
        return names

    def _readable(self, number: int) -> np.ndarray | None:
        """Contacts of a frame; None if they cannot be read."""
        try:
            pairs = self._pairs(number)
        except BadInput:
            return None
        return pairs if pairs.size == 0 or int(pairs.max()) < self.count else None

    def _nearest(self, frame: int) -> tuple[int, np.ndarray | None, np.ndarray]:
        """Index, contacts (if known) and names of the last frame up to this one whose names are known."""
        kept = max((k for k in self._kept if k <= frame), default=-1)
        if self._at is not None and kept <= self._at[0] <= frame:
            return self._at
        if kept < 0:
            return -1, None, np.full(self.count, SINGLE, dtype=np.uint32)
        return kept, None, self._kept[kept]

    def _keep(self, number: int, names: np.ndarray) -> None:
        if number % self._every == 0:
            self._kept[number] = names
        while len(self._kept) > self._most:
            self._every *= 2
            self._kept = {k: v for k, v in self._kept.items() if k % self._every == 0}
