"""SIMD: alignment of arrays, padding of loops, and minima of floats in loops that vectorise.

Arrays begin at a cache line, because the longest SIMD vectors fill one line and cost two memory accesses where they
cross a boundary.  Loop lengths are padded to whole vectors, because remaining iterations are executed one by one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..compiler.jit import formula, loop

CACHE_LINE = 64
"""Length of a cache line in bytes."""
SIMD_WIDTH = 8
"""Float64 numbers in the longest SIMD vector; the rows of some arrays are padded to a multiple of it."""


def padded_size(number: int) -> int:
    """Number of columns, rounded up to whole SIMD vectors."""
    return (number + SIMD_WIDTH - 1) // SIMD_WIDTH * SIMD_WIDTH


def aligned(array: np.ndarray) -> np.ndarray:
    """The array itself if it is contiguous and begins at a cache line or is empty, else such a copy."""
    if array.size == 0 or (array.ctypes.data % CACHE_LINE == 0 and array.flags.c_contiguous):
        return array
    raw = np.empty(array.nbytes + CACHE_LINE, np.uint8)
    first = -raw.ctypes.data % CACHE_LINE
    copy = raw[first : first + array.nbytes].view(array.dtype).reshape(array.shape)
    copy[...] = array
    return copy


def all_aligned(arrays: Any) -> Any:
    """Aligned arrays for each field of a NamedTuple of arrays."""
    return type(arrays)(*map(aligned, arrays))


@loop
def round_up_to_simd_width(number, min_remainder):
    """Loop length (uint64), padded to whole SIMD vectors if at least `min_remainder` (uint64) iterations remain."""
    lanes = np.uint64(SIMD_WIDTH)
    return (number + lanes - np.uint64(1)) // lanes * lanes if number % lanes >= min_remainder else number


@formula
def float_bits(x):
    """Bits of x ≥ 0 as an integer, which has the order of the numbers; NaN is above all others (or below 0).

    Minima and maxima of integers vectorise, those of floats do not.
    """
    return np.float64(x).view(np.int64)


@formula
def magnitude_bits(x):
    """Bits of |x|, for maxima in which NaN is above all numbers whatever its sign."""
    return float_bits(abs(x))


@formula
def float_from_bits(bits):
    """Inverse of `float_bits`."""
    return np.int64(bits).view(np.float64)
