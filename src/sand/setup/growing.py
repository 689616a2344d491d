"""Work space of the aggregation kernels, and the order in which clusters merge."""

from __future__ import annotations

import numpy as np

from ..errors import BadInput
from ._kernels.hash_grid import EMPTY, GrainSet, HashGrid, table_size

CELL = 3.0
"""Width of the lowest-level cells in radii of the largest grain, so that a grain reaches at most two per axis."""
TRIES = 100_000
"""Largest number of attempts to place a grain, or merge two clusters, with a single contact."""


def empty_hash_grid(grain_set: GrainSet, width: float | None = None) -> HashGrid:
    """Allocate an empty hash grid for all grains.

    Parameters
    ----------
    grain_set : GrainSet
        Properties of the grains.
    width : float, optional
        Width of the lowest-level cells [m]; `CELL` radii of the largest grain by default.
    """
    count = len(grain_set.radius)
    slots = table_size(count, 1 << 40)
    return HashGrid(
        np.full(slots, EMPTY, dtype=np.int64),
        np.full(slots, EMPTY, dtype=np.int32),
        np.full(count, EMPTY, dtype=np.int32),
        slots - 1,
        CELL * grain_set.largest if width is None else width,
    )


def halves(first: int, last: int) -> list[tuple[int, int, int]]:
    """Order in which grains first … last − 1 merge into one cluster by repeated halving, small clusters first.

    Each cluster is merged from two halves whose sizes differ by at most one grain.

    Returns
    -------
    list of tuple of int
        (first, middle, last) of each pair of clusters.
    """
    layers, layer = [], [(first, last)]
    while layer:
        split = [(a, (a + b) // 2, b) for a, b in layer if b - a > 1]
        layers.append(split)
        layer = [part for a, middle, b in split for part in ((a, middle), (middle, b))]
    return [join for split in reversed(layers) for join in split]


def require_all_placed(done: int, count: int, subject: str) -> None:
    """Raise BadInput if a kernel placed only `done` of `count` grains or clusters; `subject` names the failed one."""
    if done < count:
        raise BadInput(
            f"no position where {subject} has exactly one contact was found in {TRIES} attempts: equilibrium overlaps "
            "or differences of the radii are too large; use larger or stiffer grains, or a narrower distribution"
        )
