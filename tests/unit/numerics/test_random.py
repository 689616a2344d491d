"""Counter-based random numbers: published test vectors, equal with and without the compiler, distributions."""

import math

import numpy as np
import pytest
from scipy import stats

from sand.compiler.jit import COMPILED, kernel
from sand.numerics.random import LOW_WORD, normal_vector, philox, random_words, uniform

# Random123's kat_vectors, philox4x32 with 10 rounds: counter, key, result
KNOWN = (
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
)
ADDRESSES = ((0, 0, 0, 0), (2**64 - 1, 2**63 + 5, 2**32 - 1, 2**32 - 1), (12345678901234567, 2**40 + 3, 999, 1))


def fill_words(seed, number, grain, stream, out):
    for i in range(out.shape[1]):
        out[0, i], out[1, i], out[2, i], out[3, i] = random_words(seed[i], number[i], grain[i], stream[i])


def fill_normals(seed, number, grain, stream, out):
    for i in range(out.shape[1]):
        out[0, i], out[1, i], out[2, i] = normal_vector(seed[i], number[i], grain[i], stream[i])


compiled_words, compiled_normals = kernel(fill_words, cached=False), kernel(fill_normals, cached=False)
compiled = pytest.mark.skipif(not COMPILED, reason="too many numbers with the compiler off")


def filled(way, rows, kind, addresses, types=(np.int64, np.int64, np.uint32, np.int64)):
    """Words or normal deviates of many addresses, with the argument types of the driver."""
    columns = [np.ascontiguousarray(c).astype(t) for c, t in zip(np.broadcast_arrays(*addresses), types, strict=True)]
    out = np.empty((rows, columns[0].size), kind)
    way(*columns, out)
    return out


def normals(*addresses):
    return filled(compiled_normals, 3, np.float64, addresses)


def words_of(text):
    return tuple(np.uint64(int(word, 16)) for word in text.split())


@pytest.mark.interpreted
@pytest.mark.parametrize(("counter", "key", "result"), KNOWN)
def test_philox_gives_the_published_vectors(counter, key, result):
    """Philox4x32-10 of Random123's known answers, in plain Python; exact."""
    assert philox(words_of(counter), words_of(key)) == words_of(result)


@pytest.mark.compiled("small")
@pytest.mark.interpreted
@pytest.mark.parametrize(("counter", "key", "result"), KNOWN)
def test_an_address_is_counter_and_key(counter, key, result):
    """Key = seed, low word first; counter = number, low word first, grain, stream. Compiled; exact."""
    c, k = ([int(w) for w in words_of(text)] for text in (counter, key))
    address = ([k[0] + (k[1] << 32)], [c[0] + (c[1] << 32)], [c[2]], [c[3]])
    assert tuple(filled(compiled_words, 4, np.uint64, address, (np.uint64,) * 4)[:, 0]) == words_of(result)
    assert random_words(*(a[0] for a in address)) == words_of(result)


@pytest.mark.compiled("small")
@pytest.mark.interpreted
def test_words_do_not_depend_on_compiler_or_integer_type():
    """int, int64, uint32 and uint64 give equal words, returned as uint64.

    Normal deviates use sqrt, log and cos of the C library in both cases; a rounding error of the angle, ≤ 2π, changes a
    deviate of size ≤ 6.8 by 4.4e-16 of it: 6e-15.
    """
    rng, signed = np.random.default_rng(3), (np.int64, np.int64, np.uint32, np.int64)
    for types in (signed, (np.uint64,) * 4, (np.uint32, np.int32, np.int64, np.uint8)):
        most = [min(int(np.iinfo(t).max), 2**32 - 1 if k > 1 else 2**64) for k, t in enumerate(types)]
        columns = [rng.integers(0, m, 200, t, endpoint=True) for m, t in zip(most, types, strict=True)]
        words = filled(compiled_words, 4, np.uint64, columns, types)
        deviates = filled(compiled_normals, 3, np.float64, columns, types)
        for i, address in enumerate(zip(*columns, strict=True)):
            plain = random_words(*(int(a) for a in address))
            assert plain == tuple(words[:, i])
            assert plain == random_words(*(t(a) for a, t in zip(address, types, strict=True)))
            assert all(isinstance(w, np.uint64) and w <= LOW_WORD for w in plain)
            assert normal_vector(*(int(a) for a in address)) == pytest.approx(deviates[:, i], rel=0, abs=6e-15)
    for address in ADDRESSES:
        plain = [int(w) for w in random_words(*address)]
        compiled = filled(compiled_words, 4, np.uint64, [[a] for a in address], (np.uint64,) * 4)
        assert plain == compiled[:, 0].tolist()


