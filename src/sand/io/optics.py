"""Aggregates for programs of light scattering: dipoles of ADDA and DDSCAT, spheres of MSTM.

A file holds one body. Dipoles lie on a cubic lattice of spacing d; a lattice point belongs to the grain in which it
is deepest. The radius of the sphere of the same volume, a_eff = (3V/4π)^(1/3) with the volume V of the grains, by
which these programs set sizes, is stated in the file. Formats: ADDA 1.5, text with one dipole in a line, `Nmat=` if
there are several materials (manual, `-shape read`); DDSCAT 7, target FROM_FILE; MSTM 4, `sphere_data_input_file`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..basics.clusters import closes_through_boundary, in_one_piece
from ..basics.errors import BadInput, warn
from ..basics.units import format_quantity
from ..basics.version import __version__
from .extended_xyz import listed
from .run_folder import read_text

MOST_DIPOLES = 200_000_000
"""Dipoles that are made at most."""
ACROSS = 10
"""Default number of dipoles across the smallest grain."""
MARGIN = 1e-9
"""Relative margin of comparisons of lengths, above rounding errors."""
MICRON = 1e-6


class Optics(NamedTuple):
    """Settings of files for optics."""

    spacing: float | None = None  # d [m]; None: a tenth of the smallest diameter
    indices: Mapping[str, complex] = MappingProxyType({})  # refractive index n + ik of materials, for MSTM


DEFAULT = Optics()


class Spheres(NamedTuple):
    """The grains of one body."""

    position: np.ndarray  # (N, 3) [m], relative to the centre of volume
    radius: np.ndarray  # (N,) [m]
    material: np.ndarray  # (N,) number of the material

    @property
    def effective_radius(self) -> float:
        """a_eff = (Σ r³)^(1/3) [m]; where grains overlap, their volume counts twice."""
        return float(np.cbrt((self.radius**3).sum()))


class Dipoles(NamedTuple):
    """Dipoles on a cubic lattice."""

    cell: np.ndarray  # (P, 3) whole numbers ≥ 0, in the order z, y, x
    material: np.ndarray  # (P,) number of the material, from 0
    spacing: float  # d [m]; NaN if the file does not state it
    origin: np.ndarray  # (3,) [m] position of the dipole 0, 0, 0

    @property
    def position(self) -> np.ndarray:
        """Positions (P, 3) [m]."""
        return np.asarray(self.origin + self.spacing * self.cell)


def dipoles_of(spheres: Spheres, spacing: float) -> Dipoles:
    """Dipoles of a body: the points of a lattice, centred on the body, that lie in a grain.

    Parameters
    ----------
    spheres : Spheres
        The grains.
    spacing : float
        Spacing d [m], at most the smallest radius.

    Raises
    ------
    BadInput
        If the spacing is larger, or there would be too many dipoles.
    """
    position, radius = spheres.position, spheres.radius
    if spacing > radius.min() * (1.0 + MARGIN):
        least = format_quantity(float(radius.min()), "m")
        raise BadInput(f"spacing = {format_quantity(spacing, 'm')} is more than {least}, the smallest radius")
    expected = 4.0 / 3.0 * math.pi * float((radius**3).sum()) / spacing**3
    if expected > MOST_DIPOLES:
        raise BadInput(
            f"spacing = {format_quantity(spacing, 'm')} makes {expected:.1e} dipoles, at most {MOST_DIPOLES:.0e}"
        )
    low, high = (position - radius[:, None]).min(axis=0), (position + radius[:, None]).max(axis=0)
    cells = np.ceil((high - low) / spacing - MARGIN).astype(np.int64)
    origin = 0.5 * (low + high) - 0.5 * (cells - 1) * spacing
    found = [_in_sphere(position[k], radius[k], origin, spacing) for k in range(len(radius))]
    index = np.concatenate([points for points, _ in found])
    depth = np.concatenate([depths for _, depths in found])
    grain = np.repeat(np.arange(len(radius)), [len(points) for points, _ in found])
    number = (index[:, 2] * cells[1] + index[:, 1]) * cells[0] + index[:, 0]
    order = np.lexsort((grain, -depth, number))  # of several grains the one in which it is deepest comes first
    first = order[np.unique(number[order], return_index=True)[1]]
    return Dipoles(index[first], spheres.material[grain[first]], spacing, origin)


def _in_sphere(centre: np.ndarray, radius: float, origin: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Lattice points (P, 3) in a sphere, and their depths below its surface (P,) [m], rounded to the margin."""
    middle = (centre - origin) / spacing
    reach = radius / spacing
    axes = [np.arange(math.ceil(m - reach), math.floor(m + reach) + 1) for m in middle]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    squared = ((points - middle) ** 2).sum(axis=1)
    inside = squared < reach * reach * (1.0 - MARGIN)
    depth = reach - np.sqrt(squared[inside])
    return points[inside], np.round(depth / MARGIN / 10.0)


