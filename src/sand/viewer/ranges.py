"""Ranges of the quantities of a run, for the colour scales of the viewer page."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..analysis.quantities import measured
from ..errors import BadInput
from .series import evenly_spaced

SAMPLED_FRAMES = 12
"""Number of frames, spread evenly over the run, from which ranges are computed."""
PERCENTILES = ("speed", "spin", "kinetic_energy")
"""Quantities whose range leaves out outliers: from the lower to the upper of PERCENTILE_LIMITS."""
EXTREMES = ("size", "radius", "coordination", "moment", "load")
"""Quantities whose range goes from the smallest to the largest value; of `moment` and `load`, the magnitude."""
PERCENTILE_LIMITS = (1.0, 99.9)


def quantity_ranges(frames: Any) -> dict[str, list[float]]:
    """Ranges [low, high] of the magnitudes of all quantities in PERCENTILES and EXTREMES, by name, SI.

    Parameters
    ----------
    frames : LiveTrajectory or Snapshot
        Frames of a run, of which SAMPLED_FRAMES are read; damaged frames are skipped.
    """
    samples: dict[str, list[np.ndarray]] = {name: [] for name in (*PERCENTILES, *EXTREMES)}
    for number in evenly_spaced(len(frames), SAMPLED_FRAMES):
        try:
            frame = frames[int(number)]
        except BadInput:
            continue
        for name, parts in samples.items():
            parts.append(_magnitudes(frame, name))
    return {name: _range(np.concatenate([*parts, np.zeros(0)]), name) for name, parts in samples.items()}


def _magnitudes(frame: Any, name: str) -> np.ndarray:
    """Finite magnitudes of a quantity in a frame; empty if the frame does not have it."""
    try:
        values = np.linalg.norm(frame.moment, axis=1) if name == "moment" else np.abs(measured(frame, name))
    except BadInput:
        return np.zeros(0)
    return np.asarray(values[np.isfinite(values)], dtype=np.float64)


def _range(values: np.ndarray, name: str) -> list[float]:
    if not values.size:
        return [0.0, 0.0]
    low, high = PERCENTILE_LIMITS if name in PERCENTILES else (0.0, 100.0)
    return [float(np.percentile(values, low, method="lower")), float(np.percentile(values, high, method="higher"))]
