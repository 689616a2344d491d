"""Arrays aligned to cache lines."""

import numpy as np
import pytest

import sand
from sand.basics.alignment import CACHE_LINE, SIMD_WIDTH, aligned, padded_size


def is_aligned(array):
    return array.ctypes.data % CACHE_LINE == 0


def test_aligned_arrays_are_not_copied():
    """Same values, shape and type, contiguous, aligned to a cache line; copied only if not aligned yet."""
    raw = np.arange(100.0)
    one = aligned(raw)
    assert is_aligned(one) and aligned(one) is one
    for unaligned in (one[1:], one.reshape(10, 10).T, np.arange(7, dtype=np.uint32)[1:]):
        result = aligned(unaligned)
        assert result.flags.c_contiguous and result.dtype == unaligned.dtype and (result == unaligned).all()
        assert is_aligned(result) and result.shape == unaligned.shape


@pytest.mark.compiled("small")
def test_all_arrays_of_a_state_are_aligned():
    """After construction, copy and growth; per-contact and per-pair arrays hold whole SIMD vectors."""
    body = sand.setup.bpca(37, radius="0.1 um", material=sand.SILICA, seed=1)
    system = sand.Simulation(body, [sand.Contact()]).state
    for one in (system, system.copy()):
        one.grow("contacts")
        one.grow("pair_list")
        groups = (one.grains.arrays, one.contacts, one.pair_list, one.long_range)
        assert all(is_aligned(array) or array.size == 0 for group in groups for array in group)
        assert one.contacts.flag.size % SIMD_WIDTH == one.pair_list.in_contact.size % SIMD_WIDTH == 0
    assert [padded_size(number) for number in (0, 1, 8, 9)] == [0, 8, 8, 16]
