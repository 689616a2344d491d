"""Units at the door."""

import math
import re

import pint
import pytest

from sand.core import units
from sand.core.errors import BadInput
from sand.core.units import in_unit, si, spoken


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


@pytest.mark.slow
@pytest.mark.parametrize("unit", ["m", "s", "kg", "K", "Pa", "T", "J/m^2", "A m^2/kg", "kg/m^3", "rad/s", "C", "1"])
def test_units_that_need_no_pint_are_those_of_pint(unit):
    """Every prefix of every unit that is read without it, alone and as a factor: the same number, or refused alike."""
    registry = pint.UnitRegistry()
    for name in units._COMMON:
        for text in (name, f"{name}/m^2", f"J {name}^-1*A", f"A m²/{name}", f"kg·{name}**3 / s", f"J/kg {name}"):
            spelled = re.sub(r"(?<=[A-Za-zµμÅ])(-?\d)", r"**\1", text.replace("²", "**2").replace("·", "*"))
            try:
                right = registry.Quantity(1.0, spelled).to(unit.replace("^", "**")).magnitude
            except pint.DimensionalityError:
                right = None
            assert units._powers(text) is not None
            assert units._factor(text, unit) == (right and pytest.approx(right, rel=1e-14, abs=0.0))


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


def test_ranges_and_numbers_that_are_none():
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
    """Of any registry."""
    registry = pint.UnitRegistry()
    assert in_unit(3 * registry.micrometer, "m") == pytest.approx(3e-6, rel=1e-6, abs=0.0)
    assert in_unit(3 * registry.second, "m") is None


def test_quantities_of_astropy_by_what_they_can_do():
    """Anything with `to_value(unit)`; astropy itself need not be installed."""

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
def test_numbers_for_people(value, unit, text):
    """With an SI prefix."""
    assert spoken(value, unit) == text
