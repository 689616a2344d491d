"""GSD files of other programs, and files that ASE reads."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np

from ...basics.errors import BadInput
from ..trajectory import Frames
from .data import FileBox, GrainData, GrainFile

MAGIC = b"\xdf\x65" * 4
"""First bytes of a GSD file."""
ANGSTROM = 1e-10
BY_ASE = ("cfg", "cif", "gromacs", "mol", "proteindatabank", "sdf", "traj", "vasp", "xsf")
"""Formats that ASE reads for SAND."""


def is_gsd(path: Path) -> bool:
    """Whether a file begins as a GSD file does."""
    try:
        with open(path, "rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def read_gsd(path: Path) -> GrainFile:
    """Read a GSD file of another program, which does not state its units.  Raises BadInput."""
    with contextlib.closing(Frames(path)) as frames:
        count = len(frames)
    if not count:
        raise BadInput(f"{path} holds no frame")

    def frame(number: int) -> GrainData:
        with contextlib.closing(Frames(path)) as frames:
            return _of_snapshot(path, frames.stored(number))

    return GrainFile("GSD of another program", count, frame)


def _of_snapshot(path: Path, stored: Any) -> GrainData:
    p = stored.particles
    size = 0.5 * np.asarray(p.diameter, dtype=np.float64)
    data = GrainData(np.asarray(p.position, dtype=np.float64), size, None, sizes_assumed=bool((size == 0.5).all()))
    moving = {"velocities": p.velocity, "angular momenta": p.angmom, "charges": p.charge}
    for name, values in moving.items():
        if values is not None and np.any(values):
            data.refused.append(
                f"{path}: its {name} are in units that the file does not state; set them to 0, or write the grains in "
                "SI, as columns '# x y z r vx vy vz'"
            )
    if p.mass is not None and np.any(np.asarray(p.mass) != 1.0):  # 1: the default of the format
        data.notes.append(f"{path}: masses are not read, the file states no unit; they follow from radius and material")
    lengths = np.asarray(stored.configuration.box, dtype=np.float64)
    if lengths[:3].all() and not lengths[3:].any():
        data.box = FileBox(-0.5 * lengths[:3], 0.5 * lengths[:3], (True, True, True))
    elif lengths[3:].any():
        data.refused.append(f"{path}: its box is not rectangular; SAND has boxes with edges along x, y and z only")
    return data


def read_by_ase(path: Path) -> GrainFile:
    """Read a file of another format by ASE, positions in ångström.

    Raises
    ------
    BadInput
        If ASE does not know the format.
    ImportError
        If ASE is not installed.
    """
    import ase.io

    try:
        if (form := ase.io.formats.filetype(str(path), guess=True)) not in BY_ASE:
            raise ValueError(f"format {form}")
        found = ase.io.read(path, index=":", format=form)
    except Exception as error:  # its readers raise various ones
        raise BadInput(f"{path} is in no format that SAND or ASE reads ({str(error).splitlines()[0][:80]})") from None
    images = [one for one in (found if isinstance(found, list) else [found]) if len(one)]
    if not images:
        raise BadInput(f"{path} holds no grain")
    return GrainFile("a format of ASE", len(images), lambda number: _of_atoms(path, images[number]))


def _of_atoms(path: Path, atoms: Any) -> GrainData:
    radius = atoms.arrays.get("radius", atoms.arrays.get("radii"))
    data = GrainData(
        np.asarray(atoms.positions, float), None if radius is None else np.asarray(radius, float), ANGSTROM
    )
    for name, given in (
        ("momenta", "momenta"),
        ("initial_charges", "charges"),
        ("initial_magmoms", "magnetic moments"),
    ):
        if np.any(atoms.arrays.get(name, 0.0)):
            data.refused.append(f"{path}: its {given} are in units of atoms, which are not read; remove them")
    cell = np.asarray(atoms.cell)
    if np.any(atoms.pbc):
        if np.any(cell - np.diag(np.diag(cell))):
            data.refused.append(f"{path}: its cell is not a box with edges along x, y and z, the only one SAND has")
        x, y, z = (bool(v) for v in atoms.pbc)
        data.box = FileBox(np.zeros(3), np.diag(cell), (x, y, z))
    return data
