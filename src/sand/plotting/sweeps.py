"""Figures of a sweep: a result over the key with the most values, and the classes of runs, such as outcomes."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from itertools import cycle
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation

from ..basics.units import format_quantity
from .figure_format import figure_size, panel_grid
from .run_figure import DPI, RunFigure
from .style import LARGEST_COLOURS, MARKERS, OTHER_COLOURS, TEXT_COLOUR, log_axis, looks_of, no_line, plot_style, points

MOST_LINES, MOST_PANELS = 14, 9
"""Largest numbers of lines and panels: of more combinations of the other keys, the first ones are drawn."""
LEAST_ROWS = 3
"""Least number of values of a second key for a map over both."""
LOG_FROM = 15.0
"""Ratio of the largest to the smallest value from which on the axis may be logarithmic."""
MANY = 30
"""Number of values from which on keys with more values do not come before others."""
WIDTH_OF_MARKS = 0.65
"""Width of all marks at one point of a map, which is a pair of values of two keys, over the distance of two points."""
_NUMBER = re.compile(r"([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(.*)")

Table = Mapping[str, np.ndarray]


def sweep_figure(
    table: Table, keys: Sequence[str], what: str, units: Mapping[str, str] = MappingProxyType({}), title: str = ""
) -> Figure:
    """Figure of a column of the table of a sweep.

    A column of numbers is drawn as lines over the key with the most values: points are means over all runs with the
    same values of the keys, bars the standard errors of these means. A column of text, such as `outcome`, has a mark
    for each run over the two keys with the most values, or the share of each word over one key; combinations of the
    other keys have a line or a panel each.

    Parameters
    ----------
    table : mapping
        Columns by name, of runs that are done.
    keys : sequence of str
        Columns of keys that change.
    what : str
        The column.
    units : mapping of str to str, optional
        Units of columns of numbers that have one.
    title : str, optional
        Name of the sweep, before the numbers of runs and seeds.
    """
    number = {key: len(set(table[key].tolist())) for key in keys}
    ordered = sorted(keys, key=lambda key: -min(number[key], MANY))
    varied = [key for key in ordered if number[key] > 1] or [*keys, "seed"][:1]
    with plot_style():
        if table[what].dtype.kind not in "Ub":
            figure, left = _lines(
                _Values(table, varied[0], units), _combinations(table, varied[1:], units), table, what
            )
            figure.axes[0].set_ylabel(label(what, units))
        else:
            over = varied[: 2 if len(varied) > 1 and number[varied[1]] >= LEAST_ROWS else 1]
            groups = _combinations(table, varied[len(over) :], units)
            figure, left = _classes([_Values(table, key, units) for key in over], groups, table, what)
        runs, seeds = len(table[what]), len(set(table["seed"].tolist()))
        counts = f"{runs} run{'s' * (runs != 1)}, {seeds} seed{'s' * (seeds != 1)}"
        lines = [*([f"{title}: {counts}"] if title else []), *left]
        figure.suptitle("\n".join(lines), fontsize=points(7.5))
    return figure


def label(name: str, units: Mapping[str, str]) -> str:
    """A column in words, with its unit: 'impact speed (m/s)' for `impact.speed`."""
    parts = [part for part in name.split(".") if not part.isdigit()][-2:]
    words = parts[-1:] if parts[-1].startswith(parts[0]) else parts
    unit = f" ({units[name]})" if name in units else ""
    return " ".join(words).replace("_", " ") + unit


def _combinations(table: Table, keys: Sequence[str], units: Mapping[str, str]) -> np.ndarray:
    """The values of keys in each row, as text."""

    def shown(key: str, value: object) -> str:
        if not isinstance(value, float):
            return f"{label(key, {})} = {value}"
        return f"{label(key, {})} = {format_quantity(value, units[key]) if key in units else f'{value:.4g}'}"

    rows = zip(*(table[key].tolist() for key in keys), strict=True) if keys else [()] * len(next(iter(table.values())))
    return np.array([", ".join(map(shown, keys, row)) for row in rows])


def _lines(x: _Values, groups: np.ndarray, table: Table, what: str) -> tuple[Figure, list[str]]:
    """A line for each combination of the other keys, and what is left out."""
    figure = RunFigure(figsize=figure_size(6.5, 4.0), dpi=DPI, layout="constrained")
    axes = figure.subplots()
    names = list(dict.fromkeys(groups.tolist()))
    for name, colour, marker in zip(
        names[:MOST_LINES], cycle((*LARGEST_COLOURS, *OTHER_COLOURS)), cycle(MARKERS), strict=False
    ):
        of = (groups == name) & np.isfinite(x.numbers)
        means = _means(x.numbers[of], table[what][of].astype(float))
        axes.errorbar(*means, fmt=f"{marker}-", color=colour, markersize=4.0, elinewidth=0.8, label=name)
    x.describe(axes, "x")
    if len(names) > 1:
        figure.legend(loc="outside right upper")
    return figure, _left_out(len(names), MOST_LINES)


def _classes(over: Sequence[_Values], groups: np.ndarray, table: Table, what: str) -> tuple[Figure, list[str]]:
    """A panel for each combination of the other keys, a map or shares of words; what is left out."""
    looks = looks_of(table[what].tolist())
    names = list(dict.fromkeys(groups.tolist()))
    shown = names[:MOST_PANELS]
    rows, columns, size = panel_grid(
        len(shown), (4.6, 3.6) if len(shown) == 1 else (3.1, 2.7), 2 if len(shown) == 4 else 3, (1.5, 0.2)
    )
    figure = RunFigure(figsize=size, dpi=DPI, layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, name in zip(panels, shown, strict=False):
        draw = _draw_map if len(over) > 1 else _draw_shares
        draw(axes, over, groups == name, table[what].astype(str), looks)
        axes.set_title(name, fontsize=points(7.5), loc="left")
        if len(shown) == rows * columns:
            axes.label_outer()
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    marks = [Line2D([], [], **no_line(marker, colour), label=word) for word, (colour, marker) in looks.items()]
    figure.legend(handles=marks, loc="outside right upper", title=label(what, {}), alignment="left")
    return figure, _left_out(len(names), MOST_PANELS)


def _draw_map(
    axes: Axes, over: Sequence[_Values], chosen: np.ndarray, words: np.ndarray, looks: Mapping[str, tuple[str, str]]
) -> None:
    """A mark for each run at its values of two keys; marks of runs with the same values form a square."""
    pairs, index = np.unique([one.numbers[chosen] for one in over], axis=1, return_inverse=True)
    order = np.argsort(index.ravel(), kind="stable")
    rank = np.empty(len(order), int)
    rank[order] = np.arange(len(order)) - np.searchsorted(index.ravel()[order], index.ravel()[order])
    side = math.ceil(math.sqrt(rank.max(initial=0) + 1))
    size = np.array(axes.get_window_extent().size) * 72.0 / axes.figure.dpi
    spacing = min(length / len(set(one)) for length, one in zip(size, pairs.tolist(), strict=True))
    step = min(WIDTH_OF_MARKS * spacing / side, 6.0)
    for one, axis in zip(over, "xy", strict=True):
        one.describe(axes, axis)
    axes.margins(0.08)
    axes.plot(*(one.numbers for one in over), linestyle="none")  # its limits, those of all panels
    axes.autoscale_view()
    axes.set_autoscale_on(False)
    for k in range(side * side):
        right, up = (step / 72.0 * (part - 0.5 * (side - 1)) for part in (k % side, k // side))
        moved = axes.transData + ScaledTranslation(right, up, axes.figure.dpi_scale_trans)
        for word, (colour, marker) in looks.items():
            of = np.flatnonzero(chosen)[(rank == k) & (words[chosen] == word)]
            x, y = (one.numbers[of] for one in over)
            axes.plot(x, y, **no_line(marker, colour), markersize=_size(step, side), transform=moved)


def _size(step: float, side: int) -> float:
    """Size of marks [points] that do not cover each other."""
    return 5.0 if side == 1 else max(0.85 * step, 2.0)


def _draw_shares(
    axes: Axes, over: Sequence[_Values], chosen: np.ndarray, words: np.ndarray, looks: Mapping[str, tuple[str, str]]
) -> None:
    """Shares of the words at each value of a key, one above the other, each with its mark."""
    (x,) = over
    values, index = np.unique(x.numbers, return_inverse=True)
    number = np.maximum(np.bincount(index[chosen], minlength=len(values)), 1)
    bottom = np.zeros(len(values))
    for word, (colour, marker) in looks.items():
        share = np.bincount(index[chosen & (words == word)], minlength=len(values)) / number
        axes.bar(np.arange(len(values)), share, 0.8, bottom, color=colour, alpha=0.75, linewidth=0.0)
        of = share > 0.0
        axes.plot(np.flatnonzero(of), (bottom + 0.5 * share)[of], **no_line(marker, TEXT_COLOUR), markersize=3.5)
        bottom += share
    every = math.ceil(len(values) / 8)
    texts = [x.words[int(v)] if x.words else f"{v:.3g}" for v in values]
    axes.set_xticks(range(0, len(values), every), texts[::every])
    axes.set(xlabel=x.label, ylabel="share of the runs", ylim=(0.0, 1.0))


def _left_out(number: int, drawn: int) -> list[str]:
    """How many combinations of keys are drawn, if not all are."""
    return [f"the first {drawn} of {number} combinations of the other keys"] if number > drawn else []


def _means(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distinct x, the mean of y at each, and the standard error of this mean (0 for a single value)."""
    values, index, number = np.unique(x, return_inverse=True, return_counts=True)
    mean = np.bincount(index, y) / number
    spread = np.bincount(index, (y - mean[index]) ** 2)
    return values, mean, np.sqrt(spread / np.maximum(number - 1, 1) / number)


