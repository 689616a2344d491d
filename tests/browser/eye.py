"""Projection of grains to pixels, computed from the camera's parameters only, without the page's code.

A look is (target, from, up, height): the camera is in the direction `from` of the target; `height` is the height of
the visible part of the plane through the target.  In perspective the camera is two heights away (tan of half the
angle is 1/4); orthographic rays are along −from.  Lengths are in the page's unit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass
class Eye:
    """A camera and the size of its picture in pixels; pixel coordinates start at the upper left corner."""

    look: tuple[float, ...]  # target, from, up, height: ten numbers
    wide: int
    high: int
    ortho: bool = False

    def __post_init__(self) -> None:
        look = np.array(self.look, float)
        self.target, away, up, self.height = look[:3], look[3:6], look[6:9], float(look[9])
        self.away = away / np.linalg.norm(away)
        side = np.cross(up, self.away)
        self.side = side / np.linalg.norm(side)
        self.up = np.cross(self.away, self.side)
        self.scale = self.high / self.height  # pixels for a length of one at the target

    def pixels(self, places: Any) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (N, 2) of places (N, 3), and how far each is from the eye along −from (N,)."""
        apart = np.atleast_2d(places) - self.target
        depth = 2.0 * self.height - apart @ self.away
        grown = self.scale * (1.0 if self.ortho else 2.0 * self.height / depth)
        across = np.stack([apart @ self.side, -(apart @ self.up)], axis=1)
        return across * np.reshape(grown, (-1, 1)) + [self.wide / 2, self.high / 2], depth

    def rays(self, pixels: Any) -> tuple[np.ndarray, np.ndarray]:
        """Origins and unit directions (P, 3) of the rays through pixels (P, 2)."""
        at = (np.atleast_2d(pixels) - [self.wide / 2, self.high / 2]) / self.scale
        there = self.target + at[:, :1] * self.side - at[:, 1:] * self.up
        eye = self.target + 2.0 * self.height * self.away
        if self.ortho:
            return there + 2.0 * self.height * self.away, np.tile(-self.away, (len(at), 1))
        return np.tile(eye, (len(at), 1)), (there - eye) / np.linalg.norm(there - eye, axis=1)[:, None]

    def spheres(self, places: np.ndarray, radii: np.ndarray) -> np.ndarray:
        """Index of the sphere (high, wide) that is visible at the centre of each pixel, −1 for none."""
        seen, nearest = np.full((self.high, self.wide), -1), np.full((self.high, self.wide), np.inf)
        pixels, depth = self.pixels(places)
        reach = 1.5 * radii * self.scale * (1.0 if self.ortho else 2.0 * self.height / (depth - radii)) + 1.0
        for i, ((x, y), r) in enumerate(zip(pixels, reach, strict=True)):
            left, right = max(int(x - r), 0), min(int(x + r) + 1, self.wide)
            top, low = max(int(y - r), 0), min(int(y + r) + 1, self.high)
            if left >= right or top >= low:
                continue
            grid = np.stack(np.meshgrid(np.arange(left, right), np.arange(top, low)), axis=-1) + 0.5
            origin, way = self.rays(grid.reshape(-1, 2))
            distance = _distance_to_spheres(origin, way, places[i], radii[i]).reshape(grid.shape[:2])
            part = np.s_[top:low, left:right]
            closer = distance < nearest[part]
            nearest[part] = np.where(closer, distance, nearest[part])
            seen[part] = np.where(closer, i, seen[part])
        return seen


def _distance_to_spheres(origin: np.ndarray, way: np.ndarray, places: np.ndarray, radii: Any) -> np.ndarray:
    """Distance along rays to spheres: smaller root of |o + t w − c|² = r²; infinite without a hit."""
    apart = places - origin
    along = (apart * way).sum(-1)
    room = np.square(radii) - (apart**2).sum(-1) + along**2
    return np.where(room > 0.0, along - np.sqrt(np.maximum(room, 0.0)), np.inf)


def inside(seen: np.ndarray, margin: int = 1) -> np.ndarray:
    """Mask (high, wide) of pixels whose neighbours within `margin` pixels show the same: no edges."""
    same = np.ones(seen.shape, bool)
    for dy in range(-margin, margin + 1):
        for dx in range(-margin, margin + 1):
            same &= np.roll(seen, (dy, dx), (0, 1)) == seen
    same[:margin], same[-margin:], same[:, :margin], same[:, -margin:] = (False,) * 4
    return same
