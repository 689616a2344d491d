"""Bodies from files: the last frame of a SAND trajectory, or plain columns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import BadInput
from ..core.grains import Grains
from ..core.material import Material
from ..core.units import in_unit
from .folder import read_text
from .trajectory import read_frames

MOST_GRAINS = 1_000_000


def read_body(path: str | Path, material: Material, radius: Any = None, length: str = "1 m") -> Grains:
    """Grains at rest, centred on their centre of mass.

    Args:
        path: a trajectory (`.gsd`), whose last frame is taken with its radii and moments, or text with one grain a
            line, `x y z` or `x y z r`, blank lines and `#` comments allowed.
        material: of all grains; radius: [m] of all grains of a text without radii.
        length: what one unit of the text's numbers is, "1 nm" for example.

    Raises:
        BadInput: a missing or foreign file, lines that are not numbers (the first ten by number).
    """
    if Path(path).suffix == ".gsd":
        frame = read_frames(path)[-1]
        body = Grains(frame.position, frame.radius, material, moment=np.asarray(frame.moment))
    else:
        columns = _columns(path) * _unit(length)
        if columns.shape[1] == 3 and radius is None:
            raise BadInput(f"{path} has no radii; give a radius for all grains")
        body = Grains(columns[:, :3], columns[:, 3] if columns.shape[1] == 4 else radius, material)
    middle = np.average(body.position, axis=0, weights=body.mass)
    body.arrays.position[...] -= middle[:, None]
    return body


def _unit(length: str) -> float:
    factor = in_unit(length, "m")
    if factor is None or not 0.0 < factor < np.inf:
        raise BadInput(f"length = {length!r} must be a length such as '1 nm'")
    return float(factor)


def _columns(path: str | Path) -> np.ndarray:
    """(N, 3) or (N, 4) numbers."""
    rows: list[list[float]] = []
    problems: list[str] = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) not in (3, 4) or not np.isfinite(row).all() or (rows and len(row) != len(rows[0])):
            problems.append(f"{path}, line {number}: {line.strip()[:40]!r} is not x y z or x y z r, alike in all lines")
        rows.append(row)
        if len(problems) == 10 or len(rows) > MOST_GRAINS:
            break
    if problems or not rows:
        raise BadInput(problems or f"{path} holds no grain")
    return np.array(rows)
