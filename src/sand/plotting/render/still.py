"""A still picture of a frame: true spheres, contacts, moments and the box, with a key, a scale bar and a caption."""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image

from ...analysis.quantities import CONTACT_NAMES, GRAIN_NAMES, measured, quantity
from ...arguments import checked
from ...box import Box
from ...errors import BadInput, did_you_mean, refuse_other
from ..run_figure import DPI, RunFigure, headline
from ..style import DARK_BACKGROUND, LIGHT_BACKGROUND, MUTED, MUTED_ON_DARK, TEXT_COLOUR, TEXT_ON_DARK, plot_style, rgb
from .colouring import ColourKey, coloured
from .legend import draw_colour_keys, draw_directions
from .scene import Scene, camera_rotation, draw_scale_bar, make_scene, view_window
from .shading import Lighting
from .spheres import Rods, render_spheres

VIEWS: dict[str, tuple[float, float, float] | None] = {
    "iso": None,
    "front": (0.0, -1.0, 0.0),
    "top": (0.0, 0.0, 1.0),
    "side": (1.0, 0.0, 0.0),
}
"""Directions to the eye."""
LEAST_SIZE, MOST_SIZE = 200, 8000
"""Pixels along an edge."""
LIGHTING_ON_LIGHT = Lighting(haze=0.26)
LIGHTING_ON_DARK = Lighting(sky=0.64, key=0.66, specular=0.24, haze=0.45, background=tuple(rgb(DARK_BACKGROUND)))
COLLAR = 0.52
"""Radius of what marks a contact, in radii of the smaller grain; half its length is 0.4 of that."""
FEW_GRAINS = 3000
"""Up to this many, nine samples a pixel and not four."""
_INNER = (0.035, 0.845, 0.075, 0.905)
"""Left, right, bottom and top of where grains and box are, as shares of the picture."""


class Still(RunFigure):
    """A still picture: a figure with what was drawn of the grains in `grains_only`, (height, width, 4), 0 to 1.

    `window` has left, right, bottom and top [m] of the whole picture in the plane through the middle of what is seen,
    `rotation` the directions right, up and to the eye, `scene` what was drawn.
    """

    grains_only: np.ndarray
    window: tuple[float, float, float, float]
    rotation: np.ndarray
    scene: Scene

    def image(self) -> Image.Image:
        """The picture with all that is written on it, for Pillow."""
        with plot_style():
            self.savefig(content := io.BytesIO(), format="png", dpi=DPI, facecolor="auto")
        return Image.open(content)

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        self.image().save(content, format="png")
        return content.getvalue()


@checked
def still_picture(
    frame: Any,
    *,
    colour: str = "cluster",
    bonds: str | None = None,
    arrows: bool = True,
    view: str | Sequence[float] = "iso",
    size: tuple[int, int] = (1600, 1000),
    dark: bool = False,
    transparent: bool = False,
    whole: bool = True,
    cluster: int | None = None,
    perspective: bool = False,
    field: Sequence[float] | None = None,
) -> Still:
    """A picture of a frame, without a browser or a graphics card; the same numbers give the same bits.

    Parameters
    ----------
    frame
        of a trajectory, or anything that has its attributes.
    colour : str, optional
        of grains: a name in `analysis.quantities.GRAINS`.
    bonds : str or None, optional
        contacts by "load" or "mode", see `analysis.quantities.CONTACTS`; None: not marked.
    arrows : bool, optional
        moments are shown.
    view : str or Sequence[float], optional
        "iso", "front", "top", "side" or the direction to the eye, three numbers.
    size : tuple[int, int], optional
        width and height [pixels].
    dark : bool, optional
        on a dark ground; transparent: on none.
    whole : bool, optional
        clusters are not cut by the faces of a periodic box.
    cluster : int or None, optional
        one cluster by itself, counted from the largest, 1.
    perspective : bool, optional
        what is nearer is larger; otherwise lengths can be measured anywhere.
    field : Sequence[float] or None, optional
        flux density of outside (3,) [T], shown by its direction.

    Raises
    ------
    BadInput
        one line for each mistake.
    """
    refuse_other(frame, "radius", "pair", "box")
    towards = check_picture_options(colour, bonds, view, size)
    outside = None if field is None else np.asarray(field, dtype=np.float64)
    scene = make_scene(frame, frame.pair, frame.box, whole)
    scene, key = _coloured_scene(scene, frame, colour, outside, arrows)
    if cluster is not None:
        scene = _single_cluster(scene, cluster)
        if colour == "cluster":
            key = ColourKey("cluster", ((f"{len(scene.radius)} of {len(frame)} grains", scene.colour[0]),))
    if not len(scene.radius):
        raise BadInput("there is no grain with a finite position to be drawn")
    joints, bond_key = _contact_rods(scene, frame, bonds)
    rotation = camera_rotation(towards)
    keys = [each for each in (key, bond_key) if each is not None]
    with plot_style():
        figure = Still(figsize=(size[0] / DPI, size[1] / DPI), dpi=DPI)
        figure.scene, figure.rotation = scene, rotation
        _draw(figure, joints, size, dark, perspective)
        _draw_background(figure, dark, transparent)
        _write(figure, frame, keys, outside, dark)
    return figure


