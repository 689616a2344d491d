"""Figure of impacts on chains: the grains before and after, and maps of the resulting shapes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch

from .run_figure import DPI, RunFigure
from .style import plot_style

COLOURS = {
    "T": "#D55E00",
    "branched": "#E69F00",
    "bent": "#0072B2",
    "straight": "#56B4E9",
    "ring": "#CC79A7",
    "broken": "#444444",
    "gone": "#DDDDDD",
}


class Map(NamedTuple):
    """Resulting shapes for one material and contact law."""

    title: str
    speeds: Sequence[float]  # impact speeds [m/s]
    places: Sequence[float]  # impact positions along the chain, from the end grain [grain radii]
    names: np.ndarray  # (speeds, places) names of shapes, keys of COLOURS


class Picture(NamedTuple):
    """Grains to be drawn, as seen along z."""

    title: str
    position: np.ndarray  # (N, 3) [m], the projectile last
    radius: float  # [m]


def chain_figure(pictures: Sequence[Picture], maps: Sequence[Map]) -> Figure:
    """Figure with pictures in the upper row, maps in the lower row, and one legend for all maps."""
    with plot_style():
        figure = RunFigure(figsize=(3.2 * max(len(maps), len(pictures)), 5.6), dpi=DPI, layout="constrained")
        upper, lower = np.atleast_1d(figure.subfigures(2, 1, height_ratios=(1.0, 1.35)))  # type: ignore[arg-type]
        for axes, picture in zip(np.atleast_1d(upper.subplots(1, len(pictures))), pictures, strict=True):
            _draw_grains(axes, picture)
        for axes, shape_map in zip(np.atleast_1d(lower.subplots(1, len(maps))), maps, strict=True):
            _draw_map(axes, shape_map)
        used = {str(name) for shape_map in maps for name in np.unique(shape_map.names)}
        handles = [Patch(color=colour, label=name) for name, colour in COLOURS.items() if name in used]
        lower.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def _draw_grains(axes: Axes, picture: Picture) -> None:
    x = picture.position / picture.radius
    x = x - x[:-1].mean(axis=0)
    for k in np.argsort(x[:, 2]):
        colour = "#D55E00" if k == len(x) - 1 else "#0072B2" if k == len(x) - 2 else "#9FB7C9"
        axes.add_patch(Circle((x[k, 0], x[k, 1]), 1.0, facecolor=colour, edgecolor="white", linewidth=0.6))
    low, high = x.min(axis=0) - 2, x.max(axis=0) + 2
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set_axis_off()
    axes.set_title(picture.title, size=8)


def _draw_map(axes: Axes, shape_map: Map) -> None:
    order = list(COLOURS)
    numbers = np.vectorize(order.index)(shape_map.names)
    colours: Any = ListedColormap(list(COLOURS.values()))
    axes.pcolormesh(
        np.asarray(shape_map.places),
        np.arange(len(shape_map.speeds)),
        numbers,
        cmap=colours,
        norm=BoundaryNorm(np.arange(len(order) + 1) - 0.5, len(order)),
        shading="nearest",
    )
    axes.set_yticks(np.arange(len(shape_map.speeds)), [f"{v:g}" for v in shape_map.speeds])
    axes.set(xlabel="impact position (radii from the end grain)", ylabel="speed (m/s)")
    axes.set_title(shape_map.title, size=8)
