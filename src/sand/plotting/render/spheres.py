"""Shaded spheres, arrows and rods: what is in front hides the rest.

Screen coordinates: x to the right, y up, z towards the eye.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..style import TEXT_COLOUR, rgb
from .ray_casting import DepthBuffer, Solids
from .shading import SHADOW_THRESHOLD, Lighting, shade

SUPERSAMPLING = 2
"""Samples per pixel and direction, averaged at the end."""
SHAFT, HEAD_WIDTH, HEAD_LENGTH = 0.11, 0.34, 0.75
"""Half widths and length of an arrow's parts, in radii of its grain."""


@dataclass(frozen=True)
class Spheres:
    """Spheres to be drawn, all lengths [m].

    Attributes
    ----------
    centre : ndarray
        (N, 3) in screen coordinates.
    radius : ndarray
        (N,).
    colour : ndarray
        (N, 3), 0 to 1.
    arrow : ndarray
        (N, 3) half an arrow, in screen coordinates and in radii: at most 1 long, 0 for none.
    """

    centre: np.ndarray
    radius: np.ndarray
    colour: np.ndarray
    arrow: np.ndarray

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top of everything [m]."""
        low = (self.centre[:, :2] - self.radius[:, None]).min(axis=0)
        high = (self.centre[:, :2] + self.radius[:, None]).max(axis=0)
        return float(low[0]), float(high[0]), float(low[1]), float(high[1])


@dataclass(frozen=True)
class Rods:
    """Cones cut flat at both ends, cylinders among them, all lengths [m], screen coordinates.

    Attributes
    ----------
    start, end : ndarray
        (M, 3) middles of the ends.
    end_radii : ndarray
        (M, 2) radii of the ends.
    colour : ndarray
        (M, 3), 0 to 1.
    lit : ndarray
        (M,) 1 for light and shade, 0 for a flat colour.
    """

    start: np.ndarray
    end: np.ndarray
    end_radii: np.ndarray
    colour: np.ndarray
    lit: np.ndarray

    @classmethod
    def joined(cls, *parts: Rods) -> Rods:
        """All rods of several."""
        names = ("start", "end", "end_radii", "colour", "lit")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def render_spheres(
    spheres: Spheres,
    window: tuple[float, float, float, float],
    width: int,
    height: int,
    *,
    rods: Rods | None = None,
    arrows: tuple[float, float, float] | None = None,
    eye: float | None = None,
    lighting: Lighting | None = None,
    supersampling: int = SUPERSAMPLING,
) -> np.ndarray:
    """The picture, (height, width, 4) red, green, blue, opacity from 0 to 1; its first row is the lowest.

    Parameters
    ----------
    window : tuple[float, float, float, float]
        left, right, bottom, top of what is seen [m].
    rods : Rods or None, optional
        to be drawn besides.
    arrows : tuple[float, float, float] or None, optional
        their colour; that of text by default.
    eye : float or None, optional
        its distance from the plane z = 0 [m]; parallel rays by default.
    supersampling : int, optional
        samples per pixel and direction.
    """
    left, right, bottom, top = window
    scale = width * supersampling / (right - left)  # samples per metre
    w = 0.0 if eye is None else 1.0 / eye
    middle = np.array([(left + right) / 2, (bottom + top) / 2, 0.0])
    found = [_arrows(spheres, middle, w, rgb(TEXT_COLOUR) if arrows is None else np.array(arrows))]
    every = Rods.joined(*found, *([rods] if rods is not None else []))
    solids = Solids(
        (spheres.centre - middle) * scale,
        np.maximum(spheres.radius * scale, 1.0 * supersampling),  # no grain vanishes between samples
        (every.start - middle) * scale,
        (every.end - middle) * scale,
        every.end_radii * scale,
        np.concatenate([spheres.colour, every.colour]),
        np.concatenate([np.ones(len(spheres.radius)), every.lit]),
    )
    buffer = DepthBuffer((height * supersampling, width * supersampling), solids, w / scale)
    return shade(buffer, supersampling, float(np.median(solids.radius)), lighting or Lighting())


def _arrows(spheres: Spheres, middle: np.ndarray, w: float, colour: np.ndarray) -> Rods:
    """Arrows, each laid on the front of its grain: grains nearer to the eye still hide it."""
    which = np.flatnonzero(np.any(spheres.arrow != 0.0, axis=1))
    radius, half = spheres.radius[which, None], spheres.arrow[which] * spheres.radius[which, None]
    size = np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-300)
    forward = np.array([0.0, 0.0, 1.0]) - w * (spheres.centre[which] - middle)  # to the eye
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    place = spheres.centre[which] + forward * (1.05 * radius + np.abs((half * forward).sum(axis=1, keepdims=True)))
    neck = place + half * (1.0 - np.minimum(HEAD_LENGTH * radius, 1.2 * size) / size)
    narrow, wide, point = SHAFT * radius, HEAD_WIDTH * radius, 0.0 * radius
    return Rods(
        np.concatenate([place - half, neck]),
        np.concatenate([neck, place + half]),
        np.concatenate([np.hstack([narrow, narrow]), np.hstack([wide, point])]),
        np.tile(colour, (2 * len(which), 1)),
        np.full(2 * len(which), SHADOW_THRESHOLD),
    )
