"""Shaded spheres and arrows seen in parallel projection: what is in front hides the rest.

Screen coordinates: x to the right, y up, z towards the eye.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from .style import INK, rgb

FINER = 2
"""Samples per pixel and direction, averaged at the end."""
LIGHT = np.array([-0.42, 0.58, 0.70])
"""Unit vector to the lamp: from the upper left, in front."""
NOTHING = -1

SHAFT, HEAD_WIDTH, HEAD_LENGTH = 0.11, 0.34, 0.75
"""Half widths and length of an arrow's parts, in radii of its grain."""


@dataclass(frozen=True)
class Balls:
    """Spheres to be drawn, all lengths [m].

    Attributes:
        centre: (N, 3) in screen coordinates.
        radius: (N,).
        colour: (N, 3), 0 to 1.
        arrow: (N, 3) half an arrow, in screen coordinates and in radii: at most 1 long, 0 for none.
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


class Canvas:
    """Depth and owner of every sample.

    Args:
        window: left, right, bottom, top [m].
        width, height: in pixels.
    """

    def __init__(self, window: tuple[float, float, float, float], width: int, height: int):
        left, right, bottom, _ = window
        self.scale = width * FINER / (right - left)  # samples per metre
        self.left, self.bottom = left, bottom
        self.shape = (height * FINER, width * FINER)
        self.depth = np.full(self.shape, -np.inf, dtype=np.float32)
        self.owner = np.full(self.shape, NOTHING, dtype=np.int32)

    def samples(self, balls: Balls) -> tuple[np.ndarray, np.ndarray]:
        """Centres (N, 3) and radii (N,) in samples; no grain vanishes between them."""
        centre = (balls.centre - np.array([self.left, self.bottom, 0.0])) * self.scale
        return centre, np.maximum(balls.radius * self.scale, 1.0 * FINER)

    def patch(self, x: float, y: float, reach: float) -> tuple[tuple[slice, slice], np.ndarray, np.ndarray] | None:
        """The part of the canvas within `reach`, x and y of its samples from the middle; None if off it."""
        height, width = self.shape
        x0, x1 = max(int(x - reach), 0), min(int(x + reach) + 2, width)
        y0, y1 = max(int(y - reach), 0), min(int(y + reach) + 2, height)
        if x0 >= x1 or y0 >= y1:
            return None
        across = np.arange(x0, x1, dtype=np.float32) + np.float32(0.5 - x)
        along = np.arange(y0, y1, dtype=np.float32) + np.float32(0.5 - y)
        return (slice(y0, y1), slice(x0, x1)), across[None, :], along[:, None]

    def put(self, where: tuple[slice, slice], depth: np.ndarray, covered: np.ndarray, owner: int) -> None:
        """Take the samples that are covered and nearer than what is there."""
        front = covered & (depth > self.depth[where])
        self.depth[where][front] = depth[front]
        self.owner[where][front] = owner


def draw(balls: Balls, window: tuple[float, float, float, float], width: int, height: int) -> np.ndarray:
    """The picture, (height, width, 4) red, green, blue, opacity from 0 to 1; its first row is the lowest.

    Args:
        window: left, right, bottom, top of what is seen [m].
    """
    canvas = Canvas(window, width, height)
    centre, radius = canvas.samples(balls)
    for i, (x, y, z) in enumerate(centre):
        found = canvas.patch(x, y, radius[i])
        if found is not None:
            where, dx, dy = found
            square = radius[i] ** 2 - dx * dx - dy * dy
            canvas.put(where, z + np.sqrt(np.maximum(square, 0.0)), square > 0.0, i)
    shade = _occlusion(canvas, float(np.median(radius)))
    _arrows(canvas, centre, radius, balls.arrow)
    return _smaller(_colours(canvas, centre, radius, balls.colour, shade))


def _arrows(canvas: Canvas, centre: np.ndarray, radius: np.ndarray, arrow: np.ndarray) -> None:
    """Arrows, each laid on the front of its grain: grains nearer to the eye still hide it."""
    for i in np.flatnonzero(np.any(arrow != 0.0, axis=1)):
        found = canvas.patch(centre[i, 0], centre[i, 1], 1.2 * radius[i])
        if found is None:
            continue
        where, dx, dy = found
        covered = arrow_covers(dx / radius[i], dy / radius[i], arrow[i, :2])
        canvas.put(where, np.full(covered.shape, centre[i, 2] + 1.01 * radius[i], np.float32), covered, -2)


def arrow_covers(x: np.ndarray, y: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Whether points lie on an arrow from −half to +half; one along the line of sight shows as a dot."""
    length = float(np.hypot(*half))
    covered = np.asarray(x * x + y * y < (1.6 * SHAFT) ** 2)
    if length < 0.2:
        return covered
    along, off = (x * half[0] + y * half[1]) / length, np.abs(x * half[1] - y * half[0]) / length
    head = min(HEAD_LENGTH, 1.2 * length)
    shaft = (off < SHAFT) & (along > -length) & (along < length - 0.5 * head)
    tip = (along > length - head) & (off < HEAD_WIDTH * (length - along) / head)
    return np.asarray(shaft | tip)


