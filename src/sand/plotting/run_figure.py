"""The figure at the end of every run: clusters, energies, losses and balance over time; the grains in 3-D."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..analysis.quantities import material_names
from ..box import Box
from ..io.run_folder import replace_file
from .panels import draw_balance, draw_clusters, draw_energies, draw_losses, draw_time, energy_unit, time_unit
from .render.scene import Scene, draw_largest, draw_scene, make_scene, view_window
from .style import MUTED, format_number, format_si, panel_letter, plot_style

if TYPE_CHECKING:
    from ..simulation.simulation import Simulation

WIDTH, HEIGHT, DPI = 10.0, 6.25, 160
"""Inches, inches, pixels per inch: 1600 × 1000 pixels."""
SMALL_GRAIN = 11.0
"""Pixels: with grains of a smaller radius in the box, the largest clusters are shown by themselves too."""
SQUEEZE = 6
"""Of zlib; 9 saves another twentieth of a figure of shaded grains, and takes ten times as long, a second."""
_PNG: dict[str, Any] = {
    "format": "png",
    "dpi": DPI,
    "metadata": {"Software": "SAND"},
    "pil_kwargs": {"compress_level": SQUEEZE},
}

_LEFT, _RIGHT = (0.080, 0.455), (0.485, 0.992)
_TOP, _BOTTOM = 0.862, 0.075
_EDGE = 0.012


class RunFigure(Figure):
    """A figure that notebooks display as it is, whatever backend is in use."""

    def _repr_png_(self) -> bytes:
        return png(self)


def run_figure(simulation: Simulation) -> Figure:
    """One landscape figure of the run so far.

    Left, over time: clusters (Eq. 17), energies, losses by channel, the balance of the books.  Right: the
    grains as they are now, coloured by cluster, with their moments; where they are small, the largest
    clusters once more.  Energies in N k_B T of the start, or in J if the grains were at rest.

    A run that has no rows in its ledger yet, or in which no position is a finite number, gets the other half.
    """
    scene = make_scene(simulation.grains, simulation.contacts["pair"], simulation.box)
    with plot_style():
        figure = RunFigure(figsize=(WIDTH, HEIGHT), dpi=DPI)
        _draw_headline(figure, simulation)
        if simulation.ledger.rows:
            _draw_history(figure, simulation)
        if scene.label.size:
            _draw_grains(figure, scene, len(simulation.grains) - scene.label.size)
    return figure


def _draw_headline(figure: Figure, simulation: Simulation) -> None:
    told = headline(simulation.grains, simulation.box, simulation.time)
    figure.text(_EDGE, 0.968, told, size=10.5, weight="bold", va="center")
    if not simulation.ledger.rows:
        return
    last = simulation.ledger.rows[-1]
    count = int(last["clusters"])
    facts = [
        f"{count} cluster{'s' if count != 1 else ''}",
        f"mean size S = {_count(last['mean_cluster_size'])}",
        f"largest {int(last['largest_cluster'])}",
        f"{int(last['contacts'])} contacts ({int(last['made'])} made, {int(last['broken'])} broken)",
    ]
    if simulation.temperature > 0.0:
        facts.append(f"$T_0$ = {format_number(simulation.temperature)} K")
    figure.text(_EDGE, 0.931, "  ·  ".join(facts), size=8.5, color=MUTED, va="center")


def _count(number: float) -> str:
    return f"{number:.0f}" if number >= 100.0 else f"{number:.3g}"


def headline(grains: Any, box: Box, time: float) -> str:
    """Who is where, and how old: '100 grains of iron, r = 10 nm, periodic box 1.2 µm, t = 5 µs'."""
    parts = [
        f"{len(grains)} grain{'s' if len(grains) != 1 else ''} of {_materials(grains)}",
        f"r = {_span(grains.radius)}",
        _describe(box),
        f"t = {format_si(time, 's')}",
    ]
    return ",  ".join(parts)


def _materials(grains: Any) -> str:
    names = material_names(grains)
    return ", ".join(names) if len(names) < 4 else f"{len(names)} materials"


def _span(radius: np.ndarray) -> str:
    small, large = float(radius.min()), float(radius.max())
    if large < 1.001 * small:
        return format_si(large, "m")
    return f"{format_si(small, 'm')} to {format_si(large, 'm')}"


def _describe(box: Box) -> str:
    if box.is_open:
        return "open space"
    if len(set(box.lengths)) == 1:
        return f"periodic cube of {format_si(box.shortest, 'm')}"
    return "periodic " + " × ".join("open" if v is None else format_si(v, "m") for v in box.lengths)


def _draw_history(figure: Figure, simulation: Simulation) -> None:
    ledger = simulation.ledger
    time = time_unit(ledger)
    unit = energy_unit(ledger, simulation.temperature, len(simulation.grains))
    panels = [_panel(figure, _LEFT, bottom, height) for bottom, height in _stack((1.0, 1.35, 1.1, 0.5), 0.036)]
    draw_clusters(panels[0], ledger, time)
    draw_energies(panels[1], ledger, time, unit)
    draw_losses(panels[2], ledger, time, unit)
    draw_balance(panels[3], ledger, time, unit)
    draw_time(panels, time, ledger)
    for name, axes in zip("abcd", panels, strict=True):
        axes.yaxis.set_label_coords(-0.138, 0.5)
        panel_letter(axes, name, -0.185)


def _draw_grains(figure: Figure, scene: Scene, lost: int) -> None:
    """The box, and under it the largest clusters if they are small in it; `lost` grains are not drawn."""
    whole = (0.03, 0.85)
    window = view_window(scene, _pixels(whole[1])[0] / _pixels(whole[1])[1])
    grain = float(np.median(scene.radius)) * _pixels(whole[1])[0] / (window[1] - window[0])
    small = grain < SMALL_GRAIN and bool(scene.largest_clusters())
    strip = 0.235
    bottom, height = (whole[0] + strip + 0.02, whole[1] - strip - 0.02) if small else whole
    axes = _panel(figure, _RIGHT, bottom, height)
    draw_scene(axes, scene, _pixels(height))
    panel_letter(axes, "e", 0.0)
    axes.text(
        0.04,
        1.004,
        _caption(scene, lost),
        transform=axes.transAxes,
        size=7.5,
        color=MUTED,
        va="bottom",
        ha="left",
    )
    if small:
        axes = _panel(figure, _RIGHT, whole[0], strip)
        draw_largest(axes, scene, _pixels(strip))
        panel_letter(axes, "f", 0.0)


def _caption(scene: Scene, lost: int) -> str:
    told = []
    if scene.largest_clusters():
        told.append("one colour per cluster, single grains grey")
    if scene.arrow.any():
        told.append("arrows: moments")
    if lost:
        told.append(f"left out: {lost} without a finite position")
    return "; ".join(told)


def _panel(figure: Figure, columns: tuple[float, float], bottom: float, height: float) -> Axes:
    return figure.add_axes((columns[0], bottom, columns[1] - columns[0], height))


def _pixels(height: float) -> tuple[int, int]:
    """Of a panel on the right whose height is that share of the figure's."""
    return round((_RIGHT[1] - _RIGHT[0]) * WIDTH * DPI), round(height * HEIGHT * DPI)


