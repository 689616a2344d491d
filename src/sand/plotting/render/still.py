"""Rendered image of a frame: grains, contacts, moments and box, with colour keys, scale bar and caption."""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from ...analysis.quantities import CONTACT_NAMES, GRAIN_NAMES, measured, quantity
from ...basics.arguments import checked
from ...basics.box import Box
from ...basics.errors import BadInput, did_you_mean, refuse_other, shown
from ...basics.units import in_unit, si_array
from ..figure_format import figure_format, format_width
from ..run_figure import DPI, RunFigure, figure_bytes, headline
from ..style import (
    DARK_BACKGROUND,
    LIGHT_BACKGROUND,
    MUTED,
    MUTED_ON_DARK,
    TEXT_COLOUR,
    TEXT_ON_DARK,
    plot_style,
    points,
    rgb,
)
from .colouring import ColourKey, coloured
from .legend import Share, draw_colour_keys, draw_directions
from .scene import Scene, camera_rotation, draw_scale_bar, fit_window, largest_clusters, make_scene, view_window
from .shading import Lighting
from .spheres import Rods, Spheres, render_spheres
from .vector import Outlines, draw_spheres

VIEWS: dict[str, tuple[float, float, float] | None] = {
    "iso": None,
    "front": (0.0, -1.0, 0.0),
    "top": (0.0, 0.0, 1.0),
    "side": (1.0, 0.0, 0.0),
}
"""Directions to the eye; None for the default of `scene.camera_rotation`."""
MIN_SIZE, MAX_SIZE = 200, 8000
"""Allowed width and height [pixels]."""
EDGE_WIDTH = 0.7
"""Width of the edges of the box [points] in outlines."""
EDGE_WIDTH = 0.7
"""Width of the edges of the box [points], drawn as outlines."""
LEAST_DPI, MOST_DPI = 50, 1200
"""Allowed numbers of pixels per inch."""
LIGHTING_ON_LIGHT = Lighting(haze=0.26)
LIGHTING_ON_DARK = Lighting(ambient=0.64, key=0.66, specular=0.24, haze=0.45, background=tuple(rgb(DARK_BACKGROUND)))
CONTACT_RADIUS = 0.52
"""Radius of the cylinder that marks a contact, in radii of the smaller grain; its half length is 0.4 of that."""
MAX_FINE_GRAINS, MAX_FINE_PIXELS = 3000, 4_000_000
"""Up to these numbers of grains and of pixels, 9 samples per pixel are taken instead of 4."""
_VIEWPORT = (0.035, 0.155, 0.075, 0.095)
"""Space left, right, below and above the area for grains and box, relative to the image."""
DEFAULT_PIXELS, RATIO, NARROW_RATIO = (1600, 1000), 1.6, 1.1
"""Width and height [pixels], their ratio, and that of pictures so narrow that texts are enlarged."""
TEXT, LEAST_TEXT = 8.0, 6.0
"""Size of most texts [points] in a picture of 10 inches, and the least one in a picture of a given width."""


class Still(RunFigure):
    """Figure with the rendered image of a frame.

    Attributes
    ----------
    grains_only : ndarray
        (height, width, 4) rendered grains without annotations: red, green, blue and opacity from 0 to 1.
    window : tuple of float
        Left, right, bottom and top [m] of the whole image in the plane through the centre of the scene.
    rotation : ndarray
        (3, 3) rows: directions right, up and towards the eye.
    scene : Scene
        Grains drawn.
    """

    grains_only: np.ndarray
    window: tuple[float, float, float, float]
    rotation: np.ndarray
    scene: Scene

    def image(self) -> Image.Image:
        """The complete image with annotations, as a Pillow image."""
        return Image.open(io.BytesIO(figure_bytes(self)))


