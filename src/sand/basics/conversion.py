"""Conversion of numbers, text, quantities with units, and lists and arrays of these, to SI floats.

Plain numbers are in SI. Text is a number with a unit ("10 nm", "200 A m^2/kg", "1 us"). Quantities of pint, astropy and
unyt are recognised by their attributes, so that none of these packages is imported for plain numbers. Lists and arrays
are converted entry by entry where an entry is not a plain number; a unit, a mask or an imaginary part is never dropped.
"""

from __future__ import annotations

import datetime
import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from .errors import BadInput, shown
from .unit_factors import is_unit, number_from_text, scale

EXAMPLES = {
    "m": "10 nm",
    "s": "5 us",
    "kg": "3e-20 kg",
    "kg/s": "1e-9 kg/s",
    "K": "100 K",
    "m/s": "10 m/s",
    "m/s^2": "9.81 m/s^2",
    "rad/s": "1e7 rad/s",
    "1/s": "1e4 1/s",
    "kg/m^3": "2650 kg/m^3",
    "J/m^2": "25 mJ/m^2",
    "J/m^3": "48 kJ/m^3",
    "J/m": "2e-11 J/m",
    "Pa": "54 GPa",
    "T": "1 mT",
    "A m^2": "6.6e-18 A m^2",
    "A m^2/kg": "200 A m^2/kg",
    "C": "1.6e-19 C",
}
"""One quantity per unit, for error messages."""

KINDS = {
    "m": "a length",
    "s": "a time",
    "kg": "a mass",
    "K": "a temperature",
    "m/s": "a speed",
    "kg/m^3": "a density",
    "N": "a force",
    "J": "an energy or a torque",
    "Pa": "a pressure",
    "J/m^2": "an energy per area",
    "T": "a flux density",
    "A m^2": "a magnetic moment",
    "A m^2/kg": "a magnetic moment per mass",
    "C": "a charge",
    "V": "a voltage",
    "Hz": "a frequency",
    "rad/s": "an angular velocity",
    "A/m": "a magnetic field strength",
}
"""What a quantity in each unit is, for values of a wrong unit."""
DEEPEST = 8
"""Lists within lists that are looked through."""
HINTS = (
    ("K", "C", "the unit of a temperature in degrees Celsius is degC"),
    ("T", "A/m", "give the flux density μ0 H, 4π × 1e-7 T for 1 A/m"),
    ("rad/s", "Hz", "1 Hz are 2π rad/s"),
    ("Hz", "rad/s", "1 Hz are 2π rad/s"),
)
"""Wanted unit, a given one that is often meant for it, and what to write."""


def in_unit(value: Any, unit: str) -> Any:
    """Convert a quantity to SI.

    Text without a unit is accepted if `unit` is "1" or if the number is 0. A temperature in degC, degF or eV (k_B T)
    becomes one in K.

    Returns
    -------
    float or ndarray or None
        The value in `unit`; None if it is not a quantity of that dimension.
    """
    try:
        return _converted(value, unit)
    except Exception:  # errors of NumPy, and of objects that are no numbers
        return None


def _converted(value: Any, unit: str) -> Any:
    """As `in_unit`, which turns the errors of NumPy into None."""
    if isinstance(value, str):
        return number_from_text(value, unit)
    if value is None or isinstance(value, (bool, np.bool_, bytes, bytearray, Mapping)) or is_masked(value):
        return None
    if isinstance(value, datetime.timedelta):
        return _scaled(value.total_seconds(), "s", unit)
    for read in (_from_pint, _from_to_value, _from_labelled):
        if (found := read(value, unit)) is not NotImplemented:
            return found
    if not isinstance(value, np.ndarray | np.generic):
        if isinstance(value, Sequence) and not _is_plain(value):
            return _stacked(list(value), unit)
        if hasattr(value, "__array__") or isinstance(value, Sequence):
            value = np.asarray(value)
        elif hasattr(value, "__iter__"):
            return None
    kind = value.dtype.kind if isinstance(value, np.ndarray | np.generic) else "f"
    if kind == "m":
        generic = np.datetime_data(value.dtype)[0] == "generic"
        return None if generic else _scaled(value / np.timedelta64(1, "s"), "s", unit)
    if kind in "OUT":
        return _stacked(list(value), unit) if value.ndim else _converted(value.item(), unit)
    if kind not in "iuf":
        return None
    array = np.asarray(value, dtype=np.float64)
    return float(array) if array.ndim == 0 else array


