"""Figure of a run: clusters, energies, losses and energy balance over time, and an image of the grains."""

from __future__ import annotations

import io
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..analysis.quantities import material_names
from ..basics.box import Box
from ..io.run_folder import replace_file
from .figure_format import panel_grid
from .panels import (
    AxisUnit,
    draw_balance,
    draw_clusters,
    draw_contacts,
    draw_energies,
    draw_losses,
    draw_pressure,
    draw_temperatures,
    draw_time,
    energy_unit,
    has_few_bodies,
    has_temperatures,
    time_unit,
)
from .render.directions import UniformField, uniform_fields
from .render.scene import Scene, draw_largest, draw_scene, largest_clusters, make_scene, view_window
from .run_layout import DPI, Layout, layout_of
from .style import MUTED, RED, TEXT_COLOUR, format_si, panel_letter, plot_style, points

if TYPE_CHECKING:
    from ..simulation.simulation import Simulation

FEW_SIZES = 3
"""Radii up to which the title of a run names each with its number of grains."""
LETTERS = "abcdefgh"
"""Letters of the panels."""
LEAST_STRIP = 1.05
"""Least height of the picture of the largest clusters [inches]."""
MIN_GRAIN_RADIUS = 11.0
"""Radius of grains in the image [pixels] below which the largest clusters are also shown enlarged."""
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": "SAND"},
    "pdf": {"CreationDate": None, "Creator": "SAND", "Producer": "SAND"},
    "svg": {"Date": None, "Creator": "SAND"},
}
"""Metadata of files by format, without time stamps."""


_HEIGHTS, _HEIGHTS_WITH_MORE, _HEIGHT = (1.0, 1.35, 1.1), (1.0, 1.25, 1.0), 0.8
"""Heights of the first panels over time, relative to each other, and of each of more between them and the balance."""
_BALANCE = (0.5, 0.8)
"""Height of the balance without, and with more panels."""
_MARGIN = 0.012


class RunFigure(Figure):
    """A figure that notebooks display as PNG with any backend."""

    pixels_per_inch: float = DPI
    """Of its files; `dpi` is that of the window that shows it."""

    def _repr_png_(self) -> bytes:
        return figure_bytes(self)


def figure_with_panels(
    number: int,
    panel: tuple[float, float],
    columns: int = 4,
    more: tuple[float, float] = (0.0, 0.0),
    layout: Any = "constrained",
) -> tuple[RunFigure, list[Axes]]:
    """A figure of equal panels in the width that is set; parameters as for `panel_grid`."""
    rows, columns, size = panel_grid(number, panel, columns, more)
    figure = RunFigure(figsize=size, dpi=DPI, layout=layout)
    panels = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for unused in panels[number:]:
        unused.set_axis_off()
    return figure, panels[:number]


def run_figure(simulation: Simulation) -> Figure:
    """Figure of a run so far.

    Left, over time: clusters (Eq. 17), energies, losses by channel, the temperatures of the bodies of a run that began
    with ten or more, the pressure of a run with stress, and the energy balance. Right: the grains at the present time
    with their moments, coloured by cluster; if they are small, the largest clusters again, enlarged. Energies are in
    N k_B T₀, or in joules if the grains were initially at rest. Of one or two bodies, as in a collision, contacts take
    the place of clusters, and energies are in units of their kinetic energy at the start.

    The left half is empty if the ledger has no row, the right half if no position is finite.
    """
    scene = make_scene(simulation.grains, simulation.contacts["pair"], simulation.box)
    with plot_style():
        more = _more_panels(simulation.ledger)
        heights = (*(_HEIGHTS_WITH_MORE if more else _HEIGHTS), *[_HEIGHT] * len(more), _BALANCE[bool(more)])
        layout, lines = layout_of(heights, _header(simulation))
        figure = RunFigure(figsize=layout.size, dpi=DPI)
        for (text, size), height in zip(lines, layout.lines, strict=True):
            colour = {10.5: TEXT_COLOUR, 8.5: MUTED}.get(size, RED)
            weight = "bold" if colour == TEXT_COLOUR else "normal"
            figure.text(_MARGIN, height, text, size=points(size), color=colour, weight=weight, va="center")
        if simulation.ledger.rows:
            _draw_history(figure, simulation, layout, heights)
        if scene.label.size:
            lost, fields = len(simulation.grains) - scene.label.size, uniform_fields(simulation.forces, simulation.time)
            _draw_grains(figure, scene, lost, layout, LETTERS[len(heights) :], fields)
    return figure


