"""Scenes of grains: unwrapped clusters in the box, the view onto them, and the largest clusters side by side."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ...analysis.clusters import cluster_labels, cluster_sizes, unwrapped
from ...basics.box import Box
from ...basics.clusters import closes_through_boundary
from ..style import (
    LARGEST_COLOURS,
    MUTED,
    OTHER_COLOURS,
    SINGLE_COLOUR,
    TEXT_COLOUR,
    format_si,
    points,
    rgb,
    round_length,
)
from .directions import UniformField, draw_directions
from .spheres import Spheres, render_spheres

AZIMUTH, ELEVATION = 32.0, 20.0
"""Default direction to the eye [degrees], seen from the centre of the box; z is up."""
LENGTH, LENGTH_OF_LARGEST = 0.042, 8.0
"""Length of axes in heights of the picture of all grains, and below the largest clusters in `style.points`."""
WIDTH_OF_LABEL = 105.0
"""Width of the number of grains and the directions below a cluster, in `style.points`."""
BELOW_LARGEST = 38.0
"""Height of these, and of the scale bar below them, in `style.points`."""
LARGEST_SHOWN = 3
"""Maximum number of clusters shown side by side."""


def camera_rotation(towards: np.ndarray | None = None) -> np.ndarray:
    """Rotation from the laboratory frame to screen coordinates.

    Parameters
    ----------
    towards : ndarray, optional
        (3,) direction to the eye, of any length above 0.

    Returns
    -------
    ndarray
        (3, 3); rows are the directions right, up and towards the eye. Seen along z, y points up.
    """
    a, e = np.radians(AZIMUTH), np.radians(ELEVATION)
    eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    eye = eye if towards is None else np.asarray(towards, dtype=np.float64) / np.linalg.norm(towards)
    across = np.hypot(eye[0], eye[1])
    right = np.array([-eye[1], eye[0], 0.0]) / across if across > 1e-9 else np.array([1.0, 0.0, 0.0])
    return np.array([right, np.cross(eye, right), eye])


@dataclass(frozen=True)
class Scene:
    """Grains to be drawn, in the laboratory frame.

    Attributes
    ----------
    position : ndarray
        (N, 3) positions [m]; clusters are unwrapped, with their centre in the box, or all grains are in the box.
    radius : ndarray
        (N,) radii [m].
    label : ndarray
        (N,) cluster index of each grain.
    colour : ndarray
        (N, 3) red, green, blue from 0 to 1.
    arrow : ndarray
        (N, 3) half of the arrow of the moment, in grain radii.
    box : Box
        Periodic or open box.
    number : ndarray
        (N,) index of each grain in the frame or simulation.
    """

    position: np.ndarray
    radius: np.ndarray
    label: np.ndarray
    colour: np.ndarray
    arrow: np.ndarray
    box: Box
    number: np.ndarray

    def projected(self, rotation: np.ndarray, chosen: slice | np.ndarray = slice(None)) -> Spheres:
        """The chosen grains in screen coordinates (see `camera_rotation`)."""
        return Spheres(
            self.position[chosen] @ rotation.T,
            self.radius[chosen],
            self.colour[chosen],
            self.arrow[chosen] @ rotation.T,
        )

    def corners(self) -> np.ndarray | None:
        """Corners (2, 2, 2, 3) of the box [m], which encloses the grains along open axes; None if all axes are open."""
        if self.box.is_open:
            return None
        low = (self.position - self.radius[:, None]).min(axis=0)
        high = (self.position + self.radius[:, None]).max(axis=0)
        for axis, length in enumerate(self.box.lengths):
            if length is not None:
                low[axis], high[axis] = -length / 2, length / 2
        corners = np.array(list(itertools.product(*zip(low, high, strict=True)))).reshape(2, 2, 2, 3)
        corners[..., 0] += _displacement(self.box, corners)
        return corners

    def edges(self) -> list[tuple[np.ndarray, np.ndarray, int, bool]]:
        """The twelve edges of the box: two ends (3,) [m], axis, and whether the edge ends in the farthest corner."""
        corners = self.corners()
        if corners is None:
            return []
        farthest = np.unravel_index(np.argmin(corners @ camera_rotation()[2]), (2, 2, 2))
        edges = []
        for axis, *others in itertools.product(range(3), (0, 1), (0, 1)):
            start = [*others[:axis], 0, *others[axis:]]
            end = [*others[:axis], 1, *others[axis:]]
            edges.append((corners[tuple(start)], corners[tuple(end)], axis, farthest in (tuple(start), tuple(end))))
        return edges


def make_scene(grains: Any, pairs: np.ndarray, box: Box, whole: bool = True) -> Scene:
    """Scene of grains and their contacts; grains whose position is not finite are left out.

    Parameters
    ----------
    grains : Grains or Frame
        Any object with position, radius and moment.
    pairs : ndarray
        (C, 2) grains in contact.
    box : Box
        Periodic or open box.
    whole : bool, optional
        Unwrap clusters across periodic boundaries, but for percolating ones, which touch their own periodic image and
        have no extent; otherwise every grain is drawn inside the box.
    """
    label = cluster_labels(len(grains), pairs)
    position = _in_box(box, np.where(np.isfinite(grains.position), grains.position, np.nan))
    if whole:
        inside, position = position, unwrapped(position, pairs, box)
        sizes = cluster_sizes(label)
        centre = np.stack([np.bincount(label, position[:, k]) / sizes for k in range(3)], axis=1)
        position = position + (_in_box(box, centre) - centre)[label]
        percolates = np.zeros(len(sizes), bool)
        ends = np.asarray(pairs, np.int64).reshape(-1, 2)  # without contacts of any type
        percolates[label[ends[closes_through_boundary(position, ends, box), 0]]] = True
        position = np.where(percolates[label, None], inside, position)
    finite = np.isfinite(position).all(axis=1)
    numbered = np.unique(label[finite], return_inverse=True)[1]
    return Scene(
        position[finite],
        grains.radius[finite],
        numbered,
        cluster_colours(numbered),
        _arrows(grains.moment[finite]),
        box,
        np.flatnonzero(finite),
    )


def _displacement(box: Box, position: np.ndarray) -> np.ndarray:
    """Displacement along x (…) [m] of a tilted box at positions (…, 3) [m], T z/L_z; 0 of another box."""
    return box.tilt * box.span.inverse_z * position[..., 2]


def _in_box(box: Box, position: np.ndarray) -> np.ndarray:
    """Images (N, 3) [m] of positions in the box, which is a parallelepiped if it is tilted."""
    position = box.wrap(position)
    if box.tilt:
        beyond = (position[:, 0] - _displacement(box, position)) * box.span.inverse_x
        position[:, 0] -= box.span.x * np.rint(beyond)
    return position


def _arrows(moment: np.ndarray) -> np.ndarray:
    """Half arrows (N, 3) in grain radii, proportional to the moments, but at least 0.35 of the longest."""
    moment = np.nan_to_num(moment, posinf=0.0, neginf=0.0)
    size = np.linalg.norm(moment, axis=1, keepdims=True)
    largest = max(float(size.max(initial=0.0)), 1e-300)
    share = np.where(size > 0.0, np.maximum(size / largest, 0.35), 0.0)
    return 0.9 * share * moment / np.where(size > 0.0, size, 1.0)


def largest_clusters(label: np.ndarray) -> list[int]:
    """Indices of the clusters of at least two grains, largest first."""
    sizes = cluster_sizes(label)
    return [int(k) for k in np.argsort(-sizes, kind="stable") if sizes[k] > 1]


def cluster_colours(label: np.ndarray) -> np.ndarray:
    """Colours (N, 3) of grains by cluster: unique for the largest clusters, grey for single grains."""
    of_cluster = np.tile(rgb(SINGLE_COLOUR), (cluster_sizes(label).size, 1))
    names = itertools.chain(LARGEST_COLOURS, itertools.cycle(OTHER_COLOURS))
    for k, name in zip(largest_clusters(label), names, strict=False):
        of_cluster[k] = rgb(name)
    return of_cluster[label]


def view_window(
    scene: Scene, aspect: float, margin: float = 0.02, rotation: np.ndarray | None = None
) -> tuple[float, float, float, float]:
    """Left, right, bottom and top [m] of the view that encloses grains and box; `aspect` is width over height."""
    rotation = camera_rotation() if rotation is None else rotation
    left, right, bottom, top = scene.projected(rotation).bounds
    corners = scene.corners()
    if corners is not None:
        flat = corners.reshape(-1, 3) @ rotation.T
        left, right = min(left, flat[:, 0].min()), max(right, flat[:, 0].max())
        bottom, top = min(bottom, flat[:, 1].min()), max(top, flat[:, 1].max())
    return fit_window((left, right, bottom, top), aspect, margin, min_height=5.0 * float(scene.radius.max()))


def fit_window(
    bounds: tuple[float, float, float, float], aspect: float, margin: float, min_height: float = 0.0
) -> tuple[float, float, float, float]:
    """Window with aspect ratio `aspect` around `bounds`, at least `min_height` [m] high."""
    left, right, bottom, top = bounds
    height = max((top - bottom), (right - left) / aspect, min_height) * (1.0 + 2.0 * margin)
    x, y = (left + right) / 2, (bottom + top) / 2
    return x - aspect * height / 2, x + aspect * height / 2, y - height / 2, y + height / 2


def draw_scene(axes: Axes, scene: Scene, pixels: tuple[int, int], fields: Sequence[UniformField] = ()) -> None:
    """Draw all grains in the box, with a scale bar and the directions of the axes and of the fields."""
    window = view_window(scene, pixels[0] / pixels[1])
    _draw_image(axes, scene.projected(camera_rotation()), window, pixels)
    _draw_box(axes, scene)
    left, _, bottom, top = window
    size = LENGTH * (top - bottom)
    draw_directions(axes, camera_rotation(), (left + 1.6 * size, bottom + 0.9 * size), size, fields)
    draw_scale_bar(axes)


def _draw_image(
    axes: Axes, spheres: Spheres, window: tuple[float, float, float, float], pixels: tuple[int, int]
) -> None:
    picture = render_spheres(spheres, window, *pixels)
    axes.imshow(picture, extent=window, origin="lower", aspect="auto", interpolation="antialiased", zorder=2)
    axes.set(xlim=window[:2], ylim=window[2:])
    axes.set_axis_off()


def _draw_box(axes: Axes, scene: Scene) -> None:
    """Draw the edges of the box; edges that end in the farthest corner lie behind the grains."""
    for start, end, axis, behind in scene.edges():
        line = np.array([start, end]) @ camera_rotation().T
        axes.plot(
            line[:, 0],
            line[:, 1],
            color=MUTED,
            linewidth=0.6 if behind else 0.8,
            alpha=0.55 if behind else 0.75,
            linestyle="-" if scene.box.lengths[axis] is not None else (0, (1.5, 3)),
            zorder=1 if behind else 3,
            gid="box",
        )


def draw_scale_bar(
    axes: Axes, share: float = 0.25, colour: str = TEXT_COLOUR, margin: float = 0.015, scale: float = 1.0
) -> None:
    """Draw a scale bar of round length in the lower right corner, at most `share` of the width of the view."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    length = round_length(share * (right - left))
    x, y = right - margin * (right - left), bottom + 4.0 / 3.0 * margin * (top - bottom)
    bar: dict[str, Any] = {"linewidth": 2.0 * scale, "solid_capstyle": "butt", "zorder": 4, "gid": "scale"}
    axes.plot([x - length, x], [y, y], color=colour, **bar)
    look: dict[str, Any] = {"ha": "center", "color": colour, "size": points(7.5 * scale)}
    axes.annotate(format_si(length, "m"), (x - length / 2, y), (0, 3 * scale), textcoords="offset points", **look)


