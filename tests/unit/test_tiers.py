"""The tiers of the tests: default and excluded tests, and the guard against unmarked compilation."""

import pytest

import sand

from .. import specs
from ..validation import parse_part, part_of


def test_at_most_eight_specifications():
    """Drivers and scattering; each name has one kernel specification, and none has two names."""
    assert len(specs.DRIVERS) + 1 <= 8
    assert sorted(specs._kernel_specs().values()) == sorted(specs.DRIVERS)


def test_other_drivers_have_no_name():
    """A simulation with gravity alone is not in tests/specs.py."""
    sim = sand.Simulation(sand.Grains([[0, 0, 0]], 1e-8, "silica"), [sand.Gravity("9.81 m/s^2")])
    assert specs.name_of(sim._engine._kernel_spec) is None


def test_an_unmarked_test_takes_no_steps():
    """The guard of conftest.py raises before a driver is compiled."""
    sim = specs.contacts()
    with pytest.raises(AssertionError, match=r"takes steps with the driver 'contacts'.*pytest\.mark\.compiled"):
        sim.run(steps=1)


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
