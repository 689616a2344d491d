"""Files of grains of other programs: which format a file has, from its content, and its frames."""

from __future__ import annotations

from pathlib import Path

from ...basics.errors import BadInput
from ..run_folder import read_text
from .columns import read_columns
from .data import FileBox, GrainData, GrainFile
from .lammps import is_data, is_dump, read_data, read_dump
from .others import is_gsd, read_by_ase, read_gsd
from .xyz import is_xyz, read_xyz

SUFFIXES = (".cfg", ".cif", ".gro", ".mol", ".pdb", ".sdf", ".traj", ".vasp", ".xsf")
"""Suffixes of formats that ASE reads, for a message if it is not installed."""

__all__ = ["FileBox", "GrainData", "GrainFile", "is_gsd", "open_grains"]


def open_grains(path: str | Path) -> GrainFile:
    """Open a file of grains that is no trajectory of SAND; its content tells the format, not its name.

    Formats: plain and extended XYZ, LAMMPS data and dump, GSD, columns (also CSV, MSTM, FracVAL), and those of ASE if
    it is installed.

    Raises
    ------
    BadInput
        If the file is missing or in no such format; the first line that is not numbers is named.
    """
    file = Path(path)
    if is_gsd(file):
        return read_gsd(file)
    try:
        lines = read_text(path).splitlines()
    except BadInput as error:
        return _by_ase(file, error)
    while lines and not lines[-1].strip():
        lines.pop()
    if is_dump(lines):
        return read_dump(path, lines)
    if is_data(lines):
        return read_data(path, lines)
    if is_xyz(lines):
        return read_xyz(path, lines)
    try:
        return read_columns(path, lines)
    except BadInput as error:
        return _by_ase(file, error)


def _by_ase(file: Path, error: BadInput) -> GrainFile:
    """Read by ASE, if it is installed and knows the format.  Raises `error` otherwise."""
    if not file.is_file():
        raise error
    try:
        return read_by_ase(file)
    except ImportError:
        if file.suffix.lower() in SUFFIXES:
            raise BadInput(f"{file}: files {file.suffix} are read by ASE, which is missing: pip install ase") from None
        raise error from None
    except BadInput:
        raise error from None
