"""1/√x in the middle of long loops: by square root and division, or from a seed in single precision."""

import math

import numpy as np

from ..compiler.jit import formula

_SINGLE = np.float32
_ONE = np.float32(1.0)


@formula
def exact_inverse_root(x):
    """1/√x, x > 0, as the processor divides and takes roots."""
    return 1.0 / math.sqrt(x)


@formula
def seeded_inverse_root(x):
    """1/√x to rounding for 1e-37 < x < 1e37, and nothing useful farther out; faster in loops of 512-bit vectors.

    Single precision has 1/√x to 1e-6 at least, without the divider.  With e = 1 − x y², 1/√x = y (1 − e)^(−1/2), of
    which three terms leave 5/16 e³.
    """
    y = float(_ONE / math.sqrt(_SINGLE(x)))
    e = 1.0 - x * y * y
    return y + y * e * (0.5 + 0.375 * e)
