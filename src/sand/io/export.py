"""Export of frames to other programs: extended XYZ, LAMMPS data and dump, VTK (.vtp with .pvd).

All quantities are SI, except lengths in extended XYZ: its readers expect ångström, and a comment in the file says so.
LAMMPS files are for `units si` and `atom_style hybrid sphere dipole` (data), or a custom dump.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from ..errors import BadInput
from .run_folder import replace_file
from .trajectory import Frame

Clusters = Callable[[int, np.ndarray], np.ndarray]
Text = Callable[[Frame, np.ndarray], str]
Writer = Callable[[Sequence[Frame], Path, Clusters], list[Path]]

ANGSTROM = 1e-10
SYMBOLS = {"iron": "Fe", "silica": "Si", "ice": "O", "graphite": "C", "forsterite": "Mg", "magnetite": "Fe"}
"""Chemical symbols that distinguish materials; X for others."""


def _lines(columns: Sequence[np.ndarray], form: str) -> str:
    """Format one line for each row of the columns (N,) or (N, k)."""
    table = np.column_stack(columns)
    return "".join(form % tuple(row) for row in table.tolist())


def to_xyz(frame: Frame, cluster: np.ndarray) -> str:
    """Format a frame as extended XYZ: species, position [Å], radius [Å], velocity, moment, spin, cluster (SI)."""
    periodic = " ".join("T" if v is not None else "F" for v in frame.box.lengths)
    x, y, z = (v / ANGSTROM for v in frame.drawn)
    head = (
        f'Lattice="{x:.10g} 0 0 0 {y:.10g} 0 0 0 {z:.10g}" Origin="{-x / 2:.10g} {-y / 2:.10g} {-z / 2:.10g}" '
        "Properties=species:S:1:pos:R:3:radius:R:1:velo:R:3:moment:R:3:spin:R:3:cluster:I:1 "
        f'Time={frame.time!r} Step={frame.step} pbc="{periodic}" length_unit=angstrom other_units=SI'
    )
    names = [SYMBOLS.get(name, "X") for name in frame.materials]
    columns = (frame.position / ANGSTROM, frame.radius / ANGSTROM, frame.velocity, frame.moment, frame.spin)
    rows = _lines((*columns, cluster), "%.10g " * 4 + "%.9g " * 9 + "%d\n").splitlines()
    species = [names[k] for k in frame.material]
    return "\n".join([str(len(frame)), head, *(f"{s} {row}" for s, row in zip(species, rows, strict=True))]) + "\n"


def _bounds(frame: Frame) -> list[tuple[float, float]]:
    return [(-0.5 * v, 0.5 * v) for v in frame.drawn]


def to_lammps_dump(frame: Frame, cluster: np.ndarray) -> str:
    """Format a frame as a snapshot of a custom dump: id, type, position, radius, velocity, spin, moment, cluster.

    It has step numbers but no times, because some readers do not accept `ITEM: TIME`.
    """
    walls = " ".join("pp" if v is not None else "ff" for v in frame.box.lengths)
    box = "".join(f"{low:.17g} {high:.17g}\n" for low, high in _bounds(frame))
    head = (
        f"ITEM: TIMESTEP\n{frame.step}\n"
        f"ITEM: NUMBER OF ATOMS\n{len(frame)}\n"
        f"ITEM: BOX BOUNDS {walls}\n{box}"
        "ITEM: ATOMS id type x y z radius vx vy vz omegax omegay omegaz mux muy muz c_cluster\n"
    )
    ids = np.arange(1, len(frame) + 1)
    columns = (ids, frame.material + 1, frame.position, frame.radius, frame.velocity, frame.spin, frame.moment)
    return head + _lines((*columns, cluster + 1), "%d %d" + " %.10g" * 13 + " %d\n")


def to_lammps_data(frame: Frame, cluster: np.ndarray) -> str:
    """Format a frame as a data file of `atom_style hybrid sphere dipole`: grains, velocities and spins.

    Columns of an atom: id type x y z diameter density q mux muy muz.
    """
    box = "".join(
        f"{low:.17g} {high:.17g} {axis}lo {axis}hi\n" for (low, high), axis in zip(_bounds(frame), "xyz", strict=True)
    )
    ids = np.arange(1, len(frame) + 1)
    density = frame.mass / (4.0 / 3.0 * np.pi * frame.radius**3)
    columns = (ids, frame.material + 1, frame.position, 2.0 * frame.radius, density, frame.charge, frame.moment)
    atoms = _lines(columns, "%d %d" + " %.10g" * 9 + "\n")
    velocities = _lines((ids, frame.velocity, frame.spin), "%d" + " %.9g" * 6 + "\n")
    return (
        f"SAND, step {frame.step}, {frame.time!r} s, units si\n\n{len(frame)} atoms\n"
        f"{len(frame.materials)} atom types\n\n"
        f"{box}\nAtoms # hybrid sphere dipole\n\n{atoms}\nVelocities\n\n{velocities}"
    )


def _array(name: str, values: np.ndarray) -> str:
    """Format a DataArray of a VTK file, as text to full precision."""
    flat = np.asarray(values)
    parts = f' NumberOfComponents="{flat.shape[1]}"' if flat.ndim == 2 else ""
    is_integer = np.issubdtype(flat.dtype, np.integer)
    kind, form = ("Int64", "%d") if is_integer else ("Float64", "%.17g")
    text = " ".join(form % v for v in flat.ravel().tolist())
    return f'<DataArray type="{kind}" Name={quoteattr(name)}{parts} format="ascii">{text}</DataArray>'


def to_vtp(frame: Frame, cluster: np.ndarray) -> str:
    """Format a frame as VTK: grains as points, contacts as lines with overlap and force.

    Contacts across a periodic face have no line. Point data: radius [m], moment [A m²], velocity, spin, material,
    cluster; cell data (zero for the vertices, which come first): overlap [m], force [N].
    """
    n = len(frame)
    span = np.array([np.inf if v is None else 0.5 * v for v in frame.box.lengths])
    a, b = frame.pair[:, 0].astype(int), frame.pair[:, 1].astype(int)
    direct = (np.abs(frame.position[a] - frame.position[b]) < span).all(axis=1)
    lines, overlap, force = frame.pair[direct].astype(np.int64), frame.overlap[direct], frame.force[direct]
    points = {
        "radius": frame.radius,
        "moment": frame.moment,
        "velocity": frame.velocity.astype(float),
        "spin": frame.spin,
        "material": frame.material.astype(np.int64),
        "cluster": cluster.astype(np.int64),
    }
    cells = {
        "overlap": np.concatenate([np.zeros(n), overlap]),
        "force": np.concatenate([np.zeros((n, 3)), np.nan_to_num(force)]),
    }
    vertices = _array("connectivity", np.arange(n)) + _array("offsets", np.arange(1, n + 1))
    joined = _array("connectivity", lines.ravel()) + _array("offsets", 2 * np.arange(1, len(lines) + 1))
    return (
        '<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian">\n<PolyData>\n'
        f"<FieldData>{_array('TimeValue', np.array([frame.time]))}</FieldData>\n"
        f'<Piece NumberOfPoints="{n}" NumberOfVerts="{n}" NumberOfLines="{len(lines)}" NumberOfStrips="0" '
        'NumberOfPolys="0">\n'
        f"<PointData>{''.join(_array(k, v) for k, v in points.items())}</PointData>\n"
        f"<CellData>{''.join(_array(k, v) for k, v in cells.items())}</CellData>\n"
        f"<Points>{_array('Points', frame.position)}</Points>\n"
        f"<Verts>{vertices}</Verts>\n<Lines>{joined}</Lines>\n</Piece>\n</PolyData>\n</VTKFile>\n"
    )


def _one_file(text_of: Text, ending: str) -> Writer:
    """Writer of one file with all frames."""

    def write(frames: Sequence[Frame], stem: Path, clusters: Clusters) -> list[Path]:
        path = stem.with_name(stem.name + ending)
        replace_file(path, "".join(text_of(frame, clusters(len(frame), frame.pair)) for frame in frames).encode())
        return [path]

    return write


def _numbered(text_of: Text, ending: str) -> Writer:
    """Writer of one file per frame."""

    def write(frames: Sequence[Frame], stem: Path, clusters: Clusters) -> list[Path]:
        paths = []
        for frame in frames:
            paths.append(stem.with_name(f"{stem.name}-{frame.step:012d}{ending}"))
            replace_file(paths[-1], text_of(frame, clusters(len(frame), frame.pair)).encode())
        return paths

    return write


def _with_index(frames: Sequence[Frame], stem: Path, clusters: Clusters) -> list[Path]:
    """Write a .vtp for each frame, and the .pvd with their times."""
    paths = _numbered(to_vtp, ".vtp")(frames, stem, clusters)
    times = [frame.time for frame in frames]
    sets = "".join(
        f'<DataSet timestep="{time!r}" file={quoteattr(path.name)}/>\n' for time, path in zip(times, paths, strict=True)
    )
    index = stem.with_name(stem.name + ".pvd")
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
    replace_file(index, f"{head}{sets}</Collection>\n</VTKFile>\n".encode())
    return [index, *paths]


FORMATS: dict[str, Writer] = {
    "xyz": _one_file(to_xyz, ".xyz"),
    "lammps-dump": _one_file(to_lammps_dump, ".dump"),
    "lammps-data": _numbered(to_lammps_data, ".data"),
    "vtk": _with_index,
}
"""Writers by name: (frames, path without suffix, cluster labels) → the files written."""


def export_frames(frames: Sequence[Frame], stem: str | Path, form: str, clusters: Clusters) -> list[Path]:
    """Write frames for another program.

    Parameters
    ----------
    stem : str or Path
        Path without suffix; "run/pictures" gives run/pictures.xyz, or run/pictures-000000000100.vtp and so on.
    form : str
        "xyz", "lammps-dump", "lammps-data" or "vtk".
    clusters : Callable
        Function of the number of grains and the contacts (C, 2) that returns cluster labels (N,), such as
        `analysis.cluster_labels`.

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
    base = Path(stem)
    if not base.parent.is_dir():
        raise BadInput(f"there is no folder {base.parent}; make it first")
    return FORMATS[form](frames, base, clusters)