def _scaled(number: Any, given: str, unit: str) -> Any:
    """A number or an array in the unit `given`, converted; None if that has another dimension."""
    found = scale(given, unit)
    if found is None or is_masked(number) or isinstance(number, str):
        return None
    array = np.asarray(number)
    if array.dtype.kind not in "iufO":
        return None
    converted = np.asarray(array, dtype=np.float64) * found[0] + found[1]
    return float(converted) if converted.ndim == 0 else converted


def _from_pint(value: Any, unit: str) -> Any:
    """A quantity of pint, of any registry; NotImplemented for other objects."""
    if not hasattr(value, "magnitude"):
        return NotImplemented
    found = _scaled(value.magnitude, str(value.units), unit)
    if found is None and hasattr(value, "m_as") and not is_masked(value.magnitude) and not is_unit(str(value.units)):
        try:  # units that only this registry has
            found = _converted(value.m_as(unit.replace("^", "**")), "1")
        except Exception:  # pint's error classes are not imported here
            return None
    return found


def _from_to_value(value: Any, unit: str) -> Any:
    """A quantity of astropy or unyt; NotImplemented for other objects."""
    if not hasattr(value, "to_value"):
        return NotImplemented
    try:
        return _converted(np.asarray(value.to_value(unit.replace("^", "**").replace(" ", "*"))), "1")
    except Exception:  # error classes of these packages are not imported here
        given = getattr(value, "unit", getattr(value, "units", None))
        return _scaled(value.value, str(given), unit) if given is not None and hasattr(value, "value") else None


def _from_labelled(value: Any, unit: str) -> Any:
    """An array of xarray with an attribute `units`, or None for other objects with a unit; NotImplemented without."""
    attributes = getattr(value, "attrs", None)
    if isinstance(attributes, Mapping):
        if hasattr(getattr(value, "data", None), "magnitude"):  # pint in xarray
            return _from_pint(value.data, unit)
        given = attributes.get("units", attributes.get("unit"))
        return NotImplemented if given is None else _scaled(np.asarray(value), str(given), unit)
    return None if has_unit(value) else NotImplemented


def has_unit(value: Any) -> bool:
    """Whether an object has a unit of its own: a quantity of pint, astropy, unyt, or another package."""
    if isinstance(value, (str, float, int, list, tuple)) or type(value) is np.ndarray:
        return False
    if isinstance(value, type):
        return False
    return any(hasattr(value, name) for name in ("to_value", "units", "unit", "magnitude"))


def has_unit_within(value: Any, depth: int = 0) -> bool:
    """Whether a value, or an entry of a list or an array, is text, has a unit or is masked."""
    if isinstance(value, (list, tuple)):
        plain = depth == DEEPEST or set(map(type, value)) <= {float, int}
        return not plain and any(has_unit_within(one, depth + 1) for one in value)
    if type(value) is np.ndarray:
        return value.dtype.kind in "UTmM" or (value.dtype.kind == "O" and any(map(has_unit_within, value.flat)))
    return isinstance(value, (str, np.timedelta64, datetime.timedelta)) or has_unit(value) or is_masked(value)


