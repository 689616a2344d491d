"""Text with one grain per line: columns, CSV, sphere files of MSTM and of generators such as FracVAL."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ...basics.arguments import MOST_GRAINS
from ...basics.errors import BadInput
from ...basics.units import in_unit
from .data import LENGTHS, GrainData, GrainFile, data_of, known_as, numbers, with_number

COMMENTS = "#%!"
"""Characters that begin a comment."""
EXAMPLE = "# x y z r"
_NAME = re.compile(r"([A-Za-z_]\w*)\s*(?:[\[(]([^\])]*)[\])])?")
_DECIMAL_COMMA = re.compile(r"^[+-]?\d+,\d+([eEdD][+-]?\d+)?$")
CLOSE = 1e-2
"""Gaps and overlaps in radii by which spheres are taken to touch, when the column of the radius is sought."""


def read_columns(path: Any, lines: list[str]) -> GrainFile:
    """Read columns of numbers, named in a first line, or `x y z`, `x y z r`, or `r x y z`.

    Comments begin with #, % or !. Numbers are separated by blanks, commas or semicolons; a first line may hold the
    number of grains.

    Raises
    ------
    BadInput
        If lines are not such rows; the first one is named, with the number of such lines.
    """
    rows, header, first, texts = _rows(path, _sphere_block(lines))
    table = np.array(rows)
    names, units = header
    notes: list[str] = []
    if not names:
        names, notes = _unnamed(path, table)
    if len(names) != table.shape[1]:
        raise BadInput(f"{path}, line {first}: {table.shape[1]} columns, but {len(names)} names: {', '.join(names)}")
    stated = _unit_of_x(path, names, units)
    columns: dict[str, Any] = dict(zip(names, table.T, strict=True)) | texts
    data = data_of(columns, 1.0 if stated is None else stated, place=str(path), units=units)
    data.states_unit = stated is not None
    data.notes += notes
    if bare := [q for q in data.given if not any((known_as(name) or ("",))[0] == q for name in units)]:
        data.notes.append(f"{path} states no units of {' and '.join(bare)}: they are taken in SI")

    def frame(number: int) -> GrainData:
        return data

    return GrainFile("columns", 1, frame)


def _unit_of_x(path: Any, names: list[str], units: dict[str, str]) -> float | None:
    """Unit of length [m] of the column x, which is also that of lengths without one, or None.  Raises BadInput."""
    stated = next((units[name] for name in names if name in units and known_as(name) == ("position", 0)), None)
    if stated is None:
        lengths = [name for name in names if name in units and (known_as(name) or ("",))[0] in LENGTHS]
        if others := [name for name in lengths if in_unit(f"1 {units[name]}", "m") is not None]:
            unit = units[others[0]]
            raise BadInput(
                f"{path}: {others[0]} has the unit {unit}, but x has none; write x [{unit}], if that is its unit, too"
            )
        return None
    factor = in_unit(f"1 {stated}", "m")
    if factor is None:
        raise BadInput(f"{path}: {stated!r} is not a unit of length")
    return float(factor)


def _sphere_block(lines: list[str]) -> list[str]:
    """The lines of the spheres in an input file of MSTM 4, blank ones in place of the others; else all lines."""
    words = [line.strip().lower() for line in lines]
    if "sphere_data" not in words:
        return lines
    begin = words.index("sphere_data")
    end = words.index("end_of_sphere_data", begin) if "end_of_sphere_data" in words[begin:] else len(lines)
    return ["" if not begin < k < end else line for k, line in enumerate(lines)]


Header = tuple[list[str], dict[str, str]]
"""Names of columns, and the units of some."""


def _rows(path: Any, lines: list[str]) -> tuple[list[list[float]], Header, int, dict[str, list[str]]]:
    """Rows of numbers, names of the columns with their units, line of the first row, and columns of text by name.

    Raises BadInput.
    """
    rows: list[list[float]] = []
    texts: dict[str, list[str]] = {}
    wrong: list[int] = []
    header: Header = ([], {})
    stated: tuple[int, int] | None = None  # number of grains that the file states, and its line
    first = 0
    for number, line in enumerate(lines, start=1):
        text, comment = _without_comment(line)
        words = _words(text)
        if not words:
            if not rows and (found := _header(comment)):
                header = found
            continue
        try:
            row = numbers(words)
        except ValueError:
            if not rows and (found := _header(text)):
                header = found
                continue
            if stated and not rows and number <= stated[1] + 2:  # the title below the number of grains
                continue
            row = _with_text(words, header[0], texts)
        if len(row) == 1 and not rows and stated is None and row[0].is_integer() and row[0] >= 1:
            stated = (int(row[0]), number)
            continue
        if len(row) < 3 or not np.isfinite(row).all() or (rows and len(row) != len(rows[0])):
            if not wrong:
                problem = f"{path}, line {number}: {line.strip()[:40]!r} {_wanted(rows, header, first)}"
            wrong.append(number)
            continue
        if not rows:
            first = number
            header = header if len(header[0]) == len(row) or _is_named(lines, header) else ([], {})
        rows.append(row)
        if len(rows) > MOST_GRAINS:
            break
    if len(rows) > MOST_GRAINS:
        raise BadInput(f"{path} holds more than {MOST_GRAINS:.0e} grains")
    if wrong:
        raise BadInput(with_number(problem, len(wrong)))
    if stated and not rows:
        raise BadInput(f"{path}, line {stated[1]}: {lines[stated[1] - 1].strip()[:40]!r} is not x y z or x y z r")
    if stated and stated[0] != len(rows):
        raise BadInput(
            f"{path}, line {stated[1]}: '{stated[0]}' is not the number of grains; there are {len(rows)} lines"
        )
    if not rows:
        raise BadInput(f"{path} holds no grain")
    if uneven := [name for name, words in texts.items() if len(words) != len(rows)]:
        raise BadInput(f"{path}: column {uneven[0]!r} has numbers in some lines and text in others")
    return rows, header, first, texts


def _wanted(rows: list[list[float]], header: Header, first: int) -> str:
    """What a line should have held: numbers as the first row has, or else names of columns, or a row."""
    if rows:
        return f"is not {len(rows[0])} finite numbers, as in line {first}"
    if header[0]:
        return f"is not {len(header[0])} finite numbers, one for each of {', '.join(header[0])}"
    return "is not x y z or x y z r, nor names of columns with x, y and z once, such as 'x [nm], y [nm], z [nm]'"


def _with_text(words: list[str], names: list[str], texts: dict[str, list[str]]) -> list[float]:
    """Numbers of a line with text in columns that are no quantity of grains, or the material, which goes to `texts`.

    Empty if it is no such line.
    """
    if len(words) != len(names):
        return []
    row = []
    for name, word in zip(names, words, strict=True):
        try:
            row += numbers([word])
        except ValueError:
            if (known_as(name) or ("material", None))[0] != "material":
                return []
            texts.setdefault(name, []).append(word.strip("\"'"))
            row.append(0.0)
    return row


def _is_named(lines: list[str], header: Header) -> bool:
    """Whether the names of the columns were found outside comments, where a wrong number of them is a mistake."""
    return bool(header[0]) and any(_header(_without_comment(line)[0]) == header for line in lines[:50])


def _without_comment(line: str) -> tuple[str, str]:
    """The line up to a comment, and the comment."""
    at = min((k for mark in COMMENTS if (k := line.find(mark)) >= 0), default=-1)
    return (line, "") if at < 0 else (line[:at], line[at + 1 :])


def _words(text: str) -> list[str]:
    """Cells of a line that are separated by semicolons, commas or blanks."""
    if text.count(";") >= 2:
        return [word.strip().replace(",", ".") for word in text.strip().rstrip(";").split(";")]
    words = text.split()
    if len(words) >= 3 and any("," in word for word in words) and all(_DECIMAL_COMMA.match(word) for word in words):
        return [word.replace(",", ".") for word in words]
    if text.count(",") >= 2:
        return [word.strip() for word in text.strip().rstrip(",").split(",")]
    return words


def _header(text: str) -> Header | None:
    """Names of columns and units, as in `x [nm], y [nm], z [nm]`; None if x, y, z are not among them."""
    cells = (
        [cell.strip().strip("\"'") for cell in re.split(r"[;,]", text.strip())] if re.search(r"[;,]", text) else [text]
    )
    found = [_NAME.fullmatch(cell) if len(cells) > 1 else None for cell in cells]
    pairs = [(m[1], m[2]) if m else (cell, None) for m, cell in zip(found, cells, strict=True)]
    if len(cells) == 1:
        pairs = [(m[1], m[2]) for m in _NAME.finditer(text)]
    names = [name for name, _ in pairs]
    axes = {known[1] for name in names if (known := known_as(name)) and known[0] == "position"}
    if not axes >= {0, 1, 2} or len(set(names)) < len(names):
        return None
    return names, {name: unit.strip() for name, unit in pairs if unit}


def _unnamed(path: Any, table: np.ndarray) -> tuple[list[str], list[str]]:
    """Names of columns in a file without any, and notes.  Raises BadInput if they cannot be known."""
    width, notes = table.shape[1], []
    if width == 3:
        return ["x", "y", "z"], []
    names = [["x", "y", "z", "r"], ["r", "x", "y", "z"]]
    scores = [_touching(table[:, :4], order.index("r")) for order in names]
    if width == 5 and (np.diff(table[:, 0]) == 1.0).all() and _touching(table[:, 1:], 3) >= max(0, *scores):
        return ["id", "x", "y", "z", "r"], [f"{path}: columns read as number x y z r"]
    if width > 4 and max(scores) < 1:
        raise BadInput(
            f"{path} has {width} columns without names; name them in its first line, such as '{EXAMPLE} vx vy vz'"
        )
    chosen = int(scores[1] > scores[0])
    if chosen:
        notes.append(f"{path}: columns read as r x y z, as in sphere files of MSTM")
    if width > 4:
        notes.append(f"{path}: columns from the fifth on have no names; name all in the first line to have them read")
    return names[chosen] + [f"column{k}" for k in range(5, width + 1)], notes


def _touching(table: np.ndarray, at: int) -> int:
    """Number of pairs of neighbours that touch if the column `at` is the radius; −1 if it cannot be.

    It cannot be if a number is not above 0, or nearest neighbours overlap by far.
    """
    from scipy.spatial import cKDTree  # slow to import

    radius, place = table[:, at], np.delete(table, at, axis=1)
    if (radius <= 0.0).any():
        return -1
    if len(table) < 2:
        return 0
    distance, other = cKDTree(place).query(place, k=min(7, len(table)))
    small = np.minimum(radius[:, None], radius[other[:, 1:]])
    gap = (distance[:, 1:] - radius[:, None] - radius[other[:, 1:]]) / small
    return -1 if gap.min() < -10.0 * CLOSE else int((np.abs(gap) <= CLOSE).sum())