def spheres_of(one: Any) -> Spheres:
    """The largest cluster of an exported frame (`export.Exported`), in one piece across periodic boundaries.

    Raises
    ------
    BadInput
        If the cluster touches its own periodic image.
    """
    frame, sizes = one.frame, np.bincount(one.cluster)
    chosen = np.flatnonzero(one.cluster == sizes.argmax())
    if len(chosen) < len(frame):
        warn("files for optics hold the largest cluster; grains of other clusters are left out")
    ends = np.asarray(frame.pair, np.int64)
    whole = in_one_piece(np.array(frame.position, np.float64), ends, frame.box)
    ends = ends[np.isin(ends[:, 0], chosen)]
    if closes_through_boundary(whole, ends, frame.box).any():
        raise BadInput(f"step {frame.step}: the largest cluster touches its own periodic image; it has no shape")
    radius, position = np.asarray(frame.radius, np.float64)[chosen], whole[chosen]
    position -= (position * (radius**3)[:, None]).sum(axis=0) / (radius**3).sum()
    return Spheres(position, radius, one.material[chosen])


def _dipoles(one: Any) -> tuple[Spheres, Dipoles, list[str], str]:
    """Grains, dipoles with materials numbered from 0 as they occur, their names, and a description."""
    spheres = spheres_of(one)
    made = dipoles_of(spheres, one.optics.spacing or 2.0 * float(spheres.radius.min()) / ACROSS)
    used, numbers = np.unique(made.material, return_inverse=True)
    size = made.cell.max(axis=0) + 1
    about = (
        f"SAND {__version__}: aggregate of {len(spheres.radius)} grains, dipole spacing d = {made.spacing:.9g} m, "
        f"a_eff = {spheres.effective_radius / MICRON:.9g} um, box {size[0]}x{size[1]}x{size[2]}"
    )
    return spheres, made._replace(material=numbers), [listed([one.materials[k]]) for k in used], about


def to_adda(one: Any) -> str:
    """Format the largest cluster of a frame as a shape file of ADDA, `-shape read`."""
    spheres, made, names, about = _dipoles(one)
    lines = [f"#{about}", f"#adda -shape read FILE -eq_rad {spheres.effective_radius / MICRON:.9g} -lambda UM -m RE IM"]
    table = made.cell
    if len(names) > 1:
        lines += [f"#domain {k}: {name}" for k, name in enumerate(names, 1)] + [f"Nmat={len(names)}"]
        table = np.column_stack([table, made.material + 1])
    return "\n".join([*lines, *(" ".join(map(str, row)) for row in table.tolist())]) + "\n"


def to_ddscat(one: Any) -> str:
    """Format the largest cluster of a frame as shape.dat of DDSCAT 7, target FROM_FILE."""
    _, made, names, about = _dipoles(one)
    zero = made.origin / made.spacing
    lines = [
        f"{about}, materials {', '.join(names)}"[:250],
        f"{len(made.cell)} = NAT",
        "1 0 0 = A_1 vector",
        "0 1 0 = A_2 vector",
        "1 1 1 = lattice spacings (d_x,d_y,d_z)/d",
        f"{zero[0]:.9g} {zero[1]:.9g} {zero[2]:.9g} = lattice offset x0(1-3) = (x_TF,y_TF,z_TF)/d for dipole 0 0 0",
        "JA IX IY IZ ICOMP(x,y,z)",
    ]
    kind = made.material + 1
    table = np.column_stack([np.arange(1, len(kind) + 1), made.cell, kind, kind, kind])
    return "\n".join([*lines, *(" ".join(map(str, row)) for row in table.tolist())]) + "\n"


def to_mstm(one: Any) -> str:
    """Format the largest cluster of a frame as sphere data of MSTM: x y z radius [µm], and (n,k) if they are given."""
    spheres, indices = spheres_of(one), one.optics.indices
    names = [one.materials[k] for k in spheres.material]
    if missing := [name for name in dict.fromkeys(names) if name not in indices]:
        if indices or len(set(names)) > 1:
            raise BadInput(
                f"there is no refractive index of {', '.join(missing)}; give it: --index '{missing[0]}=1.5+0.01i'"
            )
        ends = [""] * len(names)
    else:
        ends = [f" ({indices[name].real:.9g},{indices[name].imag:.9g})" for name in names]
    rows = np.column_stack([spheres.position, spheres.radius]) / MICRON
    return "".join(f"{' '.join(f'{v:.9g}' for v in row)}{end}\n" for row, end in zip(rows.tolist(), ends, strict=True))


def read_dipoles(path: str | Path) -> Dipoles:
    """Read a shape file of ADDA or DDSCAT 7, of SAND or other programs.

    Spacing and origin are those that files of SAND state; NaN and 0 in others.

    Raises
    ------
    BadInput
        If the file is in neither format.
    """
    lines = read_text(path).splitlines()
    head = next((k for k, line in enumerate(lines[:9]) if line.split()[:1] == ["JA"]), None)
    start = head + 1 if head is not None else next((k for k, line in enumerate(lines) if line[:1] not in "#N"), 0)
    try:
        table = np.array([[int(word) for word in line.split()[:7]] for line in lines[start:] if line.strip()])
        columns = (table[:, 1:4], table[:, 4]) if head is not None else (table[:, :3], table[:, 3:].sum(axis=1))
        if table.shape[1] not in ((7,) if head is not None else (3, 4)):
            raise ValueError
    except (ValueError, IndexError):
        raise BadInput(f"{path} is not a shape file of ADDA or DDSCAT 7") from None
    cell, material = columns
    stated = lines[0].partition("d = ")[2].split()
    spacing = float(stated[0]) if stated else math.nan
    origin = np.zeros(3)
    if head is not None and stated:
        origin = spacing * np.array([float(word) for word in lines[5].split()[:3]])
    return Dipoles(cell, np.maximum(material - 1, 0), spacing, origin)
