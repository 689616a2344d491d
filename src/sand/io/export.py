"""Export of frames to other programs: extended XYZ, LAMMPS data and dump, VTK (.vtp with .pvd), optics (`optics.py`).

All quantities are SI, except lengths in extended XYZ: its readers expect ångström, and a comment in the file says so.
LAMMPS files are for `units si` and `atom_style hybrid sphere dipole` (data), or a custom dump. The formats are written
here because ASE rounds to 8 decimals and has neither a dump nor this atom style, and meshio has no .vtp.
"""

from __future__ import annotations

import glob
from collections.abc import Callable, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from ..basics.errors import BadInput, warn
from ..basics.paths import user_path
from .extended_xyz import ANGSTROM, format_rows, listed, own_columns, row_form, symbol_of, xyz_frame
from .frame import Frame, FrameSequence
from .optics import DEFAULT, Optics, to_adda, to_ddscat, to_mstm
from .run_folder import replace_file, replacing


class Exported(NamedTuple):
    """A frame with what its text needs besides."""

    frame: Frame
    cluster: np.ndarray  # (N,) label of the cluster of each grain
    materials: list[str]  # names of the materials of all frames, which so have the same numbers in each
    number: int  # number of the frame, which no other one has
    optics: Optics = DEFAULT

    @property
    def material(self) -> np.ndarray:
        """Number of the material of each grain (N,)."""
        own = [self.materials.index(name) for name in self.frame.materials]
        return np.array(own, np.int64)[self.frame.material]

    @property
    def virial(self) -> list[np.ndarray]:
        """Shares (N, 9) [J] of the grains in the virial of contacts, xx, xy, … zz; none of runs without stress."""
        return [] if self.frame.stored_virial is None else [self.frame.stored_virial]


def to_xyz(one: Exported) -> str:
    """Format a frame as extended XYZ, in ångström, all else in SI.

    Columns: species, position, radius, velocity, moment, spin, mass, charge, own quantities, material, identity,
    crossings of the box, cluster, and of runs with stress the virial. Names of materials, and units of own quantities,
    are in the second line.
    """
    frame = one.frame
    periodic = " ".join("T" if v is not None else "F" for v in frame.box.lengths)
    own, units = own_columns(frame.own)
    x, y, z, tilt = (v / ANGSTROM for v in (*frame.drawn, frame.box.tilt))
    head = (
        f'Lattice="{x:.17g} 0 0 0 {y:.17g} 0 {tilt:.17g} 0 {z:.17g}" '
        f'Origin="{-(x + tilt) / 2:.17g} {-y / 2:.17g} {-z / 2:.17g}" '
        "Properties=species:S:1:pos:R:3:radius:R:1:velo:R:3:moment:R:3:spin:R:3:mass:R:1:charge:R:1"
        f"{own}:material:I:1:id:I:1:images:I:3:cluster:I:1{':virial:R:9' * len(one.virial)} "
        f'Time={frame.time!r} Step={frame.step} materials="{listed(one.materials)}" pbc="{periodic}" '
        f"length_unit=angstrom other_units=SI{units}"
    )
    columns = [frame.position / ANGSTROM, frame.radius / ANGSTROM, frame.velocity, frame.moment, frame.spin]
    columns += [frame.mass, frame.charge, *frame.own.values(), one.material, frame.id, frame.image, one.cluster]
    columns += one.virial
    return xyz_frame(one.materials, one.material, head, columns)


def _rows(identity: np.ndarray, columns: Sequence[np.ndarray]) -> list[str]:
    """Format a row per grain, which begins with its identity, counted from 1."""
    columns = [identity.astype(np.int64) + 1, *columns]
    return format_rows(columns, row_form(columns))


def _table(identity: np.ndarray, columns: Sequence[np.ndarray]) -> str:
    """Format these rows as lines."""
    return "".join(f"{row}\n" for row in _rows(identity, columns))


