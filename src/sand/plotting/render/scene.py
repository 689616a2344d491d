"""The grains in three dimensions: clusters whole, in the box, and the largest ones by themselves."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ...analysis.clusters import cluster_labels, cluster_sizes, unwrapped
from ...box import Box
from ..style import LARGEST_COLOURS, MUTED, OTHER_COLOURS, SINGLE_COLOUR, TEXT_COLOUR, format_si, rgb, round_length
from .spheres import Spheres, render_spheres

AZIMUTH, ELEVATION = 32.0, 20.0
"""Where the eye is [degrees], seen from the middle of the box; z is up."""
LARGEST_SHOWN = 3
"""Clusters shown by themselves."""


def camera_rotation(towards: np.ndarray | None = None) -> np.ndarray:
    """(3, 3): rows are the directions right, up and towards the eye in the laboratory frame.

    Parameters
    ----------
    towards : ndarray or None, optional
        (3,) direction to the eye, of any length but 0; from above, y is up.
    """
    a, e = np.radians(AZIMUTH), np.radians(ELEVATION)
    eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    eye = eye if towards is None else np.asarray(towards, dtype=np.float64) / np.linalg.norm(towards)
    across = np.hypot(eye[0], eye[1])
    right = np.array([-eye[1], eye[0], 0.0]) / across if across > 1e-9 else np.array([1.0, 0.0, 0.0])
    return np.array([right, np.cross(eye, right), eye])


@dataclass(frozen=True)
class Scene:
    """What there is to see, laboratory frame.

    Attributes
    ----------
    position : ndarray
        (N, 3) [m], clusters whole and with their middle in the box.
    radius : ndarray
        (N,) [m].
    label : ndarray
        (N,) cluster of each grain.
    colour : ndarray
        (N, 3).
    arrow : ndarray
        (N, 3) direction of the moment times its share of the largest one's size.
    box : Box
        with lengths [m].
    number : ndarray
        (N,) of each grain in what the scene was made from.
    """

    position: np.ndarray
    radius: np.ndarray
    label: np.ndarray
    colour: np.ndarray
    arrow: np.ndarray
    box: Box
    number: np.ndarray

    def projected(self, rotation: np.ndarray, chosen: slice | np.ndarray = slice(None)) -> Spheres:
        """The chosen grains in screen coordinates; rows of `rotation` are right, up, to the eye."""
        return Spheres(
            self.position[chosen] @ rotation.T,
            self.radius[chosen],
            self.colour[chosen],
            self.arrow[chosen] @ rotation.T,
        )

    def corners(self) -> np.ndarray | None:
        """(2, 2, 2, 3) corners of the box [m], on open axes around the grains; None if it is all open."""
        if self.box.is_open:
            return None
        low = (self.position - self.radius[:, None]).min(axis=0)
        high = (self.position + self.radius[:, None]).max(axis=0)
        for axis, length in enumerate(self.box.lengths):
            if length is not None:
                low[axis], high[axis] = -length / 2, length / 2
        return np.array(list(itertools.product(*zip(low, high, strict=True)))).reshape(2, 2, 2, 3)

    def edges(self) -> list[tuple[np.ndarray, np.ndarray, int, bool]]:
        """The twelve edges of the box: two ends (3,) [m], axis, and whether they meet in the farthest corner."""
        corners = self.corners()
        if corners is None:
            return []
        far = np.unravel_index(np.argmin(corners @ camera_rotation()[2]), (2, 2, 2))
        found = []
        for axis, *others in itertools.product(range(3), (0, 1), (0, 1)):
            start = [*others[:axis], 0, *others[axis:]]
            end = [*others[:axis], 1, *others[axis:]]
            found.append((corners[tuple(start)], corners[tuple(end)], axis, far in (tuple(start), tuple(end))))
        return found

    def largest_clusters(self) -> list[int]:
        """Labels of clusters of at least two grains, the largest first."""
        sizes = cluster_sizes(self.label)
        order = np.argsort(-sizes, kind="stable")
        return [int(k) for k in order if sizes[k] > 1]


def make_scene(grains: Any, pairs: np.ndarray, box: Box, whole: bool = True) -> Scene:
    """The scene of grains with contacts `pairs` (C, 2); grains whose place is not a number are left out.

    Parameters
    ----------
    grains
        anything with position, radius and moment.
    whole : bool, optional
        clusters are not cut by the faces of the box; otherwise every grain lies inside it.
    """
    label = cluster_labels(len(grains), pairs)
    place = np.where(np.isfinite(grains.position), grains.position, np.nan)
    position = box.wrap(place)
    if whole:
        position = unwrapped(position, pairs, box)
        sizes = cluster_sizes(label)
        middle = np.stack([np.bincount(label, position[:, k]) / sizes for k in range(3)], axis=1)
        position = position + (box.wrap(middle) - middle)[label]
    there = np.isfinite(position).all(axis=1)
    numbered = np.unique(label[there], return_inverse=True)[1]
    return Scene(
        position[there],
        grains.radius[there],
        numbered,
        cluster_colours(numbered),
        _arrows(grains.moment[there]),
        box,
        np.flatnonzero(there),
    )


def _arrows(moment: np.ndarray) -> np.ndarray:
    """(N, 3) in radii of the grains: in proportion to the largest moment, but never too short to be seen."""
    moment = np.nan_to_num(moment, posinf=0.0, neginf=0.0)
    size = np.linalg.norm(moment, axis=1, keepdims=True)
    largest = max(float(size.max(initial=0.0)), 1e-300)
    share = np.where(size > 0.0, np.maximum(size / largest, 0.35), 0.0)
    return 0.9 * share * moment / np.where(size > 0.0, size, 1.0)


def cluster_colours(label: np.ndarray) -> np.ndarray:
    """(N, 3): a colour of its own for each of the largest clusters, grey for single grains."""
    sizes = cluster_sizes(label)
    of_cluster = np.tile(rgb(SINGLE_COLOUR), (sizes.size, 1))
    for rank, k in enumerate(np.argsort(-sizes, kind="stable")):
        if sizes[k] > 1:
            name = (
                LARGEST_COLOURS[rank]
                if rank < len(LARGEST_COLOURS)
                else OTHER_COLOURS[(rank - len(LARGEST_COLOURS)) % len(OTHER_COLOURS)]
            )
            of_cluster[k] = rgb(name)
    return of_cluster[label]


def view_window(
    scene: Scene, wide: float, margin: float = 0.02, rotation: np.ndarray | None = None
) -> tuple[float, float, float, float]:
    """Left, right, bottom, top [m] that hold the grains and the box; `wide` is width over height."""
    rotation = camera_rotation() if rotation is None else rotation
    left, right, bottom, top = scene.projected(rotation).bounds
    corners = scene.corners()
    if corners is not None:
        flat = corners.reshape(-1, 3) @ rotation.T
        left, right = min(left, flat[:, 0].min()), max(right, flat[:, 0].max())
        bottom, top = min(bottom, flat[:, 1].min()), max(top, flat[:, 1].max())
    return fit_window((left, right, bottom, top), wide, margin, least=5.0 * float(scene.radius.max()))


def fit_window(
    bounds: tuple[float, float, float, float], wide: float, margin: float, least: float = 0.0
) -> tuple[float, float, float, float]:
    """The window of proportions `wide` around `bounds`, at least `least` [m] high."""
    left, right, bottom, top = bounds
    height = max((top - bottom), (right - left) / wide, least) * (1.0 + 2.0 * margin)
    x, y = (left + right) / 2, (bottom + top) / 2
    return x - wide * height / 2, x + wide * height / 2, y - height / 2, y + height / 2


def draw_scene(axes: Axes, scene: Scene, pixels: tuple[int, int]) -> None:
    """All grains in their box, with a scale bar and the directions of the axes."""
    window = view_window(scene, pixels[0] / pixels[1])
    _show(axes, scene.projected(camera_rotation()), window, pixels)
    _draw_box(axes, scene)
    _draw_directions(axes)
    draw_scale_bar(axes)


def _show(axes: Axes, spheres: Spheres, window: tuple[float, float, float, float], pixels: tuple[int, int]) -> None:
    axes.imshow(
        render_spheres(spheres, window, *pixels),
        extent=window,
        origin="lower",
        aspect="auto",
        interpolation="antialiased",
        zorder=2,
    )
    axes.set(xlim=window[:2], ylim=window[2:])
    axes.set_axis_off()


def _draw_box(axes: Axes, scene: Scene) -> None:
    """The twelve edges; the three that meet in the farthest corner lie behind the grains."""
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


def _draw_directions(axes: Axes) -> None:
    """x, y and z as a small cross in the lower left corner."""
    left, (bottom, top) = axes.get_xlim()[0], axes.get_ylim()
    size = 0.042 * (top - bottom)
    x, y = left + 1.6 * size, bottom + 0.9 * size
    for name, step in zip("xyz", camera_rotation()[:2].T * size, strict=True):
        axes.plot([x, x + step[0]], [y, y + step[1]], color=MUTED, linewidth=0.9, zorder=4)
        axes.text(x + 1.5 * step[0], y + 1.5 * step[1], name, color=MUTED, size=7, ha="center", va="center")


def draw_scale_bar(
    axes: Axes, share: float = 0.25, ink: str = TEXT_COLOUR, margin: float = 0.015, grow: float = 1.0
) -> None:
    """A bar of a round length, at most `share` of the width, in the lower right corner, and its length."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    length = round_length(share * (right - left))
    x, y = right - margin * (right - left), bottom + 4.0 / 3.0 * margin * (top - bottom)
    axes.plot([x - length, x], [y, y], color=ink, linewidth=2.0 * grow, solid_capstyle="butt", zorder=4, gid="scale")
    place, above = (x - length / 2, y), (0, 3 * grow)
    axes.annotate(
        format_si(length, "m"), place, above, textcoords="offset points", ha="center", color=ink, size=7.5 * grow
    )


