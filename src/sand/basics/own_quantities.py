"""Own quantities of grains: numbers of the user of any name and unit, which no force depends on."""

from __future__ import annotations

import keyword
import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from .errors import BadInput, shown
from .own_units import with_own_unit
from .schema import BY_NAME, GrainField, public, stored
from .units import in_unit

LONGEST_NAME = 60
"""Most characters of a name."""
RESERVED = frozenset(
    {
        *BY_NAME,
        # attributes of grains, frames, sequences of frames and changes
        *("arrays", "material", "materials", "id", "own", "overlaps", "touching", "own_units", "with_arrays"),
        *("with_own", "copy", "grains", "forces", "box", "refuse_overlaps", "kept"),
        *("remove", "add", "scale_box", "replace", "regroups", "is_of_own", "checked_forces", "checked_grains"),
        *("step", "time", "pair", "overlap", "formed", "slide", "roll", "twist", "share", "drawn", "at_rest"),
        *("image", "images", "unwrapped", "ix", "iy", "iz", "v_time", "material_names"),
        *("path", "close", "frames", "at", "count", "index", "stored", "pairs", "identities"),
        *("written_by_sand", "head", "has_array"),
        # quantities and figures of `sand plot`, and other variables of `Run.to_xarray`
        *("cluster", "size", "coordination", "speed", "kinetic_energy", "alignment", "field_alignment"),
        *("pressure", "virial", "stored_virial", "deformation"),
        *("load", "mode", "energies", "losses", "contacts", "balance", "temperatures", "still", "frame"),
        *("grain", "axis", "along"),
        # columns of exported files
        *("species", "pos", "positions", "velo", "radii", "moments", "dipole", "charges", "type", "x", "y", "z"),
    }
)
"""Names that mean something else in a script, a file or a figure; compared without regard to capitals."""


class OwnQuantities(Mapping[str, np.ndarray]):
    """Own quantities by name: read-only arrays (N,) in SI, and `units`, the unit of SI of each.

    Parameters
    ----------
    values : Mapping[str, ndarray]
        Values (N,) by name.
    units : Mapping[str, str]
        Units of SI by name; "1" for pure numbers.
    """

    def __init__(self, values: Mapping[str, np.ndarray], units: Mapping[str, str]):
        self._values = {name: public(np.asarray(values[name], dtype=np.float64)) for name in units}
        self.units = dict(units)

    def __getitem__(self, name: str) -> np.ndarray:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        each = (f"{name} [{self.units[name]}]: {shown(values)}" for name, values in self.items())
        return f"<own quantities {', '.join(each)}>" if self else "<no own quantities>"

    def taken(self, index: Any) -> OwnQuantities:
        """Those of some grains: an index, slice or mask (N,)."""
        return OwnQuantities({name: values[index] for name, values in self.items()}, self.units)


def joined(parts: Sequence[OwnQuantities], called: Sequence[str]) -> OwnQuantities:
    """Own quantities of several sets of grains, one after the other.

    Parameters
    ----------
    parts : Sequence[OwnQuantities]
        Those of each set.
    called : Sequence[str]
        Beginning of messages about each set, such as "target: it has".

    Raises
    ------
    BadInput
        If a set lacks a quantity that another has, or has it in another unit.
    """
    units: dict[str, str] = {}
    for part in parts:
        units |= {name: unit for name, unit in part.units.items() if name not in units}
    problems = [
        f"{who} no own quantity {name}, which other grains have; give it: own={{{name!r}: (…, {units[name]!r})}}"
        for part, who in zip(parts, called, strict=True)
        for name in units
        if name not in part
    ]
    problems += [
        f"{who} {name} in {part.units[name]}, other grains in {unit}; give one of them another name"
        for part, who in zip(parts, called, strict=True)
        for name, unit in units.items()
        if name in part and not _is_same(part.units[name], unit)
    ]
    if problems:
        raise BadInput(problems)
    return OwnQuantities({name: np.concatenate([part[name] for part in parts]) for name in units}, units)


def own_name(name: Any) -> str:
    """The name of an own quantity, in the form that Python gives names in scripts (NFKC).

    Raises
    ------
    BadInput
        If it is no name of Python, begins with an underscore, is too long, or means something else in SAND.
    """
    if not isinstance(name, str):
        raise BadInput(f"own: the name of a quantity must be text, not {shown(name)}")
    found = unicodedata.normalize("NFKC", name)
    if not found.isidentifier() or keyword.iskeyword(found) or found.startswith("_"):
        words = re.sub(r"\W+", "_", found).strip("_")
        other = words if words[:1].isalpha() and not keyword.iskeyword(words) else f"own_{words}" if words else "heat"
        raise BadInput(
            f"own: {shown(name)} is no name of a quantity; it must be made of letters, digits and _, begin with a "
            f"letter and be no word of Python, such as {other!r}"
        )
    if len(found) > LONGEST_NAME:
        raise BadInput(f"own: the name {found[:20]!r}… has {len(found)} characters; at most {LONGEST_NAME}")
    if found.casefold() in RESERVED:
        raise BadInput(f"own: {found!r} has a meaning in SAND already; choose another name, such as 'own_{found}'")
    return found


def refuse_same_letters(name: str, others: Iterable[str]) -> None:
    """Refuse a name that other programs, and some file systems, take for another one.  Raises BadInput."""
    for other in others:
        if other.casefold() == name.casefold():
            raise BadInput(f"own: {name!r} and {other!r} differ by capitals at most; give one of them another name")


def read_own(own: Any, count: int) -> OwnQuantities:
    """Read the argument `own` of `Grains`.

    Parameters
    ----------
    own : Mapping or None
        Values by name: numbers, text with a unit, (numbers, unit), or quantities; one, or one per grain.
    count : int
        Number of grains N.

    Raises
    ------
    BadInput
        One line for each name or value that cannot be used.
    """
    values: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    problems: list[str] = []
    for given_name, given in (own or {}).items():
        try:
            name = own_name(given_name)
            refuse_same_letters(name, units)
            found = (given, own.units[given_name]) if isinstance(own, OwnQuantities) else with_own_unit(given)
            if found is None:
                raise BadInput(
                    f"own: {name} = {shown(given)} is no quantity; give numbers, text with a unit such as '300 K', or "
                    "(numbers, 'W/m^2'). Units with an offset or a logarithm, such as degC or dB, are not read: write "
                    "'298.15 K' for 25 degC"
                )
            values[name] = own_values(name, found[1], found[0], count)
            units[name] = found[1]
        except BadInput as error:
            problems += error.problems
    if problems:
        raise BadInput(problems)
    return OwnQuantities(values, units)


def own_values(name: str, unit: str, given: Any, count: int) -> np.ndarray:
    """Values (N,) of an own quantity, from numbers in its unit, text with a unit, (numbers, unit) or quantities.

    Raises
    ------
    BadInput
        If the unit is another one, there are not 1 or N values, or one is not finite.
    """
    field = GrainField(name, 1, unit, "own", "own quantity", "")
    if isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], str):
        numbers, own = with_own_unit(given) or (None, unit)
        given = numbers if _is_same(own, unit) else None
    return stored(field, given, count)


def _is_same(unit: str, other: str) -> bool:
    """Whether two units of SI are equal, such as J and N m."""
    return unit == other or in_unit(f"1 {unit}", other) is not None
