"""Between which numbers the quantities of a run lie: what scales of colours go from and to."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..analysis.quantities import measured
from ..errors import BadInput
from .series import thinned

LOOKED_AT = 12
"""Frames that ranges are taken from."""
PERCENTILES = ("speed", "spin", "kinetic_energy")
"""Quantities of grains of which few have very large numbers: their ranges leave those out."""
EXTREMES = ("size", "radius", "coordination", "moment", "load")
"""Whose ranges hold all; `moment` and `load`: of sizes."""
RANGE = (1.0, 99.9)
"""Percentiles between which a range of PERCENTILES goes."""


def ranges_of(frames: Any) -> dict[str, list[float]]:
    """Least and most of quantities by name, SI: of all numbers in EXTREMES, nearly all in PERCENTILES.

    Parameters
    ----------
    frames
        of a trajectory; some, spread through the run, are looked at. Those that are not whole are left out.
    """
    seen: dict[str, list[np.ndarray]] = {name: [] for name in (*PERCENTILES, *EXTREMES)}
    for number in thinned(len(frames), LOOKED_AT):
        try:
            frame = frames[int(number)]
        except BadInput:
            continue
        for name, parts in seen.items():
            parts.append(_sizes(frame, name))
    return {name: _range(np.concatenate([*parts, np.zeros(0)]), name) for name, parts in seen.items()}


def _sizes(frame: Any, name: str) -> np.ndarray:
    """Finite numbers of a quantity in a frame, without their signs."""
    try:
        values = np.linalg.norm(frame.moment, axis=1) if name == "moment" else np.abs(measured(frame, name))
    except BadInput:  # the frame has none
        return np.zeros(0)
    return np.asarray(values[np.isfinite(values)], dtype=np.float64)


def _range(values: np.ndarray, name: str) -> list[float]:
    if not values.size:
        return [0.0, 0.0]
    share = RANGE if name in PERCENTILES else (0.0, 100.0)
    low, high = np.percentile(values, share[0], method="lower"), np.percentile(values, share[1], method="higher")
    return [float(low), float(high)]