@checked
def still_picture(
    frame: Any,
    *,
    colour: str = "cluster",
    bonds: str | None = None,
    arrows: bool = True,
    view: str | Sequence[float] = "iso",
    size: tuple[int, int] | None = None,
    width: str | None = None,
    style: str | Path | None = None,
    dpi: int = DPI,
    dark: bool = False,
    transparent: bool = False,
    vector: bool = False,
    whole: bool = True,
    cluster: int | None = None,
    perspective: bool = False,
    field: Sequence[float] | None = None,
    window: Sequence[float] | None = None,
) -> Still:
    """Render an image of a frame, without a browser or graphics card; equal input gives equal pixels.

    Parameters
    ----------
    frame : Frame
        Frame of a trajectory, or any object with its attributes.
    colour : str, optional
        Quantity shown as the colour of grains: a name in `analysis.quantities.GRAINS`, or of an own quantity.
    bonds : str, optional
        Mark contacts with colours by "load" or "mode" (`analysis.quantities.CONTACTS`); None: do not mark them.
    arrows : bool, optional
        Draw moments as arrows.
    view : str or sequence of float, optional
        "iso", "front", "top", "side", or the direction to the eye as three numbers.
    size : tuple of int, optional
        Width and height [pixels], each from 200 to 8000; by default 1600 × 1000, or in the width that is set.
    width, style : str, optional
        Printed width, such as "3.4in", and style of matplotlib, see `plotting.figure_format.figure_format`. With a
        width, texts have at least 6 points.
    dpi : int, optional
        Pixels per inch, from 50 to 1200, which set the printed size; texts and lines keep their share of the picture.
    dark : bool, optional
        Dark background.
    transparent : bool, optional
        Transparent background.
    vector : bool, optional
        Draw outlines that stay sharp at any size, without shadows, for `savefig` as PDF or SVG.
    whole : bool, optional
        Unwrap clusters across periodic boundaries; a percolating one is drawn inside the box in any case.
    cluster : int, optional
        Draw one cluster only, by rank; 1 is the largest.
    perspective : bool, optional
        Perspective projection; the default is parallel projection, in which lengths can be measured.
    field : sequence of float, optional
        (3,) external flux density [T], whose direction is shown.
    window : sequence of float, optional
        Left, right, bottom and top [m] of what has to be in view, in the plane through the centre of the scene, such as
        that of several pictures; by default the grains and the box.

    Returns
    -------
    Still
        The image; with `vector`, `grains_only` is empty.

    Raises
    ------
    BadInput
        With one line for each error.
    """
    refuse_other(frame, "radius", "pair", "box")
    with figure_format(width, style):
        pixels, share = _pixels(size, width, dpi)
        towards_eye = check_picture_options(colour, bonds, view, pixels, dpi, frame)
    flux_density = None if field is None else si_array(field, "T", "field")
    if flux_density is not None and (flux_density.shape != (3,) or not np.isfinite(flux_density).all()):
        raise BadInput(f"field = {shown(field)} must be three finite numbers [T]")
    scene = make_scene(frame, frame.pair, frame.box, whole)
    scene, key = _coloured_scene(scene, frame, colour, flux_density, arrows)
    if cluster is not None:
        scene = _single_cluster(scene, cluster)
        if colour == "cluster":
            key = ColourKey("cluster", ((f"{len(scene.radius)} of {len(frame)} grains", scene.colour[0]),))
    if not len(scene.radius):
        raise BadInput("there is no grain with a finite position to draw")
    contacts, fronts, contact_key = _contact_rods(scene, frame, bonds)
    rotation = camera_rotation(towards_eye)
    keys = [each for each in (key, contact_key) if each is not None]
    with figure_format(width, style), plot_style():
        figure = Still(figsize=(pixels[0] / dpi, pixels[1] / dpi), dpi=dpi)
        figure.scene, figure.rotation, figure.pixels_per_inch = scene, rotation, dpi
        place = _place(figure, pixels, share, perspective, window)
        _draw_background(figure, dark, transparent)
        (_draw_outlines if vector else _draw)(figure, (contacts, fronts), pixels, dark, place)
        _annotate(figure, frame, keys, flux_density, dark, share)
    return figure


def _pixels(size: tuple[int, int] | None, width: str | None, dpi: int) -> tuple[tuple[int, int], Share]:
    """Width and height [pixels], and how much more of them texts take than in proportion to them.  Raises BadInput."""
    if size is not None and width is not None:
        raise BadInput("size and width both set the size of the picture; leave one of them out")
    printed = format_width() if size is None else None
    if printed is None:
        return size or DEFAULT_PIXELS, (1.0, 1.0)
    own = printed / (DEFAULT_PIXELS[0] / DPI)
    share = max(LEAST_TEXT / (TEXT * own), 1.0)
    ratio = RATIO if share == 1.0 else NARROW_RATIO
    return (round(printed * dpi), round(printed * dpi / ratio)), (share, share * ratio / RATIO)


