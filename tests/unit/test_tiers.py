"""The tiers of the tests: default and excluded tests, and the guard against unmarked compilation."""

import pytest

from sand.compiler.jit import COMPILED, kernel

from ..validation import parse_part, part_of


def test_an_unmarked_test_compiles_nothing():
    """The guard of conftest.py raises before a stage is compiled; a disk cache would make this pass by chance."""
    if not COMPILED:
        pytest.skip("nothing is compiled")
    new = kernel(lambda x: x + 1.0, cached=False)
    with pytest.raises(AssertionError, match=r"compiles .*pytest\.mark\.compiled"):
        new(1.0)


def test_parts_are_a_partition():
    """Each test is in exactly one of ten parts, independent of other tests."""
    names = [f"tests/unit/test_a.py::test_{k}" for k in range(200)]
    parts = [[name for name in names if part_of(name, (k, 10))] for k in range(10)]
    assert sorted(name for part in parts for name in part) == sorted(names)
    assert all(len(part) > 5 for part in parts)
    assert parse_part("3/10") == (3, 10)


@pytest.mark.parametrize("text", ["10/10", "1", "a/b", "-1/3"])
def test_parts_that_do_not_exist(text):
    """K of N is from 0 to N − 1."""
    with pytest.raises(Exception, match="must be K/N"):
        parse_part(text)
