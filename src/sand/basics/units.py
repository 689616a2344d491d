"""The user's quantities as SI floats, with checks of unit and range, and numbers as text with a unit."""

from __future__ import annotations

import math
import operator
import re
from decimal import Decimal
from typing import Any

import numpy as np

from .constants import LIGHT
from .conversion import EXAMPLES, dimensions, has_unit_within, in_unit, not_a_quantity, si_array
from .errors import BadInput, shown
from .unit_factors import LONGEST_TEXT

__all__ = ["EXAMPLES", "LONGEST_TEXT", "dimensions", "has_unit_within", "in_unit", "not_a_quantity", "si_array"]

LEAST, MOST = 1e-60, 1e60
"""Range of the magnitudes of SI numbers; their products and powers stay within double precision."""
MELTED = 5000.0
"""Temperature [K] above which no material is solid."""
LARGEST = {
    "K": (1e12, "where matter has no atoms"),
    "m": (1e27, "the size of the observable universe"),
    "s": (1e18, "more than the age of the universe"),
    "kg": (1e31, "more than the mass of the Sun"),
    "kg/m^3": (1e18, "more than the density of nuclei"),
    "m/s^2": (1e13, "more than the gravity of neutron stars"),
    "T": (1e12, "more than the fields of neutron stars"),
    "A m^2": (1e24, "more than the moment of the Earth"),
    "C": (1e6, "more than the charge of the Earth"),
    "Pa": (1e36, "more than the stiffness of neutron stars"),
    "J/m^3": (1e36, "more than the stiffness of neutron stars"),
    "J/m^2": (1e18, "more than the surface tension of nuclei"),
    "A m^2/kg": (1e4, "more than the moments of all electrons of matter"),
}
"""Largest magnitude accepted in each unit, and what it exceeds: larger numbers are mistakes of unit or exponent."""


def si(
    value: Any,
    unit: str,
    name: str,
    *,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
    most: float | None = None,
) -> float:
    """Convert a quantity to one finite SI number within a range.

    Parameters
    ----------
    value, unit, name
        As for `finite_number`.
    above, least, below, most : float or None, optional
        Allowed range: number > above, number ≥ least, number < below, number ≤ most.

    Returns
    -------
    float
        The number in `unit`.

    Raises
    ------
    BadInput
        As `finite_number`, or if the number is out of range, exceeds a limit of `LARGEST`, or is a speed that reaches
        that of light and `below` is not given.
    """
    number = finite_number(value, unit, name)
    label = f"{name} = {shown(value)}"
    in_units = "" if unit == "1" else f" {unit}"
    bounds = (
        ("above", above, operator.gt),
        ("at least", least, operator.ge),
        ("below", below, operator.lt),
        ("at most", most, operator.le),
    )
    if not all(bound is None or holds(number, bound) for _, bound, holds in bounds):
        allowed = " and ".join(f"{words} {bound:g}" for words, bound, _ in bounds if bound is not None)
        raise BadInput(f"{label} must be {allowed}{in_units}")
    if unit == "m/s" and below is None and not abs(number) < LIGHT:
        raise BadInput(f"{label} is not below the speed of light, {LIGHT:.4g} m/s")
    if reason := too_large(abs(number), unit):
        raise BadInput(f"{label} is {reason}")
    return number


def finite_number(value: Any, unit: str, name: str) -> float:
    """Convert a quantity to one finite SI number, of any sign and size.

    Parameters
    ----------
    value : float or str or quantity
        Float in SI, text with a unit, or a quantity of pint, astropy or unyt.
    unit : str
        SI unit, for example "m" or "A m^2/kg"; "1" for a pure number.
    name : str
        Name of the argument, for the message.

    Raises
    ------
    BadInput
        If the unit is wrong, the value is not a number, not finite, or beyond the range of the computation.
    """
    number = in_unit(value, unit)
    if number is None or np.ndim(number) != 0:
        raise not_a_quantity(value, unit, name)
    in_units = "" if unit == "1" else f" {unit}"
    if not math.isfinite(number):
        raise BadInput(f"{name} = {shown(value)} is not finite; give a number{in_units and f' in{in_units}'}")
    if number != 0.0 and not LEAST < abs(number) < MOST:
        raise BadInput(
            f"{name} = {shown(value)} is not between {LEAST:g} and {MOST:g}{in_units}, the range of the computation"
        )
    return float(number)