def _checked_window(window: Sequence[float]) -> tuple[float, float, float, float]:
    """Left, right, bottom and top [m].  Raises BadInput."""
    bounds = si_array(window, "m", "window")
    if bounds.shape != (4,) or not np.isfinite(bounds).all() or bounds[1] <= bounds[0] or bounds[3] <= bounds[2]:
        raise BadInput(f"window = {shown(window)} must be left < right and bottom < top [m], four finite numbers")
    left, right, bottom, top = map(float, bounds)
    return left, right, bottom, top


def check_picture_options(
    colour: str,
    bonds: str | None,
    view: str | Sequence[float],
    size: tuple[int, int],
    dpi: int = DPI,
    frame: Any = None,
) -> np.ndarray | None:
    """Check the options of `still_picture`; `frame` has the names of own quantities.

    Returns
    -------
    ndarray or None
        (3,) direction to the eye; None for the default.

    Raises
    ------
    BadInput
        With one line for each error.
    """
    problems: list[str] = []
    for name, allowed, of in ((colour, GRAIN_NAMES, frame), (bonds, CONTACT_NAMES, None)):
        if name is not None:
            try:
                quantity(name, allowed, of)
            except BadInput as error:
                problems += error.problems
    width, height = tuple(size)
    if not all(isinstance(v, (int, np.integer)) and MIN_SIZE <= v <= MAX_SIZE for v in (width, height)):
        problems.append(
            f"size {shown(width)}x{shown(height)}: width and height must be from {MIN_SIZE} to {MAX_SIZE} pixels"
        )
    if not LEAST_DPI <= dpi <= MOST_DPI:
        problems.append(f"dpi {dpi}: pixels per inch must be from {LEAST_DPI} to {MOST_DPI}")
    direction: Any = VIEWS.get(view) if isinstance(view, str) else view
    if isinstance(view, str) and view not in VIEWS:
        try:
            direction = [float(part) for part in view.split(",")]
        except ValueError:
            problems.append(
                f"there is no view '{view}'; {did_you_mean(view, tuple(VIEWS))} (or three numbers: '1,-2,0.5')"
            )
    if direction is not None:
        direction = in_unit(direction, "1")
        if np.shape(direction) != (3,) or not 0.0 < np.linalg.norm(direction) < 1e9:
            problems.append(f"view {shown(view)}: the direction to the eye must be three finite numbers, not all 0")
    if problems:
        raise BadInput(problems)
    return None if direction is None else np.asarray(direction)


def _coloured_scene(
    scene: Scene, frame: Any, name: str, field: np.ndarray | None, arrows: bool
) -> tuple[Scene, ColourKey | None]:
    """Scene with grains coloured by a quantity, and the colour key."""
    values = measured(frame, name, field)[scene.number]
    colours, key = coloured(values, quantity(name, frame=frame), frame, scene.label)
    shown = scene.arrow if arrows else np.zeros_like(scene.arrow)
    return dataclasses.replace(scene, colour=colours, arrow=shown), key


def _single_cluster(scene: Scene, rank: int) -> Scene:
    """Scene with the cluster of a rank only, in open space."""
    clusters = largest_clusters(scene.label)
    if not 1 <= rank <= len(clusters):
        raise BadInput(f"cluster {rank}: there are {len(clusters)} clusters of two grains or more; 1 is the largest")
    members = scene.label == clusters[rank - 1]
    arrays = {name: getattr(scene, name)[members] for name in ("position", "radius", "colour", "arrow", "number")}
    return dataclasses.replace(scene, **arrays, label=np.zeros(members.sum(), int), box=Box.open())


