"""Conversion of the user's quantities to SI floats, with checks of unit and range.

Plain numbers are in SI. Text is a number with a unit ("10 nm", "200 A m^2/kg", "1 us"). Quantities of pint and astropy
are recognised by their attributes, so that neither package is imported for plain numbers.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Mapping
from decimal import Decimal
from typing import Any

import numpy as np

from .constants import LIGHT
from .errors import BadInput, shown

EXAMPLES = {
    "m": "10 nm",
    "s": "5 us",
    "kg": "3e-20 kg",
    "kg/s": "1e-9 kg/s",
    "K": "100 K",
    "m/s": "10 m/s",
    "m/s^2": "9.81 m/s^2",
    "rad/s": "1e7 rad/s",
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

# A number, then a unit of names, integer powers of one digit, products and quotients; no arithmetic.
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?|[+-]?(?:inf|nan)"
_UNIT = r"[A-Za-zµμΩÅ°%][A-Za-zµμΩÅ°]*(?:(?:\^|\*\*)?-?\d|[²³])?"
# The pattern is unambiguous: with several ways to match, text that does not match would take exponential time.
_TEXT = re.compile(rf"\s*({_NUMBER})\s*({_UNIT}(?:(?:\s*[*/·]\s*|\s+){_UNIT})*)?\s*", re.IGNORECASE)
LONGEST_TEXT = 100
"""Characters of a number with its unit; longer text is refused before it is parsed."""

# Exponents of 10, m, kg, s, A, K. Units made of these are converted without pint, whose import takes 0.3 s.
_BASIC = {
    "m": (0, 1, 0, 0, 0, 0),
    "g": (-3, 0, 1, 0, 0, 0),
    "s": (0, 0, 0, 1, 0, 0),
    "A": (0, 0, 0, 0, 1, 0),
    "K": (0, 0, 0, 0, 0, 1),
    "C": (0, 0, 0, 1, 1, 0),
    "J": (0, 2, 1, -2, 0, 0),
    "N": (0, 1, 1, -2, 0, 0),
    "Pa": (0, -1, 1, -2, 0, 0),
    "T": (0, 0, 1, -2, -1, 0),
}
_PREFIXES = {"": 0, "f": -15, "p": -12, "n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}
_NAMED = {"rad": (0, 0, 0, 0, 0, 0), "angstrom": (-10, 1, 0, 0, 0, 0), "Å": (-10, 1, 0, 0, 0, 0)}
_COMMON = {p + u: (t + powers[0], *powers[1:]) for u, powers in _BASIC.items() for p, t in _PREFIXES.items()} | _NAMED
_FACTOR = re.compile(r"\s*([*/·]?)\s*([^\W\d²³]+)(?:(?:\^|\*\*)?(-?\d)|([²³]))?")


def _powers(text: str) -> tuple[int, ...] | None:
    """Exponents of ten, m, kg, s, A and K of a unit, or None if it contains a unit that is not in `_COMMON`."""
    total: tuple[int, ...] = (0,) * 6
    position = 0
    while position < len(text):
        found = _FACTOR.match(text, position)
        if found is None or found[2] not in _COMMON:
            return None
        power = int(found[3] or {"²": 2, "³": 3}.get(found[4], 1)) * (-1 if found[1] == "/" else 1)
        total = tuple(a + power * b for a, b in zip(total, _COMMON[found[2]], strict=True))
        position = found.end()
    return total


@functools.cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(cache_folder=None)


@functools.lru_cache(maxsize=512)
def _factor(text: str, unit: str) -> float | None:
    """Factor from the unit `text` to `unit`, or None if they are not multiples of each other."""
    given, wanted = _powers(text), _powers(unit)
    if given and wanted:
        factor = float(f"1e{given[0] - wanted[0]}")
        return factor if given[1:] == wanted[1:] and 0.0 < factor < math.inf else None
    import pint

    try:
        none, one = (_registry().Quantity(n, _spelled(text)).to(unit.replace("^", "**")).magnitude for n in (0.0, 1.0))
        # units with an offset (0 degC is not 0 K) and logarithmic units (0 dB is 1) have no factor
        return float(one) if none == 0.0 and 0.0 < one < math.inf else None
    except (pint.errors.PintError, ArithmeticError, AttributeError, TypeError, ValueError, AssertionError):
        return None


def _spelled(text: str) -> str:
    """A unit in the notation of pint."""
    spelled = text.replace("·", "*").replace("²", "**2").replace("³", "**3")
    return re.sub(r"(?<=[A-Za-zµμΩÅ°])(-?\d)", r"**\1", spelled)


def _times(number: str, factor: float) -> float:
    """Product number × factor, in exact decimal arithmetic if the factor is a power of ten: '5 us' is 5e-06."""
    power = round(math.log10(factor)) if factor > 0.0 else 0
    if factor == float(f"1e{power}") and "n" not in number.lower():
        return float(Decimal(number).scaleb(power))
    return float(number) * factor


def _wrong_unit(value: Any, unit: str, name: str) -> BadInput:
    example = EXAMPLES.get(unit, f"1 {unit}")
    return BadInput(
        f"{name} = {shown(value)} is not a quantity in {unit}; give a number in SI or text such as '{example}'"
    )


def in_unit(value: Any, unit: str) -> Any:
    """Convert a quantity to SI.

    Text without a unit is accepted if `unit` is "1" or if the number is 0.

    Returns
    -------
    float or ndarray or None
        The value in `unit`; None if it is not a quantity of that dimension.
    """
    if isinstance(value, str):
        match = _TEXT.fullmatch(value) if len(value) <= LONGEST_TEXT else None
        if not match:
            return None
        number, given = match.groups()
        bare = 1.0 if unit == "1" or float(number) == 0.0 else None
        factor = _factor(given.strip(), unit) if given else bare
        return None if factor is None else _times(number, factor)
    if value is None or isinstance(value, bool):
        return None
    if hasattr(value, "to_value"):  # astropy
        try:
            return np.asarray(value.to_value(unit.replace("^", "**").replace(" ", "*")), dtype=np.float64)[()]
        except Exception:  # astropy's error classes are not imported here
            return None
    if hasattr(value, "magnitude"):  # pint, of any registry
        factor = _factor(str(value.units), unit)
        return None if factor is None else np.asarray(value.magnitude, dtype=np.float64)[()] * factor
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError, RecursionError):
        return None
    return float(array) if array.ndim == 0 else array


_SI_UNITS = (
    "m",
    "kg",
    "s",
    "A",
    "K",
    "mol",
    "cd",
    "rad",
    "N",
    "J",
    "W",
    "Pa",
    "C",
    "V",
    "ohm",
    "T",
    "Wb",
    "F",
    "H",
    "Hz",
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
    match = _TEXT.fullmatch(f"1 {unit}") if len(unit) < LONGEST_TEXT else None
    if not match or not match[2]:
        return None
    written = re.sub(r"\s*([*/·])\s*", r"\1", unit.replace("**", "^").replace("²", "^2").replace("³", "^3"))
    powers = _powers(unit)
    if powers and powers[0] == 0:
        return written
    import pint

    try:
        base = _compact(_registry().get_base_units(_spelled(unit))[1])
        factor = _factor(unit, base)
        if factor is None or factor == 1.0 or base == "1":
            return None if factor is None else "1" if base == "1" else written
        known = {_compact(_registry().get_base_units(each)[1]): each for each in reversed(_SI_UNITS)}
        parts: dict[str, int] = {}
        for name, power in _registry().parse_units(_spelled(unit))._units.items():
            own = _compact(_registry().get_base_units(name)[1])
            if own != "1":
                parts[known.get(own, own)] = parts.get(known.get(own, own), 0) + int(power)
        simple = all(re.fullmatch("[A-Za-z]+", name) for name in parts)
        found = _written(parts) if simple else base
        return found if _factor(unit, found) is not None else base
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
    return _written({f"{_registry().get_symbol(name)}": int(power) for name, power in unit._units.items()})


def with_own_unit(value: Any) -> tuple[Any, str] | None:
    """Convert a quantity of any dimension to SI.

    Parameters
    ----------
    value : float, array_like, str, tuple or quantity
        Numbers without a unit; text with a unit; numbers and a unit, `(values, "W/m^2")`; or a quantity of pint or
        astropy.

    Returns
    -------
    tuple of (float or ndarray, str) or None
        Values, and their unit of SI; None if it is no such quantity.
    """
    given: str = "1"
    if isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], str):
        value, given = (None if isinstance(value[0], str) else value[0]), _as_factors(value[1])
    elif isinstance(value, str):
        match = re.fullmatch(rf"\s*({_NUMBER})(.*)", value) if len(value) <= LONGEST_TEXT else None
        value, given = (match[1], _as_factors(match[2])) if match else (None, "1")
    elif hasattr(value, "to_value"):  # astropy
        value, given = value.value, value.unit.to_string().replace(" ", "*") or "1"
    elif hasattr(value, "magnitude"):  # pint, of any registry
        value, given = value.magnitude, f"{value.units:~C}" or "1"
    unit = si_unit(given)
    factor = None if unit is None else 1.0 if given in ("", unit) else _factor(given, unit)
    if unit is None or factor is None:
        return None
    if isinstance(value, str):
        return _times(value, factor), unit
    numbers = in_unit(value, "1")
    return None if numbers is None else (numbers * factor, unit)


LEAST, MOST = 1e-60, 1e60
"""Range of the magnitudes of SI numbers; their products and powers stay within double precision."""
MELTED = 5000.0
"""Temperature [K] above which no material is solid."""
HOTTEST = 1e12
"""Highest temperature [K] accepted; above it there are neither atoms nor nuclei."""


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
    """Convert a quantity to one finite SI number.

    Parameters
    ----------
    value : float or str or quantity
        Float in SI, text with a unit, or a pint or astropy quantity.
    unit : str
        SI unit, for example "m" or "A m^2/kg"; "1" for a pure number.
    name : str
        Name of the argument, for the message.
    above, least, below, most : float or None, optional
        Allowed range: number > above, number ≥ least, number < below, number ≤ most.

    Returns
    -------
    float
        The number in `unit`.

    Raises
    ------
    BadInput
        If the unit is wrong, the value is not a number, not finite or out of range, a temperature exceeds `HOTTEST`, or
        a speed reaches that of light and `below` is not given.
    """
    number = in_unit(value, unit)
    if number is None or np.ndim(number) != 0:
        raise _wrong_unit(value, unit, name)
    label = f"{name} = {shown(value)}"
    in_units = "" if unit == "1" else f" {unit}"
    if not math.isfinite(number):
        raise BadInput(f"{label} is not finite; give a number{in_units and f' in{in_units}'}")
    if number != 0.0 and not LEAST < abs(number) < MOST:
        raise BadInput(f"{label} is not between {LEAST:g} and {MOST:g}{in_units}, the range of the computation")
    if above is not None and not number > above:
        raise BadInput(f"{label} must be above {above:g}{in_units}")
    if least is not None and not number >= least:
        raise BadInput(f"{label} must be at least {least:g}{in_units}")
    if below is not None and not number < below:
        raise BadInput(f"{label} must be below {below:g}{in_units}")
    if most is not None and not number <= most:
        raise BadInput(f"{label} must be at most {most:g}{in_units}")
    if unit == "m/s" and below is None and not abs(number) < LIGHT:
        raise BadInput(f"{label} is not below the speed of light, {LIGHT:.4g} m/s")
    if unit == "K" and number > HOTTEST:
        raise BadInput(f"{label} is above {HOTTEST:g} K, where matter has no atoms")
    return float(number)


def is_word(value: Any, word: str) -> bool:
    """Whether `value` is this text; False for arrays, whose comparison with text would be an array."""
    return isinstance(value, str) and value == word


def whole_number(value: Any, name: str, least: int = 1, most: int | None = None) -> int:
    """Check a whole number from `least` to `most`. Raises BadInput."""
    is_whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not is_whole or value < least or (most is not None and value > most):
        bounds = (
            f"of at least {least}" if most is None or (is_whole and value < least) else f"from {least} to {most:.3g}"
        )
        raise BadInput(f"{name} = {shown(value)} must be a whole number {bounds}")
    return int(value)


def seed_given(value: Any, bits: int = 64) -> int:
    """Check a random seed, 0 … 2**bits − 1. Raises BadInput."""
    is_whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not is_whole or not 0 <= value < 2**bits:
        raise BadInput(f"seed = {shown(value)} must be a whole number of at least 0, below 2**{bits}")
    return int(value)


def format_quantity(value: float, unit: str) -> str:
    """Format a number with an SI prefix: 1.2e-6 m → '1.2 um'."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g} {unit}"
    exponent = _prefix_exponent(value)
    return f"{value / 10.0**exponent:.4g} {_SI_PREFIXES[exponent]}{unit}"


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