def _header(simulation: Simulation) -> list[tuple[str, float]]:
    """Lines of the header with their font sizes: title, facts, notes."""
    title = headline(simulation.grains, simulation.box, simulation.time, simulation.title)
    if not simulation.ledger.rows:
        return [(title, 10.5)]
    last = simulation.ledger.rows[-1]
    count, mean = int(last["clusters"]), last["mean_cluster_size"]
    unit = energy_unit(simulation.ledger, simulation.temperature, len(simulation.grains))
    if has_few_bodies(simulation.ledger):
        largest = f"{', the largest' if count > 1 else ''} of {int(last['largest_cluster'])} grains"
        facts = [f"{count} bod{'ies' if count > 1 else 'y'}{largest}"]
    else:
        facts = [
            f"{count} cluster{'s' if count != 1 else ''}",
            f"mean size S = {mean:.0f}" if mean >= 100.0 else f"mean size S = {mean:.3g}",
            f"largest of {int(last['largest_cluster'])} grains",
        ]
    facts.append(f"{int(last['contacts'])} contacts ({int(last['made'])} formed, {int(last['broken'])} broken)")
    facts += [field.text() for field in uniform_fields(simulation.forces, simulation.time)]
    facts += [unit.value.replace(", the kinetic temperature at the start", " at the start")] if unit.value else []
    notes = [(f"Note: {note.split(';')[0]}.", 7.0) for note in simulation.notes()]
    return [(title, 10.5), ("  ·  ".join(facts), 8.5), *notes]


def headline(grains: Any, box: Box, time: float, title: str = "") -> str:
    """Title of a run: '100 grains of iron, r = 10 nm, periodic cube of 1.2 µm, t = 5 µs'.

    Parameters
    ----------
    title : str, optional
        What takes the place of the grains and the box, such as 'Collision of 3 + 1 grains of silica'.
    """
    names = material_names(grains)
    materials = ", ".join(names) if len(names) < 4 else f"{len(names)} materials"
    what = title or f"{len(grains)} grain{'s' if len(grains) != 1 else ''} of {materials}"
    parts = [what, f"r = {_radii(grains.radius)}", *([] if title else [_describe_box(box)])]
    parts.append(f"t = {format_si(time, 's')}")
    return ",  ".join(parts)


def _radii(radius: np.ndarray) -> str:
    """Radii in words: '10 nm'; of up to `FEW_SIZES` classes '5 nm (80) and 10 nm (20)'; of more '5 nm to 10 nm'."""
    number = Counter(format_si(one, "m") for one in np.sort(radius).tolist())
    texts = list(number)
    if len(texts) == 1:
        return texts[0]
    if len(texts) > FEW_SIZES:
        return f"{texts[0]} to {texts[-1]}"
    counted = [f"{text} ({count})" for text, count in number.items()]
    return f"{', '.join(counted[:-1])} and {counted[-1]}"


def _describe_box(box: Box) -> str:
    if box.is_open:
        return "open space"
    if box.tilt:
        return f"{_describe_box(Box(box.lengths))}, tilted by {format_si(box.tilt, 'm')}"
    if len(set(box.lengths)) == 1:
        return f"periodic cube of {format_si(box.shortest, 'm')}"
    return "periodic " + " × ".join("open" if v is None else format_si(v, "m") for v in box.lengths)


def _draw_history(figure: Figure, simulation: Simulation, layout: Layout, heights: Sequence[float]) -> None:
    ledger = simulation.ledger
    time = time_unit(ledger)
    unit = energy_unit(ledger, simulation.temperature, len(simulation.grains))
    left, right = layout.history[:2]
    panels = [figure.add_axes((left, 0.1 * k, right - left, 0.1)) for k in range(len(heights))]
    (draw_contacts if has_few_bodies(ledger) else draw_clusters)(panels[0], ledger, time)
    draw_energies(panels[1], ledger, time, unit)
    draw_losses(panels[2], ledger, time, unit)
    for axes, draw in zip(panels[3:], _more_panels(ledger), strict=False):
        draw(axes, ledger, time)
    draw_balance(panels[-1], ledger, time, unit)
    draw_time(panels, time, ledger)
    for name, axes in zip(LETTERS, panels, strict=False):
        axes.yaxis.set_label_coords(layout.label, 0.5)
        panel_letter(axes, name, layout.letter)
    _place_panels(figure, panels, heights, layout)


def _more_panels(ledger: Any) -> list[Callable[[Axes, Any, AxisUnit], None]]:
    """Functions that draw the panels which only some runs have."""
    if not ledger.rows:
        return []
    return [draw_temperatures] * has_temperatures(ledger) + [draw_pressure] * ("pressure" in ledger.columns)