class _Values:
    """A column of keys as numbers: those of text, such as '0.5 b', with their unit, or the number of each word.

    Attributes
    ----------
    numbers : ndarray
        Of each row.
    words : list of str
        What the numbers stand for; empty if they are values.
    label : str
        The key in words, with its unit.
    """

    def __init__(self, table: Table, key: str, units: Mapping[str, str]):
        column, self.words, self.label = table[key], list[str](), label(key, {})
        if column.dtype.kind != "U":
            self.numbers, self.label = column.astype(float), label(key, units)
            return
        found = [_NUMBER.fullmatch(text) for text in column.tolist()]
        found_units = {match[2] for match in found if match}
        if None not in found and len(found_units) == 1:
            self.numbers = np.array([float(match[1]) for match in found if match])
            self.label += f" ({unit})" if (unit := found_units.pop()) else ""
        else:
            words, index = np.unique(column, return_inverse=True)
            self.words, self.numbers = words.tolist(), index.astype(float)

    def describe(self, axes: Axes, axis: str) -> None:
        """Label and scale of an axis."""
        getattr(axes, f"set_{axis}label")(self.label)
        if self.words:
            getattr(axes, f"set_{axis}ticks")(range(len(self.words)), self.words)
        elif self._is_logarithmic():
            log_axis(axes, axis)

    def _is_logarithmic(self) -> bool:
        """Whether the values are spread evenly in the logarithm rather than evenly."""
        values = np.unique(self.numbers)
        return bool(values[0] > 0.0 and values[-1] > LOG_FROM * values[0] and np.median(values) < values[-1] / 3.0)