def side_by_side(scene: Scene, count: int) -> tuple[Spheres, np.ndarray, list[int], list[np.ndarray]]:
    """Arrange the `count` largest clusters in a row, each rotated so that its longest axis is horizontal.

    Returns
    -------
    tuple of (Spheres, ndarray, list of int, list of ndarray)
        Spheres to be drawn; (K, 2) centre of the lower edge of each cluster [m]; number of grains of each cluster; its
        rotation (3, 3) from the laboratory.
    """
    parts, lower_edges, sizes, rotations, x = [], [], [], [], 0.0
    gap = 3.0 * float(scene.radius.max())
    for label in largest_clusters(scene.label)[:count]:
        members = np.flatnonzero(scene.label == label)
        rotations.append(_principal_axes(scene.position[members]))
        spheres = scene.projected(rotations[-1], members)
        left, right, bottom, top = spheres.bounds
        shift = np.array([x - left, -(bottom + top) / 2, -spheres.centre[:, 2].mean()])
        parts.append(Spheres(spheres.centre + shift, spheres.radius, spheres.colour, spheres.arrow))
        lower_edges.append((x + (right - left) / 2, -(top - bottom) / 2))
        sizes.append(members.size)
        x += right - left + gap
    fields = zip(*((p.centre, p.radius, p.colour, p.arrow) for p in parts), strict=True)
    return Spheres(*(np.concatenate(each) for each in fields)), np.array(lower_edges), sizes, rotations


