"""The least of many numbers in a loop that vectorises: minima of integers do, those of floats do not."""

import numpy as np

from ..compiler.jit import formula


@formula
def rank(x):
    """The bits of x ≥ 0 as an integer; ranks are ordered as the numbers are, and NaN comes last (or below 0)."""
    return np.float64(x).view(np.int64)


@formula
def magnitude_bits(x):
    """The rank of x ≥ 0 in a search for the largest: NaN comes last, whatever its sign."""
    return rank(abs(x))


@formula
def float_from_bits(bits):
    """The number of this rank."""
    return np.int64(bits).view(np.float64)
