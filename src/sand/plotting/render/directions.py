"""Axes x, y and z and uniform fields as arrows in a picture of grains, and fields in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from ...basics.ramps import force_at, ramps_of
from ..style import MUTED, RED, format_si, points

SYMBOLS = {"field": ("B", "T"), "electric": ("E", "V/m"), "gravity": ("g", "m/s²")}
"""Symbol and unit of each uniform field, by the name of the force."""
LEAST_LENGTH = 0.25
"""Length of an axis in the picture, over that across the direction to the eye, from which on it has its letter."""
LEAST_SHARE = 1e-9
"""Strength of an oscillating field over its largest one, below which it is 0 to rounding."""


class UniformField(NamedTuple):
    """A field at one time."""

    symbol: str
    vector: np.ndarray  # (3,) [unit]
    unit: str
    varies: bool  # whether it depends on time

    def text(self) -> str:
        """In words: 'B = 1 mT along z'."""
        size = float(np.linalg.norm(self.vector))
        varies = " at this time" if self.varies else ""
        if size == 0.0:
            return f"{self.symbol} = 0{varies}"
        unit = self.vector / size
        axis = int(np.argmax(np.abs(unit)))
        name = f"{'−' * bool(unit[axis] < 0.0)}{'xyz'[axis]}"
        if abs(unit[axis]) < 1.0 - 1e-6:
            name = f"({', '.join(f'{v:.2g}'.replace('-', '−') for v in unit)})"
        return f"{self.symbol} = {format_si(size, self.unit)} along {name}{varies}"


def uniform_fields(forces: Iterable[Any], time: float) -> list[UniformField]:
    """Uniform fields at a time [s]; a field that is 0 at all times is left out."""
    found = []
    for force in forces:
        if force.name in SYMBOLS:
            now, symbol = force_at(force, time), SYMBOLS[force.name]
            is_magnetic = force.name == "field"
            vector = np.array(now.flux_density_at(time) if is_magnetic else now.numbers(), float)
            if is_magnetic and np.linalg.norm(vector) < LEAST_SHARE * force.flux_density_size():
                vector[:] = 0.0
            varies = bool(ramps_of(force)) or getattr(force, "time_dependent", False)
            if vector.any() or varies:
                found.append(UniformField(symbol[0], vector, symbol[1], varies))
    return found


def draw_directions(
    axes: Axes, rotation: np.ndarray, place: tuple[float, float], size: float, fields: Sequence[UniformField] = ()
) -> None:
    """Draw the axes x, y and z and, to the right of them, an arrow for each field.

    Parameters
    ----------
    rotation : ndarray
        (3, 3) from the laboratory to the screen, see `scene.camera_rotation`.
    place : tuple of float
        Origin of the axes in the picture [m].
    size : float
        Length of an axis [m].
    """
    x, y = place
    for name, step in zip("xyz", rotation[:2].T * size, strict=True):
        axes.plot([x, x + step[0]], [y, y + step[1]], color=MUTED, linewidth=0.9, zorder=4)
        if np.hypot(*step) < LEAST_LENGTH * size:  # towards the eye, or away from it
            continue
        axes.text(x + 1.5 * step[0], y + 1.5 * step[1], name, color=MUTED, size=points(7.0), ha="center", va="center")
    for field in fields:
        if not field.vector.any():
            continue
        x += 2.8 * size
        step = 1.6 * size * (rotation @ (field.vector / np.linalg.norm(field.vector)))[:2]
        tail, head = ((x + half * step[0], y + half * step[1]) for half in (-0.5, 0.5))
        style = {"arrowstyle": "-|>", "color": RED, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7}
        axes.annotate("", head, tail, arrowprops=style, zorder=4, gid=f"direction of {field.symbol}")
        axes.text(x + 0.7 * size, y, field.symbol, color=RED, size=points(7.0), va="center", weight="bold")
