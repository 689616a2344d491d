"""The arrays of walls, and of the contacts of grains with them."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from ..basics.array_groups import GRAINS, USED, Array
from ..basics.arrays import DAMPING_ROWS


class WallArrays(NamedTuple):
    """Walls, one column each."""

    position: Annotated[np.ndarray, Array((3, "walls"), "m")]  # a point of the plane
    normal: Annotated[np.ndarray, Array((3, "walls"))]  # unit vector towards the grains
    velocity: Annotated[np.ndarray, Array((3, "walls"), "m/s")]
    force: Annotated[np.ndarray, Array((3, "walls"), "N")]  # of the grains on the wall at the end of the last step
    impulse: Annotated[np.ndarray, Array((3, "walls"), "N s", summed=True)]  # its integral over time since the start
    # force on a wall with a mass along its normal
    push: Annotated[np.ndarray, Array(("walls",), "N", required=False)]
    # energy that the wall has given to grains and contacts by its motion
    work: Annotated[np.ndarray, Array(("walls",), "J")]
    # used within a step: velocity and impulse at its start
    velocity_before: Annotated[np.ndarray, Array((3, "walls"), "m/s", saved=False)]
    impulse_before: Annotated[np.ndarray, Array((3, "walls"), "N s", saved=False)]
    contacts: Annotated[np.ndarray, Array(("walls",), saved=False)]  # number of contacts
    touching: Annotated[np.ndarray, Array(("walls", GRAINS), dtype="u1", saved=False)]  # 1 for grains in contact


class WallContactArrays(NamedTuple):
    """Contacts of grains with walls, one column each, as `ContactArrays`; the first used[0] columns are in use."""

    used: Annotated[np.ndarray, Array((1,), dtype="i8", saved=False)]
    pair: Annotated[np.ndarray, Array((2, USED), dtype="u4", rule="any", names=(GRAINS, "walls"))]  # grain and wall
    pointer1: Annotated[np.ndarray, Array((3, USED))]  # contact pointer of the grain: unit vector, body frame
    # anchor: place on the wall relative to its point, laboratory frame
    pointer2: Annotated[np.ndarray, Array((3, USED), "m")]
    twist: Annotated[np.ndarray, Array((USED,), "rad")]
    formed: Annotated[np.ndarray, Array((USED,), "s")]
    constants: Annotated[np.ndarray, Array(("constants", USED), rule="no nan")]  # a wall has an infinite radius
    lost: Annotated[np.ndarray, Array(("channels", USED), "J", summed=True)]
    damping: Annotated[np.ndarray, Array((DAMPING_ROWS, USED), fewer=0)]
    force: Annotated[np.ndarray, Array((3, USED), "N")]
    torque1: Annotated[np.ndarray, Array((3, USED), "N m")]
    flag: Annotated[np.ndarray, Array((USED,), dtype="u1", rule="any")]
    # written by what contacts of two grains share with these, and not used
    torque2: Annotated[np.ndarray, Array((3, USED), "N m", saved=False)]
    every_step: Annotated[np.ndarray, Array((USED,), dtype="u1", saved=False)]
    kept: Annotated[np.ndarray, Array((0, USED), saved=False)]
