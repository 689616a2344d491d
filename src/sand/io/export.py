"""Export of frames to other programs: extended XYZ, LAMMPS data and dump, VTK (.vtp with .pvd).

All quantities are SI, except lengths in extended XYZ: its readers expect ångström, and a comment in the file says so.
LAMMPS files are for `units si` and `atom_style hybrid sphere dipole` (data), or a custom dump. The formats are written
here because ASE rounds to 8 decimals and has neither a dump nor this atom style, and meshio has no .vtp.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from ..errors import BadInput, warn
from .extended_xyz import ANGSTROM, format_rows, own_columns, xyz_frame
from .run_folder import replace_file
from .trajectory import Frame


def to_xyz(frame: Frame, cluster: np.ndarray) -> str:
    """Format a frame as extended XYZ: species, position [Å], radius [Å], velocity, moment, spin, mass, charge (SI).

    Then own quantities in SI, whose units are in the second line, and the cluster.
    """
    periodic = " ".join("T" if v is not None else "F" for v in frame.box.lengths)
    own, units = own_columns(frame.own)
    x, y, z = (v / ANGSTROM for v in frame.drawn)
    head = (
        f'Lattice="{x:.10g} 0 0 0 {y:.10g} 0 0 0 {z:.10g}" Origin="{-x / 2:.10g} {-y / 2:.10g} {-z / 2:.10g}" '
        "Properties=species:S:1:pos:R:3:radius:R:1:velo:R:3:moment:R:3:spin:R:3:mass:R:1:charge:R:1"
        f"{own}:cluster:I:1 "
        f'Time={frame.time!r} Step={frame.step} pbc="{periodic}" length_unit=angstrom other_units=SI{units}'
    )
    columns = [frame.position / ANGSTROM, frame.radius / ANGSTROM, frame.velocity, frame.moment, frame.spin]
    columns += [frame.mass, frame.charge, *frame.own.values(), cluster]
    form = "%.10g " * 4 + "%.9g " * 11 + "%.17g " * len(frame.own) + "%d"
    return xyz_frame(frame.materials, frame.material, head, columns, form)


def _table(columns: Sequence[np.ndarray], form: str) -> str:
    """Format one line per grain, which begins with its number from 1 on."""
    return "".join(f"{k} {row}\n" for k, row in enumerate(format_rows(columns, form), 1))


def _file_names(stem: str, ending: str, steps: Sequence[int]) -> list[str]:
    """File of each frame: with the number of its step, and "-1", "-2", … where several frames follow one step."""
    if "{" not in ending:  # one file for all
        return [stem + ending] * len(steps)
    names = []
    for k, step in enumerate(steps):
        repeated = sum(other == step for other in steps[:k])
        number, _, suffix = ending.format(step).rpartition(".")
        names.append(f"{stem}{number}{f'-{repeated}' if repeated else ''}.{suffix}")
    return names


def to_lammps_dump(frame: Frame, cluster: np.ndarray) -> str:
    """Format a frame as a snapshot of a custom dump.

    Columns: id, type, position, radius, velocity, spin, moment, cluster, mass, charge, and own quantities in SI, with
    the prefix `d_` that LAMMPS gives such numbers. The snapshot has a step number but no time, because some readers do
    not accept `ITEM: TIME`.
    """
    walls = " ".join("pp" if v is not None else "ff" for v in frame.box.lengths)
    box = "".join(f"{-0.5 * v:.17g} {0.5 * v:.17g}\n" for v in frame.drawn)
    head = (
        f"ITEM: TIMESTEP\n{frame.step}\n"
        f"ITEM: NUMBER OF ATOMS\n{len(frame)}\n"
        f"ITEM: BOX BOUNDS {walls}\n{box}"
        "ITEM: ATOMS id type x y z radius vx vy vz omegax omegay omegaz mux muy muz c_cluster mass q"
        f"{''.join(f' d_{name}' for name in frame.own)}\n"
    )
    columns = [frame.material + 1, frame.position, frame.radius, frame.velocity, frame.spin, frame.moment, cluster + 1]
    columns += [frame.mass, frame.charge, *frame.own.values()]
    return head + _table(columns, "%d" + " %.10g" * 13 + " %d %.9g %.9g" + " %.17g" * len(frame.own))


def to_lammps_data(frame: Frame, cluster: np.ndarray) -> str:
    """Format a frame as a data file of `atom_style hybrid sphere dipole`: grains, velocities and spins.

    Columns of an atom: id type x y z diameter density q mux muy muz. There is no place for own quantities.
    """
    box = "".join(
        f"{-0.5 * v:.17g} {0.5 * v:.17g} {axis}lo {axis}hi\n" for v, axis in zip(frame.drawn, "xyz", strict=True)
    )
    density = frame.mass / (4.0 / 3.0 * np.pi * frame.radius**3)
    columns = (frame.material + 1, frame.position, 2.0 * frame.radius, density, frame.charge, frame.moment)
    return (
        f"SAND, step {frame.step}, {frame.time!r} s, units si\n\n{len(frame)} atoms\n"
        f"{len(frame.materials)} atom types\n\n"
        f"{box}\nAtoms # hybrid sphere dipole\n\n{_table(columns, '%d' + ' %.10g' * 9)}\n"
        f"Velocities\n\n{_table((frame.velocity, frame.spin), '%.9g' + ' %.9g' * 5)}"
    )


def _array(name: str, values: np.ndarray, unit: str = "") -> str:
    """Format a DataArray of a VTK file, as text to full precision; `unit` is what ParaView shows beside its name."""
    parts = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    kind, form = ("Int64", "%d") if np.issubdtype(values.dtype, np.integer) else ("Float64", "%.17g")
    text = " ".join(form % v for v in values.ravel().tolist())
    # after the numbers: VTK reads these from the beginning of the element
    key = f'<InformationKey name="UNITS_LABEL" location="vtkDataArray">{escape(unit)}</InformationKey>' if unit else ""
    return f'<DataArray type="{kind}" Name={quoteattr(name)}{parts} format="ascii">{text}{key}</DataArray>'


def to_vtp(frame: Frame, cluster: np.ndarray) -> str:
    """Format a frame as VTK: grains as points, contacts as lines with overlap and force.

    Contacts across a periodic face have no line. Point data: radius [m], moment [A m²], velocity, spin, mass, charge,
    material, cluster, own quantities in SI. Cell data (zero for the vertices, which come first): overlap [m], force
    [N].
    """
    n = len(frame)
    offset = np.diff(frame.position[frame.pair], axis=1)[:, 0]
    inside = (np.abs(offset) < 0.5 * np.array(frame.drawn)).all(axis=1)
    lines = frame.pair[inside]
    overlap = np.concatenate([np.zeros(n), frame.overlap[inside]])
    force = np.concatenate([np.zeros((n, 3)), frame.force[inside]])
    columns = ("radius", "moment", "velocity", "spin", "mass", "charge", "material")
    points = [_array(name, getattr(frame, name)) for name in columns] + [_array("cluster", cluster)]
    points += [_array(name, values, frame.own.units[name]) for name, values in frame.own.items()]
    vertices = _array("connectivity", np.arange(n)) + _array("offsets", np.arange(1, n + 1))
    joined = _array("connectivity", lines.ravel()) + _array("offsets", 2 * np.arange(1, len(lines) + 1))
    return (
        '<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian">\n<PolyData>\n'
        f"<FieldData>{_array('TimeValue', np.array([frame.time]))}</FieldData>\n"
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


FORMATS: dict[str, tuple[Callable[[Frame, np.ndarray], str], str]] = {
    "xyz": (to_xyz, ".xyz"),
    "lammps-dump": (to_lammps_dump, ".dump"),
    "lammps-data": (to_lammps_data, "-{:012d}.data"),
    "vtk": (to_vtp, "-{:012d}.vtp"),
}
"""Text of a frame with its cluster labels, and end of the file name; one file per step if the name has the step."""


def export_frames(
    frames: Sequence[Frame], stem: str | Path, form: str, clusters: Callable[[int, np.ndarray], np.ndarray]
) -> list[Path]:
    """Write frames for another program.

    Parameters
    ----------
    stem : str or Path
        Path without suffix; "run/pictures" gives run/pictures.xyz, or run/pictures-000000000100.vtp and so on.
    form : str
        "xyz", "lammps-dump", "lammps-data" or "vtk".
    clusters : Callable
        Function of the number of grains and the contacts (C, 2) that returns cluster labels (N,), such as
        `analysis.clusters.cluster_labels`.

    Returns
    -------
    list[Path]
        The files written.

    Raises
    ------
    BadInput
        If the format is unknown, there is no frame, or the folder does not exist.
    FilesFailed
        If a file cannot be written.
    """
    if form not in FORMATS:
        raise BadInput(f"format = {form!r}; allowed: {', '.join(FORMATS)}")
    if not len(frames):
        raise BadInput("there is no frame to export")
    place = Path(stem)
    if not place.parent.is_dir():
        raise BadInput(f"there is no folder {place.parent}; make it first")
    if form == "lammps-data" and (own := frames[0].own):
        warn(f"LAMMPS data files have no place for own quantities: {', '.join(own)} left out; lammps-dump has them")
    text_of, ending = FORMATS[form]
    paths = [place.with_name(name) for name in _file_names(place.name, ending, [frame.step for frame in frames])]
    texts = (text_of(frame, clusters(len(frame), frame.pair)) for frame in frames)
    for path, group in groupby(zip(paths, texts, strict=True), itemgetter(0)):
        replace_file(path, "".join(text for _, text in group).encode())
    if form != "vtk":
        return list(dict.fromkeys(paths))
    index = place.with_name(f"{place.name}.pvd")
    replace_file(index, _pvd([frame.time for frame in frames], paths).encode())
    return [index, *paths]
