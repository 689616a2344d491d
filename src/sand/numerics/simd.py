"""SIMD: padding of loops to whole vectors, and minima of floats in loops that vectorise."""

import numpy as np

from ..basics.alignment import SIMD_WIDTH
from ..compiler.jit import formula, loop


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
