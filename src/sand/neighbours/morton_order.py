"""Numbering grains so that neighbours in space are neighbours in memory."""

from __future__ import annotations

import numpy as np

from ..arguments import checked
from ..grains import Grains

BITS = 21
"""Of each coordinate: three of them fill 63 bits."""


def morton_keys(position: np.ndarray) -> np.ndarray:
    """Place of each point (N, 3) on Morton's curve, (N,) uint64: the bits of its three coordinates in turns."""
    low = position.min(axis=0)
    longest = float((position.max(axis=0) - low).max())
    scaled = (position - low) / longest if longest > 0.0 else np.zeros_like(position)
    cell = (scaled * (2**BITS - 1)).astype(np.uint64)
    place = np.zeros(len(position), np.uint64)
    for axis in range(3):
        bits = cell[:, axis]
        # each step moves the upper half of the bits away from the lower: 21 bits end three apart
        for shift, mask in (
            (32, 0x1F00000000FFFF),
            (16, 0x1F0000FF0000FF),
            (8, 0x100F00F00F00F00F),
            (4, 0x10C30C30C30C30C3),
            (2, 0x1249249249249249),
        ):
            bits = (bits | (bits << np.uint64(shift))) & np.uint64(mask)
        place |= bits << np.uint64(axis)
    return place


@checked
def in_space_order(grains: Grains) -> Grains:
    """The same grains, numbered along a curve that fills space (Morton 1966).

    Where numbers come at random, grains that touch lie far apart in memory; along the curve they lie close. Large
    simulations do so by themselves (`Neighbours.order`), and keep the numbers. Nothing else changes.

    Parameters
    ----------
    grains : Grains
        at their places.

    Returns
    -------
    Grains
        A copy; grain k of it is `order[k]` of the old ones, order = argsort of `morton_keys`.
    """
    order = np.argsort(morton_keys(grains.position), kind="stable")
    ordered = grains.copy()
    for array, old in zip(ordered.arrays, grains.arrays, strict=True):
        array[...] = old[..., order]
    return ordered
