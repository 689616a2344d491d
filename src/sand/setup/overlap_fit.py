"""Positions that give pairs of grains wanted overlaps: smallest displacements, by least squares."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..basics.box import Box

APART = 1e-9
"""Gap, in mean radii, given to pairs without a contact that would overlap."""
ITERATIONS = 30
CONVERGED = 1e-12
"""Largest displacement of a step, in mean radii, at which the least-squares fit has converged."""


class Fit(NamedTuple):
    """Positions after a fit of overlaps."""

    position: np.ndarray  # (N, 3) [m]
    moved: float  # largest displacement [m]
    residue: float  # largest difference of an overlap from the wanted one [m]


def fit_overlaps(position: np.ndarray, radius: np.ndarray, box: Box, pair: np.ndarray, overlap: np.ndarray) -> Fit:
    """Move grains so that the overlaps of pairs come as close to the wanted ones as possible.

    Gauss–Newton iteration for the least sum of squares of the differences; of all such positions those with the
    smallest displacements. In a cluster without rings all overlaps are met. Other pairs that would come to overlap are
    separated.

    Parameters
    ----------
    position, radius : ndarray
        (N, 3) and (N,) [m].
    box : Box
        Boundary conditions.
    pair, overlap : ndarray
        (C, 2) and (C,) [m] of the pairs in contact.
    """
    unit = float(radius.mean())
    size, scaled = radius / unit, scaled_box(box, unit)
    x = initial = position / unit
    known = set(map(tuple, np.sort(pair, axis=1).tolist()))
    parted = np.zeros((0, 2), dtype=np.int64)
    target = size[pair].sum(axis=1) - overlap / unit
    for _ in range(ITERATIONS):
        fresh = [p for p in overlapping(x, size, scaled) if p not in known]
        known |= set(fresh)
        parted = np.concatenate([parted, np.array(fresh, dtype=np.int64).reshape(-1, 2)])
        constrained = np.concatenate([pair, parted])
        lacking, n = deficit(x, constrained, np.concatenate([target, size[parted].sum(axis=1)]), scaled)
        free = np.arange(len(lacking)) >= len(pair)
        use = ~free | (lacking >= 0.0)
        lacking = np.where(free, lacking + APART, lacking)
        shift = least_shift(constrained[use], n[use], lacking[use], len(x))
        x = x + shift
        if not len(pair) or np.abs(shift).max() <= CONVERGED:
            break
    left, _ = deficit(x, pair, target, scaled)
    moved = np.linalg.norm(x - initial, axis=1)
    return Fit(x * unit, unit * float(moved.max()), unit * float(np.abs(left).max(initial=0.0)))


def scaled_box(box: Box, unit: float) -> Box:
    """The box with lengths in `unit` [m]."""
    x, y, z = (None if v is None else v / unit for v in box.lengths)
    return Box((x, y, z), box.tilt / unit)


def deficit(place: np.ndarray, pair: np.ndarray, wanted: np.ndarray, box: Box) -> tuple[np.ndarray, np.ndarray]:
    """Deficit of each pair's distance (C,), and its direction (C, 3)."""
    apart = box.nearest(place[pair[:, 0]] - place[pair[:, 1]])
    distance = np.linalg.norm(apart, axis=1)
    return wanted - distance, apart / distance[:, None]


def overlapping(place: np.ndarray, size: np.ndarray, box: Box) -> list[tuple[int, int]]:
    """Pairs of spheres that touch."""
    pairs = box.close_pairs(place, 2.0 * float(size.max()))
    apart = np.linalg.norm(box.nearest(place[pairs[:, 0]] - place[pairs[:, 1]]), axis=1)
    return [(int(i), int(j)) for i, j in pairs[apart <= size[pairs].sum(axis=1)]]


def least_shift(pair: np.ndarray, n: np.ndarray, lacking: np.ndarray, count: int) -> np.ndarray:
    """Smallest displacements (N, 3) that compensate the deficit of each distance to first order."""
    from scipy.sparse import csr_array
    from scipy.sparse.linalg import lsqr

    rows = np.repeat(np.arange(len(pair)), 6)
    columns = (3 * pair[:, :, None] + np.arange(3)).reshape(-1)
    jacobian = csr_array((np.stack([n, -n], axis=1).reshape(-1), (rows, columns)), shape=(len(pair), 3 * count))
    return lsqr(jacobian, lacking, atol=1e-12, btol=1e-12)[0].reshape(count, 3)
