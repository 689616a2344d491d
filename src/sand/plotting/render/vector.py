"""Spheres, arrows, contacts and edges as filled outlines, for files that stay sharp at any size (PDF, SVG).

Outlines are drawn from the farthest to the nearest. For spheres that do not intersect this order is exact: the plane
of equal power |x − c|² − r² separates two of them, so that an eye at e sees that with the smaller power of e in front;
seen in parallel, that whose centre is nearer. A point of a line is a sphere of radius 0.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.path import Path

from ..style import TEXT_COLOUR, rgb
from .shading import KEY_LIGHT, Lighting
from .spheres import HEAD_LENGTH, HEAD_WIDTH, SHAFT, Rods, Spheres

RINGS = ((1.0, 0.52), (0.955, 0.80), (0.80, 0.90), (0.60, 0.98), (0.40, 1.05), (0.20, 1.12))
"""Radii of the discs of which a sphere is drawn, over its radius, and brightness of its colour in each."""
TOWARDS_LIGHT = 0.42
"""Shift of the smallest discs towards the light, over the radius of the sphere."""
FINE, COARSE = 1500, 6000
"""Up to these numbers of spheres all discs are drawn, or every other one; of more the largest two."""
PARTS = 48
"""Parts of an edge of the box, each in front of or behind a sphere as a whole."""
_KAPPA = 0.5522847498
"""Distance of the control points of a quarter of a circle, by a cubic Bézier curve that is right to 3e-4 of r."""
_QUARTER = np.array([[1.0, _KAPPA], [_KAPPA, 1.0], [0.0, 1.0]])
_TURNS = np.array([[[1, 0], [0, 1]], [[0, 1], [-1, 0]], [[-1, 0], [0, -1]], [[0, -1], [1, 0]]])
_CIRCLE = np.concatenate([[[1.0, 0.0]], *(_QUARTER @ turn for turn in _TURNS)])
_CURVES = np.array([Path.MOVETO, *[Path.CURVE4] * 12], Path.code_type)


class Outlines:
    """Filled outlines that are drawn in the order of their distance from the eye.

    Parameters
    ----------
    middle : ndarray
        (2,) centre of the view [m].
    eye : float or None
        Distance of the eye from the plane z = 0 [m]; None: parallel projection.
    """

    def __init__(self, middle: np.ndarray, eye: float | None):
        self._middle, self._eye = middle, eye
        self._paths: list[Path] = []
        self._colours: list[np.ndarray] = []
        self._keys: list[float] = []

    def order_of(self, centre: np.ndarray, radius: np.ndarray | float = 0.0) -> np.ndarray:
        """Keys (K,) of spheres or points in screen coordinates (K, 3) [m]; the nearest has the largest."""
        if self._eye is None:
            return np.asarray(centre[:, 2])
        across = ((centre[:, :2] - self._middle) ** 2).sum(axis=1)
        return np.asarray(radius**2 - across - (centre[:, 2] - self._eye) ** 2)

    def flat(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (K, 2) of the view at which positions (K, 3) are seen, and their magnification (K,)."""
        scale = np.ones(len(position)) if self._eye is None else 1.0 / (1.0 - position[:, 2] / self._eye)
        return self._middle + (position[:, :2] - self._middle) * scale[:, None], scale

    def disc(self, centre: np.ndarray, radius: float, colour: np.ndarray, key: float) -> None:
        """Add a disc in the view."""
        self._add(Path(centre + radius * _CIRCLE, _CURVES), colour, key)

    def band(
        self, start: np.ndarray, end: np.ndarray, widths: tuple[float, float], colour: np.ndarray, key: float
    ) -> None:
        """Add a straight band in the view, with half its widths at both ends; a tip has none."""
        along = end - start
        across = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-300)
        first, last = widths[0] * across, widths[1] * across
        self._add(Path(np.array([start - first, end - last, end + last, start + first])), colour, key)

    def _add(self, path: Path, colour: np.ndarray, key: float) -> None:
        self._paths.append(path)
        self._colours.append(np.clip(colour, 0.0, 1.0))
        self._keys.append(key)

    def draw(self, axes: Axes) -> None:
        """Draw all outlines, the farthest first; those with equal keys in the order in which they were added."""
        order = np.argsort(self._keys, kind="stable")
        paths, colours = [self._paths[k] for k in order], np.array(self._colours)[order]
        axes.add_collection(
            PathCollection(paths, facecolors=colours, edgecolors="none", linewidths=0.0, snap=False, gid="grains"),
            autolim=False,
        )


