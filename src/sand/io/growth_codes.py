"""Collision models for codes of dust growth: tables for DustPy, lines of setup.par for mcdust, in their cgs units.

DustPy 1.0 takes `ini.dust.vFrag` [cm/s], `erosionMassRatio`, `excavatedMass` (in masses of the smaller body) and
`fragmentDistribution` (γ of n(m) ∝ m^γ), and probabilities `dust.p.stick` and `dust.p.frag`, whose sum is below 1 where
bodies bounce. mcdust takes `fragmentation_velocity_[cm/s]`, `erosion_mass_ratio`, `monomer_radius_[cm]` and
`material_density_[g/cm3]`; its eroded mass is that of the small body, and γ = −11/6 is a constant of its source.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.errors import BadInput
from .run_folder import read_text, replace_file

COLUMNS = (
    "mass_ratio",
    "filling_factor",
    "speed_cm_s",
    "collisions",
    "growth_efficiency",
    "growth_efficiency_error",
    "p_stick",
    "p_frag",
    "excavated_mass",
)
"""Columns of the table for DustPy: those of `analysis.collision_model.Efficiency`, the speed in cm/s."""
CM = 1e-2


def write_dustpy(path: str | Path, rows: Sequence[Any]) -> None:
    """Write the table of `analysis.collision_model.efficiencies` as CSV with the columns `COLUMNS`.

    Raises
    ------
    BadInput
        If there is no row.
    FilesFailed
        If the file cannot be written.
    """
    if not rows:
        raise BadInput("there is no row to write")
    lines = [",".join(COLUMNS)]
    for row in rows:
        values = [*row[:2], row.speed / CM, *row[3:]]
        lines.append(",".join("" if math.isnan(value) else f"{value:.17g}" for value in values))
    replace_file(path, ("\n".join(lines) + "\n").encode())


def read_dustpy(path: str | Path) -> dict[str, np.ndarray]:
    """Columns of a file of `write_dustpy`, in its units; empty cells are NaN.  Raises BadInput."""
    lines = list(csv.reader(read_text(path).splitlines()))
    if not lines or tuple(lines[0]) != COLUMNS or any(len(line) != len(COLUMNS) for line in lines):
        raise BadInput(f"{path} is not a table of write_dustpy")
    table = np.array([[float(cell) if cell else math.nan for cell in line] for line in lines[1:]])
    return dict(zip(COLUMNS, table.reshape(-1, len(COLUMNS)).T, strict=True))


def write_mcdust(
    path: str | Path, speed: float, radius: float, density: float, erosion_mass_ratio: float = 10.0
) -> None:
    """Write the lines of mcdust's setup.par that describe collisions.

    Parameters
    ----------
    speed : float
        Fragmentation speed [m/s] > 0, such as `Threshold.speed`.
    radius, density : float
        Radius [m] of the grains, and density of the bodies [kg/m³]: that of the grains times the filling factor.
    erosion_mass_ratio : float, optional
        Mass ratio from which on a collision erodes the larger body.

    Raises
    ------
    BadInput
        If a number is not above 0, or infinite.
    FilesFailed
        If the file cannot be written.
    """
    given = {"speed": speed, "radius": radius, "density": density, "erosion_mass_ratio": erosion_mass_ratio}
    if wrong := [f"{name} = {value:g} must be above 0" for name, value in given.items() if not 0.0 < value < math.inf]:
        raise BadInput(wrong)
    values = {
        "monomer_radius_[cm]": radius / CM,
        "material_density_[g/cm3]": density * 1e-3,
        "fragmentation_velocity_[cm/s]": speed / CM,
        "erosion_mass_ratio": erosion_mass_ratio,
    }
    replace_file(path, "".join(f"{name:41} {value:.9g}\n" for name, value in values.items()).encode())