@pytest.mark.interpreted
def test_a_uniform_is_never_0_or_1():
    """u = (w + ½)/2³² is exact: ½/2³² and 1 − ½/2³² at the ends, so log u is finite and below 0."""
    assert uniform(np.uint64(0)) == 2.0**-33
    assert uniform(LOW_WORD) == 1.0 - 2.0**-33
    assert uniform(np.uint64(2**31)) == 0.5 + 2.0**-33
    assert math.sqrt(-2.0 * math.log(uniform(np.uint64(0)))) < 6.8


@pytest.mark.compiled("small")
@compiled
def test_bits_are_evenly_distributed():
    """1e6 consecutive addresses as in a run: each of 128 bits is set in half of the words.

    The fraction of set bits is ½ ± ½/√n; the largest of 128 deviations exceeds 4.5 σ once in 1150 runs (fixed seed).
    """
    n = 1_000_000
    words = filled(compiled_words, 4, np.uint64, (5, np.arange(n) // 1000, np.arange(n) % 1000, 0))
    share = np.array([((words >> np.uint64(bit)) & np.uint64(1)).mean(axis=1) for bit in range(32)])
    assert np.abs(share - 0.5).max() < 4.5 * 0.5 / math.sqrt(n)
    assert np.unique(words[0] + (words[1] << np.uint64(32))).size == n


@pytest.mark.compiled("small")
@compiled
def test_moments_of_the_normals():
    """Mean 0, ⟨ξ²⟩ = 1, ⟨ξ³⟩ = 0, ⟨ξ⁴⟩ = 3 per component, with σ² = 1, 2, 15, 96 over n = 1e6; within 4 σ."""
    n = 1_000_000
    x = normals(1, np.arange(n) // 1000, np.arange(n) % 1000, 0)
    for power, mean, variance in ((1, 0, 1), (2, 1, 2), (3, 0, 15), (4, 3, 96)):
        assert np.abs((x**power).mean(axis=1) - mean).max() < 4.0 * math.sqrt(variance / n)


@pytest.mark.compiled("small")
@compiled
def test_normal_deviates_are_normal():
    """Kolmogorov–Smirnov per component, n = 2e5: p > 1e-3.  A χ² of |ξ|² (3 degrees of freedom) likewise."""
    n = 200_000
    x = normals(2, np.arange(n), 7, 1)
    for component in x:
        assert stats.kstest(component, "norm").pvalue > 1e-3
    assert stats.kstest((x**2).sum(axis=0), stats.chi2(3).cdf).pvalue > 1e-3


@pytest.mark.compiled("small")
@compiled
@pytest.mark.parametrize("power", [1, 2])
def test_neighbouring_addresses_are_uncorrelated(power):
    """Correlation of ξ and of ξ² between components, grains, kicks, streams and seeds: 0 ± 1/√n, n = 2e5.

    45 correlations of each kind; the largest exceeds 4 σ once in 350 runs (fixed seed).
    """
    n = 200_000
    kicks, grains = np.arange(n) // 500, np.arange(n) % 500
    here = normals(3, kicks, grains, 0) ** power
    others = {
        "grain": (3, kicks, grains + 1, 0),
        "kick": (3, kicks + 1, grains, 0),
        "high half": (3, kicks + 2**32, grains, 0),
        "stream": (3, kicks, grains, 1),
        "seed": (4, kicks, grains, 0),
        "high half of the seed": (3 + 2**32, kicks, grains, 0),
    }
    limit = 4.0 / math.sqrt(n)
    both = np.corrcoef(here)
    assert np.abs(both - np.eye(3)).max() < limit
    for name, address in others.items():
        there = normals(*address) ** power
        assert np.abs(np.corrcoef(here, there)[:3, 3:]).max() < limit, name


@pytest.mark.compiled("small")
@compiled
def test_sums_over_kicks_and_over_grains_are_normal():
    """Σ ξ over 500 kicks of a grain or 500 grains of a kick has variance 500 (1 ± √(2/m)), m sums; within 4 σ.

    This detects correlations beyond the next neighbour.
    """
    kicks, grains = np.meshgrid(np.arange(500), np.arange(500), indexing="ij")
    x = normals(6, kicks.ravel(), grains.ravel(), 0).reshape(3, 500, 500)
    for axis in (1, 2):
        sums = x.sum(axis=axis).ravel()
        assert abs((sums**2).mean() / 500 - 1.0) < 4.0 * math.sqrt(2.0 / sums.size)