def to_lammps_dump(one: Exported) -> str:
    """Format a frame as a snapshot of a custom dump.

    Columns: id, type, position, radius, velocity, spin, moment, mass, charge, crossings of the box, time [s], own
    quantities in SI with the prefix `d_` that LAMMPS gives such numbers, of runs with stress the virial as `d2_virial`,
    chemical symbol, and cluster. The time is a
    column, because some readers do not accept `ITEM: TIME`, and the names of the materials, in the order of their
    types, are behind `NUMBER OF ATOMS`, because others accept no text but chemical symbols in columns. `TIMESTEP` is
    different in each frame, see `_numbers`.
    """
    frame = one.frame
    boundary = " ".join("pp" if v is not None else "ff" for v in frame.box.lengths)
    virial = "".join(f" d2_virial[{k}]" for k in range(1, 9 * len(one.virial) + 1))
    box = "".join(f"{-0.5 * v:.17g} {0.5 * v:.17g}\n" for v in frame.drawn)
    if tilt := frame.box.tilt:  # the bounds of the parallelepiped, and its tilts
        ends, boundary = 0.5 * (np.array(frame.drawn) + np.array([abs(tilt), 0.0, 0.0])), f"xy xz yz {boundary}"
        box = "".join(f"{-v:.17g} {v:.17g} {own:.17g}\n" for v, own in zip(ends, (0.0, tilt, 0.0), strict=True))
    head = (
        f"ITEM: TIMESTEP\n{one.number}\n"
        f"ITEM: NUMBER OF ATOMS # {listed(one.materials)}\n{len(frame)}\n"
        f"ITEM: BOX BOUNDS {boundary}\n{box}"
        "ITEM: ATOMS id type x y z radius vx vy vz omegax omegay omegaz mux muy muz mass q ix iy iz v_time"
        f"{''.join(f' d_{name}' for name in frame.own)}{virial} element c_cluster\n"
    )
    columns = [one.material + 1, frame.position, frame.radius, frame.velocity, frame.spin, frame.moment, frame.mass]
    columns += [frame.charge, frame.image, np.full(len(frame), frame.time), *frame.own.values(), *one.virial]
    symbols = [symbol_of(name) for name in one.materials]
    ends = [f"{symbols[kind]} {cluster}\n" for kind, cluster in zip(one.material, one.cluster + 1, strict=True)]
    return head + "".join(f"{row} {end}" for row, end in zip(_rows(frame.id, columns), ends, strict=True))


def to_lammps_data(one: Exported) -> str:
    """Format a frame as a data file of `atom_style hybrid sphere dipole`: grains, velocities and spins.

    Columns of an atom: id type x y z diameter density q mux muy muz, and the crossings of the box. Materials are
    comments in the head. There is no place for own quantities.
    """
    frame = one.frame
    box = "".join(
        f"{-0.5 * v - at:.17g} {0.5 * v - at:.17g} {axis}lo {axis}hi\n"
        for v, at, axis in zip(frame.drawn, (0.5 * frame.box.tilt, 0.0, 0.0), "xyz", strict=True)
    )
    box += f"0 {frame.box.tilt:.17g} 0 xy xz yz\n" if frame.box.tilt else ""
    density = np.asarray(frame.mass, np.float64) / (4.0 / 3.0 * np.pi * frame.radius**3)
    atoms = [one.material + 1, frame.position, 2.0 * frame.radius, density, frame.charge, frame.moment, frame.image]
    boundary = " ".join("p" if v is not None else "f" for v in frame.box.lengths)
    return (
        f"SAND, step {frame.step}, {frame.time!r} s, units si, boundary {boundary}\n\n{len(frame)} atoms\n"
        f"{len(one.materials)} atom types # {listed(one.materials)}\n\n"
        f"{box}\nAtoms # hybrid sphere dipole\n\n{_table(frame.id, atoms)}\n"
        f"Velocities\n\n{_table(frame.id, [frame.velocity, frame.spin])}"
    )


def _array(name: str, values: np.ndarray, unit: str = "") -> str:
    """Format a DataArray of a VTK file, as text to full precision; `unit` is what ParaView shows beside its name."""
    parts = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    kind, form = ("Int64", "%d") if np.issubdtype(values.dtype, np.integer) else ("Float64", "%.17g")
    text = " ".join(form % v for v in values.ravel().tolist())
    # after the numbers: VTK reads these from the beginning of the element
    key = f'<InformationKey name="UNITS_LABEL" location="vtkDataArray">{escape(unit)}</InformationKey>' if unit else ""
    return f'<DataArray type="{kind}" Name={quoteattr(name)}{parts} format="ascii">{text}{key}</DataArray>'


