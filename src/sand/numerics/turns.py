"""Cosine and sine of angles in turns, in loops that vectorise; those of the C library are called one by one."""

import math

from ..compiler.jit import formula


@formula
def cosine_and_sine(turns):
    """cos(2π f) and sin(2π f) for |f| ≤ ½, to 1e-15: Taylor series of half the angle, up to its 20th and 21st power."""
    x = math.pi * turns
    z = x * x
    a = 1.0 / 51090942171709440000.0 * z - 1.0 / 121645100408832000.0
    a = ((a * z + 1.0 / 355687428096000.0) * z - 1.0 / 1307674368000.0) * z + 1.0 / 6227020800.0
    a = ((a * z - 1.0 / 39916800.0) * z + 1.0 / 362880.0) * z - 1.0 / 5040.0
    sine = (((a * z + 1.0 / 120.0) * z - 1.0 / 6.0) * z + 1.0) * x
    b = 1.0 / 2432902008176640000.0 * z - 1.0 / 6402373705728000.0
    b = ((b * z + 1.0 / 20922789888000.0) * z - 1.0 / 87178291200.0) * z + 1.0 / 479001600.0
    b = ((b * z - 1.0 / 3628800.0) * z + 1.0 / 40320.0) * z - 1.0 / 720.0
    cosine = ((b * z + 1.0 / 24.0) * z - 0.5) * z + 1.0
    return 1.0 - 2.0 * sine * sine, 2.0 * sine * cosine
