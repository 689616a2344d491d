"""Arrays that begin at a cache line, with rows of whole SIMD vectors.

The longest SIMD vectors fill one cache line and cost two memory accesses where they cross a boundary.  Rows are padded
to whole vectors, because remaining iterations of a loop are executed one by one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

CACHE_LINE = 64
"""Length of a cache line in bytes."""
SIMD_WIDTH = 8
"""Float64 numbers in the longest SIMD vector; the rows of some arrays are padded to a multiple of it."""


def padded_size(number: int) -> int:
    """Number of columns, rounded up to whole SIMD vectors."""
    return (number + SIMD_WIDTH - 1) // SIMD_WIDTH * SIMD_WIDTH


def aligned(array: np.ndarray) -> np.ndarray:
    """The array itself if it is contiguous and begins at a cache line or is empty, else such a copy."""
    if array.size == 0 or (address(array) % CACHE_LINE == 0 and array.flags.c_contiguous):
        return array
    return aligned_copies([array])[0]


def aligned_copies(arrays: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Contiguous copies in one block of memory, each of which begins at a cache line."""
    lengths = [(array.nbytes + CACHE_LINE - 1) // CACHE_LINE * CACHE_LINE for array in arrays]
    block = np.empty(sum(lengths) + CACHE_LINE, np.uint8)
    at, copies = -address(block) % CACHE_LINE, []
    for array, length in zip(arrays, lengths, strict=True):
        copy = np.ndarray(array.shape, array.dtype, block, at)
        copy[...] = array
        copies.append(copy)
        at += length
    return copies


def address(array: np.ndarray) -> int:
    """Address of the first number of an array."""
    return int(array.__array_interface__["data"][0])


def all_aligned(arrays: Any) -> Any:
    """Aligned arrays for each field of a NamedTuple of arrays."""
    return type(arrays)(*map(aligned, arrays))
