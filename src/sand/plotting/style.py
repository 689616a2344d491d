"""Style of all figures: matplotlib settings, colours that colour-blind readers can tell apart, SI prefixes."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from itertools import cycle
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter, StrMethodFormatter

from .figure_format import FONT_SIZE, settings_of_style

BLUE, RED, GREEN, PURPLE, ORANGE, SKY, YELLOW = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#B8579A",
    "#E69F00",
    "#56B4E9",
    "#D9C400",
)
"""After Okabe & Ito (2008): distinct for colour-blind readers."""
BROWN, INDIGO, PLUM = "#8A4B08", "#4B4FA8", "#601860"
"""Further colours of lines."""
MARKERS = "osD^vP*X<>"
"""Markers of lines."""
LARGEST_COLOURS = (RED, BLUE, GREEN, ORANGE, PURPLE, SKY, YELLOW)
"""Colours of the largest clusters, largest first."""
LINE_COLOURS = (*LARGEST_COLOURS, INDIGO, BROWN, PLUM)
"""Colours of lines, one for each marker."""
OTHER_COLOURS = ("#8C6BB1", "#A6761D", "#66A182", "#6F8FB8", "#C58B8B", "#9A9A4A", "#5E9EA0")
"""Colours of all other clusters, used cyclically."""
SINGLE_COLOUR = "#B9BDC3"
"""Colour of grains without a contact."""
TEXT_COLOUR, MUTED = "#22262B", "#7A828C"
"""Colours of text and axes, and of notes and guide lines."""
LIGHT_BACKGROUND, DARK_BACKGROUND, TEXT_ON_DARK, MUTED_ON_DARK = "#FFFFFF", "#101418", "#E9ECEF", "#98A2AD"
LOOKS = {
    "undecided": (TEXT_COLOUR, "$?$"),
    "miss": (MUTED, "x"),
    "bouncing": (ORANGE, "s"),
    "sticking": (BLUE, "o"),
    "restructuring": (SKY, "P"),
    "mass transfer": (GREEN, "^"),
    "erosion": (PURPLE, "v"),
    "fragmentation": (RED, "D"),
}
"""Colour and marker of each kind of outcome of a collision, in this order."""
LOOKS |= {"bounce": LOOKS["bouncing"], "stick": LOOKS["sticking"], "fragment": LOOKS["fragmentation"]}
ON_DARK = {
    BLUE: "#5AA9E6",
    RED: "#F08A4B",
    GREEN: "#3CC9A0",
    PURPLE: "#D98CC0",
    ORANGE: "#F0B94A",
    SKY: "#8FD0F2",
    YELLOW: "#E8DA4F",
    BROWN: "#C98B4E",
    INDIGO: "#8F93E0",
    PLUM: "#8C5CD6",
    TEXT_COLOUR: TEXT_ON_DARK,
    MUTED: MUTED_ON_DARK,
}
"""Line colours for dark backgrounds, by the colour for light ones."""

_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": FONT_SIZE,
    "text.color": TEXT_COLOUR,
    "axes.labelcolor": TEXT_COLOUR,
    "axes.edgecolor": TEXT_COLOUR,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.facecolor": "none",
    "savefig.facecolor": "white",
    "lines.linewidth": 1.3,
    "lines.solid_capstyle": "round",
    "xtick.color": TEXT_COLOUR,
    "ytick.color": TEXT_COLOUR,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "xtick.minor.width": 0.5,
    "ytick.minor.width": 0.5,
    "legend.frameon": False,
}
_SIZES = {"axes.labelsize": 8.0, "xtick.labelsize": 7.5, "ytick.labelsize": 7.5, "legend.fontsize": 7.5}
"""Font sizes [points] at the font size `FONT_SIZE`."""

_PREFIX = dict(
    zip(range(-24, 16, 3), ("y", "z", "a", "f", "p", "n", "µ", "m", "", "k", "M", "G", "T", "P"), strict=True)
)
_TAKES_PREFIX = re.compile(r"(?!kg\b|count\b)[^\W\d]+(?![\w^²³-])")
"""Units whose prefix multiplies the whole unit, unlike that of m^2 or kg."""
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def plot_style() -> AbstractContextManager[None]:
    """Context manager that sets the SAND style, with that of `figure_format`, and restores the user's on exit."""
    # Without the backend: to set one would start it.
    defaults = {k: v for k, v in matplotlib.rcParamsDefault.items() if not k.startswith(("backend", "interactive"))}
    chosen = settings_of_style()
    scale = float(chosen.get("font.size", FONT_SIZE)) / FONT_SIZE
    sizes = {name: scale * size for name, size in _SIZES.items()}
    return matplotlib.rc_context({**defaults, **_STYLE, **sizes, **chosen})


def points(size: float) -> float:
    """Font size [points] that is `size` at the default `FONT_SIZE`, and follows `font.size` of a style."""
    return size * float(matplotlib.rcParams["font.size"]) / FONT_SIZE


def looks_of(words: Iterable[Any]) -> dict[str, tuple[str, str]]:
    """Colour and marker of each word: those of `LOOKS`, in its order, and others in turn."""
    found = {str(word) for word in words}
    known = {word: look for word, look in LOOKS.items() if word in found}
    others = zip(cycle((BROWN, YELLOW, INDIGO, *OTHER_COLOURS)), cycle("*X<>8p"), strict=False)
    return known | dict(zip(sorted(found - known.keys()), others, strict=False))  # as many as there are words