def check_picture_options(
    colour: str, bonds: str | None, view: str | Sequence[float], size: tuple[int, int]
) -> np.ndarray | None:
    """The direction to the eye, None for the usual one.  Raises BadInput with a line for each mistake."""
    wrong: list[str] = []
    for name, allowed in ((colour, GRAIN_NAMES), (bonds, CONTACT_NAMES)):
        if name is not None:
            try:
                quantity(name, allowed)
            except BadInput as error:
                wrong += error.problems
    if not all(LEAST_SIZE <= length <= MOST_SIZE for length in size):
        wrong.append(f"size {size[0]}x{size[1]}: each must be from {LEAST_SIZE} to {MOST_SIZE} pixels")
    towards: Any = VIEWS.get(view) if isinstance(view, str) else view
    if isinstance(view, str) and view not in VIEWS:
        try:
            towards = [float(part) for part in view.split(",")]
        except ValueError:
            wrong.append(
                f"there is no view '{view}'; {did_you_mean(view, tuple(VIEWS))} (or three numbers: '1,-2,0.5')"
            )
    if towards is not None:
        numbers = np.asarray(towards, dtype=np.float64)
        if numbers.shape != (3,) or not np.isfinite(numbers).all() or not 0.0 < np.linalg.norm(numbers) < 1e9:
            wrong.append(f"view {view!r}: the direction to the eye is three numbers that are not all 0")
    if wrong:
        raise BadInput(wrong)
    return None if towards is None else np.asarray(towards, dtype=np.float64)


def _coloured_scene(
    scene: Scene, frame: Any, name: str, field: np.ndarray | None, arrows: bool
) -> tuple[Scene, ColourKey | None]:
    """The scene with grains of the quantity's colours, and the key to them."""
    values = measured(frame, name, field)[scene.number]
    colours, key = coloured(values, quantity(name), frame, scene.label)
    shown = scene.arrow if arrows else np.zeros_like(scene.arrow)
    return dataclasses.replace(scene, colour=colours, arrow=shown), key


def _single_cluster(scene: Scene, rank: int) -> Scene:
    """One cluster in open space.  Raises BadInput."""
    clusters = scene.largest_clusters()
    if not 1 <= rank <= len(clusters):
        raise BadInput(f"cluster {rank}: there are {len(clusters)} of two grains or more, the largest is 1")
    chosen = scene.label == clusters[rank - 1]
    one = {name: getattr(scene, name)[chosen] for name in ("position", "radius", "colour", "arrow", "number")}
    return dataclasses.replace(scene, **one, label=np.zeros(chosen.sum(), int), box=Box.open())


def _contact_rods(scene: Scene, frame: Any, name: str | None) -> tuple[Rods, ColourKey | None]:
    """A collar round every contact [m], laboratory frame; where faces of the box part two grains, one at each."""
    place = np.full(len(frame.radius), -1)
    place[scene.number] = np.arange(len(scene.number))
    pair = place[np.asarray(frame.pair, dtype=np.int64).reshape(-1, 2)]
    there = (pair >= 0).all(axis=1)
    if name is None or not there.any():
        return _rods(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3))), None
    values = measured(frame, name)[there]
    colours, key = coloured(values, quantity(name, CONTACT_NAMES), frame, scene.label)
    i, j = pair[there].T
    way = frame.box.nearest(scene.position[j] - scene.position[i])
    size = np.linalg.norm(way, axis=1, keepdims=True)
    thick = COLLAR * np.minimum(scene.radius[i], scene.radius[j])
    half = 0.4 * thick[:, None] * way / np.maximum(size, 1e-300)
    share = (scene.radius[i] / (scene.radius[i] + scene.radius[j]))[:, None]
    first, second = scene.position[i] + share * way, scene.position[j] - (1.0 - share) * way
    apart = np.linalg.norm(first - second, axis=1) > 1e-6 * size[:, 0]
    middle = np.concatenate([first, second[apart]])
    half, thick, colours = (np.concatenate([each, each[apart]]) for each in (half, thick, colours))
    return _rods(middle - half, middle + half, thick, colours), key


