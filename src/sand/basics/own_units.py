"""Units of own quantities: quantities of any dimension as numbers in SI with their unit."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from .conversion import has_unit_within, in_unit
from .unit_factors import LONGEST_TEXT, NUMBER, TEXT, factor, powers_of, registry, spelled, times

_SI_UNITS = (
    *("m", "kg", "s", "A", "K", "mol", "cd", "rad"),
    *("N", "J", "W", "Pa", "C", "V", "ohm", "T", "Wb", "F", "H", "Hz"),
)
"""Units of SI without a prefix that replace others of the same dimension."""


@functools.lru_cache(maxsize=512)
def si_unit(text: str) -> str | None:
    """SI unit of the dimension of a unit: "W/m^2" for "mW/cm^2", "J" for "eV", "1" for "percent".

    A unit that is one of SI is kept as it is written; of others, each factor becomes one of SI.

    Parameters
    ----------
    text : str
        A unit as in text with a unit, or its inverse "1/s"; "1" or "" for pure numbers.

    Returns
    -------
    str or None
        The unit; None if it is unknown, or no multiple of a unit of SI: degC has an offset, dB a logarithm.
    """
    unit = _as_factors(text)
    if unit in ("", "1"):
        return "1"
    match = TEXT.fullmatch(f"1 {unit}") if len(unit) < LONGEST_TEXT else None
    if not match or not match[2]:
        return None
    written = re.sub(r"\s*([*/·])\s*", r"\1", unit.replace("**", "^").replace("²", "^2").replace("³", "^3"))
    powers = powers_of(unit)
    if powers and powers[0] == 0:
        return written
    import pint

    try:
        base = _compact(registry().get_base_units(spelled(unit))[1])
        ratio = factor(unit, base)
        if ratio is None or ratio == 1.0 or base == "1":
            return None if ratio is None else "1" if base == "1" else written
        known = {_compact(registry().get_base_units(each)[1]): each for each in reversed(_SI_UNITS)}
        parts: dict[str, int] = {}
        for name, power in registry().parse_units(spelled(unit))._units.items():
            own = _compact(registry().get_base_units(name)[1])
            if own != "1":
                parts[known.get(own, own)] = parts.get(known.get(own, own), 0) + int(power)
        simple = all(re.fullmatch("[A-Za-z]+", name) for name in parts)
        found = _written(parts) if simple else base
        return found if factor(unit, found) is not None else base
    except (pint.errors.PintError, ArithmeticError, AttributeError, TypeError, ValueError, AssertionError):
        return None


def _as_factors(text: str) -> str:
    """A unit that begins with a name and has no brackets: "s^-1" for "1/s", "J/kg/K" for "J/(kg K)"."""
    flat = re.sub(
        r"/\s*\(([^()]*)\)", lambda found: "/" + "/".join(re.split(r"[\s*·]+", found[1].strip())), text.strip()
    )
    inverse = re.fullmatch(r"1\s*/\s*([^\W\d²³]+)(?:(?:\^|\*\*)?(\d)|([²³]))?", flat)
    return f"{inverse[1]}^-{inverse[2] or {'²': 2, '³': 3}.get(inverse[3], 1)}" if inverse else flat


def _written(powers: Mapping[str, int]) -> str:
    """Unit from the powers of its factors: "kg m^2/s^3"."""
    above, below = (
        [f"{name}^{abs(p)}" if abs(p) > 1 else name for name, p in powers.items() if p * sign > 0] for sign in (1, -1)
    )
    if not above:
        return " ".join(f"{name}^{p}" for name, p in powers.items() if p) or "1"
    return "/".join([" ".join(above), *below])


def _compact(unit: Any) -> str:
    """A unit of base units of pint, with symbols and integer powers."""
    return _written({f"{registry().get_symbol(name)}": int(power) for name, power in unit._units.items()})


def with_own_unit(value: Any) -> tuple[Any, str] | None:
    """Convert a quantity of any dimension to SI.

    Parameters
    ----------
    value : float, array_like, str, tuple or quantity
        Numbers without a unit; text with a unit; numbers and a unit, `(values, "W/m^2")`; a quantity of pint, astropy
        or unyt, or an array of xarray; or a list of texts and quantities of one dimension, and of numbers in SI.

    Returns
    -------
    tuple of (float or ndarray, str) or None
        Values, and their unit of SI; None if it is no such quantity.
    """
    given: str = "1"
    if isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], str):
        value, given = (None if isinstance(value[0], str) else value[0]), _as_factors(value[1])
    elif isinstance(value, str):
        match = re.fullmatch(rf"\s*({NUMBER})(.*)", value) if len(value) <= LONGEST_TEXT else None
        value, given = (match[1], _as_factors(match[2])) if match else (None, "1")
    elif hasattr(value, "to_value"):  # astropy, unyt
        unit_of_value = value.unit.to_string().replace(" ", "*") if hasattr(value, "unit") else str(value.units)
        value, given = value.value, {"dimensionless": ""}.get(unit_of_value, unit_of_value) or "1"
    elif hasattr(value, "magnitude"):  # pint, of any registry
        value, given = value.magnitude, f"{value.units:~C}" or "1"
    elif isinstance(getattr(value, "attrs", None), Mapping) and "units" in value.attrs:  # xarray
        value, given = value.values, str(value.attrs["units"])
    elif (isinstance(value, list) or (type(value) is np.ndarray and value.ndim)) and has_unit_within(value):
        return _of_entries(list(value))
    unit = si_unit(given)
    ratio = None if unit is None else 1.0 if given in ("", unit) else factor(given, unit)
    if unit is None or ratio is None:
        return None
    if isinstance(value, str):
        return times(value, ratio), unit
    numbers = in_unit(value, "1")
    return None if numbers is None else (numbers * ratio, unit)


def _of_entries(values: list[Any]) -> tuple[Any, str] | None:
    """As `with_own_unit`, for a list: its unit is the first one of an entry."""
    found = [with_own_unit(one) for one in values]
    if any(one is None for one in found):
        return None
    unit = next((one[1] for one in found if one is not None and one[1] != "1"), "1")
    numbers = in_unit(values, unit)
    return None if numbers is None else (numbers, unit)
