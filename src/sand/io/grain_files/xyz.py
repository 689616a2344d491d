"""Plain and extended XYZ: number of grains, a line of text, and one line per grain; lengths in ångström."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ...basics.errors import BadInput
from ...basics.units import in_unit
from ..extended_xyz import unlisted
from .data import FileBox, GrainData, GrainFile, data_of, known_as, numbers, with_number

PERIODIC = dict.fromkeys(("T", "TRUE", "1"), True) | dict.fromkeys(("F", "FALSE", "0"), False)
"""Values of pbc."""


def is_xyz(lines: list[str]) -> bool:
    """Whether a text is extended XYZ, or plain XYZ with the name of an element in each line."""
    if len(lines) < 2 or not lines[0].strip().isdecimal():
        return False
    if "Properties=" in lines[1]:
        return True
    words = lines[2].split() if len(lines) > 2 else []
    try:
        return (
            len(words) >= 4 and not words[0][0].isdigit() and len(numbers(words[1:4])) == 3 and not _is_number(words[0])
        )
    except ValueError:
        return False


def _is_number(word: str) -> bool:
    try:
        numbers([word])
    except ValueError:
        return False
    return True


def read_xyz(path: Any, lines: list[str]) -> GrainFile:
    """Read plain or extended XYZ.

    Raises
    ------
    BadInput
        If a frame is incomplete, has no positions, or has lines that are not numbers (the first one is named).
    """
    starts = _frames(path, lines)

    def frame(number: int) -> GrainData:
        first, count = starts[number]
        return _read_frame(path, lines, first, count)

    extended = "Properties=" in lines[1]
    return GrainFile("extended XYZ" if extended else "XYZ", len(starts), frame)


def _frames(path: Any, lines: list[str]) -> list[tuple[int, int]]:
    """First line and number of grains of each frame.  Raises BadInput."""
    at, found = 0, []
    while at < len(lines) and lines[at].strip():
        text = lines[at].strip()
        if not text.isdecimal() or int(text) < 1 or at + 2 + int(text) > len(lines):
            raise BadInput(f"{path}, line {at + 1}: {text[:40]!r} is not the number of grains in the lines below")
        found.append((at, int(text)))
        at += 2 + int(text)
    return found


def _read_frame(path: Any, lines: list[str], first: int, count: int) -> GrainData:
    place = f"{path}, line {first + 2}"
    head = {k: v.strip("\"'") for k, v in re.findall(r"""(\w+)=("[^"]*"|'[^']*'|\S+)""", lines[first + 1])}
    rows = [lines[k].split() for k in range(first + 2, first + 2 + count)]
    layout = _layout(place, head["Properties"]) if "Properties" in head else [("species", "S", 1), ("pos", "R", 3)]
    width = sum(n for _, _, n in layout)
    short = f"line {first + 2} names {width}" if "Properties" in head else "XYZ has 4, a name and x y z"
    more = "" if "Properties" in head else "; name further ones in line 2: Properties=species:S:1:pos:R:3:radius:R:1"
    problems = [
        f"{path}, line {first + 3 + k}: {len(words)} columns, but {short}{more}"
        for k, words in enumerate(rows)
        if len(words) != width
    ]
    if problems:
        raise BadInput(with_number(problems[0], len(problems)))
    unit = in_unit(f"1 {head.get('length_unit', 'angstrom')}", "m")
    if unit is None:
        raise BadInput(f"{place}: length_unit={head['length_unit']!r} is not a unit of length")
    if not any(known_as(name) == ("position", None) and n == 3 for name, _, n in layout):
        raise BadInput(f"{path} has no positions; its Properties must have pos:R:3")
    columns = _columns(path, rows, layout, first)
    own = dict(entry.partition("=")[::2] for entry in head.get("own", "").split(";") if entry)
    if missing := [name for name in own if name not in columns]:
        raise BadInput(f"{place}: own= names {missing[0]}, but Properties has no {missing[0]}:R:1")
    if "material" in columns and "materials" in head:
        columns["material"] = _named(path, columns["material"], head["materials"])
    data = data_of(columns, unit, place=place, own=own)
    data.states_unit = "length_unit" in head
    data.box = _box(place, head)
    if head.get("other_units") == "SI" and _is_number(head.get("Time", "")):
        data.time = numbers([head["Time"]])[0]
    data.step = int(head["Step"]) if head.get("Step", "").isdecimal() else None
    if head.get("other_units") != "SI" and (kept := [q for q in data.given if np.any(data.given[q])]):
        data.notes.append(f"{path} states no units of {' and '.join(kept)}: they are taken in SI")
    return data


