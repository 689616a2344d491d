"""Units of arguments."""

import math
import re
import sys

import pytest

from sand.basics.errors import BadInput
from sand.basics.units import format_quantity, in_unit, si
from tests.unit.pint_units import UNIT


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("10 nm", "m", 1e-8),
        ("5 us", "s", 5e-6),
        ("25 ns", "s", 25e-9),
        ("10 angstrom", "m", 1e-9),
        ("200 A m^2/kg", "A m^2/kg", 200.0),
        ("200 A*m**2/kg", "A m^2/kg", 200.0),
        ("25 mJ/m^2", "J/m^2", 0.025),
        ("25 mJ/m²", "J/m^2", 0.025),
        ("54 GPa", "Pa", 54e9),
        ("1 mT", "T", 1e-3),
        ("2.65 g/cm^3", "kg/m^3", 2650.0),
        ("1e-9m", "m", 1e-9),
        ("-3.5e2 µm", "m", -3.5e-4),
    ],
)
def test_text_with_units(text, unit, value):
    """Decimal prefixes come out to the last bit."""
    assert in_unit(text, unit) == pytest.approx(value, rel=1e-15, abs=0.0)


def test_decimal_prefixes_are_exact():
    """'5 us' is the float 5e-06, not 5 times the float 1e-06."""
    assert in_unit("5 us", "s") == 5e-6
    assert in_unit("1.2 um", "m") == 1.2e-6


PREFIXES = ("", "f", "p", "n", "u", "µ", "μ", "m", "c", "k", "M", "G")
USUAL = [
    *(p + u for u in ("m", "g", "s", "A", "K", "C", "J", "N", "Pa", "T") for p in PREFIXES),
    "rad",
    "angstrom",
    "Å",
]
"""Units that are parsed without importing pint."""


FORMS = ("{}", "{}/m^2", "J {}^-1*A", "A m²/{}", "kg·{}**3 / s", "rad/{}", "{}/m^3", "J/{}")


@pytest.fixture(scope="module")
def samples():
    """Three of each common unit, alone and as a factor, as quantities of pint from SAND's text."""
    texts = [form.format(name) for form in FORMS for name in USUAL]
    spelled = [re.sub(r"(?<=[A-Za-zµμÅ])(-?\d)", r"**\1", t.replace("²", "**2").replace("·", "*")) for t in texts]
    return {text: UNIT.Quantity(3.0, other) for text, other in zip(texts, spelled, strict=True)}


@pytest.mark.slow
@pytest.mark.parametrize(
    "unit", ["m", "s", "kg", "K", "Pa", "T", "J/m^2", "A m^2/kg", "kg/m^3", "rad/s", "C", "A m^2", "1"]
)
def test_built_in_units_agree_with_pint(unit, samples, monkeypatch):
    """Every prefix of every common unit, alone and as a factor: pint's value to rounding, or refused.

    pint cannot be imported while they are read, except for pure numbers, which need it.
    """
    wanted = unit.replace("^", "**")
    expected = {text: value.to(wanted).magnitude for text, value in samples.items() if value.is_compatible_with(wanted)}
    assert len(expected) >= 2
    if unit != "1":
        monkeypatch.setitem(sys.modules, "pint", None)
    found = {text: value for text in samples if (value := in_unit(f"3 {text}", unit)) is not None}
    assert found == pytest.approx(expected, rel=1e-14, abs=0.0)


@pytest.mark.parametrize(
    "text",
    [
        "10 kg",
        "nm",
        "10",
        "",
        "10 nmm",
        "ten nm",
        "1e9999 m",
        "2**9 m",
        "__import__('os')",
        "1 m; 2 m",
        "1 m^99",
    ],
)
def test_what_is_not_a_length(text):
    """Wrong units, no units, nonsense and code are refused with the name, what was given and an example."""
    with pytest.raises(BadInput, match=r"radius = .*m.*10 nm|not finite"):
        si(text, "m", "radius")


def test_ranges_and_malformed_numbers():
    """One line each."""
    with pytest.raises(BadInput, match="radius = -1 must be above 0 m"):
        si(-1, "m", "radius", above=0.0)
    with pytest.raises(BadInput, match="at least 0 K"):
        si("-3 K", "K", "temperature", least=0.0)
    with pytest.raises(BadInput, match="not finite"):
        si(math.nan, "m", "radius")
    with pytest.raises(BadInput):
        si(True, "m", "radius")


@pytest.mark.slow
def test_quantities_of_pint():
    """From any registry."""
    assert in_unit(3 * UNIT.micrometer, "m") == pytest.approx(3e-6, rel=1e-6, abs=0.0)
    assert in_unit(3 * UNIT.second, "m") is None


def test_quantities_with_to_value():
    """Anything with `to_value(unit)`, as in astropy, which need not be installed."""

    class Duck:
        def to_value(self, unit):
            if unit != "m":
                raise TypeError
            return 3e-6

    assert in_unit(Duck(), "m") == 3e-6
    assert in_unit(Duck(), "s") is None


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(1.2e-6, "m", "1.2 um"), (5e-6, "s", "5 us"), (0.0, "s", "0 s"), (1.0, "m", "1 m")],
)
def test_numbers_with_si_prefix(value, unit, text):
    """The prefix leaves one to three digits."""
    assert format_quantity(value, unit) == text
