"""LAMMPS: data files of `write_data` (styles of spheres, dipoles and charges), and dumps of atoms."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ...basics.errors import BadInput
from ..extended_xyz import unlisted
from .data import FileBox, GrainData, GrainFile, data_of, number, with_number

CENTIMETRE, ANGSTROM, BOHR, FEMTOSECOND = 1e-2, 1e-10, 5.29177210903e-11, 1e-15
STYLES = {
    "si": (1.0, 1.0, 1.0, 1.0),
    "cgs": (CENTIMETRE, CENTIMETRE, 1e-3, 3.3356409519815204e-10),
    "micro": (1e-6, 1.0, 1e-15, 1e-12),
    "nano": (1e-9, 1.0, 1e-21, 1.602176634e-19),
    "metal": (ANGSTROM, 100.0, 1.66053906660e-27, 1.602176634e-19),
    "real": (ANGSTROM, 1e5, 1.66053906660e-27, 1.602176634e-19),
    "electron": (BOHR, BOHR / 1.03275e-15, 1.66053906660e-27, 1.602176634e-19),
}
"""Units of length [m], velocity [m/s], mass [kg] and charge [C] of the styles of units; lj has none of these."""
ATOMS = {
    "atomic": "id type x y z",
    "charge": "id type q x y z",
    "dipole": "id type q x y z mux muy muz",
    "sphere": "id type diameter density x y z",
    "bond": "id mol type x y z",
    "angle": "id mol type x y z",
    "molecular": "id mol type x y z",
    "full": "id mol type q x y z",
}
"""Columns of an atom by style."""
IN_HYBRID = {"sphere": "diameter density", "dipole": "q mux muy muz", "charge": "q", "atomic": ""}
"""Columns that a style adds to `id type x y z` of `hybrid`; one that occurs twice is written once."""
BY_SAND = re.compile(r"SAND, step (\d+), (\S+) s, units si")
"""First line of a data file that SAND exported."""
NUMBER = "NUMBER OF ATOMS"
"""Item of a dump, behind which SAND lists the names of the materials in the order of their types."""
SECTIONS = re.compile(
    r"^(Atoms|Velocities|Masses|Atom Type Labels|Bonds|Angles|Dihedrals|Impropers|Ellipsoids|Lines|Triangles|Bodies|"
    r"[A-Z][A-Za-z]* (?:Coeffs|Type Labels))\b\s*(?:#\s*(.*))?$"
)
BOUNDS = re.compile(r"^\s*(\S+)\s+(\S+)\s+([xyz])lo\s+[xyz]hi")


def is_dump(lines: list[str]) -> bool:
    """Whether a text is a dump."""
    return next((line for line in lines if line.strip()), "").startswith("ITEM:")


def is_data(lines: list[str]) -> bool:
    """Whether a text is a data file: its head states the number of atoms, and it has a section of them."""
    has_number = any(re.match(r"^\s*\d+\s+atoms\b", line) for line in lines[1:40])
    return has_number and any(re.match(r"^\s*Atoms\b", line) for line in lines[1:])


def _units(text: str) -> str | None:
    """Style of units that a comment states."""
    found = re.search(r"\bunits\s*=?\s*(\w+)", text)
    return found[1] if found else None


def read_data(path: Any, lines: list[str]) -> GrainFile:
    """Read a data file.

    Raises
    ------
    BadInput
        If its style of atoms is not stated or has no spheres, or lines are not numbers (the first one is named).
    """
    sections, head = _sections(lines)
    stated = next((int(m[1]) for line in head if (m := re.match(r"^\s*(\d+)\s+atoms\b", line))), 0)
    start, style, atoms = sections["Atoms"]
    columns = _numbers(path, atoms, _atom_columns(path, start, style, len(atoms[0][1]) if atoms else 5))
    order = np.argsort(columns["id"], kind="stable")
    identity = columns["id"][order]
    if len(order) != stated or (np.diff(identity) == 0).any():
        raise BadInput(f"{path}: section Atoms has {len(np.unique(identity))} atoms, but the head says {stated}")
    columns = {name: values[order] for name, values in columns.items()}
    if "Velocities" in sections:
        _, _, rows = sections["Velocities"]
        width = len(rows[0][1]) if rows else 4
        names = ["id", "vx", "vy", "vz", "wx", "wy", "wz"][: 7 if width == 7 else 4]
        moving = _numbers(path, rows, names)
        turn = np.argsort(moving["id"], kind="stable")
        if not np.array_equal(moving.pop("id")[turn], identity):
            raise BadInput(
                f"{path}: section Velocities must have one line for each atom of section Atoms, by its number"
            )
        columns |= {name: values[turn] for name, values in moving.items()}
    own = BY_SAND.match(lines[0])
    data = _in_si(path, columns, _units(lines[0]), by_sand=own is not None)
    listed = next((m[1] for line in head if own and (m := re.match(r"^\d+ atom types # (.*)", line))), None)
    data.names = _labels(sections, columns["type"], listed)
    if own:
        data.step, data.time = int(own[1]), number(own[2])
    try:
        bounds = {m[3]: (number(m[1]), number(m[2])) for line in head if (m := BOUNDS.match(line))}
    except ValueError:
        raise BadInput(f"{path}: the bounds of its box, such as 'xlo xhi', must be two numbers each") from None
    if len(bounds) == 3:
        low, high = np.array([bounds[axis] for axis in "xyz"]).T
        found = re.search(r"\bboundary\s+([pfsm]{1,2})\s+([pfsm]{1,2})\s+([pfsm]{1,2})", lines[0])
        x, y, z = (found is not None and found[k + 1].startswith("p") for k in range(3))
        data.box = FileBox(low, high, (x, y, z))
    return GrainFile("LAMMPS data", 1, lambda _number: data)


Section = tuple[int, str, list[tuple[int, list[str], str]]]


def _sections(lines: list[str]) -> tuple[dict[str, Section], list[str]]:
    """Sections by name (line, comment behind the name, rows with their line, words and comment), and the head."""
    found: dict[str, Section] = {}
    head: list[str] = []
    rows: list[tuple[int, list[str], str]] | None = None
    for k, line in enumerate(lines[1:], start=2):
        if section := SECTIONS.match(line.strip()):
            rows = []
            found[section[1]] = (k, section[2] or "", rows)
            continue
        text, _, comment = line.partition("#")
        if rows is None:
            head.append(line)
        elif words := text.split():
            rows.append((k, words, comment.strip()))
    return found, head


def _atom_columns(path: Any, line: int, style: str, width: int) -> list[str]:
    """Names of the columns of an atom, with the three optional image flags.  Raises BadInput."""
    words = style.split()
    if not words and width in (5, 8):
        words = ["atomic"]
    if words[:1] == ["hybrid"] and words[1:] and all(word in IN_HYBRID for word in words[1:]):
        names = list(
            dict.fromkeys(["id", "type", "x", "y", "z", *(c for w in words[1:] for c in IN_HYBRID[w].split())])
        )
    elif len(words) == 1 and words[0] in ATOMS:
        names = ATOMS[words[0]].split()
    else:
        raise BadInput(
            f"{path}, line {line}: atoms of style {style or '(none is stated)'}; write the style behind Atoms, one of "
            f"{', '.join(ATOMS)}, or hybrid with {', '.join(IN_HYBRID)}, such as 'Atoms # sphere'"
        )
    if width not in (len(names), len(names) + 3):
        raise BadInput(f"{path}, line {line}: atoms have {width} columns, but style {' '.join(words)} has {len(names)}")
    return names + ["ix", "iy", "iz"] * (width == len(names) + 3)


def _numbers(path: Any, rows: list[tuple[int, list[str], str]], names: list[str]) -> dict[str, np.ndarray]:
    """Columns of numbers by name.  Raises BadInput."""
    values, problems = np.zeros((len(rows), len(names))), []
    for k, (line, words, _) in enumerate(rows):
        try:
            if len(words) != len(names):
                raise ValueError
            values[k] = [number(word) for word in words]
            if not np.isfinite(values[k]).all():
                raise ValueError
        except ValueError:
            problems.append(f"{path}, line {line}: {' '.join(words)[:40]!r} is not {' '.join(names)}")
    if problems:
        raise BadInput(with_number(problems[0], len(problems)))
    return dict(zip(names, values.T, strict=True))


def _labels(sections: dict[str, Section], kinds: np.ndarray, listed: str | None) -> list[str] | None:
    """Names of the materials: those `listed` by SAND, labels of the types, or comments behind all masses, or None."""
    if listed is not None:
        labels = {str(k): name for k, name in enumerate(unlisted(listed), start=1)}
    elif "Atom Type Labels" in sections:
        labels = {words[0]: words[-1] for _, words, _ in sections["Atom Type Labels"][2]}
    else:
        labels = {words[0]: comment for _, words, comment in sections.get("Masses", (0, "", []))[2] if comment}
    names = [labels.get(str(int(kind)), "") for kind in kinds]
    return names if all(names) else None


def read_dump(path: Any, lines: list[str]) -> GrainFile:
    """Read a dump, of style atom or custom.

    Raises
    ------
    BadInput
        If a snapshot is incomplete, or lines are not numbers (the first one is named).
    """
    starts = [k for k, line in enumerate(lines) if line.strip() == "ITEM: TIMESTEP"]
    ends = [*starts[1:], len(lines)]
    stated = [k for k, line in enumerate(lines) if line.strip() == "ITEM: UNITS"]  # in the first snapshot only
    units = lines[stated[0] + 1].strip() if stated and stated[0] + 1 < len(lines) else None
    if not starts:
        raise BadInput(f"{path} is a LAMMPS dump without ITEM: TIMESTEP")

    def frame(k: int) -> GrainData:
        return _snapshot(path, lines, starts[k], ends[k], units)

    return GrainFile("LAMMPS dump", len(starts), frame)


def _snapshot(path: Any, lines: list[str], first: int, end: int, units: str | None) -> GrainData:
    items = {lines[k].strip().removeprefix("ITEM: "): k for k in range(first, end) if lines[k].startswith("ITEM: ")}
    atoms = next((name for name in items if name.startswith("ATOMS")), None)
    bounds = next((name for name in items if name.startswith("BOX BOUNDS")), None)
    number_of = next((name for name in items if name.startswith(NUMBER)), NUMBER)
    listed = number_of.removeprefix(f"{NUMBER} # ") if number_of != NUMBER else None
    try:
        count = int(lines[items[number_of] + 1])
        low, high = np.array([[float(v) for v in lines[items[bounds or ""] + k].split()[:2]] for k in (1, 2, 3)]).T
    except (KeyError, ValueError, IndexError):
        raise BadInput(f"{path}, line {first + 1}: a snapshot without its number of atoms or its box") from None
    names = (atoms or "ATOMS").split()[1:]
    begin = items.get(atoms or "", first) + 1
    if len(set(names)) < len(names):
        raise BadInput(f"{path}, line {begin}: a column occurs twice among {' '.join(names)}")
    if not names or begin + count > end:
        raise BadInput(
            f"{path}, line {first + 1}: the snapshot lacks some of its {count} atoms, or their columns' names"
        )
    boundary = [word for word in (bounds or "").split()[2:] if word[:1] in "pfsm" and word not in ("xy", "xz", "yz")]
    x, y, z = (k < len(boundary) and boundary[k].startswith("p") for k in range(3))
    if "xy" in (bounds or "") and any((x, y, z)):
        raise BadInput(f"{path}, line {items[bounds or ''] + 1}: SAND has boxes with edges along x, y and z only")
    rows = [(k + 1, lines[k].split(), "") for k in range(begin, begin + count)]
    texts = [name for name in names if name in ("element", "typelabel")]
    kept = [name for name in names if name not in texts]
    picked = [(line, [w for w, n in zip(words, names, strict=False) if n not in texts], "") for line, words, _ in rows]
    short = [line for line, words, _ in rows if len(words) != len(names)]
    if short:
        problem = f"{path}, line {short[0]}: not the {len(names)} columns {' '.join(names)}"
        raise BadInput(with_number(problem, len(short)))
    columns = _numbers(path, picked, kept)
    order = np.argsort(columns["id"], kind="stable") if "id" in columns else np.arange(count)
    columns = {name: values[order] for name, values in columns.items()}
    for k, axis in enumerate("xyz"):  # scaled and unwrapped coordinates
        for name, scaled in ((f"{axis}u", False), (f"{axis}s", True), (f"{axis}su", True)):
            values = columns.pop(name, None)
            if values is not None and axis not in columns:
                columns[axis] = low[k] + values * (high[k] - low[k]) if scaled else values
    data = _in_si(path, columns, units, by_sand=listed is not None)
    data.box = FileBox(low, high, (x, y, z))
    if listed is not None and "type" in columns:
        data.names = _labels({}, columns["type"], listed)
    elif "typelabel" in texts:
        at = names.index("typelabel")
        data.names = [rows[k][1][at] for k in order]
    words = lines[first + 1].split()
    data.step = int(words[0]) if len(words) == 1 and words[0].isdecimal() else None
    data.time = _time(lines, first, columns, units)
    return data


def _time(lines: list[str], first: int, columns: dict[str, np.ndarray], units: str | None) -> float | None:
    """Time of a snapshot [s]: `ITEM: TIME`, or the column `v_time` of exports of SAND; None without these."""
    length, speed, _, _ = STYLES.get(units or "si", (1.0, 1.0, 1.0, 1.0))
    unit = FEMTOSECOND if units == "electron" else length / speed
    if units == "lj":
        return None
    try:
        if first >= 2 and lines[first - 2].strip() == "ITEM: TIME":
            return number(lines[first - 1].strip()) * unit
    except ValueError:
        return None
    found = columns.get("v_time", np.zeros(0))
    return float(found[0]) * unit if len(found) and (found == found[0]).all() else None


def _in_si(path: Any, columns: dict[str, np.ndarray], units: str | None, *, by_sand: bool) -> GrainData:
    """Grains from columns in a style of units; without one, in `si`.

    Point particles, of which LAMMPS writes the diameter 0, have no radii.
    """
    columns = dict(columns)
    for name in ("diameter", "radius"):
        if name in columns and not columns[name].any():
            columns.pop(name)
            columns.pop("density", None)
    length, speed, mass, charge = STYLES.get(units or "si", (1.0, 1.0, 1.0, 1.0))
    data = data_of(columns, length if units != "lj" else None, place=str(path))
    factors = {
        "velocity": speed,
        "spin": speed / length,
        "mass": mass,
        "charge": charge,
        "density": mass / length**3,
        "moment": 1.0,
    }
    data.states_unit = units in STYLES or by_sand
    data.given = {name: values * factors[name] for name, values in data.given.items()}
    kept = [name for name, values in data.given.items() if name != "density" and values.any()]
    if units == "lj":
        data.given = {}
        data.refused += [f"{path} is in lj units, in which {name} has no value in SI; set it to 0" for name in kept]
    elif units not in (None, *STYLES):
        data.refused.append(f"{path}: units {units} are unknown; known are {', '.join(STYLES)} and lj")
    elif units is None and (kept := [name for name in kept if not by_sand]):
        data.notes.append(f"{path} states no style of units: {' and '.join(kept)} taken in SI")
    if units not in (None, "si", "lj") and np.any(data.given.get("moment", 0.0)):
        data.refused.append(f"{path}: moments are read in A m^2 from files in si units only; set mux, muy, muz to 0")
    if "mass" in data.given:
        data.given.pop("density", None)
    return data