def side_by_side(scene: Scene, count: int) -> tuple[Spheres, np.ndarray, list[int]]:
    """The `count` largest clusters next to each other, each turned so that its long axis is across.

    Returns
    -------
    tuple[Spheres, ndarray, list[int]]
        What to draw; (K, 2) the middle of the lower edge of each cluster [m]; their numbers of grains.
    """
    parts, feet, sizes, edge = [], [], [], 0.0
    gap = 3.0 * float(scene.radius.max())
    for label in scene.largest_clusters()[:count]:
        chosen = np.flatnonzero(scene.label == label)
        spheres = scene.projected(_principal(scene.position[chosen]), chosen)
        left, right, bottom, top = spheres.bounds
        shift = np.array([edge - left, -(bottom + top) / 2, -spheres.centre[:, 2].mean()])
        parts.append(Spheres(spheres.centre + shift, spheres.radius, spheres.colour, spheres.arrow))
        feet.append((edge + (right - left) / 2, -(top - bottom) / 2))
        sizes.append(chosen.size)
        edge += right - left + gap
    fields = zip(*((p.centre, p.radius, p.colour, p.arrow) for p in parts), strict=True)
    return Spheres(*(np.concatenate(each) for each in fields)), np.array(feet), sizes


def _principal(position: np.ndarray) -> np.ndarray:
    """Rows: longest, middle and shortest axis of a cluster, right-handed."""
    _, _, axes = np.linalg.svd(position - position.mean(axis=0), full_matrices=True)
    axes[2] = np.cross(axes[0], axes[1])
    return axes


def draw_largest(axes: Axes, scene: Scene, pixels: tuple[int, int]) -> None:
    """The largest clusters at a scale at which grains, contacts and moments can be told apart."""
    wide = pixels[0] / pixels[1]
    least = 2.0 * float(np.median(scene.radius)) * pixels[1] / 76.0  # a grain is at most 76 pixels across
    for count in range(min(LARGEST_SHOWN, len(scene.largest_clusters())), 0, -1):
        spheres, feet, sizes = side_by_side(scene, count)
        left, right, bottom, top = spheres.bounds
        # More clusters only as long as they do not make all of them small.
        if right - left < 1.5 * wide * max(top - bottom, least):
            break
    window = fit_window((left, right, bottom - 0.22 * (top - bottom), top), wide, 0.02, least)
    _show(axes, spheres, window, pixels)
    for (x, y), size in zip(feet, sizes, strict=True):
        axes.annotate(f"{size} grains", (x, y), (0, -3), textcoords="offset points", ha="center", va="top", size=7.5)
    draw_scale_bar(axes, 0.15)