def _rods(start: np.ndarray, end: np.ndarray, thick: np.ndarray, colour: np.ndarray, lit: float = 1.0) -> Rods:
    return Rods(start, end, np.column_stack([thick, thick]), colour, np.full(len(start), lit))


def _draw(figure: Still, joints: Rods, size: tuple[int, int], dark: bool, perspective: bool) -> None:
    """The grains, what marks their contacts, and the edges of the box."""
    scene, turn = figure.scene, figure.rotation
    left, right, bottom, top = _INNER
    wide = size[0] * (right - left) / (size[1] * (top - bottom))
    x0, x1, y0, y1 = view_window(scene, wide, 0.03, turn)
    spheres = scene.projected(turn)
    depth = float(spheres.centre[:, 2].min() + spheres.centre[:, 2].max()) / 2
    eye = 2.6 * float(np.hypot(x1 - x0, np.ptp(spheres.centre[:, 2]))) if perspective else None
    if eye is not None:  # what comes nearer needs more room
        room = 1.0 / (1.0 - (float((spheres.centre[:, 2] + spheres.radius).max()) - depth) / eye)
        x0, x1 = (x0 + x1) / 2 - room * (x1 - x0) / 2, (x0 + x1) / 2 + room * (x1 - x0) / 2
        y0, y1 = (y0 + y1) / 2 - room * (y1 - y0) / 2, (y0 + y1) / 2 + room * (y1 - y0) / 2
    pixel = (x1 - x0) / ((right - left) * size[0])
    x0, y0 = x0 - left * size[0] * pixel, y0 - bottom * size[1] * pixel
    figure.window = (x0, x0 + pixel * size[0], y0, y0 + pixel * size[1])
    down = np.array([0.0, 0.0, depth])
    edges = [(a, b) for a, b, _, _ in scene.edges()]
    ends = np.array(edges).reshape(-1, 2, 3)
    line = rgb(MUTED_ON_DARK if dark else MUTED)
    frame = _rods(ends[:, 0], ends[:, 1], np.full(len(ends), 0.75 * pixel), np.tile(line, (len(ends), 1)), 0.0)
    every = Rods.joined(joints, frame)
    figure.grains_only = render_spheres(
        dataclasses.replace(spheres, centre=spheres.centre - down),
        figure.window,
        *size,
        rods=dataclasses.replace(every, start=every.start @ turn.T - down, end=every.end @ turn.T - down),
        eye=eye,
        lighting=LIGHTING_ON_DARK if dark else LIGHTING_ON_LIGHT,
        supersampling=3 if len(spheres.radius) <= FEW_GRAINS else 2,
    )


def _draw_background(figure: Still, dark: bool, transparent: bool) -> None:
    """The background, and the picture on it, pixel for pixel."""
    figure.patch.set_facecolor(DARK_BACKGROUND if dark else LIGHT_BACKGROUND)
    figure.patch.set_alpha(0.0 if transparent else 1.0)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(figure.grains_only, extent=figure.window, origin="lower", aspect="auto", interpolation="none")
    axes.set(xlim=figure.window[:2], ylim=figure.window[2:])
    axes.set_axis_off()


def _write(figure: Still, frame: Any, keys: list[ColourKey], field: np.ndarray | None, dark: bool) -> None:
    """Caption, keys, scale bar and directions; letters grow with the picture."""
    ink, faint = (TEXT_ON_DARK, MUTED_ON_DARK) if dark else (TEXT_COLOUR, MUTED)
    width, height = figure.get_size_inches() * DPI
    grow = float(min(width / 1600.0, height / 1000.0))
    axes = figure.axes[0]
    caption = headline(frame, frame.box, frame.time).split(",  ")
    figure.text(0.022, 0.962, caption[-1], size=13.0 * grow, weight="bold", color=ink, va="center")
    figure.text(0.022, 0.922, ",  ".join(caption[:-1]), size=8.5 * grow, color=faint, va="center")
    draw_colour_keys(figure, keys, grow, ink)
    draw_directions(figure, figure.rotation, field, grow, faint, ink)
    draw_scale_bar(axes, 0.16, ink, 0.03, 1.2 * grow)