def _text_array(name: str, texts: Sequence[str]) -> str:
    """Format a DataArray of texts: the numbers of their bytes, each text ended by 0."""
    numbers = " ".join(str(byte) for text in texts for byte in (*text.encode(), 0))
    return (
        f'<DataArray type="String" Name={quoteattr(name)} NumberOfTuples="{len(texts)}" format="ascii">{numbers}'
        "</DataArray>"
    )


def to_vtp(one: Exported) -> str:
    """Format a frame as VTK: grains as points, contacts as lines with overlap and force.

    Contacts across a periodic face have no line. Point data: radius [m], moment [A m²], velocity, spin, mass, charge,
    material, id, image (crossings of the box), cluster, virial [J] of runs with stress, own quantities in SI. Cell data
    (zero for the vertices, which come first): overlap [m], force [N]. Field data: the time, the names of the materials,
    and the sides of the box [m], 0 where it is open.
    """
    frame, n = one.frame, len(one.frame)
    offset = np.diff(frame.position[frame.pair], axis=1)[:, 0]
    inside = (np.abs(offset) < 0.5 * np.array(frame.drawn)).all(axis=1)
    lines = frame.pair[inside]
    overlap = np.concatenate([np.zeros(n), frame.overlap[inside]])
    force = np.concatenate([np.zeros((n, 3)), frame.force[inside]])
    columns = ("radius", "moment", "velocity", "spin", "mass", "charge")
    points = [_array(name, getattr(frame, name)) for name in columns]
    points += [_array("material", one.material), _array("id", frame.id), _array("image", frame.image)]
    points += [_array("cluster", one.cluster)]
    points += [_array("virial", values, "J") for values in one.virial]
    points += [_array(name, values, frame.own.units[name]) for name, values in frame.own.items()]
    sides = np.array([0.0 if v is None else v for v in frame.box.lengths])
    fields = _array("TimeValue", np.array([frame.time])) + _array("periodic_box", sides, "m")
    fields += _array("step", np.array([frame.step])) + _text_array("materials", one.materials)
    vertices = _array("connectivity", np.arange(n)) + _array("offsets", np.arange(1, n + 1))
    joined = _array("connectivity", lines.ravel()) + _array("offsets", 2 * np.arange(1, len(lines) + 1))
    return (
        '<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian">\n<PolyData>\n'
        f"<FieldData>{fields}</FieldData>\n"
        f'<Piece NumberOfPoints="{n}" NumberOfVerts="{n}" NumberOfLines="{len(lines)}" NumberOfStrips="0" '
        'NumberOfPolys="0">\n'
        f"<PointData>{''.join(points)}</PointData>\n"
        f"<CellData>{_array('overlap', overlap)}{_array('force', force)}</CellData>\n"
        f"<Points>{_array('Points', frame.position)}</Points>\n"
        f"<Verts>{vertices}</Verts>\n<Lines>{joined}</Lines>\n</Piece>\n</PolyData>\n</VTKFile>\n"
    )


def _pvd(times: Sequence[float], paths: Sequence[Path]) -> str:
    """Format the list of .vtp files with their times."""
    sets = "".join(
        f'<DataSet timestep="{time!r}" file={quoteattr(path.name)}/>\n' for time, path in zip(times, paths, strict=True)
    )
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
    return f"{head}{sets}</Collection>\n</VTKFile>\n"


FORMATS: dict[str, tuple[Callable[[Exported], str], str]] = {
    "xyz": (to_xyz, ".xyz"),
    "lammps-dump": (to_lammps_dump, ".dump"),
    "lammps-data": (to_lammps_data, "-{:012d}.data"),
    "vtk": (to_vtp, "-{:012d}.vtp"),
    "adda": (to_adda, "-{:012d}.geom"),
    "ddscat": (to_ddscat, "-{:012d}.dat"),
    "mstm": (to_mstm, "-{:012d}.pos"),
}
"""Text of a frame, and end of the file name; one file per frame if the name has the step."""


