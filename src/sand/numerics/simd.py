"""Rows as long as whole vectors of the processor: what is left over of a row is slow one by one."""

import numpy as np

from ..compiler.jit import loop
from .aligned import SIMD_WIDTH


@loop
def round_up_to_simd_width(number, few):
    """A row's length (uint64), rounded up to whole vectors where `few` or more are left over (uint64)."""
    lanes = np.uint64(SIMD_WIDTH)
    return (number + lanes - np.uint64(1)) // lanes * lanes if number % lanes >= few else number