def _contact_rods(scene: Scene, frame: Any, name: str | None) -> tuple[Rods, np.ndarray, ColourKey | None]:
    """Short cylinders [m] at contacts, laboratory frame; two where a periodic boundary separates the grains.

    Also the grains (M, 2) of the scene beside each of them, and the colour key.
    """
    index = np.full(len(frame.radius), -1)
    index[scene.number] = np.arange(len(scene.number))
    pair = index[np.asarray(frame.pair, dtype=np.int64).reshape(-1, 2)]
    shown = (pair >= 0).all(axis=1)
    if name is None or not shown.any():
        none = _cylinders(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)))
        return none, np.zeros((0, 2), int), None
    values = measured(frame, name)[shown]
    colours, key = coloured(values, quantity(name, CONTACT_NAMES), frame, scene.label)
    i, j = pair[shown].T
    offset = frame.box.nearest(scene.position[j] - scene.position[i])
    distance = np.linalg.norm(offset, axis=1, keepdims=True)
    radius = CONTACT_RADIUS * np.minimum(scene.radius[i], scene.radius[j])
    half = 0.4 * radius[:, None] * offset / np.maximum(distance, 1e-300)
    share = contact_share(distance[:, 0], scene.radius[i], scene.radius[j])[:, None]
    first, second = scene.position[i] + share * offset, scene.position[j] - (1.0 - share) * offset
    separated = np.linalg.norm(first - second, axis=1) > 1e-6 * distance[:, 0]
    centre = np.concatenate([first, second[separated]])
    beside = np.concatenate([np.column_stack([i, np.where(separated, i, j)]), np.column_stack([j, j])[separated]])
    half, radius, colours = (np.concatenate([each, each[separated]]) for each in (half, radius, colours))
    return _cylinders(centre - half, centre + half, radius, colours), beside, key


