"""Counter-based random numbers: pure functions of seed, number, grain and stream, without a generator state.

Philox4x32-10 (Salmon, Moraes, Dror & Shaw 2011, section 3.3; checked against the test vectors of Random123) is a
bijection of 128 bits, the counter, for each of 2⁶⁴ keys.  The key is the seed; the counter consists of the low and high
half of `number` (of the kick, for instance), grain, and stream.  Results therefore do not depend on the order in which
grains are visited, nor on interruptions of a run.

32-bit words are stored in uint64, where no product or sum in this file overflows: Python integers, NumPy scalars and
compiled code then agree.  They must not be mixed with signed integers, which would convert them to floats.
"""

import math

import numpy as np

from ..compiler.jit import formula

ROUNDS = 10
LOW_WORD = np.uint64(0xFFFFFFFF)
WORD_BITS = np.uint64(32)
MULTIPLIER0, MULTIPLIER1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
WEYL0, WEYL1 = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)


@formula
def philox(counter, key):
    """Four random words (uint64 below 2³²) from a counter of four words and a key of two words."""
    a, b, c, d = counter
    k0, k1 = key
    for _ in range(ROUNDS):
        p, q = MULTIPLIER0 * a, MULTIPLIER1 * c
        a, b, c, d = (q >> WORD_BITS) ^ b ^ k0, q & LOW_WORD, (p >> WORD_BITS) ^ d ^ k1, p & LOW_WORD
        k0, k1 = (k0 + WEYL0) & LOW_WORD, (k1 + WEYL1) & LOW_WORD
    return a, b, c, d


@formula
def random_words(seed, number, grain, stream):
    """Four random words (uint64 below 2³²) for the given arguments.

    Parameters
    ----------
    seed : int
        Seed, 0 ≤ seed < 2⁶⁴.
    number : int
        Number of the kick or trial, 0 ≤ number < 2⁶⁴.
    grain : int
        Index of the grain, below 2³².
    stream : int
        Purpose of the words, below 2³².

    Returns
    -------
    tuple of uint64
        The words.
    """
    seed, number = np.uint64(seed), np.uint64(number)
    counter = (number & LOW_WORD, number >> WORD_BITS, np.uint64(grain), np.uint64(stream))
    return philox(counter, (seed & LOW_WORD, seed >> WORD_BITS))


@formula
def uniform(word):
    """Uniform deviate u = (w + ½)/2³² from a word, 0 < u < 1, exact in floating point."""
    return (float(word) + 0.5) * 2.0**-32


@formula
def normal_pair(word1, word2):
    """Two independent standard normal deviates from two words (Box & Muller 1958); their magnitude is below 6.8."""
    size = math.sqrt(-2.0 * math.log(uniform(word1)))
    angle = 2.0 * math.pi * uniform(word2)
    return size * math.cos(angle), size * math.sin(angle)


@formula
def normal_vector(seed, number, grain, stream):
    """Three independent standard normal deviates ξ for the given arguments (see `random_words`)."""
    a, b, c, d = random_words(seed, number, grain, stream)
    x, y = normal_pair(a, b)
    return x, y, normal_pair(c, d)[0]
