"""What is written round a still picture: keys to its colours, directions of the axes and of the field."""

from __future__ import annotations

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from ..palettes import SEQUENTIAL
from ..style import BLUE
from .colouring import ColourKey

COLUMN = 0.865
"""Left edge of the keys, as a share of the width."""


def draw_colour_keys(figure: Figure, keys: list[ColourKey], grow: float, ink: str) -> None:
    """Keys above each other on the right: a bar with its range and unit, or a swatch for each kind."""
    top = 0.87
    for key in keys:
        lines = _wrapped(key.title)
        figure.text(COLUMN, top, lines, size=8.5 * grow, weight="bold", color=ink, va="top", linespacing=1.25)
        top -= 0.034 * (lines.count("\n") + 1) + 0.012
        if key.swatches:
            top = _swatches(figure, key, top, grow, ink) - 0.045
        else:
            top = _bar(figure, key, top, 0.30 if len(keys) == 1 else 0.21, grow, ink) - 0.045


def _wrapped(title: str, wide: int = 18) -> str:
    lines = [""]
    for word in title.split(" "):
        if lines[-1] and len(lines[-1]) + len(word) >= wide:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join(lines)


def _swatches(figure: Figure, key: ColourKey, top: float, grow: float, ink: str) -> float:
    width, height = figure.get_size_inches()
    for k, (text, colour) in enumerate(key.swatches):
        y = top - 0.036 * k - 0.018
        if np.isfinite(colour).all():
            axes = figure.add_axes((COLUMN, y - 0.011, 0.022 * height / width, 0.022), label=f"swatch {text}")
            axes.set(xlim=(-1.05, 1.05), ylim=(-1.05, 1.05))
            axes.set_axis_off()
            axes.fill(*(f(np.linspace(0.0, 2.0 * np.pi, 60)) for f in (np.cos, np.sin)), color=colour, linewidth=0.0)
        figure.text(COLUMN + 0.034 * height / width, y, text, size=8.0 * grow, color=ink, va="center_baseline")
    return top - 0.036 * len(key.swatches)


def _bar(figure: Figure, key: ColourKey, top: float, tall: float, grow: float, ink: str) -> float:
    axes = figure.add_axes((COLUMN, top - tall, 0.013, tall), label="bar")
    norm = (LogNorm if key.log else Normalize)(key.low, key.high)
    bar = figure.colorbar(ScalarMappable(norm, key.map or SEQUENTIAL), cax=axes)
    bar.outline.set_visible(False)
    bar.locator = LogLocator(subs=(1.0, 2.0, 5.0), numticks=8) if key.log else MaxNLocator(6)
    bar.formatter = FuncFormatter(lambda value, _: f"{value:.4g}".replace("-", "−"))
    bar.update_ticks()
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(
        labelsize=8.0 * grow, colors=ink, width=0.7 * grow, length=3.0 * grow, pad=3.0 * grow, which="both"
    )
    return top - tall


def draw_directions(
    figure: Figure, rotation: np.ndarray, field: np.ndarray | None, grow: float, faint: str, ink: str
) -> None:
    """x, y and z as a small cross in the lower left corner, and the outside field as an arrow."""
    width, height = figure.get_size_inches()
    tall = 0.13
    axes = figure.add_axes((0.012, 0.015, tall * height / width, tall), label="directions")
    axes.set(xlim=(-1.6, 1.6), ylim=(-1.6, 1.6))
    axes.set_axis_off()
    for name, step in zip("xyz", rotation[:2].T, strict=True):
        if np.hypot(*step) > 0.05:
            axes.plot([0.0, step[0]], [0.0, step[1]], color=faint, linewidth=1.1 * grow)
            far = step * (1.0 + 0.32 / np.hypot(*step))
            axes.text(far[0], far[1], name, color=faint, size=8.0 * grow, ha="center", va="center")
    if field is not None and np.linalg.norm(field) > 0.0:
        flat = (rotation @ field)[:2] / np.linalg.norm(field)
        colour = BLUE if ink.startswith("#2") else "#7CC4F5"
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6 * grow, "mutation_scale": 9.0 * grow}
        axes.annotate("", tuple(1.15 * flat), tuple(-0.0 * flat), arrowprops={**style, "shrinkA": 0.0, "shrinkB": 0.0})
        far = flat * (1.15 + 0.3 / max(float(np.hypot(*flat)), 0.3))
        axes.text(far[0], far[1], "B", color=colour, size=8.5 * grow, ha="center", va="center", weight="bold")
