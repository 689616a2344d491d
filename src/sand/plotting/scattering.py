"""Figures of scattering: trajectories (Fig. 2 of the paper), collision probability (Fig. 3), cross-section (Eq. 14)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Circle, Wedge

from .figure_format import format_width, panel_grid
from .run_figure import DPI, RunFigure, figure_with_panels
from .style import (
    BLUE,
    LARGEST_COLOURS,
    MUTED,
    ORANGE,
    RED,
    TEXT_COLOUR,
    figure_title,
    format_si,
    legend_above,
    panel_letter,
    plot_style,
    points,
    si_prefix,
)

WINDOW = 2.5
"""Half the width of a panel of trajectories, in the unit of length."""
DOTS = 60
"""Dots along each trajectory, at equal time intervals."""
LINE_POINTS = 600
"""Points of the line of each trajectory."""
LAYOUT = ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.06)
"""Paddings [inches] that keep labels with subscripts clear of the edges."""
SPEED = "speed $v_\\infty$ [m/s]"
"""Label of the axis of speeds."""
PROBABILITY_MAP = "cividis"
"""Colour map of probabilities: perceptually uniform, also for colour-blind readers."""


def trajectories_figure(groups: Sequence[Sequence[Any]], names: Sequence[str], scales: Any, title: str) -> Figure:
    """Figure with one panel per initial spin: trajectories of both bodies in the x-y plane.

    Parameters
    ----------
    groups : Sequence[Sequence[Trajectory]]
        Trajectories of each panel.
    names : Sequence[str]
        Initial spin of each panel.
    scales : Scales
        Its `capture`, the impact parameter b_max of Eq. 14 [m], is the unit of length; r₁ + r₂ if it is 0.
    title : str
        Description of the two bodies.
    """
    unit = scales.capture or scales.touch
    unit_name = "b_\\mathrm{max}" if scales.capture else "(r_1+r_2)"
    with plot_style():
        more = 0.4 * (format_width() is None)
        figure, panels = figure_with_panels(len(groups), (4.6, 4.9), more=(more, 0.0), layout=LAYOUT)
        for k, axes in enumerate(panels):
            for one, colour in zip(groups[k], cycle(LARGEST_COLOURS), strict=False):
                _draw_trajectory(axes, one, colour, unit)
            axes.set(xlim=(-WINDOW, WINDOW), ylim=(-WINDOW, WINDOW), aspect="equal")
            axes.set(xlabel=f"$x/{unit_name}$", ylabel=f"$y/{unit_name}$")
            legend_above(axes, title=f"spin: {names[k]};  $b/{unit_name}$ and outcome:")
            panel_letter(axes, "abcdefgh"[k], -0.12)
        lines = "thick lines: projectile; thin lines: target; dots: equal time intervals"
        figure_title(figure, f"{title}\n{lines}")
    return figure


def _draw_trajectory(axes: Axes, one: Any, colour: str, unit: float) -> None:
    """One trajectory projected along z; dots are spaced over the time that it spends in and near the window."""
    reach = np.minimum(*(np.abs(body[:, :2]).max(axis=1) for body in (one.projectile, one.target)))
    near = reach < 1.4 * WINDOW * unit
    inside = np.flatnonzero(near)
    first, last = (one.time[inside[0]], one.time[inside[-1]]) if inside.size else (one.time[0], one.time[-1])
    label = f"{one.impact_parameter / unit:.4g}: {one.end}"
    for body, width, text in ((0, 1.2, label), (1, 0.6, None)):
        line, dots = (one.at(np.linspace(first, last, n))[body][:, :2] / unit for n in (LINE_POINTS, DOTS))
        axes.plot(line[:, 0], line[:, 1], color=colour, linewidth=width, label=text)
        axes.plot(dots[:, 0], dots[:, 1], "o", color=colour, markersize=2.4 if text else 1.6, markeredgewidth=0.0)
    if one.end == "hit":
        x, y = one.projectile[-1, :2] / unit
        axes.plot([x], [y], "*", color=colour, markersize=9.0, markeredgecolor=TEXT_COLOUR, markeredgewidth=0.5)


def map_figure(found: Any, title: str) -> Figure:
    """Figure of the collision probability over speed and impact parameter (left), and as discs for four speeds (right).

    Parameters
    ----------
    found : ProbabilityMap
        Collision probabilities.
    title : str
        Description of the two bodies.
    """
    with plot_style():
        rows, columns, size = panel_grid(2, (4.8, 4.4), 2)
        figure = RunFigure(figsize=size, dpi=DPI, layout=LAYOUT)
        ratios: dict[str, Any] = {"width_ratios": (1.25, 1.0)} if columns == 2 else {}
        left, right = np.asarray(figure.subfigures(rows, columns, **ratios)).ravel()
        axes = left.subplots()
        mesh = _draw_map(axes, found)
        panel_letter(axes, "a", -0.12)
        chosen = np.unique(np.linspace(0, found.speeds.size - 1, 4).round().astype(int))
        discs = np.atleast_1d(right.subplots(2, 2) if chosen.size > 1 else right.subplots()).ravel()
        for k, disc in enumerate(discs):
            disc.axis("off")
            if k < chosen.size:
                _draw_disc(disc, found, int(chosen[k]), mesh)
        panel_letter(discs[0], "b", 0.0)
        right.colorbar(mesh, ax=list(discs), label="collision probability", shrink=0.8)
        figure_title(figure, f"{title}; dashed: $b_\\mathrm{{max}}$ (Eq. 14)", 9.0)
    return figure


def _draw_map(axes: Axes, found: Any) -> Any:
    """Draw one column of cells per speed, each with its own impact parameters, and the line of b_max."""
    speeds, unit = found.speeds, found.geometric
    middle = 0.5 * (speeds[1:] + speeds[:-1])
    first = 1.5 * speeds[0] - 0.5 * speeds[1] if speeds.size > 1 else 0.9 * speeds[0]
    last = 1.5 * speeds[-1] - 0.5 * speeds[-2] if speeds.size > 1 else 1.1 * speeds[0]
    borders = np.concatenate([[max(first, 0.0)], middle, [last]])
    mesh = None
    for v in range(speeds.size):
        column = found.probability[v][:, None]
        mesh = axes.pcolormesh(
            borders[v : v + 2], found.edges[v] / unit, column, cmap=PROBABILITY_MAP, vmin=0.0, vmax=1.0
        )
    if found.capture.any():
        axes.plot(speeds, found.capture / unit, "--", color=RED, linewidth=1.4)
    axes.set(xlim=(borders[0], borders[-1]), ylim=(0.0, found.edges.max() / unit))
    axes.set(xlabel=SPEED, ylabel="impact parameter $b/(r_1+r_2)$")
    return mesh


def _draw_disc(axes: Axes, found: Any, k: int, mesh: Any) -> None:
    """Draw the probabilities at one speed as annuli in the plane of impact, in units of b_max."""
    unit = found.capture[k] or found.geometric
    edges = found.edges[k] / unit
    for low, high, p in zip(edges[:-1], edges[1:], found.probability[k], strict=True):
        colour = mesh.cmap(p)
        ring = Wedge((0.0, 0.0), high, 0.0, 360.0, width=high - low, facecolor=colour, edgecolor=colour, linewidth=0.4)
        axes.add_patch(ring)
    axes.add_patch(Circle((0.0, 0.0), 1.0, fill=False, linestyle="--", color=RED, linewidth=1.4))
    axes.set(xlim=(-edges[-1], edges[-1]), ylim=(-edges[-1], edges[-1]), aspect="equal")
    axes.set_title(format_si(float(found.speeds[k]), "m/s"), fontsize=points(8.0))


def sigma_figure(found: Sequence[Any], title: str) -> Figure:
    """Figure of σ over speed with Eq. 14 and the geometric cross-section (left) and c = σ/σ_Eq14 (right).

    With a single speed, or if Eq. 14 does not apply, the right panel shows the collision probability P(b).

    Parameters
    ----------
    found : Sequence[CrossSection]
        Cross-sections.
    title : str
        Description of the two bodies.
    """
    with plot_style():
        figure, (left, right) = figure_with_panels(2, (4.5, 3.9), layout=LAYOUT)
        _draw_sigma(left, found)
        if len(found) > 1 and found[0].analytic > 0.0:
            speeds = [one.speed for one in found]
            right.errorbar(speeds, [one.c for one in found], [one.c_error for one in found], fmt="o", color=BLUE)
            right.axhline(1.0, linestyle="--", color=RED)
            right.set_ylim(bottom=0.0)
            right.set(xscale="log", xlabel=SPEED, ylabel="$c=\\sigma/\\sigma_\\mathrm{Eq.14}$")
        else:
            _draw_profile(right, found[0])
        panel_letter(left, "a", -0.14)
        panel_letter(right, "b", -0.14)
        figure_title(figure, title, 9.0)
    return figure


def _draw_sigma(axes: Axes, found: Sequence[Any]) -> None:
    size, name = si_prefix(max(c.sigma for c in found) ** 0.5, "m")
    speeds = np.array([c.speed for c in found])
    sigma, error = (np.array([getattr(c, name) for c in found]) / size**2 for name in ("sigma", "sigma_error"))
    axes.errorbar(speeds, sigma, error, fmt="o", color=BLUE, label="simulated")
    if found[0].analytic > 0.0:
        fine = np.geomspace(0.8 * speeds.min(), 1.25 * speeds.max(), 50)
        line = found[0].analytic * (fine / speeds[0]) ** (-4.0 / 3.0)
        axes.plot(fine, line / size**2, "--", color=RED, label="Eq. 14")
    axes.axhline(found[0].geometric / size**2, color=MUTED, linewidth=0.9, label="$\\pi(r_1+r_2)^2$")
    axes.set(xscale="log", yscale="log", xlabel=SPEED, ylabel=f"$\\sigma$ [{name}²]")
    legend_above(axes)


def _draw_profile(axes: Axes, found: Any) -> None:
    """Draw the fraction of trajectories that collide, for each annulus of impact parameters."""
    low, high, tries, hits = found.profile.T
    unit = (found.analytic / np.pi) ** 0.5 or (found.geometric / np.pi) ** 0.5
    p = hits / np.maximum(tries, 1)
    axes.stairs(p, np.append(low, high[-1]) / unit, color=BLUE, fill=True, alpha=0.25)
    error = np.sqrt(p * (1 - p) / np.maximum(tries, 1) + 0.25 / np.maximum(tries, 1) ** 2)
    axes.errorbar(0.5 * (low + high) / unit, p, error, fmt=".", color=BLUE, elinewidth=0.8)
    axes.axvline(1.0, linestyle="--", color=RED)
    axes.axhline(0.5, color=ORANGE, linewidth=0.5)
    axes.set(xlim=(0.0, high[-1] / unit), ylim=(0.0, 1.05), ylabel="collision probability $P(b)$")
    axes.set_xlabel("$b/b_\\mathrm{max}$" if found.analytic > 0.0 else "$b/(r_1+r_2)$")
