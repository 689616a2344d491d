"""Ray casting of spheres and rods into a depth buffer.

Eye coordinates in units of samples: x to the right, y up, z towards the eye, the origin in the centre of the image.
The ray through (X, Y, 0) consists of the points (X(1 − wz), Y(1 − wz), z), where w is the reciprocal distance of the
eye; w = 0 gives parallel projection.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

TILE_EDGES = (4, 6, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 64)
"""Edge lengths [samples] of the square tiles in which shapes are processed."""
MAX_SAMPLES = 400_000
"""Samples processed at a time; limits memory."""


@dataclass(frozen=True)
class Solids:
    """N spheres and M rods (cylinders or truncated cones with flat ends), all lengths in samples.

    Attributes
    ----------
    centre, radius : ndarray
        (N, 3), (N,) of spheres.
    start, end, end_radii : ndarray
        (M, 3), (M, 3), (M, 2) centres of the two ends of rods, and their radii.
    colour : ndarray
        (N + M, 3) red, green, blue from 0 to 1, spheres first.
    shading : ndarray
        (N + M,) weight of the shading, 0 to 1.
    """

    centre: np.ndarray
    radius: np.ndarray
    start: np.ndarray
    end: np.ndarray
    end_radii: np.ndarray
    colour: np.ndarray
    shading: np.ndarray

    def depths(self) -> tuple[float, float]:
        """Lowest and highest z of all shapes; at least the plane z = 0."""
        radius = self.end_radii.max(axis=1) if len(self.end_radii) else np.zeros(0)
        low = [self.centre[:, 2] - self.radius, np.minimum(self.start, self.end)[:, 2] - radius]
        high = [self.centre[:, 2] + self.radius, np.maximum(self.start, self.end)[:, 2] + radius]
        return float(np.concatenate(low).min(initial=0.0)), float(np.concatenate(high).max(initial=0.0))


class DepthBuffer:
    """Nearest shape in each sample of an image, and its depth.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns; the first row is the lowest.
    solids : Solids
        Shapes to be drawn.
    w : float, optional
        Reciprocal distance of the eye; 0 for parallel projection.

    Attributes
    ----------
    nearest : ndarray
        uint64 per sample, 0 if empty: the float32 bits of the depth in the upper half, the number of the shape + 1 in
        the lower half, so that the larger value belongs to the nearer shape.
    """

    def __init__(self, shape: tuple[int, int], solids: Solids, w: float = 0.0):
        self.shape, self.solids, self.w = shape, solids, w
        self.lowest, highest = solids.depths()
        self.range = max(highest - self.lowest, 1.0) * 1.001
        self.nearest = np.zeros(shape, dtype=np.uint64)
        for items, tile in _tiles(shape, *_sphere_windows(self), solids.centre[:, 2]):
            self._rasterise(items, tile, self._intersect_spheres, 0)
        for items, tile in _tiles(shape, *_rod_windows(self), solids.start[:, 2]):
            self._rasterise(_tiles_near_axis(self, items, tile), tile, self._intersect_rods, len(solids.radius))

    def depth(self, key: np.ndarray) -> np.ndarray:
        """Depth z stored in values of `nearest`."""
        return (key >> np.uint64(32)).astype(np.uint32).view(np.float32) * self.range + self.lowest

    def _rasterise(self, items: np.ndarray, tile: int, intersect, first: int) -> None:
        """Draw tiles `items` (K, 3): shape (shape `first` has number 0), lowest column, lowest row."""
        flat, (height, width) = self.nearest.reshape(-1), self.shape
        step, tiles_at_once = np.arange(tile), max(MAX_SAMPLES // tile**2, 1)
        for begin in range(0, len(items), tiles_at_once):
            which, left, low = items[begin : begin + tiles_at_once][::-1].T
            columns, rows = left[:, None] + step, low[:, None] + step
            z = intersect(which, (columns + 0.5 - width / 2)[:, None, :], (rows + 0.5 - height / 2)[:, :, None])
            inside = ((rows >= 0) & (rows < height))[:, :, None] & ((columns >= 0) & (columns < width))[:, None, :]
            b, r, c = np.nonzero(np.isfinite(z) & inside)
            share = np.clip((z[b, r, c] - self.lowest) / self.range, 1e-30, 1.0).astype(np.float32)
            key = (share.view(np.uint32).astype(np.uint64) << np.uint64(32)) | (which[b] + first + 1).astype(np.uint64)
            index = rows[b, r] * width + columns[b, c]
            front = key > flat[index]
            while front.any():  # of several values for one index, numpy stores the last: repeat until it is the largest
                index, key = index[front], key[front]
                flat[index] = key
                front = key > flat[index]

    def _intersect_spheres(self, which: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """First intersection z of rays and spheres; NaN if there is none."""
        cx, cy, cz = self.solids.centre[which].T[:, :, None, None]
        radius, w = self.solids.radius[which][:, None, None], self.w
        ox = ((x * (1.0 - w * cz) - cx) / radius).astype(np.float32)
        oy = ((y * (1.0 - w * cz) - cy) / radius).astype(np.float32)
        cz, radius = cz.astype(np.float32), radius.astype(np.float32)
        with np.errstate(invalid="ignore"):
            if w == 0.0:
                return cz + radius * np.sqrt(1.0 - ox * ox - oy * oy)
            dx, dy = (w * x).astype(np.float32), (w * y).astype(np.float32)
            long, along = 1.0 + dx * dx + dy * dy, ox * dx + oy * dy
            root = np.sqrt(along * along - long * (ox * ox + oy * oy - 1.0))
            return cz + radius * ((along + root) / long)

    def _intersect_rods(self, which: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """First intersection z of rays and rods; NaN if there is none."""
        s, w = self.solids, self.w
        a, axis = s.start[which], (s.end - s.start)[which]
        first, second = s.end_radii[which].T[:, :, None, None]
        # Rays start at z = top, in front of the rod.
        top = np.maximum(a[:, 2], a[:, 2] + axis[:, 2]) + s.end_radii[which].max(axis=1)
        bx, by, bz = axis.T[:, :, None, None]
        m0 = bx * bx + by * by + bz * bz
        scale = (1.0 - w * top)[:, None, None]
        ox, oy = x * scale - a[:, 0, None, None], y * scale - a[:, 1, None, None]
        oz = (top - a[:, 2])[:, None, None]
        dx, dy = w * x, w * y
        dd = dx * dx + dy * dy + 1.0
        m1, m2 = ox * bx + oy * by + oz * bz, dx * bx + dy * by - bz
        m3, m5 = dx * ox + dy * oy - oz, ox * ox + oy * oy + oz * oz
        with np.errstate(invalid="ignore", divide="ignore"):
            t = _intersect_cone(m0, m1, m2, m3, m5, dd, first, second)
            t1 = -m1 / m2
            hits_start = (m5 + 2.0 * t1 * m3 + t1 * t1 * dd < first**2) & (m1 < 0.0)
            t2 = (m0 - m1) / m2
            hits_end = (m5 - 2.0 * m1 + m0 + 2.0 * t2 * (m3 - m2) + t2 * t2 * dd < second**2) & (m1 > m0)
            t = np.where(hits_start & (t1 > 0.0), t1, np.where(hits_end & (t2 > 0.0), t2, t))
        return top[:, None, None] - t

    def surface(self, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Shape (K,), point (K, 3) and outward unit normal (K, 3) in covered samples."""
        key = self.nearest[rows, columns]
        which = (key & np.uint64(0xFFFFFFFF)).astype(np.int64) - 1
        z = self.depth(key)
        height, width = self.shape
        near = 1.0 - self.w * z
        point = np.column_stack([(columns + 0.5 - width / 2) * near, (rows + 0.5 - height / 2) * near, z])
        normal = np.empty_like(point)
        ball = which < len(self.solids.radius)
        normal[ball] = point[ball] - self.solids.centre[which[ball]]
        normal[~ball] = self._rod_normals(which[~ball] - len(self.solids.radius), point[~ball])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        return which, point.astype(np.float32), normal.astype(np.float32)

    def _rod_normals(self, which: np.ndarray, point: np.ndarray) -> np.ndarray:
        s = self.solids
        axis, (first, second) = (s.end - s.start)[which], s.end_radii[which].T
        q, m0 = point - s.start[which], (axis * axis).sum(axis=1)
        along = (q * axis).sum(axis=1) / m0
        radial = q - along[:, None] * axis
        distance = np.linalg.norm(radial, axis=1)
        slope = ((first - second) / m0 * distance)[:, None] * axis
        on_end = distance < first + (second - first) * along - 0.05
        ends = np.sign(along - 0.5)[:, None] * axis
        return np.where(on_end[:, None], ends, radial + slope)