def too_large(number: float, unit: str) -> str:
    """Which limit of `LARGEST` a magnitude exceeds, in words; empty if none."""
    largest, reason = LARGEST.get(unit, (math.inf, ""))
    return f"above {largest:g} {unit}, {reason}" if number > largest else ""


def is_word(value: Any, word: str) -> bool:
    """Whether `value` is this text; False for arrays, whose comparison with text would be an array."""
    return isinstance(value, str) and value == word


def _is_whole(value: Any) -> bool:
    """Whether a value is a whole number; time spans of numpy, which are integers to it, are none."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.timedelta64))


def whole_number(value: Any, name: str, least: int = 1, most: int | None = None) -> int:
    """Check a whole number from `least` to `most`. Raises BadInput."""
    is_whole = _is_whole(value)
    if not is_whole or value < least or (most is not None and value > most):
        bounds = f"of at least {least}" if most is None or (is_whole and value < least) else f"from {least} to {most:g}"
        raise BadInput(f"{name} = {shown(value)} must be a whole number {bounds}")
    return int(value)


def seed_given(value: Any, bits: int = 64) -> int:
    """Check a random seed, 0 … 2**bits − 1. Raises BadInput."""
    if not _is_whole(value) or not 0 <= value < 2**bits:
        raise BadInput(f"seed = {shown(value)} must be a whole number of at least 0, below 2**{bits}")
    return int(value)


def format_quantity(value: float, unit: str, past: float = math.nan) -> str:
    """Format a number with an SI prefix: 1.2e-6 m → '1.2 um'; `past` is a limit, as for `digits_past`."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g} {unit}"
    exponent = _prefix_exponent(value)
    return f"{value / 10.0**exponent:.{digits_past(value, past, 4)}g} {_SI_PREFIXES[exponent]}{unit}"


def digits_past(value: float, limit: float, least: int = 3) -> int:
    """How many digits show that a number is past a limit of up to four digits: 4 for 0.1004 and 0.1."""
    shown_limit = float(f"{limit:.4g}")
    return next((n for n in range(least, 17) if float(f"{value:.{n}g}") != shown_limit), 17)


def text_past(value: float, limit: float, least: int = 3) -> str:
    """A number that is past a limit, with three digits, or as many as show it."""
    return f"{value:.{digits_past(value, limit, least)}g}"


def exact_quantity(value: float, unit: str) -> str:
    """Format a number as text that is read as exactly this number: 1.2e-6 m → '1.2 um'."""
    short = f"{value:.12g}"
    if value != 0.0 and math.isfinite(value) and _TAKES_PREFIX.fullmatch(unit):
        exponent = _prefix_exponent(value)
        scaled = f"{value / 10.0**exponent:.12g}"
        if float(Decimal(scaled).scaleb(exponent)) == value:
            return f"{scaled} {_SI_PREFIXES[exponent]}{unit}"
    return f"{short if float(short) == value else repr(value)} {unit}"


_SI_PREFIXES = {-18: "a", -15: "f", -12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_TAKES_PREFIX = re.compile("(?!kg|rad)[A-Za-z]+(/[a-z]+)?")
"""Units whose prefix multiplies the whole unit, unlike that of m^2 or kg."""


def _prefix_exponent(value: float) -> int:
    """Exponent of the SI prefix for a number, a multiple of 3."""
    return min(max(3 * math.floor(math.log10(abs(value)) / 3 + 1e-12), -18), 9)