def _files(place: Path, ending: str) -> Callable[[int], Path]:
    """Function of the step of each frame in turn that returns its file: "-1", "-2", … where several have one step."""
    seen: dict[int, int] = {}

    def path(step: int) -> Path:
        number, _, suffix = ending.format(step).rpartition(".")
        repeated = seen[step] = seen.get(step, -1) + 1
        return place.with_name(f"{place.name}{number}{f'-{repeated}' if repeated else ''}.{suffix}")

    return path if "{" in ending else lambda step: place.with_name(place.name + ending)


def _materials(frames: Sequence[Frame]) -> list[str]:
    """Names of the materials of all frames, in the order in which they first appear."""
    if isinstance(frames, FrameSequence):
        return frames.material_names()
    return list(dict.fromkeys(name for frame in frames for name in frame.materials))


def _numbers(frames: Sequence[Frame]) -> list[int]:
    """Numbers that tell frames apart: their steps, or their indices where several frames lie within one step."""
    steps = frames.steps if isinstance(frames, FrameSequence) else [frame.step for frame in frames]
    return [int(k) for k in steps] if len(set(steps)) == len(frames) else list(range(len(frames)))


def stale_files(stem: str | Path, form: str, written: Sequence[Path]) -> list[Path]:
    """Files of an earlier export of the same name that a later one, which wrote `written`, has not replaced."""
    ending = FORMATS[form][1].replace("{:012d}", "[0-9]*[0-9]")
    place, now = Path(stem), {path.name for path in written}
    return sorted(path for path in place.parent.glob(glob.escape(place.name) + ending) if path.name not in now)


def export_frames(
    frames: Sequence[Frame],
    stem: str | Path,
    form: str,
    clusters: Callable[[int, np.ndarray], np.ndarray],
    chosen: slice = slice(None),
    optics: Optics = DEFAULT,
) -> list[Path]:
    """Write frames for another program, one after the other: only one is in memory at a time.

    Parameters
    ----------
    frames : Sequence[Frame]
        The frames, such as those of `io.trajectory.Frames`.
    stem : str or Path
        Path without suffix; "run/pictures" gives run/pictures.xyz, or run/pictures-000000000100.vtp and so on.
    form : str
        "xyz", "lammps-dump", "lammps-data", "vtk", "adda", "ddscat" or "mstm"; of the last three each file holds the
        largest cluster of a frame.
    clusters : Callable
        Function of the number of grains and the contacts (C, 2) that returns cluster labels (N,), such as
        `analysis.clusters.cluster_labels`.
    chosen : slice, optional
        Frames to write, by default all. Materials have the same numbers whichever are chosen, but for optics.
    optics : Optics, optional
        Settings of files for optics.

    Returns
    -------
    list[Path]
        The files written.

    Raises
    ------
    BadInput
        If the format is unknown, there is no frame, or the folder does not exist.
    FilesFailed
        If a file cannot be written; of a format with one file for all frames the old one is untouched then.
    """
    if form not in FORMATS:
        raise BadInput(f"format = {form!r}; allowed: {', '.join(FORMATS)}")
    numbers = range(len(frames))[chosen]
    if not numbers:
        raise BadInput("there is no frame to export")
    place = user_path(stem)
    if not place.parent.is_dir():
        raise BadInput(f"there is no folder {place.parent}; make it first")
    text_of, ending = FORMATS[form]
    materials, names = _materials(frames), _numbers(frames)
    path_of, times = _files(place, ending), dict[Path, float]()
    each = ((path_of(frame.step), frame, names[k]) for k, frame in ((k, frames[k]) for k in numbers))
    for path, group in groupby(each, itemgetter(0)):
        with replacing(path) as file:
            for _, frame, name in group:
                if form == "lammps-data" and frame.own and not times:
                    left = ", ".join(frame.own)
                    warn(f"LAMMPS data files have no place for own quantities: {left} left out; lammps-dump has them")
                times[path] = frame.time
                one = Exported(frame, clusters(len(frame), frame.pair), materials, name, optics)
                file.write(text_of(one).encode())
    if form != "vtk":
        return list(times)
    index = place.with_name(f"{place.name}.pvd")
    replace_file(index, _pvd(list(times.values()), list(times)).encode())
    return [index, *times]