def draw_spheres(
    outlines: Outlines,
    spheres: Spheres,
    contacts: tuple[Rods, np.ndarray],
    edges: tuple[np.ndarray, float, np.ndarray],
    lighting: Lighting,
) -> None:
    """Add spheres with their arrows, contacts and edges.

    Parameters
    ----------
    outlines : Outlines
        What they are added to.
    spheres : Spheres
        Spheres and arrows in screen coordinates [m], the middle of their depths at z = 0.
    contacts : tuple of (Rods, ndarray)
        Cylinders around contacts in screen coordinates, and (M, 2) the spheres in front of which each is drawn.
    edges : tuple of (ndarray, float, ndarray)
        Ends (K, 2, 3) of straight lines in screen coordinates [m], half their width [m], and their colour (3,).
    lighting : Lighting
        Its haze and background.
    """
    keys = outlines.order_of(spheres.centre, spheres.radius)
    lowest, extent = _depths(spheres)
    share = lighting.haze * extent / (extent + 14.0 * float(np.median(spheres.radius)))
    haze = (share * (1.0 - (spheres.centre[:, 2] + spheres.radius - lowest) / extent))[:, None]
    colour = spheres.colour * (1.0 - haze) + np.array(lighting.background) * haze
    place, scale = outlines.flat(spheres.centre)
    number = len(keys)
    rings = RINGS if number <= FINE else RINGS[::2] if number <= COARSE else RINGS[:2]
    shift = TOWARDS_LIGHT * KEY_LIGHT[:2] / float(np.linalg.norm(KEY_LIGHT))
    for k in range(number):
        radius = spheres.radius[k] * scale[k]
        for part, brightness in rings:
            outlines.disc(place[k] + (1.0 - part) * radius * shift, part * radius, brightness * colour[k], keys[k])
        if spheres.arrow[k].any():
            _add_arrow(outlines, place[k], spheres.arrow[k] * radius, radius, keys[k])
    rods, fronts = contacts
    ends = outlines.flat(rods.start)[0], outlines.flat(rods.end)[0]
    for m in range(len(fronts)):
        width = float(rods.end_radii[m, 0]) * float(scale[fronts[m, 0]])
        outlines.band(ends[0][m], ends[1][m], (width, width), rods.colour[m], float(keys[fronts[m]].max()))
    lines, half, shade = edges
    for start, end in lines:
        at = start + np.linspace(0.0, 1.0, PARTS + 1)[:, None] * (end - start)
        order, flat = outlines.order_of(0.5 * (at[1:] + at[:-1])), outlines.flat(at)[0]
        for k in range(PARTS):
            outlines.band(flat[k], flat[k + 1], (half, half), shade, float(order[k]))


def _depths(spheres: Spheres) -> tuple[float, float]:
    """Lowest point of spheres along the view, and their extent [m]."""
    low = float((spheres.centre[:, 2] - spheres.radius).min())
    return low, float((spheres.centre[:, 2] + spheres.radius).max()) - low


def _add_arrow(outlines: Outlines, place: np.ndarray, half: np.ndarray, radius: float, key: float) -> None:
    """Add an arrow in front of a sphere; one that points to the eye is a dot."""
    dark, flat = rgb(TEXT_COLOUR), half[:2]
    length = float(np.hypot(*flat))
    if length < 0.5 * HEAD_WIDTH * radius:
        outlines.disc(place, HEAD_WIDTH * radius, dark, key)
        return
    size = float(np.linalg.norm(half))
    head = place + flat * (1.0 - min(HEAD_LENGTH * radius, 1.2 * size) / size)
    outlines.band(place - flat, head, (SHAFT * radius, SHAFT * radius), dark, key)
    outlines.band(head, place + flat, (HEAD_WIDTH * radius, 0.0), dark, key)
