"""Grains as a file of any format gives them, and the names by which columns of files are known."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ...basics.errors import BadInput
from ...basics.units import in_unit

NAMED = 10
"""Lines that are named one by one in a message."""
VECTORS = {
    "position": ("pos", "position", "positions"),
    "velocity": ("velo", "velocity", "velocities", "vel"),
    "spin": ("spin", "spins", "omega", "angular_velocity"),
    "moment": ("moment", "moments", "dipole", "mu"),
}
"""Names of columns of three numbers, by quantity; with _x, _y, _z or x, y, z at their end, of one number."""
SHORT = {"position": ("",), "velocity": ("v",), "spin": ("w",)}
"""Further beginnings of names that end with x, y or z."""
SCALARS = {
    "radius": ("radius", "radii", "r", "rad"),
    "diameter": ("diameter", "diameters", "d", "diam"),
    "charge": ("charge", "charges", "q"),
    "mass": ("mass", "masses"),
    "density": ("density", "rho"),
    "material": ("material", "materials"),
}
"""Names of columns of one number, or one name, by quantity."""
COMPONENTS = {
    f"{start}{joint}{axis}": (quantity, k)
    for quantity, names in VECTORS.items()
    for start in (*names, *SHORT.get(quantity, ()))
    for joint in ("", "_")
    for k, axis in enumerate("xyz")
    if start or not joint
}
WHOLE = {name: quantity for table in (VECTORS, SCALARS) for quantity, names in table.items() for name in names}
UNITS = {"velocity": "m/s", "spin": "rad/s", "moment": "A m^2", "charge": "C", "mass": "kg", "density": "kg/m^3"}
"""Units of SI of the quantities that are not lengths."""
DERIVED = frozenset(
    (
        *("id", "type", "types", "species", "symbol", "symbols", "element", "elements", "numbers", "index", "particle"),
        *("mol", "cluster", "c_cluster", "cluster_id", "tags", "orientation", "orientations", "quaternion"),
        *("images", "image", "v_time"),
        *("force", "forces", "torque", "torques", "field", "fields", "energy", "stress"),
        *("fx", "fy", "fz", "tqx", "tqy", "tqz", "ix", "iy", "iz"),
    )
)
"""Names of columns that number grains, or that SAND computes itself; they are not read."""
LENGTHS = ("position", "radius", "diameter")


class FileBox(NamedTuple):
    """The box that a file states, in its unit of length."""

    low: np.ndarray  # (3,)
    high: np.ndarray  # (3,)
    periodic: tuple[bool, bool, bool]
    tilt: float = 0.0  # displacement along x of the image one length beyond along z


@dataclass
class GrainData:
    """Grains of one frame of a file: lengths in its unit, all else in SI.

    Attributes
    ----------
    position : ndarray
        (N, 3).
    radius : ndarray or None
        (N,), None if the file has no radii.
    unit : float or None
        Unit of length [m]; None if the file does not state it and its format does not define it.
    states_unit : bool
        Whether the file itself states the unit of length.
    given : dict
        Arrays by name, as far as the file has them: velocity, spin, moment (N, 3), charge, mass, density (N,).
    names : list of str or None
        Name of the material of each grain.
    own : dict
        Own quantities: values (N,) and unit by name.
    box : FileBox or None
        The box.
    notes : list of str
        Columns that were not read, and assumptions about units, radii and masses.
    refused : list of str
        Messages about quantities that cannot be kept.
    sizes_assumed : bool
        Whether the radii are the default of the format, because the file has none.
    time : float or None
        Time [s], if the file states it.
    step : int or None
        Number of the step, if the file states it.
    """

    position: np.ndarray
    radius: np.ndarray | None
    unit: float | None
    given: dict[str, np.ndarray] = field(default_factory=dict)
    names: list[str] | None = None
    own: dict[str, tuple[np.ndarray, str]] = field(default_factory=dict)
    box: FileBox | None = None
    notes: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    sizes_assumed: bool = False
    time: float | None = None
    step: int | None = None
    states_unit: bool = False


class GrainFile(NamedTuple):
    """A file of grains: its format, and its frames, each read on access."""

    form: str
    frame_count: int
    frame: Callable[[int], GrainData]


def with_number(problem: str, number: int) -> str:
    """The message about the first wrong line of a file, and the number of such lines if there are several."""
    return problem if number == 1 else f"{problem} (the first of {number} such lines)"


def known_as(name: str) -> tuple[str, int | None] | None:
    """Quantity of a column, and its component; None if the name is unknown."""
    low = name.lower()
    return COMPONENTS.get(low) or ((WHOLE[low], None) if low in WHOLE else None)


def data_of(
    columns: Mapping[str, Any],
    unit: float | None,
    *,
    place: str,
    units: Mapping[str, str] | None = None,
    own: Mapping[str, str] | None = None,
) -> GrainData:
    """Grains from named columns.

    Parameters
    ----------
    columns : Mapping[str, array]
        (N,) or (N, 3) numbers, or N names, by the name in the file.
    unit : float or None
        Unit of length [m].
    place : str
        File and line of the names, for messages.
    units : Mapping[str, str], optional
        Units that the file states for some columns.
    own : Mapping[str, str], optional
        Names and units of own quantities.

    Raises
    ------
    BadInput
        If a quantity occurs twice, a component is missing, or a unit does not fit; one line for each.
    """
    units, own = units or {}, own or {}
    parts: dict[str, dict[int | None, np.ndarray]] = {}
    problems = _half_stated(columns, units, place)
    carried: dict[str, tuple[np.ndarray, str]] = {}
    unread: list[str] = []
    for name, values in columns.items():
        known = None if name in own else known_as(name)
        if name in own or (known is None and units.get(name) and name.lower() not in DERIVED):
            carried[name] = (values, own.get(name) or units[name])
            continue
        if known is None or (known[0] in VECTORS) != (known[1] is not None or np.ndim(values) == 2):
            unread += [name] * (name.lower() not in {"", *DERIVED} and not name.startswith("column"))
            continue
        quantity, component = known
        have = parts.setdefault(quantity, {})
        if component in have or (have and (component is None or None in have)):
            problems.append(f"{place}: {quantity} is given twice, also as {name!r}; leave one out")
            continue
        have[component] = values
        if units.get(name):
            try:
                have[component] = _converted(values, units[name], quantity, unit)
            except BadInput as error:
                problems += error.at(f"{place}: column {name!r}").problems
    whole = {quantity: _joined(quantity, found, place, problems) for quantity, found in parts.items()}
    if "position" not in whole:
        problems.append(f"{place}: there are no positions; name their columns x, y and z")
    if {"radius", "diameter"} <= whole.keys():
        problems.append(f"{place}: both radius and diameter are given; leave one out")
    if problems:
        raise BadInput(problems[:NAMED])
    radius = 0.5 * whole["diameter"] if "diameter" in whole else whole.get("radius")
    given = {name: whole[name] for name in UNITS if name in whole}
    names = [str(one) for one in whole["material"]] if "material" in whole else None
    data = GrainData(whole["position"], radius, unit, given, names, carried)
    if unread:
        data.notes.append(f"columns that are no quantity of grains, or have no unit, are not read: {', '.join(unread)}")
    return data


def _half_stated(columns: Mapping[str, Any], units: Mapping[str, str], place: str) -> list[str]:
    """Messages about vectors of which some components have a unit and others none, lengths excepted."""
    found: dict[str, dict[str, str | None]] = {}
    for name in columns:
        known = known_as(name)
        if known is not None and known[0] in VECTORS and known[0] not in LENGTHS:
            found.setdefault(known[0], {})[name] = units.get(name)
    return [
        f"{place}: {', '.join(name for name, unit in parts.items() if not unit)}: no unit, but "
        f"{', '.join(name for name, unit in parts.items() if unit)} has one; write it behind each component"
        for parts in found.values()
        if len({bool(unit) for unit in parts.values()}) > 1
    ]


def _converted(values: np.ndarray, text: str, quantity: str, unit: float | None) -> np.ndarray:
    """Numbers of a column whose unit the file states: lengths in the unit of the file, all else in SI."""
    wanted = "m" if quantity in LENGTHS else UNITS.get(quantity, "1")
    factor = in_unit(f"1 {text}", wanted)
    if factor is None:
        raise BadInput(f"{text!r} is not a unit of {quantity}, which is in {wanted}")
    return values * (factor / (unit or 1.0) if quantity in LENGTHS else factor)


def _joined(quantity: str, found: Mapping[int | None, np.ndarray], place: str, problems: list[str]) -> Any:
    """The (N, 3) array of components, or the array itself."""
    if None in found:
        return found[None]
    if missing := [axis for k, axis in enumerate("xyz") if k not in found]:
        problems.append(f"{place}: {quantity} lacks its component {', '.join(missing)}")
        return next(iter(found.values()))
    return np.column_stack([found[k] for k in range(3)])


_FORTRAN = re.compile(r"^([+-]?(?:\d+\.?\d*|\.\d+))(?:[dDqQ]([+-]?\d+)|([+-]\d{2,4}))$")
_REPEATED = re.compile(r"^(\d{1,6})\*(\S+)$")


def number(word: str) -> float:
    """A number, also with an exponent as Fortran writes it: 1.0D-8, 1.0-108.  Raises ValueError."""
    try:
        return float(word)
    except ValueError:
        found = _FORTRAN.match(word)
        if found is None:
            raise
        return float(f"{found[1]}e{found[2] or found[3]}")


def numbers(words: Sequence[str]) -> list[float]:
    """Numbers; 3*0.0 stands for three of them, as in lists that Fortran writes.  Raises ValueError."""
    try:
        return [float(word) for word in words]
    except ValueError:
        values: list[float] = []
        for word in words:
            repeated = _REPEATED.match(word)
            values += [number(repeated[2])] * int(repeated[1]) if repeated else [number(word)]
        return values
