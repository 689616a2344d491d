"""Bodies in extended XYZ: one line per grain, columns named in the second line, lengths in ångström."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import BadInput
from ..grains import Grains
from ..own_quantities import OwnQuantities
from ..units import in_unit

ANGSTROM = 1e-10
SYMBOLS = {"iron": "Fe", "silica": "Si", "ice": "O", "graphite": "C", "forsterite": "Mg", "magnetite": "Fe"}
"""Chemical symbols that distinguish materials; X for others."""
POSITIONS, RADII, MOMENTS = ("pos", "position", "positions"), ("radius", "radii"), ("moment", "moments", "dipole")
"""Accepted names of columns, by quantity."""


class Columns(NamedTuple):
    """Quantities of grains from a file, in its own unit of length."""

    position: np.ndarray  # (N, 3)
    radius: np.ndarray | None  # (N,)
    moment: np.ndarray | None  # (N, 3) [A m²]
    names: list[str] | None  # N names of materials
    unit: float  # unit of length [m], unless the caller gives another
    own: OwnQuantities | None = None  # own quantities of the user
    charge: np.ndarray | None = None  # (N,) [C]


def own_columns(own: OwnQuantities) -> tuple[str, str]:
    """Names of the columns of own quantities in `Properties=`, and the entry with their units."""
    units = ";".join(f"{name}={unit}" for name, unit in own.units.items())
    return "".join(f":{name}:R:1" for name in own), f' own="{units}"' if own else ""


def listed(names: Sequence[str]) -> str:
    """Names of materials for `materials="…"`, separated by semicolons.

    Characters that would end a name, the list or the line are written as in a URL: "%3B" for a semicolon.
    """

    def escaped(found: re.Match[str]) -> str:
        return "".join(f"%{byte:02X}" for byte in found[0].encode())

    return ";".join(re.sub(r"[^\S ]|[;\"'%\\\x00-\x1f\x7f]", escaped, name) for name in names)


def unlisted(text: str) -> list[str]:
    """Names of `listed`."""

    def unescaped(found: re.Match[str]) -> str:
        return bytes.fromhex(found[0].replace("%", "")).decode(errors="replace")

    return [re.sub("(%[0-9A-Fa-f]{2})+", unescaped, name) for name in text.split(";")]


def row_form(columns: Sequence[np.ndarray]) -> str:
    """Format of a row of the columns (N,) or (N, k), with the digits that restore their numbers exactly."""
    forms = ("%d" if c.dtype.kind in "iu" else "%.9g" if c.dtype == np.float32 else "%.17g" for c in columns)
    return " ".join(" ".join([form] * (c.size // max(len(c), 1))) for form, c in zip(forms, columns, strict=True))


def format_rows(columns: Sequence[np.ndarray], form: str) -> list[str]:
    """Format the rows of the columns (N,) or (N, k)."""
    return [form % tuple(row) for row in np.column_stack(columns).tolist()]


def xyz_frame(names: Sequence[str], material: np.ndarray, head: str, columns: Sequence[np.ndarray]) -> str:
    """Format a frame: number of grains, `head`, and per grain the chemical symbol of its material and the columns."""
    symbols, form = [SYMBOLS.get(names[k], "X") for k in material], row_form(columns)
    rows = [f"{symbol} {row}" for symbol, row in zip(symbols, format_rows(columns, form), strict=True)]
    return "\n".join([str(len(rows)), head, *rows]) + "\n"


def xyz_text(grains: Grains) -> str:
    """Format grains as extended XYZ: species, position and radius [Å], moment [A m²], charge [C], own quantities.

    Numbers are in full precision. The last column, material, is an index; names of materials, and units of own
    quantities, are in the second line.
    """
    names, (own, units) = [m.name for m in grains.materials], own_columns(grains.own)
    head = (
        f"Properties=species:S:1:pos:R:3:radius:R:1:moment:R:3:charge:R:1{own}:material:I:1 "
        f'materials="{listed(names)}" pbc="F F F" length_unit=angstrom other_units=SI{units}'
    )
    columns = [grains.position / ANGSTROM, grains.radius / ANGSTROM, grains.moment, grains.charge, *grains.own.values()]
    return xyz_frame(names, grains.material, head, [*columns, grains.material])


def is_xyz(lines: list[str]) -> bool:
    """Whether a text is extended XYZ, as opposed to plain columns."""
    return len(lines) > 1 and lines[0].strip().isdecimal() and "Properties=" in lines[1]


def read_xyz(path: Any, lines: list[str]) -> Columns:
    """Read the last frame of extended XYZ.

    Raises
    ------
    BadInput
        If the frame is incomplete, has no positions, or has lines that are not numbers (the first ten are named).
    """
    first, count = _last_frame(path, lines)
    head = dict(re.findall(r'(\w+)=("[^"]*"|\S+)', lines[first + 1]))
    head = {key: value.strip('"') for key, value in head.items()}
    layout, width = _layout(path, head.get("Properties", ""))
    rows, problems = [], []
    for number in range(first + 2, first + 2 + count):
        words = lines[number].split()
        if len(words) != width:
            problems.append(f"{path}, line {number + 1}: {len(words)} columns, but line 2 names {width}")
        rows.append(words)
    if problems:
        raise BadInput(problems[:10])
    position = _numbers(path, rows, layout, POSITIONS, 3, first)
    if position is None:
        raise BadInput(f"{path} has no positions; its Properties must have pos:R:3")
    size, moment = (_numbers(path, rows, layout, n, w, first) for n, w in ((RADII, 1), (MOMENTS, 3)))
    unit = in_unit(f"1 {head.get('length_unit', 'angstrom')}", "m")
    if unit is None:
        raise BadInput(f"{path}, line 2: length_unit={head['length_unit']!r} is not a unit of length")
    charge = _numbers(path, rows, layout, ("charge", "charges"), 1, first)
    return Columns(
        position,
        None if size is None else size[:, 0],
        moment,
        _names(path, rows, layout, head),
        unit,
        _own(path, rows, head, first),
        None if charge is None else charge[:, 0],
    )


def _own(path: Any, rows: list[list[str]], head: dict[str, str], first: int) -> OwnQuantities:
    """Own quantities named by `own="temperature=K;…"`.  Raises BadInput."""
    units = dict(entry.partition("=")[::2] for entry in head.get("own", "").split(";") if entry)
    layout, _ = _layout(path, head.get("Properties", ""), exact=True)
    columns = {name: _numbers(path, rows, layout, (name,), 1, first) for name in units}
    if missing := [name for name, column in columns.items() if column is None]:
        raise BadInput(f"{path}, line 2: own= names {missing[0]}, but Properties has no {missing[0]}:R:1")
    return OwnQuantities({name: column[:, 0] for name, column in columns.items() if column is not None}, units)


def _last_frame(path: Any, lines: list[str]) -> tuple[int, int]:
    """First line and number of grains of the last frame.  Raises BadInput."""
    at, found = 0, (0, 0)
    while at < len(lines) and lines[at].strip():
        text = lines[at].strip()
        if not text.isdecimal() or int(text) < 1 or at + 2 + int(text) > len(lines):
            raise BadInput(f"{path}, line {at + 1}: {text[:40]!r} is not the number of grains in the lines below")
        found = (at, int(text))
        at += 2 + int(text)
    return found


def _layout(path: Any, text: str, exact: bool = False) -> tuple[dict[str, tuple[int, int]], int]:
    """First column and number of columns of each name, in lower case or `exact`, and the total number of columns.

    Raises BadInput if the text is not such a list.
    """
    parts, layout, at = text.split(":"), {}, 0
    if len(parts) % 3 or not all(width.isdecimal() for width in parts[2::3]):
        raise BadInput(f"{path}, line 2: Properties={text[:60]!r} is not made of name:type:number")
    for name, width in zip(parts[::3], parts[2::3], strict=True):
        layout[name if exact else name.lower()] = (at, int(width))
        at += int(width)
    return layout, at


def _numbers(
    path: Any, rows: list[list[str]], layout: dict[str, tuple[int, int]], names: tuple[str, ...], width: int, first: int
) -> np.ndarray | None:
    """Columns (N, width) of the first of `names` that the file has, None if it has none.  Raises BadInput."""
    at = next((layout[name] for name in names if name in layout), None)
    if at is None or at[1] != width:
        return None
    values, problems = np.empty((len(rows), width)), []
    for number, words in enumerate(rows):
        try:
            values[number] = [float(word) for word in words[at[0] : at[0] + width]]
        except ValueError:
            problems.append(
                f"{path}, line {first + 3 + number}: {' '.join(words)[:40]!r} has no numbers for {names[0]}"
            )
    if problems:
        raise BadInput(problems[:10])
    return values


def _names(
    path: Any, rows: list[list[str]], layout: dict[str, tuple[int, int]], head: dict[str, str]
) -> list[str] | None:
    """Names of materials, None if the file has none.  Raises BadInput."""
    if "material" not in layout:
        return None
    words = [row[layout["material"][0]] for row in rows]
    known = unlisted(head.get("materials", ""))
    try:
        return [known[int(word)] for word in words] if "materials" in head else words
    except (ValueError, IndexError):
        raise BadInput(f"{path}: the column 'material' has no index into materials=\"{head['materials']}\"") from None