def dimensions(value: Any) -> int:
    """Number of axes of an array, or of lists within lists; 0 for a number, text or a quantity.

    `numpy.ndim` drops units in lists, and raises errors for some.
    """
    count = 0
    while isinstance(value, (list, tuple)) and count < DEEPEST:
        count, value = count + 1, value[0] if value else None
    if count:
        return count + (dimensions(value) if count < DEEPEST else 0)
    found = getattr(value, "ndim", 0)
    return found if isinstance(found, int) else 0


def is_masked(value: Any) -> bool:
    """Whether entries of an array are masked, that is, missing."""
    mask = getattr(value, "mask", None)
    return isinstance(mask, np.ndarray | np.bool_) and bool(np.any(mask))


def _is_plain(values: Any, depth: int = 0) -> bool:
    """Whether a sequence, or one of sequences, holds only plain numbers, which NumPy converts without a loss."""
    if type(values) is np.ndarray:
        return values.dtype.kind in "iuf"
    if isinstance(values, (list, tuple)):
        return set(map(type, values)) <= {float, int} or (
            depth < DEEPEST and all(_is_plain(one, depth + 1) for one in values)
        )
    return isinstance(values, (float, int, np.integer, np.floating, range)) and not isinstance(values, bool)


def _stacked(entries: list[Any], unit: str) -> Any:
    """An array of entries, each converted; None if one is not a quantity or they differ in shape."""
    found = [in_unit(one, unit) for one in entries]
    return None if any(one is None for one in found) else np.asarray(found, dtype=np.float64)


def not_a_quantity(value: Any, unit: str, name: str) -> BadInput:
    """The error for a value that `in_unit` does not convert; in lists and arrays it names the first such entry."""
    for _ in range(3):  # (N, 3) and one more
        if isinstance(value, (str, bytes)):
            break
        if is_masked(value) and np.ndim(value.mask):
            missing = int(np.sum(value.mask))
            return BadInput(f"{name} has masked entries, {missing} of {value.mask.size}; fill them, or leave them out")
        bad = next(((k, one) for k, one in enumerate(_entries(value)) if in_unit(one, unit) is None), None)
        if bad is None or bad[1] is value:
            break
        name, value = f"{name}[{bad[0]}]", bad[1]
    label, hints = f"{name} = {shown(value)}", [text for to, of, text in HINTS if to == unit and _is_of(value, of)]
    if any(True for _ in _entries(value)) and not has_unit(value) and not isinstance(value, Mapping):
        label += " has entries that differ in length or are not numbers, and"
    if unit == "1":
        return BadInput(f"{label} is not a number; give one without a unit")
    example = f"give a number in SI or text such as '{EXAMPLES.get(unit, f'1 {unit}')}'"
    return BadInput(f"{label} is {kind_of(value)}not a quantity in {unit}; {hints[0] if hints else example}")


def kind_of(value: Any) -> str:
    """What a value with a unit is, such as "a mass, "; empty for other values."""
    return next((f"{kind}, " for unit, kind in KINDS.items() if _is_of(value, unit) and not _is_of(value, "1")), "")


def _is_of(value: Any, unit: str) -> bool:
    """Whether a value has a unit, and it is of this dimension."""
    return (isinstance(value, str) or has_unit(value)) and in_unit(value, unit) is not None


def _entries(value: Any) -> Iterator[Any]:
    """The entries of a list or an array of objects, the first 100,000; none of anything else."""
    is_array = isinstance(value, np.ndarray) and value.dtype.kind in "OUT" and value.ndim > 0
    is_list = isinstance(value, Sequence) and not isinstance(value, (str, bytes, range))
    return itertools.islice(iter(value), 100_000) if is_array or is_list else iter(())


def si_array(value: Any, unit: str, name: str) -> np.ndarray:
    """Convert numbers, text or quantities to an array of SI floats, of any shape.

    Raises
    ------
    BadInput
        If one of them is not a quantity of that dimension.
    """
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    found = in_unit(value, unit)
    if found is None:
        raise not_a_quantity(value, unit, name)
    return np.asarray(found, dtype=np.float64)
