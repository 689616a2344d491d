"""Room for the stages of a Runge–Kutta step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class StageArrays(NamedTuple):
    """Room for the stages of a Runge–Kutta step; rows are position, velocity, orientation, spin.  Never saved."""

    start: np.ndarray  # (13, N) the state that a step begins with
    rate: np.ndarray  # (7, 13, N) its rates of change at each stage
    power: np.ndarray  # (7,) of the outside forces at each stage [W]


def stage_arrays(grains: int) -> StageArrays:
    """Room for so many grains; 0 where no Runge–Kutta step is taken."""
    return StageArrays(np.zeros((13, grains)), np.zeros((7, 13, grains)), np.zeros(7))
