"""Grains in files of any format, and bodies that are written as extended XYZ or GSD."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..basics.box import Box
from ..basics.errors import BadInput, FilesFailed, did_you_mean, naming
from ..basics.grains import Grains
from ..basics.material import PRESETS, Material
from ..basics.paths import user_path
from ..basics.schema import MODES
from ..basics.units import format_quantity, si
from .extended_xyz import xyz_text
from .grain_files import FileBox, GrainData, GrainFile, is_gsd, open_grains
from .run_folder import replace_file
from .trajectory import Frames, TrajectoryWriter

SINGLE_PRECISION = 6e-8
"""Relative rounding error of single precision, in which trajectories store masses."""
OPEN = Box.open()
SUFFIXES = (".xyz", ".extxyz", ".gsd")


class ReadGrains(NamedTuple):
    """Grains of one frame of a file, in SI, as they are there: neither shifted nor made whole."""

    grains: Grains
    box: Box  # of the file; open space if it states none
    centre: np.ndarray | None  # (3,) centre of this box [m]; None if the file states none
    contacts: tuple[np.ndarray, np.ndarray] | None  # pairs (C, 2) and overlaps [m], in frames of SAND
    notes: tuple[str, ...]
    time: float | None = None  # [s], if the file states it
    step: int | None = None


MASSES = 1e3
"""Largest factor between a mass in a file and that of a sphere of the material; beyond, its unit must be another."""
# parameters of `read_grains`: material, materials, otherwise
_Choice = tuple[Material | None, Mapping[str, Material], Material | None]


def read_grains(
    path: str | Path,
    material: Material | None = None,
    radius: Any = None,
    length: str | None = None,
    materials: Mapping[str, Material] = PRESETS,
    otherwise: Material | None = None,
    frame: int = -1,
) -> ReadGrains:
    """Read grains from a file of any format that `io.grain_files` knows, or a trajectory of SAND.

    Velocities, spins, moments, charges, masses and own quantities are kept, or refused if their unit is unknown.

    Parameters
    ----------
    path : str or Path
        The file; its content tells its format.
    material : Material or None, optional
        Material of all grains; by default those named in the file.
    radius : float or str, optional
        Radius [m] of all grains, for a file without radii.
    length : str or None, optional
        Unit of length of the file, "1 nm" for example. Default: the one that the file states; 1 Å in XYZ; 1 m in
        columns and in LAMMPS files that state no unit. GSD of other programs needs it.
        A file that states another one is refused.
    materials : Mapping[str, Material], optional
        Materials that the file may name.
    otherwise : Material or None, optional
        Material of all grains if the file names none.
    frame : int, optional
        Index of the frame; −1 is the last.

    Raises
    ------
    BadInput
        If the file is missing or in no such format, has lines that are not numbers (the first one is named), grains
        with impossible numbers, quantities without a unit, no radii or two, no such frame, or unknown materials.
    """
    file, choice = user_path(path), (material, materials, otherwise)
    if is_gsd(file) and (found := _read_own_gsd(file, frame)) is not None:
        data, contacts = found
        return _in_si(path, data, radius, length, choice)._replace(contacts=contacts)
    return read_frame(path, open_grains(path), radius, length, choice, frame)


def read_frame(
    path: str | Path, opened: GrainFile, radius: Any, length: str | None, choice: _Choice, frame: int
) -> ReadGrains:
    """Read a frame of an open file of another program; parameters and errors as for `read_grains`."""
    if not -opened.frame_count <= frame < opened.frame_count:
        raise BadInput(
            f"{path} has {opened.frame_count} frames, from 0 to {opened.frame_count - 1}; there is no {frame}"
        )
    data = opened.frame(frame % opened.frame_count)
    if data.unit is None and length is None:
        raise BadInput(
            f"{path} ({opened.form}) does not state its unit of length; give it: length = '1 um', for example"
        )
    return _in_si(path, data, radius, length, choice)


def _in_si(path: str | Path, data: GrainData, radius: Any, length: str | None, choice: _Choice) -> ReadGrains:
    """Grains and box in SI.  Raises BadInput."""
    if data.refused:
        raise BadInput(data.refused)
    unit = data.unit if length is None else si(length, "m", "length", above=0.0)
    assert unit is not None
    if data.states_unit and data.unit is not None and not math.isclose(unit, data.unit, rel_tol=1e-9):
        stated = format_quantity(data.unit, "m")
        raise BadInput(f"length = {length!r}: {path} states its unit of length, {stated}; leave length out")
    if data.sizes_assumed and radius is None:
        data.notes.append(f"{path}: all diameters are 1 unit of length, the default of GSD; give a radius for others")
    grains = _grains_of(path, data, unit, radius, choice)
    with naming(f"{path}: box"):
        box, centre = _box_of(data, unit)
    return ReadGrains(grains, box, centre, None, tuple(data.notes), data.time, data.step)


def _grains_of(path: str | Path, data: GrainData, unit: float, radius: Any, choice: _Choice) -> Grains:
    """Grains in SI.  Raises BadInput."""
    if data.radius is None and radius is None:
        raise BadInput(f"{path} has no radii; give a radius for all grains: radius = '0.1 um', for example")
    if data.radius is not None and radius is not None and not data.sizes_assumed:
        raise BadInput(f"radius: {path} has the radii of its grains; leave radius out")
    size = radius if radius is not None else np.asarray(data.radius) * unit
    material, materials, otherwise = choice
    kinds = _materials(path, data, material or (otherwise if data.names is None else None), materials)
    given = dict(data.given)
    density = given.pop("density", None)
    with naming(path):
        grains = Grains(data.position * unit, size, kinds, own=data.own, **(given | {"mass": None}))
        if density is not None and "mass" not in given:
            given["mass"] = density * (4.0 / 3.0 * np.pi) * grains.radius**3
        if "mass" not in given:
            return grains
        mass = kept_masses(given["mass"], grains.mass)
        if data.names is not None and all(name in materials for name in data.names):  # the material may be another one
            before = Grains(data.position * unit, size, [materials[name] for name in data.names]).mass
            mass = np.where(kept_masses(given["mass"], before) == before, grains.mass, mass)
        ratio = np.asarray(mass) / grains.mass
        if (far := np.flatnonzero(~((ratio > 1.0 / MASSES) & (ratio < MASSES)))).size:
            k, name = far[0], grains.materials[grains.material[far[0]]].name
            raise BadInput(
                f"mass of grain {k} is {mass[k]:.3g} kg, but a sphere of {name} of its radius has "
                f"{grains.mass[k]:.3g} kg; give masses in kg, or leave them out"
            )
        return Grains(data.position * unit, size, kinds, own=data.own, **(given | {"mass": mass}))


def kept_masses(mass: np.ndarray, nominal: np.ndarray) -> np.ndarray:
    """Masses from a file, (N,) [kg]; the nominal ones where they are equal to single precision."""
    return np.where(np.abs(mass - nominal) <= 8.0 * SINGLE_PRECISION * nominal, nominal, mass)


def _box_of(data: GrainData, unit: float) -> tuple[Box, np.ndarray | None]:
    """The box that the file states [m], and its centre (3,)."""
    if data.box is None:
        return Box.open(), None
    low, high, periodic, tilt = data.box
    x, y, z = (float(v) * unit if on else None for v, on in zip(high - low, periodic, strict=True))
    return Box((x, y, z), tilt * unit), 0.5 * (low + high) * unit


def read_body(path: str | Path, *arguments: Any, **named: Any) -> Grains:
    """Read a body, with the centre of mass at the origin; parameters as for `read_grains`.

    Raises
    ------
    BadInput
        As `read_grains`.
    """
    return centred(read_grains(path, *arguments, **named).grains)


def centred(body: Grains) -> Grains:
    """The grains, shifted so that the centre of mass is at the origin; changes them."""
    centre = np.average(body.position, axis=0, weights=body.mass)
    body.arrays.position[...] -= centre[:, None]
    return body


def _materials(
    path: str | Path, found: GrainData, material: Material | None, known: Mapping[str, Material]
) -> Material | list[Material]:
    if material is not None:
        return material
    if found.names is None:
        raise BadInput(f"{path} does not name the materials of its grains; give a material")
    if unknown := [name for name in dict.fromkeys(found.names) if name not in known]:
        raise BadInput(f"{path}: unknown material '{unknown[0]}'; {did_you_mean(unknown[0], list(known))}")
    return [known[name] for name in found.names]


def _read_own_gsd(path: Path, number: int) -> tuple[GrainData, tuple[np.ndarray, np.ndarray]] | None:
    """Grains and contacts of a frame of a trajectory; None if another program wrote it.  Raises BadInput."""
    with contextlib.closing(Frames(path)) as frames:
        if not len(frames):
            raise BadInput(f"{path} holds no frame")
        if not frames.written_by_sand:
            return None
        frame = frames[number]
    names = ("velocity", "spin", "moment", "charge", "mass")
    data = GrainData(
        frame.position,
        frame.radius,
        1.0,
        {name: np.asarray(getattr(frame, name), np.float64) for name in names},
        [frame.materials[k] for k in frame.material],
        {name: (values, frame.own.units[name]) for name, values in frame.own.items()},
        states_unit=True,
    )
    lengths = np.array(frame.drawn)
    x, y, z = (length is not None for length in frame.box.lengths)
    data.box = FileBox(-0.5 * lengths, 0.5 * lengths, (x, y, z), frame.box.tilt)
    return data, (np.asarray(frame.pair, np.int64), frame.overlap)


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

    Positions are written to full precision, so that contacts stay at rest. `read_grains`, `sand collide`, `sand run`,
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


def contacts_of(grains: Grains, box: Box = OPEN, gap: float = 0.0) -> dict[str, np.ndarray]:
    """Table of the unstrained contacts of grains, by column, as `TrajectoryWriter.write` takes it.

    `gap`: as in `Grains.touching`.
    """
    pair, overlap = grains.touching(box, gap)
    none, vectors = np.zeros(len(pair)), np.zeros((len(pair), 3))
    shares = {f"{mode}_share": none for mode in MODES}
    vectors_of = dict.fromkeys(("force", "slide_vector", "roll_vector"), vectors)
    return {"pair": pair, "overlap": np.maximum(overlap, 0.0), "formed": none, "twist": none, **vectors_of, **shares}
