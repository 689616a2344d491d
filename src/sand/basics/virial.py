"""Shares of grains in the virial of contacts."""

from __future__ import annotations

from typing import Any

import numpy as np


def shares_of_virial(radius: np.ndarray, pair: np.ndarray, separation: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Share (N, 3, 3) [J] of each grain in Σ l_a f_b: arms l r_i/(r1 + r2) to a point that divides l as the radii.

    Parameters
    ----------
    radius : ndarray
        (N,) radii [m].
    pair : ndarray
        (C, 2) grains of the contacts.
    separation : ndarray
        (C, 3) l, the nearest image of x1 − x2 [m].
    force : ndarray
        (C, 3) f, the force on grain 1 [N].
    """
    each = (separation[:, :, None] * force[:, None, :]).reshape(-1, 9)
    of_pair = radius[pair]
    shares = of_pair / of_pair.sum(axis=1, keepdims=True)
    found = np.zeros((len(radius), 9))
    for side in range(2):
        for k in range(9):
            found[:, k] += np.bincount(pair[:, side], shares[:, side] * each[:, k], len(radius))
    return found.reshape(-1, 3, 3)


def virials_of_frame(frame: Any) -> np.ndarray:
    """Shares (N, 3, 3) [J] of the grains of a frame in the virial of its contacts of grains."""
    pair = np.asarray(frame.pair, np.int64).reshape(-1, 2)
    position = np.asarray(frame.position, np.float64)
    separation = frame.box.nearest(position[pair[:, 0]] - position[pair[:, 1]])
    return shares_of_virial(np.asarray(frame.radius, np.float64), pair, separation, np.asarray(frame.force, np.float64))