def _principal_axes(position: np.ndarray) -> np.ndarray:
    """Right-handed principal axes (3, 3) of a cluster as rows, longest first."""
    _, _, axes = np.linalg.svd(position - position.mean(axis=0), full_matrices=True)
    axes[2] = np.cross(axes[0], axes[1])
    return axes


def draw_largest(axes: Axes, scene: Scene, pixels: tuple[int, int], fields: Sequence[UniformField] = ()) -> None:
    """Draw the largest clusters side by side, enlarged so that grains and moments are distinguishable.

    Each is turned so that it lies flat, and has its own directions of the axes and of the fields below it.
    """
    aspect = pixels[0] / pixels[1]
    min_height = 2.0 * float(np.median(scene.radius)) * pixels[1] / 76.0  # at most 76 pixels per grain
    extent = axes.get_window_extent()
    width, height = (72.0 * size / axes.figure.dpi / points(1.0) for size in (extent.width, extent.height))
    most = max(1, min(LARGEST_SHOWN, len(largest_clusters(scene.label)), int(width / WIDTH_OF_LABEL)))
    for count in range(most, 0, -1):
        spheres, lower_edges, sizes, rotations = side_by_side(scene, count)
        left, right, bottom, top = spheres.bounds
        # Further clusters only if they do not make all of them small.
        if right - left < 1.5 * aspect * max(top - bottom, min_height):
            break
    below = BELOW_LARGEST / (height - BELOW_LARGEST)
    window = fit_window((left, right, bottom - below * (top - bottom), top), aspect, 0.02, min_height)
    _draw_image(axes, spheres, window, pixels)
    point = (window[3] - window[2]) / height
    aside, length = 15.0 + 13.0 * len(fields), LENGTH_OF_LARGEST * point
    for edge, size, rotation in zip(lower_edges, sizes, rotations, strict=True):
        x = np.clip(edge[0], window[0] + (aside + 22.0) * point, window[1] - (aside + 22.0) * point) - aside * point
        y = edge[1] - 1.8 * length
        axes.annotate(f"{size} grains", (x, y), ha="center", va="center", size=points(7.5))
        draw_directions(axes, rotation, (x + 36.0 * point, y), length, fields)
    draw_scale_bar(axes, 0.15)
