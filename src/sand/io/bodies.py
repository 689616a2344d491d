"""Bodies in files: extended XYZ, GSD, or plain columns."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import MOST_GRAINS
from ..box import Box
from ..errors import BadInput, FilesFailed, did_you_mean
from ..grains import Grains
from ..material import PRESETS, Material
from ..paths import user_path
from ..schema import own_values
from ..units import si
from .extended_xyz import Columns, is_xyz, read_xyz, xyz_text
from .frame import MODES
from .run_folder import read_text, replace_file
from .trajectory import Frames, TrajectoryWriter

NAMED = 10
"""Lines that are named one by one in a message."""
SUFFIXES = (".xyz", ".extxyz", ".gsd")


def read_body(
    path: str | Path,
    material: Material | None = None,
    radius: Any = None,
    length: str | None = None,
    materials: Mapping[str, Material] = PRESETS,
    otherwise: Material | None = None,
) -> Grains:
    """Read a body: grains at rest, with the centre of mass at the origin.

    Parameters
    ----------
    path : str or Path
        Extended XYZ or `.gsd` (of SAND or of other programs), of which the last frame is read; or text with one grain
        per line, `x y z` or `x y z r`, with blank lines and `#` comments allowed.
    material : Material or None, optional
        Material of all grains; by default those named in the file.
    radius : float or str, optional
        Radius [m] of all grains, for a file without radii.
    length : str or None, optional
        Unit of length of the file, "1 nm" for example; by default 1 Å in extended XYZ (or its `length_unit`), 1 m in
        columns and in GSD of other programs.
    materials : Mapping[str, Material], optional
        Materials that the file may name.
    otherwise : Material or None, optional
        Material of all grains if the file names none.

    Returns
    -------
    Grains
        The body.

    Raises
    ------
    BadInput
        If the file is missing or foreign, has lines that are not numbers (the first ten are named), grains with
        impossible numbers, no radii, or unknown materials.
    """
    file = user_path(path)
    found = _read_gsd(file) if file.suffix == ".gsd" else _read_lines(path)
    unit = found.unit if length is None else si(length, "m", "length", above=0.0)
    if found.radius is None and radius is None:
        raise BadInput(f"{path} has no radii; give a radius for all grains")
    size = radius if found.radius is None else found.radius * unit
    kinds = _materials(path, found, material or (otherwise if found.names is None else None), materials)
    try:
        body = Grains(found.position * unit, size, kinds, moment=found.moment, own=found.own, charge=found.charge)
    except BadInput as error:
        raise error.at(str(path)) from None
    centre = np.average(body.position, axis=0, weights=body.mass)
    body.arrays.position[...] -= centre[:, None]
    return body


def _materials(
    path: str | Path, found: Columns, material: Material | None, known: Mapping[str, Material]
) -> Material | list[Material]:
    if material is not None:
        return material
    if found.names is None:
        raise BadInput(f"{path} does not name the materials of its grains; give a material")
    if unknown := [name for name in dict.fromkeys(found.names) if name not in known]:
        raise BadInput(f"{path}: unknown material '{unknown[0]}'; {did_you_mean(unknown[0], list(known))}")
    return [known[name] for name in found.names]


def _read_gsd(path: Path) -> Columns:
    """Read the last frame of a trajectory of SAND or of another program.  Raises BadInput."""
    with contextlib.closing(Frames(path)) as frames:
        if not len(frames):
            raise BadInput(f"{path} holds no frame")
        if frames.written_by_sand:
            frame = frames[-1]
            names = [frame.materials[k] for k in frame.material]
            moment, own = np.asarray(frame.moment), own_values(frame)
            return Columns(frame.position, frame.radius, moment, names, 1.0, own, frame.charge)
        stored = frames.stored(-1)
        size = 0.5 * np.asarray(stored.particles.diameter, dtype=np.float64)
        return Columns(np.asarray(stored.particles.position, dtype=np.float64), size, None, None, 1.0)


def _read_lines(path: str | Path) -> Columns:
    """Read extended XYZ, or columns x y z or x y z r.  Raises BadInput."""
    lines = read_text(path).splitlines()
    if is_xyz(lines):
        return read_xyz(path, lines)
    rows: list[list[float]] = []
    problems: list[str] = []
    for number, line in enumerate(lines, start=1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) not in (3, 4) or not np.isfinite(row).all() or (rows and len(row) != len(rows[0])):
            problems.append(f"{path}, line {number}: {line.strip()[:40]!r} is not x y z or x y z r, as in all lines")
        rows.append(row)
        if len(problems) == NAMED or len(rows) > MOST_GRAINS:
            break
    if len(rows) > MOST_GRAINS:
        problems.append(f"{path} holds more than {MOST_GRAINS:.0e} grains")
    if problems or not rows:
        raise BadInput(problems or f"{path} holds no grain")
    table = np.array(rows)
    return Columns(table[:, :3], table[:, 3] if table.shape[1] == 4 else None, None, None, 1.0)


def refuse_target(path: Path, *, overwrite: bool) -> None:
    """Raise BadInput if a body cannot be written to `path`; called before the body is built."""
    if path.suffix not in SUFFIXES:
        raise BadInput(f"{path}: the suffix selects the format of a body; allowed: {', '.join(SUFFIXES)}")
    if not path.parent.is_dir():
        raise BadInput(f"there is no folder {path.parent}; make it first")
    if path.is_dir() or (path.exists() and not overwrite):
        raise BadInput(f"{path} exists; give another name, or allow overwriting (--overwrite)")


def write_body(path: str | Path, grains: Grains, *, overwrite: bool = False) -> Path:
    """Write a body: extended XYZ for `.xyz` and `.extxyz`, a trajectory of one frame for `.gsd`.

    Positions are written to full precision, so that contacts stay at rest. `read_body`, `sand collide`, `sand run`,
    OVITO and ASE read both formats.

    Raises
    ------
    BadInput
        If the suffix is unknown, the folder does not exist, or the file exists already.
    FilesFailed
        If the file cannot be written.
    """
    target = user_path(path)
    refuse_target(target, overwrite=overwrite)
    if target.suffix != ".gsd":
        replace_file(target, xyz_text(grains).encode())
        return target
    temporary = target.with_name(f".{target.stem}.building.gsd")
    try:
        writer = TrajectoryWriter(temporary)
        writer.write(0, 0.0, grains, Box.open(), contacts_of(grains), exact=True)
        writer.flush()
        writer.close()
        replace_file(target, temporary.read_bytes())
    except OSError as error:
        raise FilesFailed(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
    return target


def contacts_of(grains: Grains) -> dict[str, np.ndarray]:
    """Table of the unstrained contacts of grains in open space, by column, as `TrajectoryWriter.write` takes it."""
    pair, overlap = grains.touching(Box.open())
    none, vectors = np.zeros(len(pair)), np.zeros((len(pair), 3))
    shares = {f"{mode}_share": none for mode in MODES}
    vectors_of = dict.fromkeys(("force", "slide_vector", "roll_vector"), vectors)
    return {"pair": pair, "overlap": np.maximum(overlap, 0.0), "formed": none, "twist": none, **vectors_of, **shares}
