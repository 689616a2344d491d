"""Numbers as figures write them."""

import pytest

from sand.plotting.style import format_number


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (81.9, "82"),
        (99.4, "99"),
        (99.99, "100"),
        (100.0, "100"),
        (1234.0, "1230"),
        (0.0123, "0.012"),
        (31400.0, r"3.1$\times 10^{4}$"),
        (6.7e-4, r"6.7$\times 10^{-4}$"),
        (0.0, "0"),
        (-99.99, "-100"),
    ],
)
def test_numbers_have_no_exponent_below_ten_thousand(value, text):
    """Two digits, three from 99.5 on, which would be 100 in two: "1e+02" of a format with two digits is never shown."""
    assert format_number(value) == text
