"""Text with a unit, and the factors between units: SI with prefixes, Gaussian magnetic units, and all units of pint.

A temperature in degC or degF also has an offset, and one in eV is the energy k_B T.
"""

from __future__ import annotations

import functools
import math
import re
from decimal import Decimal
from typing import Any

from .constants import BOLTZMANN

# A number, then a unit of names, integer powers of one digit, products and quotients, or 1 over these; no arithmetic.
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?|[+-]?(?:inf|nan)"
_UNIT = r"[A-Za-zµμΩÅ°%][A-Za-zµμΩÅ°]*(?:(?:\^|\*\*)?-?\d|[²³])?"
# The pattern is unambiguous: with several ways to match, text that does not match would take exponential time.
TEXT = re.compile(
    rf"\s*({NUMBER})(?:\s+1(?=\s*/))?\s*((?:/\s*)?{_UNIT}(?:(?:\s*[*/·]\s*|\s+){_UNIT})*)?\s*", re.IGNORECASE
)
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
    "dyn": (-5, 1, 1, -2, 0, 0),
    "erg": (-7, 2, 1, -2, 0, 0),
    "G": (-4, 0, 1, -2, -1, 0),
    "gauss": (-4, 0, 1, -2, -1, 0),
    # the flux density of this field in empty space, where 1 Oe belongs to 1 G
    "Oe": (-4, 0, 1, -2, -1, 0),
    "oersted": (-4, 0, 1, -2, -1, 0),
    "emu": (-3, 2, 0, 0, 1, 0),  # of magnetic moment, 1 erg/G
}
_PREFIXES = {"": 0, "f": -15, "p": -12, "n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}
_NAMED = {
    "rad": (0, 0, 0, 0, 0, 0),
    "angstrom": (-10, 1, 0, 0, 0, 0),
    "Å": (-10, 1, 0, 0, 0, 0),
    "Gauss": _BASIC["G"],
    "Oersted": _BASIC["Oe"],
}
_COMMON = {p + u: (t + powers[0], *powers[1:]) for u, powers in _BASIC.items() for p, t in _PREFIXES.items()} | _NAMED
_FACTOR = re.compile(r"\s*([*/·]?)\s*([^\W\d²³]+)(?:(?:\^|\*\*)?(-?\d)|([²³]))?")

_GAUSSIAN = {
    "G|[Gg]auss": "sand_gauss = 1e-4 tesla",
    "Oe|[Oo]ersted": "sand_oersted = 1e-4 tesla",
    "emu": "sand_emu = 1e-3 ampere * meter ** 2",
    "statC|statcoulomb|esu|Fr|franklin": f"sand_franklin = {1.0 / 2997924580.0!r} coulomb",
}
"""Gaussian units by their names, in pint's language; pint itself gives them dimensions other than those of SI."""
_PREFIX = "[fpnuµμmckMG]?|femto|pico|nano|micro|milli|centi|kilo|mega|giga"
_KELVIN = {
    **dict.fromkeys(("degC", "°C", "deg_C", "degree_Celsius", "celsius", "Celsius"), (1.0, 273.15)),
    **dict.fromkeys(("degF", "°F", "deg_F", "degree_Fahrenheit", "fahrenheit", "Fahrenheit"), (5 / 9, 459.67 * 5 / 9)),
}
"""Factor and offset [K] of the scales of temperature."""
_ENERGY_OF_ELECTRON = re.compile(r"[A-Za-zµμ]*(?:eV|electron_?volt)s?")
_CYCLES = re.compile(r"(?<![A-Za-z])[A-Za-zµμ]*(?:Hz|hertz|Bq|becquerel)(?![A-Za-z])")
_ANGLES = re.compile(r"rad|rpm|rps|rev|turn|deg|cycle")


def powers_of(text: str) -> tuple[int, ...] | None:
    """Exponents of ten, m, kg, s, A and K of a unit, or None if it contains a unit that is not in `_COMMON`."""
    total: tuple[int, ...] = (0,) * 6
    position = 1 if text.startswith("1/") else 0
    while position < len(text):
        found = _FACTOR.match(text, position)
        if found is None or found[2] not in _COMMON:
            return None
        power = int(found[3] or {"²": 2, "³": 3}.get(found[4], 1)) * (-1 if found[1] == "/" else 1)
        total = tuple(a + power * b for a, b in zip(total, _COMMON[found[2]], strict=True))
        position = found.end()
    return total


@functools.cache
def registry() -> Any:
    """The units of pint, and Gaussian ones."""
    import pint

    registry = pint.UnitRegistry(cache_folder=None)
    for definition in _GAUSSIAN.values():
        registry.define(definition)
    return registry


def spelled(text: str) -> str:
    """A unit in the notation of pint."""
    found = f"1{text}" if text.startswith("/") else text
    found = found.replace("·", "*").replace("²", "**2").replace("³", "**3")
    found = re.sub(r"(?<=[A-Za-zµμΩÅ°])(-?\d)", r"**\1", found)
    for names, definition in _GAUSSIAN.items():
        found = re.sub(rf"(?<![A-Za-z])({_PREFIX})(?:{names})(?![A-Za-z])", rf"\1{definition.split()[0]}", found)
    return found


@functools.lru_cache(maxsize=512)
def factor(text: str, unit: str) -> float | None:
    """Factor from the unit `text` to `unit`, or None if they are not multiples of each other."""
    given, wanted = powers_of(text), powers_of(unit)
    if given and wanted:
        power = float(f"1e{given[0] - wanted[0]}")
        return power if given[1:] == wanted[1:] and 0.0 < power < math.inf else None
    if (unit == "rad/s" and _CYCLES.search(text)) or (unit == "Hz" and _ANGLES.search(text)):
        return None  # 1 Hz are 2π rad/s, but pint takes an angle for a number
    import pint

    try:
        none, one = (registry().Quantity(n, spelled(text)).to(unit.replace("^", "**")).magnitude for n in (0.0, 1.0))
        # units with an offset (0 degC is not 0 K) and logarithmic units (0 dB is 1) have no factor
        return float(one) if none == 0.0 and 0.0 < one < math.inf else None
    except (pint.errors.PintError, ArithmeticError, AttributeError, TypeError, ValueError, AssertionError):
        return None


def scale(text: str, unit: str) -> tuple[float, float] | None:
    """Factor and offset from the unit `text` to `unit`; the offset is 0 but for temperatures. None if there is none."""
    if unit == "K" and text in _KELVIN:
        return _KELVIN[text]
    if unit == "K" and _ENERGY_OF_ELECTRON.fullmatch(text):
        energy = factor(text, "J")
        return None if energy is None else (energy / BOLTZMANN, 0.0)
    found = factor(text, unit)
    return None if found is None else (found, 0.0)


@functools.lru_cache(maxsize=512)
def is_unit(text: str) -> bool:
    """Whether this is a unit, of any dimension."""
    try:
        return powers_of(text) is not None or bool(registry().parse_units(spelled(text)) is not None)
    except Exception:  # various error classes of pint, which is not imported here
        return False


def number_from_text(text: str, unit: str) -> float | None:
    """Convert a number with a unit to SI; None if it is none, or one of another dimension.

    A unit may be missing if `unit` is "1" or the number is 0.
    """
    match = TEXT.fullmatch(text) if len(text) <= LONGEST_TEXT else None
    if not match:
        return None
    number, given = match.groups()
    if not given:
        return float(number) if unit == "1" or float(number) == 0.0 else None
    found = scale(given.strip(), unit)
    return None if found is None else times(number, found[0]) + found[1]


def times(number: str, factor: float) -> float:
    """Product number × factor, in exact decimal arithmetic if the factor is a power of ten: '5 us' is 5e-06."""
    power = round(math.log10(factor)) if factor > 0.0 else 0
    if factor == float(f"1e{power}") and "n" not in number.lower():
        return float(Decimal(number).scaleb(power))
    return float(number) * factor
