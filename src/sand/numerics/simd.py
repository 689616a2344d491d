"""Arrays that begin with a line of the cache: the longest vectors fill one, and cost two where they straddle."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..compiler.jit import formula, loop

LINE = 64
"""Bytes of a line."""
SIMD_WIDTH = 8
"""Numbers in the longest vectors of a processor; some rows have room for whole ones, V = N rounded up."""


def whole(number: int) -> int:
    """So many columns, rounded up to whole vectors."""
    return (number + SIMD_WIDTH - 1) // SIMD_WIDTH * SIMD_WIDTH


def aligned(array: np.ndarray) -> np.ndarray:
    """The array, or a contiguous copy of it that begins with a line; an empty one as it is."""
    if array.size == 0 or (array.ctypes.data % LINE == 0 and array.flags.c_contiguous):
        return array
    raw = np.empty(array.nbytes + LINE, np.uint8)
    first = -raw.ctypes.data % LINE
    copy = raw[first : first + array.nbytes].view(array.dtype).reshape(array.shape)
    copy[...] = array
    return copy


def all_aligned(arrays: Any) -> Any:
    """The same for each field of a NamedTuple of arrays."""
    return type(arrays)(*map(aligned, arrays))


@loop
def round_up_to_simd_width(number, few):
    """A row's length (uint64), rounded up to whole vectors where `few` or more are left over (uint64)."""
    lanes = np.uint64(SIMD_WIDTH)
    return (number + lanes - np.uint64(1)) // lanes * lanes if number % lanes >= few else number


@formula
def float_bits(x):
    """The bits of x ≥ 0 as an integer; ranks are ordered as the numbers are, and NaN comes last (or below 0)."""
    return np.float64(x).view(np.int64)


@formula
def magnitude_bits(x):
    """The float_bits of x ≥ 0 in a search for the largest: NaN comes last, whatever its sign."""
    return float_bits(abs(x))


@formula
def float_from_bits(bits):
    """The number of this float_bits."""
    return np.int64(bits).view(np.float64)