def _layout(place: str, text: str) -> list[tuple[str, str, int]]:
    """Name, type and number of each entry of Properties.  Raises BadInput."""
    parts = text.split(":")
    if len(parts) % 3 or not all(width.isdecimal() and int(width) for width in parts[2::3]):
        raise BadInput(f"{place}: Properties={text[:60]!r} is not made of name:type:number")
    if len(set(parts[::3])) < len(parts[::3]):
        raise BadInput(f"{place}: a name occurs twice in Properties={text[:60]!r}")
    return [(name, kind, int(width)) for name, kind, width in zip(parts[::3], parts[1::3], parts[2::3], strict=True)]


def _columns(path: Any, rows: list[list[str]], layout: list[tuple[str, str, int]], first: int) -> dict[str, Any]:
    """Columns by name: words, numbers (N,) or (N, k).  Raises BadInput for lines without numbers."""
    columns: dict[str, Any] = {}
    problems: list[str] = []
    at = 0
    for name, kind, width in layout:
        known = known_as(name)
        is_text = kind.upper() in "SL" if known is None else known[0] == "material"
        if name == "Z":  # atomic numbers, not a coordinate
            known = None
        cells = [words[at : at + width] for words in rows]
        at += width
        if is_text or name == "Z":
            columns["species" if name == "Z" else name] = [words[0] for words in cells]
            continue
        values = np.zeros((len(rows), width))
        for k, words in enumerate(cells):
            try:
                values[k] = numbers(words)
            except ValueError:
                problems.append(f"{path}, line {first + 3 + k}: {' '.join(rows[k])[:40]!r} has no numbers for {name}")
        if problems:
            raise BadInput(with_number(problems[0], len(problems)))
        columns[name] = values[:, 0] if width == 1 else values
    return columns


def _named(path: Any, words: list[str], listed: str) -> list[str]:
    """Names of materials for their indices.  Raises BadInput."""
    known = unlisted(listed)
    try:
        numbers_of = [int(word) for word in words]
        if min(numbers_of) < 0:
            raise IndexError
        return [known[k] for k in numbers_of]
    except (ValueError, IndexError):
        raise BadInput(f"{path}: the column 'material' has no index into materials=\"{listed}\"") from None


def _box(place: str, head: dict[str, str]) -> FileBox | None:
    """The box of Lattice, Origin and pbc (periodic if there is a Lattice, but no pbc).  Raises BadInput."""
    if "Lattice" not in head:
        return None
    try:
        cell = np.array(numbers(head["Lattice"].split())).reshape(3, 3)
        origin = np.array(numbers(head.get("Origin", "0 0 0").split())).reshape(3)
    except ValueError:
        raise BadInput(f"{place}: Lattice and Origin must be nine and three numbers") from None
    flags = head.get("pbc", "T").upper().split()
    flags *= 3 if len(flags) == 1 else 1
    if len(flags) != 3 or not PERIODIC.keys() >= set(flags):
        raise BadInput(f"{place}: pbc={head['pbc']!r} must be T or F, for each of the three axes or once for all")
    x, y, z = (PERIODIC[flag] for flag in flags)
    diagonal = np.diag(cell)
    if any((x, y, z)) and (np.abs(cell - np.diag(diagonal)).max() > 1e-9 * np.abs(cell).max() or (diagonal <= 0).any()):
        raise BadInput(f"{place}: Lattice is not a box with edges along x, y and z, the only one SAND has")
    return FileBox(origin, origin + diagonal, (x, y, z))
