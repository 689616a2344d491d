"""What all aggregates that grow share: room for kernels, and plans of which clusters meet."""

from __future__ import annotations

import numpy as np

from ..errors import BadInput
from ._kernels.hash_grid import GrainSet, HashGrid, places_for

CELL = 3.0
"""Width of the lowest cells, in largest radii: no grain reaches over more than two of them."""
TRIES = 100_000
"""Flights or walks of one grain or pair of clusters until they meet in a single contact."""


def room(grain_set: GrainSet, width: float | None = None) -> HashGrid:
    """A crowd with room for all grains, nobody there yet; `width` of its cells [m]."""
    count = len(grain_set.radius)
    places = places_for(count, 1 << 40)
    return HashGrid(
        np.full(places, -1, dtype=np.int64),
        np.full(places, -1, dtype=np.int32),
        np.full(count, -1, dtype=np.int32),
        places - 1,
        CELL * grain_set.largest if width is None else width,
    )


def halves(first: int, last: int) -> list[tuple[int, int, int]]:
    """Joins (first, middle, last) that make one cluster of grains first … last − 1, smaller clusters before larger.

    Each cluster is made of two halves, equal to within one grain.
    """
    layers, layer = [], [(first, last)]
    while layer:
        split = [(a, (a + b) // 2, b) for a, b in layer if b - a > 1]
        layers.append(split)
        layer = [part for a, middle, b in split for part in ((a, middle), (middle, b))]
    return [join for split in reversed(layers) for join in split]


def require_all_placed(done: int, wanted: int, what: str, advice: str) -> None:
    """Raises BadInput where kernels have given up."""
    if done < wanted:
        raise BadInput(
            f"no place where {what} touches just one other grain was found in {TRIES} tries: these grains sink in "
            f"too deep, or differ too much; {advice}"
        )
