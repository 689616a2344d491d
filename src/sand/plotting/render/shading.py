"""Shading of a depth buffer: key light with shadows, fill light, ambient light with occlusion, and haze with depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter

from .ray_casting import DepthBuffer, Solids

KEY_LIGHT = np.array([-0.46, 0.62, 0.64])
"""Direction to the key light: upper left, in front."""
FILL_LIGHT = np.array([0.75, -0.15, 0.45])
"""Direction to the weaker fill light."""
OCCLUSION_PATTERN = 4
"""Edge of a block of pixels that sample ambient occlusion in different directions [pixels]."""
OCCLUSION_SAMPLES = 9
"""Depth samples per pixel for ambient occlusion."""
SHADOW_THRESHOLD = 0.5
"""Rods with a shading weight up to this cast no shadow."""
MAX_SHADOW_MAP = 3000
"""Maximum edge of the shadow map [samples]."""
MAX_SHADED = 400_000
"""Samples shaded at a time; limits memory."""


@dataclass(frozen=True)
class Lighting:
    """Brightness of the lights; their sum is the brightness of a surface that faces the key light.

    Attributes
    ----------
    ambient : float
        Ambient light, stronger from above, reduced by occlusion.
    key, fill : float
        Key light and fill light.
    specular : float
        Specular reflection of the key light.
    haze : float
        Weight of the background colour at the largest depth.
    background : tuple of float
        Red, green, blue of the background from 0 to 1.
    """

    ambient: float = 0.60
    key: float = 0.54
    fill: float = 0.12
    specular: float = 0.20
    haze: float = 0.34
    background: tuple[float, float, float] = (1.0, 1.0, 1.0)


def shade(buffer: DepthBuffer, supersampling: int, radius: float, lighting: Lighting) -> np.ndarray:
    """Shade a depth buffer.

    Parameters
    ----------
    buffer : DepthBuffer
        Visible surfaces.
    supersampling : int
        Samples per pixel and direction, which are averaged.
    radius : float
        Radius of a typical grain [samples], the length scale of occlusion and haze.
    lighting : Lighting
        Brightness of the lights.

    Returns
    -------
    ndarray
        (rows, columns, 4) pixels: red, green, blue and opacity from 0 to 1.
    """
    height, width = buffer.shape[0] // supersampling, buffer.shape[1] // supersampling
    ambient, key_light = _visibility(buffer, supersampling, radius)
    picture = np.zeros((height, width, 4), dtype=np.float32)
    rows_at_once = max(MAX_SHADED // (buffer.shape[1] * supersampling), 1)
    for first in range(0, height, rows_at_once):
        last = min(first + rows_at_once, height)
        strip = buffer.nearest[first * supersampling : last * supersampling]
        rows, columns = np.nonzero(strip)
        colour = np.zeros((*strip.shape, 4), dtype=np.float32)
        at = (first + rows // supersampling, columns // supersampling)
        colour[rows, columns, :3] = _colours(
            buffer, rows + first * supersampling, columns, ambient[at], key_light[at], radius, lighting
        )
        colour[rows, columns, 3] = 1.0
        mean = colour.reshape(last - first, supersampling, width, supersampling, 4).mean(axis=(1, 3))
        mean[..., :3] /= np.maximum(mean[..., 3:], 1e-6)
        picture[first:last] = mean
    return picture


def _colours(
    buffer: DepthBuffer,
    rows: np.ndarray,
    columns: np.ndarray,
    ambient: np.ndarray,
    key_light: np.ndarray,
    radius: float,
    lighting: Lighting,
) -> np.ndarray:
    """Colours (K, 3) of covered samples, with the visible fraction of ambient light and key light for each sample."""
    which, point, normal = buffer.surface(rows, columns)
    key, fill = (v.astype(np.float32) / np.float32(np.linalg.norm(v)) for v in (KEY_LIGHT, FILL_LIGHT))
    facing = np.maximum(normal @ key, 0.0)
    soft = np.clip(0.3 + 0.7 * (normal @ key), 0.0, 1.0)  # also lights surfaces slightly turned away
    halfway = key + np.array([0.0, 0.0, 1.0], dtype=np.float32)
    specular = np.maximum(normal @ (halfway / np.linalg.norm(halfway)), 0.0) ** 48 * key_light
    power = lighting.ambient * (0.80 + 0.20 * normal[:, 1]) * ambient
    power += lighting.fill * np.maximum(normal @ fill, 0.0) * ambient
    power += lighting.key * (0.45 * soft * ambient * (0.6 + 0.4 * key_light) + 0.55 * facing * key_light)
    weight = buffer.solids.shading[which].astype(np.float32)
    base = buffer.solids.colour[which].astype(np.float32)
    power *= 0.74 + 0.26 * np.clip(normal[:, 2] / 0.55, 0.0, 1.0)  # darker outlines separate shapes of equal colour
    power = 1.0 + weight * (power - 1.0)
    colour = base * power[:, None] + (lighting.specular * weight * specular * ambient)[:, None]
    extent = buffer.range
    haze = lighting.haze * extent / (extent + 14.0 * radius) * (1.0 - (point[:, 2] - buffer.lowest) / extent) * weight
    colour = colour * (1.0 - haze[:, None]) + np.array(lighting.background, dtype=np.float32) * haze[:, None]
    return np.clip(colour, 0.0, 1.0)


def _visibility(buffer: DepthBuffer, supersampling: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Visible fraction, 0 to 1, of ambient light and of the key light for each pixel."""
    every = slice(supersampling // 2, None, supersampling)
    covered = buffer.nearest[every, every] > 0
    rows, columns = np.nonzero(covered)
    if not rows.size:
        return np.ones(covered.shape, np.float32), np.ones(covered.shape, np.float32)
    offset = supersampling // 2
    _, point, normal = buffer.surface(rows * supersampling + offset, columns * supersampling + offset)
    depth = np.full(covered.shape, -np.inf, np.float32)
    depth[covered] = point[:, 2] / supersampling
    normals = np.zeros((*covered.shape, 3), np.float32)
    normals[covered] = normal
    ambient = np.exp(-2.3 * _occlusion(depth, normals, radius / supersampling))
    key_light = np.ones(covered.shape, np.float32)
    key_light[covered] = _key_light_visibility(buffer.solids, point, normal, supersampling, radius)
    weight = np.maximum(uniform_filter(covered.astype(np.float32), OCCLUSION_PATTERN), 1e-3)
    smoothed = (uniform_filter(np.where(covered, each, 0.0), OCCLUSION_PATTERN) for each in (ambient, key_light))
    return tuple(each / weight for each in smoothed)


def _occlusion(depth: np.ndarray, normal: np.ndarray, radius: float) -> np.ndarray:
    """Ambient occlusion from the depths around each pixel [pixels], 0 to 1.

    Each pixel samples the depth at a few distances from 1 pixel to 4 radii. Surfaces that rise above its horizon, by no
    more than about the distance, occlude ambient light. The pixels of a block sample different directions; the caller
    averages over blocks.
    """
    nearest, farthest = 1.0, float(np.clip(4.0 * radius, 4.0, 90.0))
    reach = int(farthest) + 2
    padded = np.pad(depth, reach + OCCLUSION_PATTERN, constant_values=-np.inf)
    occlusion = np.zeros(depth.shape, np.float32)
    for i in range(OCCLUSION_PATTERN):
        for j in range(OCCLUSION_PATTERN):
            block = (slice(i, None, OCCLUSION_PATTERN), slice(j, None, OCCLUSION_PATTERN))
            z, n = depth[block], normal[block]
            turn = (7 * (i * OCCLUSION_PATTERN + j)) % OCCLUSION_PATTERN**2 / OCCLUSION_PATTERN**2
            total = np.zeros(z.shape, np.float32)
            for k in range(OCCLUSION_SAMPLES):
                distance = nearest * (farthest / nearest) ** ((k + turn) / OCCLUSION_SAMPLES)
                angle = 2.0 * np.pi * (k * 0.618034 + turn)
                dx, dy = round(distance * np.cos(angle)), round(distance * np.sin(angle))
                if dx == dy == 0:
                    dx = 1
                top, left = reach + OCCLUSION_PATTERN + i + dy, reach + OCCLUSION_PATTERN + j + dx
                sample = padded[top::OCCLUSION_PATTERN, left::OCCLUSION_PATTERN][: z.shape[0], : z.shape[1]]
                with np.errstate(invalid="ignore"):
                    dz = np.where(np.isfinite(z), sample - z, -np.inf)
                flat = np.float32(dx * dx + dy * dy)
                dz = np.maximum(dz, np.float32(-1e6))
                squared = flat + dz * dz
                rise = (n[..., 0] * dx + n[..., 1] * dy + n[..., 2] * dz) / np.sqrt(squared)
                total += np.maximum(rise - 0.08, 0.0) / (1.0 + (squared / (5.0 * flat)) ** 2)
            occlusion[block] = total / OCCLUSION_SAMPLES
    return occlusion


def _key_light_visibility(
    solids: Solids, point: np.ndarray, normal: np.ndarray, supersampling: int, radius: float
) -> np.ndarray:
    """Visible fraction (K,) of the key light at points, 0 to 1, from a shadow map."""
    forward = KEY_LIGHT / np.linalg.norm(KEY_LIGHT)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    frame = np.array([right, np.cross(forward, right), forward])
    casting = solids.shading[len(solids.radius) :] > SHADOW_THRESHOLD
    turned = [p @ frame.T for p in (solids.centre, solids.start[casting], solids.end[casting])]
    reach = 2.0 * (
        max(float(np.abs(p[:, :2]).max(initial=0.0)) for p in turned) + float(solids.radius.max(initial=0.0))
    )
    scale = min(1.0 / supersampling, MAX_SHADOW_MAP / (reach + 1.0))
    size = int(reach * scale) + 8
    end_radii = solids.end_radii[casting] * scale
    blank = np.zeros((0, 3)), np.zeros(0)
    centre, start, end = (p * scale for p in turned)
    shadow_map = DepthBuffer((size, size), Solids(centre, solids.radius * scale, start, end, end_radii, *blank))
    grazing = 1.0 - np.clip(normal @ forward.astype(np.float32), 0.0, 1.0)
    lifted = (point + normal * (0.02 * radius + (1.0 + 2.0 * grazing[:, None]) / scale)) @ (frame.T * scale).astype(
        np.float32
    )
    soft = max(0.10 * radius * scale, 0.75)
    visible = np.zeros(len(point), np.float32)
    taps = [(np.sqrt((k + 0.5) / 8), 2.399963 * k) for k in range(8)]
    z = lifted[:, 2] + 0.5
    for distance, angle in taps:
        column = (lifted[:, 0] + (size / 2 + soft * distance * np.cos(angle))).astype(np.int32)
        row = (lifted[:, 1] + (size / 2 + soft * distance * np.sin(angle))).astype(np.int32)
        key = shadow_map.nearest[np.clip(row, 0, size - 1), np.clip(column, 0, size - 1)]
        visible += (z >= shadow_map.depth(key)) | (key == 0)
    return np.asarray(visible / len(taps))