def _stack(heights: tuple[float, ...], gap: float) -> list[tuple[float, float]]:
    """Bottom and height of panels above each other, the highest first; `heights` in proportion."""
    room = (_TOP - _BOTTOM - gap * (len(heights) - 1)) / sum(heights)
    places, top = [], _TOP
    for share in heights:
        places.append((top - share * room, share * room))
        top -= share * room + gap
    return places


def png(figure: Figure) -> bytes:
    """The figure as a PNG."""
    with plot_style():
        figure.savefig(content := io.BytesIO(), **_PNG)
    return content.getvalue()


def save(figure: Figure, path: str | Path) -> None:
    """Write the figure as a PNG; the file is whole or not there.

    Raises
    ------
    FilesFailed
        the disk is full, the folder has vanished, …
    """
    replace_file(Path(path), png(figure))


def show(figure: Figure) -> Figure:
    """Show the figure in a window where there can be one; notebooks display what is returned."""
    if not in_notebook():
        from matplotlib import pyplot as plt

        if plt.get_backend().lower() in _windows():
            # pyplot takes a figure only when it makes it: this hands it ours as the new one.
            plt.figure(FigureClass=lambda *_, **__: figure)
            plt.show()
    return figure


def in_notebook() -> bool:
    """Whether cells of a notebook call."""
    python = sys.modules.get("IPython")
    shell: Any = python.get_ipython() if python is not None else None
    return shell is not None and hasattr(shell, "kernel")


def _windows() -> set[str]:
    """Backends that open windows."""
    kits = ("qt5", "qt", "gtk3", "gtk4", "tk", "wx")
    return {f"{kit}{how}" for kit in kits for how in ("agg", "cairo")} | {"macosx"}
