"""Inverse square roots in long loops: by square root and division, or refined from single precision."""

import math

import numpy as np

from ..compiler.jit import formula

_SINGLE = np.float32
_ONE = np.float32(1.0)


@formula
def exact_inverse_root(x):
    """1/√x, x > 0, by square root and division."""
    return 1.0 / math.sqrt(x)


@formula
def seeded_inverse_root(x):
    """1/√x to rounding for 1e-37 < x < 1e37, invalid outside; faster in loops of 512-bit vectors.

    Single precision gives y ≈ 1/√x to at least 1e-6 without the double-precision divider.  With e = 1 − x y², 1/√x = y
    (1 − e)^(−1/2); three terms of the series leave a relative error of 5/16 e³.
    """
    y = float(_ONE / math.sqrt(_SINGLE(x)))
    e = 1.0 - x * y * y
    return y + y * e * (0.5 + 0.375 * e)
