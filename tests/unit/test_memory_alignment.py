"""Arrays that begin with a line of the cache."""

import numpy as np
import pytest

import sand
from sand.numerics.simd import CACHE_LINE, SIMD_WIDTH, aligned, padded_size


def begins(array):
    return array.ctypes.data % CACHE_LINE == 0


def test_what_is_aligned_stays_and_what_is_not_is_copied():
    """The same numbers, shape and kind, contiguous, at the begin of a line; no copy where that is so already."""
    raw = np.arange(100.0)
    one = aligned(raw)
    assert begins(one) and aligned(one) is one
    for crooked in (one[1:], one.reshape(10, 10).T, np.arange(7, dtype=np.uint32)[1:]):
        straight = aligned(crooked)
        assert straight.flags.c_contiguous and straight.dtype == crooked.dtype and (straight == crooked).all()
        assert begins(straight) and straight.shape == crooked.shape


@pytest.mark.compiled("small")
def test_all_arrays_of_a_world_begin_with_a_line():
    """When it is made, copied, and after arrays have grown; contacts and pairs have room for whole vectors."""
    body = sand.setup.bpca(37, radius="0.1 um", material=sand.SILICA, seed=1)
    world = sand.Simulation(body, [sand.Contact()]).state
    for one in (world, world.copy()):
        one.grow_contacts()
        one.grow_pairs()
        groups = (one.grains.arrays, one.contacts, one.pair_list, one.long_range, one.stages)
        assert all(begins(array) or array.size == 0 for group in groups for array in group)
        assert one.contacts.flag.size % SIMD_WIDTH == one.pair_list.in_contact.size % SIMD_WIDTH == 0
    assert [padded_size(number) for number in (0, 1, 8, 9)] == [0, 8, 8, 16]
