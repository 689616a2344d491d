"""Morton order of grains."""

import numpy as np
import pytest

import sand
from sand.neighbours.spatial_sort import morton_keys


def test_morton_codes_interleave_bits():
    """x, y, z have 21 bits each: bit b of axis a is bit 3b + a of the code (cube corners, a power of two)."""
    top = 2**21 - 1
    corners = np.array([[0, 0, 0], [top, 0, 0], [0, top, 0], [0, 0, top], [top, top, top], [2**7, 0, 2**20]], float)
    spread = sum(1 << (3 * b) for b in range(21))
    expected = [0, spread, spread << 1, spread << 2, spread * 7, (1 << 21) | (1 << 62)]
    assert morton_keys(corners).tolist() == expected


@pytest.mark.compiled("small")
def test_reordering_grains():
    """Every quantity is permuted; contacts of an aggregate are closer in memory than in the order of growth."""
    grains = sand.setup.bpca(2000, radius="0.1 um", material=sand.SILICA, seed=3)
    grains.arrays.velocity[...] = grains.arrays.position * 2.0
    ordered = sand.setup.in_space_order(grains)
    order = np.argsort(morton_keys(grains.position), kind="stable")
    assert sorted(order) == list(range(2000))
    for name, array in grains.arrays._asdict().items():
        assert (getattr(ordered.arrays, name) == array[..., order]).all(), name
    assert (ordered.velocity == 2.0 * ordered.position).all()

    def distance(some):
        pair = np.asarray(sand.Box.open().close_pairs(some.position, 2.001e-7), dtype=np.int64)
        return np.median(np.abs(pair[:, 0] - pair[:, 1]))

    assert distance(ordered) < 0.1 * distance(grains)


def test_morton_order_of_degenerate_points():
    """No extent along one axis or all axes is no error."""
    assert (morton_keys(np.zeros((3, 3))) == 0).all()
    plane = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0]])
    assert len(set(morton_keys(plane).tolist())) == 3
