"""Copies of grains and contacts to a part and back, in one compiled call, against the same by NumPy."""

from typing import Annotated, NamedTuple

import numpy as np
import pytest

from sand.basics.array_groups import GRAINS, USED, Array
from sand.integrate.part_copies import ColumnCopies, array_pairs, copy_columns


class Group(NamedTuple):
    """Arrays of each width of numbers, of grains and of contacts."""

    vector: Annotated[np.ndarray, Array((3, GRAINS))]
    number: Annotated[np.ndarray, Array((GRAINS,), dtype="i8")]
    image: Annotated[np.ndarray, Array((3, GRAINS), dtype="i4")]
    mark: Annotated[np.ndarray, Array((GRAINS,), dtype="u1")]
    first: Annotated[np.ndarray, Array((GRAINS,), dtype="u4")]
    pair: Annotated[np.ndarray, Array((2, USED), dtype="u4")]
    twist: Annotated[np.ndarray, Array((USED,))]
    unused: Annotated[np.ndarray, Array((4, USED))]


def group(grains, contacts, rng):
    """Random arrays; indices are those of grains, and one array has no columns."""
    return Group(
        rng.normal(size=(3, grains)),
        rng.integers(-(2**62), 2**62, grains),
        rng.integers(-5, 5, (3, grains)).astype(np.int32),
        rng.integers(0, 255, grains).astype(np.uint8),
        rng.integers(0, grains, grains).astype(np.uint32),
        rng.integers(0, grains, (2, contacts)).astype(np.uint32),
        rng.normal(size=contacts),
        np.zeros((4, 0)),
    )


@pytest.mark.compiled("listed")
def test_copies_to_a_part_and_back():
    """target[r, to[k]] = source[r, from[k]] for every array; indices of grains follow; all other columns stay."""
    rng = np.random.default_rng(3)
    index, columns = np.array([1, 4, 5, 9]), np.array([2, 3, 7])
    whole, part = group(12, 8, rng), group(len(index), 5, rng)
    whole.first[index] = [1, 1, 9, 9]
    whole.pair[:, columns] = [[1, 4, 9], [5, 9, 4]]
    number = np.zeros(12, np.int64)
    number[index] = np.arange(4)
    there = np.array([index, np.arange(4)]), np.array([columns, np.arange(3)])

    def copied(one, other):
        return np.array([*array_pairs(one, other, Group._fields, ("first", "pair"))])

    before = Group(*(array.copy() for array in part))
    assert len(copied(whole, part)) == 7  # not the one without columns
    copy_columns(ColumnCopies(copied(whole, part), *there, number))
    for name in ("vector", "number", "image", "mark"):
        assert getattr(part, name).tobytes() == np.ascontiguousarray(getattr(whole, name)[..., index]).tobytes()
    assert part.first.tolist() == [0, 0, 3, 3]
    assert part.pair[:, :3].tolist() == [[0, 1, 3], [2, 3, 1]]
    assert part.twist[:3].tolist() == whole.twist[columns].tolist()
    assert np.array_equal(part.pair[:, 3:], before.pair[:, 3:]) and np.array_equal(part.twist[3:], before.twist[3:])
    after = Group(*(array.copy() for array in whole))
    part.vector[...] = rng.normal(size=(3, 4))
    part.twist[...] = 7.0
    back = tuple(np.ascontiguousarray(each[::-1]) for each in there)
    copy_columns(ColumnCopies(copied(part, whole), *back, index))
    after.vector[:, index], after.twist[columns] = part.vector, 7.0
    for one, other in zip(whole, after, strict=True):
        assert one.tobytes() == other.tobytes()