def _occlusion(canvas: Canvas, radius: float) -> np.ndarray:
    """How much light each sample loses to what is near and in front of it, 0 to 1."""
    covered = (canvas.owner != NOTHING).astype(np.float32)
    if not covered.any():
        return covered
    middle = float(canvas.depth[covered > 0].mean())
    depth = np.where(covered > 0, canvas.depth - middle, 0.0).astype(np.float32)
    width = min(max(0.9 * radius, 2.0), 40.0)
    step = max(int(width / 4.0), 1)  # what is blurred that much needs no finer grid
    few = (slice(None, None, step), slice(None, None, step))
    blurred = gaussian_filter(depth[few], width / step, truncate=2.5) / np.maximum(
        gaussian_filter(covered[few], width / step, truncate=2.5), 1e-3
    )
    blurred = _finer(_finer(blurred, step, canvas.shape[0]).T, step, canvas.shape[1]).T
    behind = np.maximum(blurred - depth, 0.0) / (3.0 * radius)
    # What is in front by much more than a grain throws no shadow, or lonely grains would look dark.
    return behind * np.exp(1.0 - behind) * covered


def _finer(coarse: np.ndarray, step: int, count: int) -> np.ndarray:
    """Rows between those of every `step`-th, `count` in all, by straight lines."""
    place = np.arange(count) / step
    low = place.astype(int)
    high = np.minimum(low + 1, coarse.shape[0] - 1)
    share = (place - low).astype(np.float32)[:, None]
    return np.asarray(coarse[low] * (1.0 - share) + coarse[high] * share)


def _colours(
    canvas: Canvas, centre: np.ndarray, radius: np.ndarray, colour: np.ndarray, shade: np.ndarray
) -> np.ndarray:
    """Lambert's law with a soft lamp, a glint, a darker rim, and a little haze over what is far."""
    picture = np.zeros((*canvas.shape, 4), dtype=np.float32)
    picture[canvas.owner != NOTHING, 3] = 1.0
    picture[canvas.owner == -2, :3] = rgb(INK)
    rows, columns = np.nonzero(canvas.owner >= 0)
    own = canvas.owner[rows, columns]
    normal = np.empty((own.size, 3), dtype=np.float32)
    normal[:, 0] = (columns + 0.5 - centre[own, 0]) / radius[own]
    normal[:, 1] = (rows + 0.5 - centre[own, 1]) / radius[own]
    normal[:, 2] = np.sqrt(np.maximum(1.0 - normal[:, 0] ** 2 - normal[:, 1] ** 2, 0.0))
    light = LIGHT.astype(np.float32) / np.float32(np.linalg.norm(LIGHT))
    lit = normal @ light
    half = light + np.array([0.0, 0.0, 1.0], dtype=np.float32)
    glint = np.maximum(normal @ (half / np.linalg.norm(half)), 0.0) ** 40
    rim = np.clip(normal[:, 2] / 0.45, 0.0, 1.0)
    power = (0.50 + 0.56 * np.clip(0.25 + 0.75 * lit, 0.0, 1.0)) * (0.62 + 0.38 * rim)
    power *= 1.0 - 0.32 * shade[rows, columns]
    shown = colour[own].astype(np.float32) * power[:, None] + 0.22 * glint[:, None]
    depth = centre[own, 2]
    extent = max(float(np.ptp(centre[:, 2])), 1e-30)
    deep = np.maximum(extent / (extent + 12.0 * float(np.median(radius))), 0.0)
    haze = (0.38 * deep * (centre[:, 2].max() - depth) / extent).astype(np.float32)
    picture[rows, columns, :3] = np.clip(shown * (1.0 - haze[:, None]) + haze[:, None], 0.0, 1.0)
    return picture


def _smaller(picture: np.ndarray) -> np.ndarray:
    """Average over the samples of each pixel; colours count by their opacity."""
    picture[..., :3] *= picture[..., 3:]
    height, width = picture.shape[0] // FINER, picture.shape[1] // FINER
    mean = picture.reshape(height, FINER, width, FINER, 4).mean(axis=(1, 3))
    mean[..., :3] /= np.maximum(mean[..., 3:], 1e-6)
    return mean
