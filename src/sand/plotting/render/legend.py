"""Annotations of a rendered image: colour keys, and directions of the axes and the field."""

from __future__ import annotations

import textwrap

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from ..palettes import SEQUENTIAL
from ..style import BLUE, points
from .colouring import ColourKey

Share = tuple[float, float]
COLUMN = 0.135
"""Width of the colour keys, relative to that of the figure."""


def draw_colour_keys(figure: Figure, keys: list[ColourKey], scale: float, colour: str, share: Share) -> None:
    """Draw colour keys below each other on the right, as colour bars or as swatches with labels.

    `share` is how much more of width and height of the picture they take than in proportion to it.
    """
    top, left = 1.0 - 0.13 * share[1], 1.0 - COLUMN * share[0]
    for key in keys:
        lines = textwrap.fill(key.title, 18, break_long_words=False, break_on_hyphens=False)
        figure.text(left, top, lines, size=points(8.5 * scale), weight="bold", color=colour, va="top", linespacing=1.25)
        top -= share[1] * (0.034 * (lines.count("\n") + 1) + 0.012)
        if key.swatches:
            top = _swatches(figure, key, (left, top), scale, colour, share[1]) - 0.045 * share[1]
        else:
            top = _bar(figure, key, (left, top), 0.30 if len(keys) == 1 else 0.21, scale, colour) - 0.045 * share[1]


def _swatches(
    figure: Figure, key: ColourKey, at: tuple[float, float], scale: float, colour: str, share: float
) -> float:
    left, top = at
    width, height = figure.get_size_inches()
    for k, (text, swatch) in enumerate(key.swatches):
        y = top - share * (0.036 * k + 0.018)
        if np.isfinite(swatch).all():
            axes = figure.add_axes(
                (left, y - 0.011 * share, 0.022 * share * height / width, 0.022 * share), label=f"swatch {text}"
            )
            axes.set(xlim=(-1.05, 1.05), ylim=(-1.05, 1.05))
            axes.set_axis_off()
            axes.fill(*(f(np.linspace(0.0, 2.0 * np.pi, 60)) for f in (np.cos, np.sin)), color=swatch, linewidth=0.0)
        figure.text(
            left + 0.034 * share * height / width, y, text, size=points(8.0 * scale), color=colour, va="center_baseline"
        )
    return top - 0.036 * share * len(key.swatches)


def _bar(figure: Figure, key: ColourKey, at: tuple[float, float], height: float, scale: float, colour: str) -> float:
    left, top = at
    axes = figure.add_axes((left, top - height, 0.013, height), label="bar")
    norm = (LogNorm if key.log else Normalize)(key.low, key.high)
    bar = figure.colorbar(ScalarMappable(norm, key.map or SEQUENTIAL), cax=axes)
    bar.outline.set_visible(False)
    bar.locator = LogLocator(subs=(1.0, 2.0, 5.0), numticks=8) if key.log else MaxNLocator(6)
    bar.formatter = FuncFormatter(lambda value, _: f"{value:.4g}".replace("-", "−"))
    bar.update_ticks()
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(
        labelsize=points(8.0 * scale),
        colors=colour,
        width=0.7 * scale,
        length=3.0 * scale,
        pad=3.0 * scale,
        which="both",
    )
    return top - height


def draw_directions(
    figure: Figure, rotation: np.ndarray, field: np.ndarray | None, scale: float, axes_colour: str, dark: bool
) -> None:
    """Draw the axes x, y and z in the lower left corner, and the external field as an arrow."""
    width, height = figure.get_size_inches()
    size = 0.13
    axes = figure.add_axes((0.012, 0.015, size * height / width, size), label="directions")
    axes.set(xlim=(-1.6, 1.6), ylim=(-1.6, 1.6))
    axes.set_axis_off()
    for name, step in zip("xyz", rotation[:2].T, strict=True):
        if np.hypot(*step) > 0.05:
            axes.plot([0.0, step[0]], [0.0, step[1]], color=axes_colour, linewidth=1.1 * scale)
            end = step * (1.0 + 0.32 / np.hypot(*step))
            axes.text(end[0], end[1], name, color=axes_colour, size=points(8.0 * scale), ha="center", va="center")
    if field is not None and np.linalg.norm(field) > 0.0:
        flat = (rotation @ field)[:2] / np.linalg.norm(field)
        colour = "#7CC4F5" if dark else BLUE
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6 * scale, "mutation_scale": 9.0 * scale}
        axes.annotate("", tuple(1.15 * flat), (0.0, 0.0), arrowprops={**style, "shrinkA": 0.0, "shrinkB": 0.0})
        end = flat * (1.15 + 0.3 / max(float(np.hypot(*flat)), 0.3))
        axes.text(end[0], end[1], "B", color=colour, size=points(8.5 * scale), ha="center", va="center", weight="bold")