class _Numbers(LogFormatter):
    """Labels as 0.4, where `LogFormatter` has 4e-01."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return f"{x:g}" if super().__call__(x, pos) else ""


def log_axis(axes: Axes, axis: str) -> None:
    """Make an axis, "x" or "y", logarithmic, with numbers in place of powers of ten."""
    getattr(axes, f"set_{axis}scale")("log")
    shown = getattr(axes, f"{axis}axis")
    shown.set_major_formatter(StrMethodFormatter("{x:g}"))
    shown.set_minor_formatter(_Numbers(minor_thresholds=(1.5, 0.5)))


def no_line(marker: str, colour: str) -> dict[str, Any]:
    """Settings of matplotlib for marks without a line."""
    return {"linestyle": "none", "marker": marker, "color": colour}


def si_prefix(largest: float, unit: str) -> tuple[float, str]:
    """Choose an SI prefix for a set of values.

    Parameters
    ----------
    largest : float
        Largest magnitude among the values [SI].
    unit : str
        Unit without prefix.

    Returns
    -------
    tuple of (float, str)
        Size of the prefixed unit in SI units, and its name; (1e-9, "nm") for 3e-7 m. A unit to which no prefix can be
        written has a power of ten: (1e-18, "10⁻¹⁸ m^2") for 3e-17 m^2.
    """
    if not (math.isfinite(largest) and largest > 0.0):
        return 1.0, unit
    exponent = 3 * math.floor(math.log10(largest) / 3 + 1e-9)
    if not _TAKES_PREFIX.match(unit):
        return float(f"1e{exponent}"), f"10{str(exponent).translate(_RAISED)} {unit}" if exponent else unit
    exponent = min(max(exponent, min(_PREFIX)), max(_PREFIX))
    return float(f"1e{exponent}"), _PREFIX[exponent] + unit


def format_si(value: float, unit: str) -> str:
    """Format a value with three digits and an SI prefix: 1.2e-6 m → '1.2 µm'."""
    size, name = si_prefix(abs(value), unit)
    return f"{value / size:.3g} {name}"


def format_number(value: float) -> str:
    """Format a pure number with two digits, three from 100 on: 6.7e-4 → '6.7×10⁻⁴', 31400 → '3.1×10⁴', 81.9 → '82'."""
    if value == 0.0 or not math.isfinite(value) or 0.01 <= abs(value) < 1e4:
        return f"{float(f'{value:.3g}' if abs(value) >= 99.5 else f'{value:.2g}'):g}"
    digits, exponent = f"{value:.1e}".split("e")
    return rf"{digits}$\times 10^{{{int(exponent)}}}$"


def legend_above(axes: Axes, lines: Sequence[Artist] = (), *, title: str = "") -> None:
    """Draw the legend of the axes, or of these lines, above the axes, where it covers no data.

    It has one row, or more if it would be wider than the axes; entries that look and read the same are drawn once.

    Parameters
    ----------
    lines : Sequence[Artist], optional
        What to list; everything that has a label by default.
    title : str, optional
        Text above the entries, at the left.
    """
    given: list[Any] = list(lines) or axes.get_legend_handles_labels()[0]
    handles = list({_look(one): one for one in given}.values())
    for columns in range(len(handles), 0, -1):
        legend = axes.legend(
            handles=handles,
            loc="lower right",
            bbox_to_anchor=(1.01, 1.0),
            ncols=columns,
            borderpad=0.1,
            borderaxespad=0.25,
            handlelength=1.3,
            handletextpad=0.5,
            columnspacing=1.1,
            title=title or None,
            title_fontsize=points(7.5),
            alignment="left",
        )
        if legend.get_window_extent().width <= axes.get_window_extent().width:
            return


def _look(handle: Any) -> tuple[str, str, object]:
    """What an entry of a legend reads, and what its line looks like; no two handles of another kind look the same."""
    if not hasattr(handle, "get_marker"):
        return handle.get_label(), "", id(handle)
    return handle.get_label(), str(handle.get_color()), f"{handle.get_marker()} {handle.get_linestyle()}"


def figure_title(figure: Figure, text: str, size: float = 8.0, **look: Any) -> None:
    """Draw a title at the left, in as many lines as the width of the figure needs; `size` in points as for `points`."""
    letters = int(72.0 * figure.get_size_inches()[0] / (0.5 * points(size)))
    kept = re.sub(r"\$[^$]*\$", lambda found: found[0].replace(" ", "\0"), text)  # formulas are not cut
    lines = [row for line in kept.split("\n") for row in textwrap.wrap(line, letters, break_long_words=False)]
    title = "\n".join(lines).replace("\0", " ")
    figure.suptitle(title, x=0.01, ha="left", fontsize=points(size), **look)


def panel_letter(axes: Axes, text: str, x: float) -> None:
    """Draw the letter of a panel at its top; `x` in units of the panel width."""
    axes.text(x, 1.0, text, transform=axes.transAxes, weight="bold", size=points(10.0), va="bottom", ha="left")


def round_length(at_most: float) -> float:
    """Largest 1, 2 or 5 times a power of ten that does not exceed `at_most`."""
    power = 10.0 ** math.floor(math.log10(at_most))
    return float(max(m for m in (1.0, 2.0, 5.0) if m * power <= at_most * (1.0 + 1e-9)) * power)


def rgb(colour: str) -> np.ndarray:
    """Red, green and blue (3,) from 0 to 1 of a colour '#rrggbb'."""
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
