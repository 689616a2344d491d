"""Light and shade on what a buffer holds: a key lamp with shadows, a soft fill, dark clefts, haze over what is far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter

from .ray_casting import DepthBuffer, Solids

KEY = np.array([-0.46, 0.62, 0.64])
"""To the lamp: from the upper left, in front."""
FILL = np.array([0.75, -0.15, 0.45])
"""To the weak second lamp."""
OCCLUSION_PATTERN = 4
"""Pixels of a square of this edge look in different directions for what darkens them."""
OCCLUSION_SAMPLES = 9
"""Places that each pixel looks at."""
SHADOW_THRESHOLD = 0.5
"""Rods that are `lit` no more than this throw no shadow."""
MAX_SHADOW_MAP = 3000
"""Samples along an edge of what the key lamp sees."""
MAX_SHADED = 400_000
"""Samples that are coloured in one go."""


@dataclass(frozen=True)
class Lighting:
    """How bright it is: the sum is the brightness of a surface that faces the key lamp.

    Attributes
    ----------
    sky : float
        from everywhere, more from above; clefts and hollows see less of it.
    key, fill : float
        of the two lighting.
    specular : float
        how bright the key lamp's reflection is.
    haze : float
        share of the background in what is farthest.
    background : tuple[float, float, float]
        (3,) colour that haze fades to.
    """

    sky: float = 0.60
    key: float = 0.54
    fill: float = 0.12
    specular: float = 0.20
    haze: float = 0.34
    background: tuple[float, float, float] = (1.0, 1.0, 1.0)


def shade(buffer: DepthBuffer, supersampling: int, radius: float, lighting: Lighting) -> np.ndarray:
    """The picture (rows/supersampling, columns/supersampling, 4): red, green, blue, opacity from 0 to 1.

    Parameters
    ----------
    supersampling : int
        samples per pixel and direction, averaged.
    radius : float
        of a typical grain [samples], for the size of clefts.
    """
    height, width = buffer.shape[0] // supersampling, buffer.shape[1] // supersampling
    dim, lamp = _shade(buffer, supersampling, radius)
    picture = np.zeros((height, width, 4), dtype=np.float32)
    rows_at_once = max(MAX_SHADED // (buffer.shape[1] * supersampling), 1)
    for first in range(0, height, rows_at_once):
        last = min(first + rows_at_once, height)
        strip = buffer.nearest[first * supersampling : last * supersampling]
        rows, columns = np.nonzero(strip)
        colour = np.zeros((*strip.shape, 4), dtype=np.float32)
        at = (first + rows // supersampling, columns // supersampling)
        colour[rows, columns, :3] = _coloured(
            buffer, rows + first * supersampling, columns, dim[at], lamp[at], radius, lighting
        )
        colour[rows, columns, 3] = 1.0
        mean = colour.reshape(last - first, supersampling, width, supersampling, 4).mean(axis=(1, 3))
        mean[..., :3] /= np.maximum(mean[..., 3:], 1e-6)
        picture[first:last] = mean
    return picture


def _coloured(
    buffer: DepthBuffer,
    rows: np.ndarray,
    columns: np.ndarray,
    dim: np.ndarray,
    lamp: np.ndarray,
    radius: float,
    lighting: Lighting,
) -> np.ndarray:
    """(K, 3) colours of covered samples; `dim`: how much sky each sees, `lamp`: how much of the key lamp."""
    which, point, normal = buffer.surface(rows, columns)
    key, fill = (v.astype(np.float32) / np.float32(np.linalg.norm(v)) for v in (KEY, FILL))
    facing = np.maximum(normal @ key, 0.0)
    soft = np.clip(0.3 + 0.7 * (normal @ key), 0.0, 1.0)  # light creeps round the edge
    half = key + np.array([0.0, 0.0, 1.0], dtype=np.float32)
    specular = np.maximum(normal @ (half / np.linalg.norm(half)), 0.0) ** 48 * lamp
    power = lighting.sky * (0.80 + 0.20 * normal[:, 1]) * dim + lighting.fill * np.maximum(normal @ fill, 0.0) * dim
    power += lighting.key * (0.45 * soft * dim * (0.6 + 0.4 * lamp) + 0.55 * facing * lamp)
    lit = buffer.solids.lit[which].astype(np.float32)
    base = buffer.solids.colour[which].astype(np.float32)
    power *= 0.74 + 0.26 * np.clip(normal[:, 2] / 0.55, 0.0, 1.0)  # a rim parts what has one colour
    power = 1.0 + lit * (power - 1.0)
    colour = base * power[:, None] + (lighting.specular * lit * specular * dim)[:, None]
    extent = buffer.range
    haze = lighting.haze * extent / (extent + 14.0 * radius) * (1.0 - (point[:, 2] - buffer.far) / extent) * lit
    colour = colour * (1.0 - haze[:, None]) + np.array(lighting.background, dtype=np.float32) * haze[:, None]
    return np.clip(colour, 0.0, 1.0)


def _shade(buffer: DepthBuffer, supersampling: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """For each pixel the share of the sky it sees, and of the key lamp, 0 to 1."""
    few = slice(supersampling // 2, None, supersampling)
    there = buffer.nearest[few, few] > 0
    rows, columns = np.nonzero(there)
    if not rows.size:
        return np.ones(there.shape, np.float32), np.ones(there.shape, np.float32)
    _, point, normal = buffer.surface(
        rows * supersampling + supersampling // 2, columns * supersampling + supersampling // 2
    )
    depth = np.full(there.shape, -np.inf, np.float32)
    depth[there] = point[:, 2] / supersampling
    facing = np.zeros((*there.shape, 3), np.float32)
    facing[there] = normal
    dim = np.exp(-2.3 * _occlusion(depth, facing, radius / supersampling))
    lamp = np.ones(there.shape, np.float32)
    lamp[there] = _key_light_visibility(buffer.solids, point, normal, supersampling, radius)
    weight = np.maximum(uniform_filter(there.astype(np.float32), OCCLUSION_PATTERN), 1e-3)
    return tuple(uniform_filter(np.where(there, each, 0.0), OCCLUSION_PATTERN) / weight for each in (dim, lamp))


def _occlusion(depth: np.ndarray, normal: np.ndarray, radius: float) -> np.ndarray:
    """How much of the sky is hidden by what is near, from the depths around each pixel [pixels], 0 to 1.

    Each pixel looks at a few places at distances from a pixel to some radii; what rises there above its horizon, by
    no more than about that distance, hides sky.  Neighbours look in other directions; averaging over the pattern is
    left to the caller.
    """
    near, far = 1.0, float(np.clip(4.0 * radius, 4.0, 90.0))
    reach = int(far) + 2
    padded = np.pad(depth, reach + OCCLUSION_PATTERN, constant_values=-np.inf)
    hidden = np.zeros(depth.shape, np.float32)
    for i in range(OCCLUSION_PATTERN):
        for j in range(OCCLUSION_PATTERN):
            own = (slice(i, None, OCCLUSION_PATTERN), slice(j, None, OCCLUSION_PATTERN))
            z, n = depth[own], normal[own]
            turn = (7 * (i * OCCLUSION_PATTERN + j)) % OCCLUSION_PATTERN**2 / OCCLUSION_PATTERN**2
            total = np.zeros(z.shape, np.float32)
            for k in range(OCCLUSION_SAMPLES):
                away = near * (far / near) ** ((k + turn) / OCCLUSION_SAMPLES)
                angle = 2.0 * np.pi * (k * 0.618034 + turn)
                dx, dy = round(away * np.cos(angle)), round(away * np.sin(angle))
                if dx == dy == 0:
                    dx = 1
                top, left = reach + OCCLUSION_PATTERN + i + dy, reach + OCCLUSION_PATTERN + j + dx
                seen = padded[top::OCCLUSION_PATTERN, left::OCCLUSION_PATTERN][: z.shape[0], : z.shape[1]]
                with np.errstate(invalid="ignore"):
                    dz = np.where(np.isfinite(z), seen - z, -np.inf)
                flat = np.float32(dx * dx + dy * dy)
                dz = np.maximum(dz, np.float32(-1e6))
                long = flat + dz * dz
                rise = (n[..., 0] * dx + n[..., 1] * dy + n[..., 2] * dz) / np.sqrt(long)
                total += np.maximum(rise - 0.08, 0.0) / (1.0 + (long / (5.0 * flat)) ** 2)
            hidden[own] = total / OCCLUSION_SAMPLES
    return hidden


def _key_light_visibility(
    solids: Solids, point: np.ndarray, normal: np.ndarray, supersampling: int, radius: float
) -> np.ndarray:
    """How much of the key lamp points see (K,), 0 to 1: from the depths that the lamp sees."""
    forward = KEY / np.linalg.norm(KEY)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    frame = np.array([right, np.cross(forward, right), forward])
    shown = solids.lit[len(solids.radius) :] > SHADOW_THRESHOLD
    turned = [p @ frame.T for p in (solids.centre, solids.start[shown], solids.end[shown])]
    reach = 2.0 * (
        max(float(np.abs(p[:, :2]).max(initial=0.0)) for p in turned) + float(solids.radius.max(initial=0.0))
    )
    scale = min(1.0 / supersampling, MAX_SHADOW_MAP / (reach + 1.0))
    size = int(reach * scale) + 8
    end_radii = solids.end_radii[shown] * scale
    blank = np.zeros((0, 3)), np.zeros(0)
    centre, start, end = (p * scale for p in turned)
    lamp = DepthBuffer((size, size), Solids(centre, solids.radius * scale, start, end, end_radii, *blank))
    grazing = 1.0 - np.clip(normal @ forward.astype(np.float32), 0.0, 1.0)
    lifted = (point + normal * (0.02 * radius + (1.0 + 2.0 * grazing[:, None]) / scale)) @ (frame.T * scale).astype(
        np.float32
    )
    soft = max(0.10 * radius * scale, 0.75)
    seen = np.zeros(len(point), np.float32)
    taps = [(np.sqrt((k + 0.5) / 8), 2.399963 * k) for k in range(8)]
    z = lifted[:, 2] + 0.5
    for away, angle in taps:
        column = (lifted[:, 0] + (size / 2 + soft * away * np.cos(angle))).astype(np.int32)
        row = (lifted[:, 1] + (size / 2 + soft * away * np.sin(angle))).astype(np.int32)
        key = lamp.nearest[np.clip(row, 0, size - 1), np.clip(column, 0, size - 1)]
        depth = (key >> np.uint64(32)).astype(np.uint32).view(np.float32) * lamp.range + lamp.far
        seen += (z >= depth) | (key == 0)
    return np.asarray(seen / len(taps))
