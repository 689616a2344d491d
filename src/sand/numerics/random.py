"""Random numbers as pure functions of where they are used: no state, nothing to store, nothing to share.

Philox4x32-10 (Salmon, Moraes, Dror & Shaw 2011, section 3.3, recalled; held to the vectors of Random123 by the
tests) is a bijection of 128 bits, the counter, for each of 2⁶⁴ keys.  The key is the seed; the counter is (low and
high half of the number of the kick, grain, stream).  A number therefore depends on nothing but its address, in
particular not on the order in which grains are visited, nor on how often a run was interrupted.

Words of 32 bits are kept in uint64, where no product or sum of this file overflows: plain Python, NumPy scalars and
compiled code then agree.  Nothing here may be mixed with a signed integer, which would make a float of it.
"""

import math

import numpy as np

from ..compiler.jit import formula

ROUNDS = 10
LOW = np.uint64(0xFFFFFFFF)
HALF = np.uint64(32)
MULTIPLIER0, MULTIPLIER1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
WEYL0, WEYL1 = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)


@formula
def philox(counter, key):
    """Four random words (uint64 below 2³²) from a counter of four and a key of two such words."""
    a, b, c, d = counter
    k0, k1 = key
    for _ in range(ROUNDS):
        p, q = MULTIPLIER0 * a, MULTIPLIER1 * c
        a, b, c, d = (q >> HALF) ^ b ^ k0, q & LOW, (p >> HALF) ^ d ^ k1, p & LOW
        k0, k1 = (k0 + WEYL0) & LOW, (k1 + WEYL1) & LOW
    return a, b, c, d


@formula
def random_words(seed, number, grain, stream):
    """Four random words (uint64 below 2³²) that belong to one address.

    Parameters
    ----------
    seed
        0 ≤ seed < 2⁶⁴.
    number
        of the kick, 0 ≤ number < 2⁶⁴.
    grain
        id of the grain, below 2³².
    stream
        what the words are for, below 2³².
    """
    seed, number = np.uint64(seed), np.uint64(number)
    counter = (number & LOW, number >> HALF, np.uint64(grain), np.uint64(stream))
    return philox(counter, (seed & LOW, seed >> HALF))


@formula
def uniform(word):
    """u = (w + ½)/2³²: evenly spread over 0 … 1, never 0 and never 1, exact in floating point."""
    return (float(word) + 0.5) * 2.0**-32


@formula
def normal_pair(word1, word2):
    """Two independent standard normal deviates from two words (Box & Muller 1958); none is beyond 6.8."""
    size = math.sqrt(-2.0 * math.log(uniform(word1)))
    angle = 2.0 * math.pi * uniform(word2)
    return size * math.cos(angle), size * math.sin(angle)


@formula
def normal_vector(seed, number, grain, stream):
    """Three independent standard normal deviates ξ that belong to one address (see `random_words`)."""
    a, b, c, d = random_words(seed, number, grain, stream)
    x, y = normal_pair(a, b)
    return x, y, normal_pair(c, d)[0]