def _intersect_cone(m0, m1, m2, m3, m5, dd, first, second):
    """Ray parameter of the first intersection with the side of a cone, from scalar products; NaN if there is none.

    m0 = b·b, m1 = o·b, m2 = d·b, m3 = d·o, m5 = o·o and dd = d·d, with the axis b of the cone from its first to its
    second end, the ray o + t d, and o relative to the first end.
    """
    narrow = first - second
    h = m0 + narrow * narrow
    k2 = m0 * m0 * dd - m2 * m2 * h
    k1 = m0 * m0 * m3 - m1 * m2 * h + m0 * first * narrow * m2
    k0 = m0 * m0 * m5 - m1 * m1 * h + m0 * first * (2.0 * narrow * m1 - m0 * first)
    t = (-k1 - np.sqrt(k1 * k1 - k2 * k0)) / k2
    y = m1 + t * m2
    return np.where((y >= 0.0) & (y <= m0), t, np.nan)


def _sphere_windows(buffer: DepthBuffer) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest column and row (N, 2) of the exact outlines of spheres."""
    s, w = buffer.solids, buffer.w
    if w == 0.0:
        return s.centre[:, :2] - s.radius[:, None], s.centre[:, :2] + s.radius[:, None]
    away = (1.0 / w - s.centre[:, 2])[:, None]
    middle = np.arctan2(s.centre[:, :2], away)
    half = np.arcsin(np.clip(s.radius[:, None] / np.hypot(s.centre[:, :2], away), 0.0, 1.0))
    limit = 0.49 * np.pi
    return np.tan(np.clip(middle - half, -limit, limit)) / w, np.tan(np.clip(middle + half, -limit, limit)) / w


def _rod_windows(buffer: DepthBuffer) -> tuple[np.ndarray, np.ndarray]:
    """Bounds (M, 2) of the columns and rows of rods."""
    s, w = buffer.solids, buffer.w
    ends = []
    for point, end_radii in ((s.start, s.end_radii[:, 0]), (s.end, s.end_radii[:, 1])):
        near = np.maximum(1.0 - w * (point[:, 2] + end_radii), 1e-3)[:, None]
        flat = point[:, :2] / np.maximum(1.0 - w * point[:, 2], 1e-3)[:, None]
        wide = end_radii[:, None] / near * (1.0 + w * np.abs(flat)) + 0.5
        ends.append((flat - wide, flat + wide))
    return np.minimum(ends[0][0], ends[1][0]), np.maximum(ends[0][1], ends[1][1])


def _tiles_near_axis(buffer: DepthBuffer, items: np.ndarray, tile: int) -> np.ndarray:
    """Select the tiles close to the projected axis of a rod; a long rod covers few of the tiles in its window."""
    s, w = buffer.solids, buffer.w
    which = items[:, 0]
    a, b = (p[which, :2] / np.maximum(1.0 - w * p[which, 2], 1e-3)[:, None] for p in (s.start, s.end))
    middle = items[:, 1:] + tile / 2 - np.array(buffer.shape[::-1]) / 2
    axis = b - a
    along = np.clip(((middle - a) * axis).sum(axis=1) / np.maximum((axis**2).sum(axis=1), 1e-12), 0.0, 1.0)
    away = np.linalg.norm(middle - a - along[:, None] * axis, axis=1)
    top = np.maximum(s.start, s.end)[which, 2] + s.end_radii[which].max(axis=1)
    return items[away < 0.75 * tile + 1.5 * s.end_radii[which].max(axis=1) / np.maximum(1.0 - w * top, 1e-3) + 1.0]


def _tiles(
    shape: tuple[int, int], low: np.ndarray, high: np.ndarray, z: np.ndarray
) -> Iterator[tuple[np.ndarray, int]]:
    """Divide windows into square tiles.

    Yields for each edge length the tiles (K, 3) (shape, lowest column, lowest row), and the edge length.
    """
    size = np.array(shape[::-1])
    with np.errstate(invalid="ignore"):
        first = np.floor(np.clip(low + size / 2 - 0.5, 0, size)).astype(np.int64)
        last = np.ceil(np.clip(high + size / 2 - 0.5, -1, size - 1)).astype(np.int64)
    span = last - first + 1
    visible = np.flatnonzero((span > 0).all(axis=1))
    visible = visible[np.argsort(-z[visible], kind="stable")]  # nearest first: they hide most of the others
    edge = np.array(TILE_EDGES)[np.minimum(np.searchsorted(TILE_EDGES, span[visible].max(axis=1)), len(TILE_EDGES) - 1)]
    for tile in np.unique(edge):
        own = visible[edge == tile]
        across, along = (-(-span[own] // tile)).T
        which = np.repeat(own, across * along)
        number = np.arange(len(which)) - np.repeat(np.cumsum(across * along) - across * along, across * along)
        wide = np.repeat(across, across * along)
        yield (
            np.column_stack([which, first[which] + tile * np.column_stack([number % wide, number // wide])]),
            int(tile),
        )