def _place_panels(figure: Figure, panels: list[Axes], heights: Sequence[float], layout: Layout) -> None:
    """Place the panels one below the other, with space for the rows of their legends."""
    left, right, bottom, top = layout.history
    legends = [axes.get_legend() for axes in panels]
    rows = [0.0 if one is None else one.get_window_extent().height / figure.bbox.height for one in legends]
    gaps = [max(layout.gap, row + 0.4 * layout.gap) for row in rows]
    top += layout.gap
    height = (top - bottom - sum(gaps)) / sum(heights)
    for axes, share, gap in zip(panels, heights, gaps, strict=True):
        top -= gap + share * height
        axes.set_position((left, top, right - left, share * height))
        above = axes.yaxis.label.get_window_extent().y1 - axes.bbox.y1
        if above > -2.0:  # pixels; the letter of the panel is there
            axes.yaxis.set_label_coords(layout.label, 0.5 - (above + 2.0) / axes.bbox.height)


def _draw_grains(
    figure: Figure, scene: Scene, lost: int, layout: Layout, letters: str, fields: list[UniformField]
) -> None:
    """All grains in the box, and below it the largest clusters if grains are small; `lost` grains are not drawn."""
    left, right, bottom, height = layout.grains
    pixels = layout.pixels(height)
    window = view_window(scene, pixels[0] / pixels[1])
    grain_radius = float(np.median(scene.radius)) * pixels[0] / (window[1] - window[0])
    enlarge = grain_radius < MIN_GRAIN_RADIUS and bool(largest_clusters(scene.label))
    strip = max(0.276 * height, LEAST_STRIP / layout.size[1]) if enlarge else 0.0
    above = strip + 0.02 * enlarge
    axes = figure.add_axes((left, bottom + above, right - left, height - above))
    draw_scene(axes, scene, layout.pixels(height - above), fields)
    panel_letter(axes, letters[0], 0.0)
    axes.text(0.04, 1.004, _caption(scene, lost), transform=axes.transAxes, size=points(7.5), color=MUTED, va="bottom")
    if enlarge:
        axes = figure.add_axes((left, bottom, right - left, strip))
        draw_largest(axes, scene, layout.pixels(strip), fields)
        panel_letter(axes, letters[1], 0.0)


def _caption(scene: Scene, lost: int) -> str:
    parts = []
    if largest_clusters(scene.label):
        parts.append("one colour per cluster, single grains grey")
    if scene.arrow.any():
        parts.append("arrows: moments")
    if lost:
        parts.append(f"left out: {lost} without a finite position")
    return "; ".join(parts)


def figure_bytes(figure: Figure, form: str = "png", transparent: bool = False, dpi: float = 0.0) -> bytes:
    """Encode a figure as a file, without time stamps: equal figures give equal bytes.

    Parameters
    ----------
    figure : Figure
        Figure of matplotlib.
    form : str, optional
        "png", "pdf" or "svg".
    transparent : bool, optional
        Transparent background.
    dpi : float, optional
        Pixels per inch, which a PNG states; by default `RunFigure.pixels_per_inch`, DPI for other figures.
    """
    colour = "none" if transparent else "auto"  # "auto" is the colour of the figure, also with a dark background
    with plot_style(), matplotlib.rc_context({"svg.hashsalt": "SAND", "pdf.fonttype": 42}):
        figure.savefig(
            content := io.BytesIO(),
            format=form,
            dpi=dpi or getattr(figure, "pixels_per_inch", DPI),
            facecolor=colour,
            metadata=_METADATA[form],
        )
    return content.getvalue()


def save(figure: Figure, path: str | Path) -> None:
    """Write a figure as PNG, atomically.

    Raises
    ------
    FilesFailed
        If the file cannot be written.
    """
    replace_file(path, figure_bytes(figure))


def show(figure: Figure) -> Figure:
    """Show a figure in a window, unless in a notebook, which displays the returned figure."""
    if not in_notebook():
        from matplotlib import pyplot as plt

        if plt.get_backend().lower() in _window_backends():
            # pyplot manages only figures that it has created: let its factory return this one.
            plt.figure(FigureClass=lambda *_, **__: figure)
            plt.show()
    return figure


def in_notebook() -> bool:
    """Whether the code runs in a notebook."""
    ipython = sys.modules.get("IPython")
    shell: Any = ipython.get_ipython() if ipython is not None else None
    return shell is not None and hasattr(shell, "kernel")


def _window_backends() -> set[str]:
    """Names of the matplotlib backends that open windows."""
    toolkits = ("qt5", "qt", "gtk3", "gtk4", "tk", "wx")
    return {f"{toolkit}{renderer}" for toolkit in toolkits for renderer in ("agg", "cairo")} | {"macosx"}
