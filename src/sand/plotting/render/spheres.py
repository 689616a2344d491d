"""Rendering of shaded spheres with arrows, and of rods, with hidden surfaces removed.

Screen coordinates: x to the right, y up, z towards the eye.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..style import TEXT_COLOUR, rgb
from .ray_casting import DepthBuffer, Solids
from .shading import SHADOW_THRESHOLD, Lighting, shade

SUPERSAMPLING = 2
"""Default number of samples per pixel and direction."""
SHAFT, HEAD_WIDTH, HEAD_LENGTH = 0.11, 0.34, 0.75
"""Radius of the shaft, radius of the head and length of the head of an arrow, in grain radii."""


@dataclass(frozen=True)
class Spheres:
    """Spheres with arrows.

    Attributes
    ----------
    centre : ndarray
        (N, 3) screen coordinates [m].
    radius : ndarray
        (N,) radii [m].
    colour : ndarray
        (N, 3) red, green, blue from 0 to 1.
    arrow : ndarray
        (N, 3) half of each arrow in screen coordinates, in radii of its sphere: length at most 1, 0 for no arrow.
    """

    centre: np.ndarray
    radius: np.ndarray
    colour: np.ndarray
    arrow: np.ndarray

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of all spheres [m]."""
        low = (self.centre[:, :2] - self.radius[:, None]).min(axis=0)
        high = (self.centre[:, :2] + self.radius[:, None]).max(axis=0)
        return float(low[0]), float(high[0]), float(low[1]), float(high[1])


@dataclass(frozen=True)
class Rods:
    """Cylinders and truncated cones in screen coordinates, with flat ends.

    Attributes
    ----------
    start, end : ndarray
        (M, 3) centres of the ends [m].
    end_radii : ndarray
        (M, 2) radii of the ends [m].
    colour : ndarray
        (M, 3) red, green, blue from 0 to 1.
    shading : ndarray
        (M,) weight of the shading: 1 for a shaded surface, 0 for a uniform colour.
    """

    start: np.ndarray
    end: np.ndarray
    end_radii: np.ndarray
    colour: np.ndarray
    shading: np.ndarray

    @classmethod
    def joined(cls, *parts: Rods) -> Rods:
        """Concatenate sets of rods."""
        names = ("start", "end", "end_radii", "colour", "shading")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def render_spheres(
    spheres: Spheres,
    window: tuple[float, float, float, float],
    width: int,
    height: int,
    *,
    rods: Rods | None = None,
    eye: float | None = None,
    lighting: Lighting | None = None,
    supersampling: int = SUPERSAMPLING,
) -> np.ndarray:
    """Render spheres with their arrows, and rods.

    Parameters
    ----------
    spheres : Spheres
        Spheres and arrows.
    window : tuple of float
        Left, right, bottom and top of the view in the plane z = 0 [m].
    width, height : int
        Size of the image [pixels].
    rods : Rods, optional
        Further rods.
    eye : float, optional
        Distance of the eye from the plane z = 0 [m]; parallel projection by default.
    lighting : Lighting, optional
        Brightness of the lights.
    supersampling : int, optional
        Samples per pixel and direction.

    Returns
    -------
    ndarray
        (height, width, 4) red, green, blue and opacity from 0 to 1; the first row is the lowest.
    """
    left, right, bottom, top = window
    scale = width * supersampling / (right - left)  # samples per metre
    w = 0.0 if eye is None else 1.0 / eye
    middle = np.array([(left + right) / 2, (bottom + top) / 2, 0.0])
    arrows = _arrow_rods(spheres, middle, w, rgb(TEXT_COLOUR))
    all_rods = arrows if rods is None else Rods.joined(arrows, rods)
    solids = Solids(
        (spheres.centre - middle) * scale,
        np.maximum(spheres.radius * scale, 1.0 * supersampling),  # grains smaller than a sample stay visible
        (all_rods.start - middle) * scale,
        (all_rods.end - middle) * scale,
        all_rods.end_radii * scale,
        np.concatenate([spheres.colour, all_rods.colour]),
        np.concatenate([np.ones(len(spheres.radius)), all_rods.shading]),
    )
    buffer = DepthBuffer((height * supersampling, width * supersampling), solids, w / scale)
    return shade(buffer, supersampling, float(np.median(solids.radius)), lighting or Lighting())


def _arrow_rods(spheres: Spheres, middle: np.ndarray, w: float, colour: np.ndarray) -> Rods:
    """Shafts and heads of the arrows, each directly in front of its grain, so that only nearer grains hide it."""
    which = np.flatnonzero(np.any(spheres.arrow != 0.0, axis=1))
    radius, half = spheres.radius[which, None], spheres.arrow[which] * spheres.radius[which, None]
    size = np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-300)
    towards_eye = np.array([0.0, 0.0, 1.0]) - w * (spheres.centre[which] - middle)
    towards_eye /= np.linalg.norm(towards_eye, axis=1, keepdims=True)
    offset = 1.05 * radius + np.abs((half * towards_eye).sum(axis=1, keepdims=True))
    centre = spheres.centre[which] + towards_eye * offset
    head = centre + half * (1.0 - np.minimum(HEAD_LENGTH * radius, 1.2 * size) / size)
    shaft_radius, head_radius, tip_radius = SHAFT * radius, HEAD_WIDTH * radius, 0.0 * radius
    return Rods(
        np.concatenate([centre - half, head]),
        np.concatenate([head, centre + half]),
        np.concatenate([np.hstack([shaft_radius, shaft_radius]), np.hstack([head_radius, tip_radius])]),
        np.tile(colour, (2 * len(which), 1)),
        np.full(2 * len(which), SHADOW_THRESHOLD),
    )