def contact_share(distance: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Share of the way between two centres at which their spheres intersect, (d² + r² − s²) / (2 d²), from 0 to 1.

    Parameters
    ----------
    distance : ndarray
        Distances d (C,) [m].
    first, second : ndarray
        Radii r and s (C,) [m]; the share is measured from the centre of the first grain.
    """
    squared = np.maximum(distance, 1e-300) ** 2
    return np.clip(0.5 + 0.5 * (first**2 - second**2) / np.maximum(squared, 1e-300), 0.0, 1.0)


def _cylinders(
    start: np.ndarray, end: np.ndarray, radius: np.ndarray, colour: np.ndarray, shading: float = 1.0
) -> Rods:
    return Rods(start, end, np.column_stack([radius, radius]), colour, np.full(len(start), shading))


class _Place(NamedTuple):
    """Where the grains are drawn: spheres before the plane z = 0, turned, and what is seen of them."""

    spheres: Spheres
    shift: np.ndarray  # of what is turned, the middle of its depths [m]
    eye: float | None
    pixel: float  # [m]


def _place(
    figure: Still,
    size: tuple[int, int],
    share: Share,
    perspective: bool,
    window: Sequence[float] | None,
) -> _Place:
    """Set the window of the picture, with space for keys and caption, which are larger by `share`."""
    scene, rotation = figure.scene, figure.rotation
    left, bottom = _VIEWPORT[0], _VIEWPORT[2]
    right, top = 1.0 - _VIEWPORT[1] * share[0], 1.0 - _VIEWPORT[3] * share[1]
    aspect = size[0] * (right - left) / (size[1] * (top - bottom))
    if window is None:
        x0, x1, y0, y1 = view_window(scene, aspect, 0.03, rotation)
    else:
        x0, x1, y0, y1 = fit_window(_checked_window(window), aspect, 0.03)
    spheres = scene.projected(rotation)
    depth = float(spheres.centre[:, 2].min() + spheres.centre[:, 2].max()) / 2
    eye = 2.6 * float(np.hypot(x1 - x0, np.ptp(spheres.centre[:, 2]))) if perspective else None
    if eye is not None:  # enlarge the window by the magnification of the nearest grain
        zoom = 1.0 / (1.0 - (float((spheres.centre[:, 2] + spheres.radius).max()) - depth) / eye)
        x0, x1 = (x0 + x1) / 2 - zoom * (x1 - x0) / 2, (x0 + x1) / 2 + zoom * (x1 - x0) / 2
        y0, y1 = (y0 + y1) / 2 - zoom * (y1 - y0) / 2, (y0 + y1) / 2 + zoom * (y1 - y0) / 2
    pixel = (x1 - x0) / ((right - left) * size[0])
    x0, y0 = x0 - left * size[0] * pixel, y0 - bottom * size[1] * pixel
    figure.window = (x0, x0 + pixel * size[0], y0, y0 + pixel * size[1])
    shift = np.array([0.0, 0.0, depth])
    return _Place(dataclasses.replace(spheres, centre=spheres.centre - shift), shift, eye, pixel)


def _draw(figure: Still, contacts: tuple[Rods, np.ndarray], size: tuple[int, int], dark: bool, place: _Place) -> None:
    """Render grains, contacts and the edges of the box, and draw the image, pixel by pixel."""
    scene, spheres = figure.scene, place.spheres
    edges = np.array([(a, b) for a, b, _, _ in scene.edges()]).reshape(-1, 2, 3)
    colour = np.tile(_edge_colour(dark), (len(edges), 1))
    box = _cylinders(edges[:, 0], edges[:, 1], np.full(len(edges), 0.75 * place.pixel), colour, 0.0)
    figure.grains_only = render_spheres(
        spheres,
        figure.window,
        *size,
        rods=_turned(Rods.joined(contacts[0], box), figure, place),
        eye=place.eye,
        lighting=LIGHTING_ON_DARK if dark else LIGHTING_ON_LIGHT,
        supersampling=3 if len(spheres.radius) <= MAX_FINE_GRAINS and size[0] * size[1] <= MAX_FINE_PIXELS else 2,
    )
    window = figure.window
    figure.axes[0].imshow(figure.grains_only, extent=window, origin="lower", aspect="auto", interpolation="none")
    figure.axes[0].set(xlim=window[:2], ylim=window[2:])


def _draw_outlines(
    figure: Still, contacts: tuple[Rods, np.ndarray], size: tuple[int, int], dark: bool, place: _Place
) -> None:
    """Draw grains, contacts and the edges of the box as filled outlines."""
    left, right, bottom, top = figure.window
    figure.grains_only = np.zeros((0, 0, 4))
    edges = np.array([(a, b) for a, b, _, _ in figure.scene.edges()]).reshape(-1, 2, 3)
    line = 0.5 * EDGE_WIDTH / 72.0 / float(figure.get_size_inches()[0]) * (right - left)
    outlines = Outlines(np.array([(left + right) / 2, (bottom + top) / 2]), place.eye)
    rods, beside = contacts
    draw_spheres(
        outlines,
        place.spheres,
        (_turned(rods, figure, place), beside),
        (edges @ figure.rotation.T - place.shift, line, _edge_colour(dark)),
        LIGHTING_ON_DARK if dark else LIGHTING_ON_LIGHT,
    )
    figure.axes[0].set(xlim=figure.window[:2], ylim=figure.window[2:])
    outlines.draw(figure.axes[0])


def _turned(rods: Rods, figure: Still, place: _Place) -> Rods:
    """Rods in the coordinates of the spheres of a place."""
    turn = figure.rotation.T
    return dataclasses.replace(rods, start=rods.start @ turn - place.shift, end=rods.end @ turn - place.shift)


def _edge_colour(dark: bool) -> np.ndarray:
    return rgb(MUTED_ON_DARK if dark else MUTED)


def _draw_background(figure: Still, dark: bool, transparent: bool) -> None:
    """Draw the background, and make the axes, in which a unit is 1 m."""
    figure.patch.set_facecolor(DARK_BACKGROUND if dark else LIGHT_BACKGROUND)
    figure.patch.set_alpha(0.0 if transparent else 1.0)
    figure.add_axes((0.0, 0.0, 1.0, 1.0)).set_axis_off()


def _annotate(
    figure: Still, frame: Any, keys: list[ColourKey], field: np.ndarray | None, dark: bool, share: Share
) -> None:
    """Draw caption, colour keys, scale bar and directions, with font sizes in proportion to the image, × `share`."""
    text_colour, muted = (TEXT_ON_DARK, MUTED_ON_DARK) if dark else (TEXT_COLOUR, MUTED)
    width, height = figure.get_size_inches() * DPI  # points keep their share of the picture at any `dpi`
    scale = share[0] * width / 1600.0 if share[0] > 1.0 else float(min(width / 1600.0, height / 1000.0))
    axes = figure.axes[0]
    caption = headline(frame, frame.box, frame.time).split(",  ")
    figure.text(
        0.022,
        1.0 - 0.038 * share[1],
        caption[-1],
        size=points(13.0 * scale),
        weight="bold",
        color=text_colour,
        va="center",
    )
    figure.text(
        0.022, 1.0 - 0.078 * share[1], ",  ".join(caption[:-1]), size=points(8.5 * scale), color=muted, va="center"
    )
    draw_colour_keys(figure, keys, scale, text_colour, share)
    draw_directions(figure, figure.rotation, field, scale, muted, dark)
    draw_scale_bar(axes, 0.16, text_colour, 0.03, 1.2 * scale)
