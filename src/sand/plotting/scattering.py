"""Figures of scattering: trajectories (Fig. 2 of the paper), maps of the probability (Fig. 3), σ against Eq. 14."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Wedge

from .run_figure import DPI, RunFigure
from .style import (
    BLUE,
    LARGEST_COLOURS,
    MUTED,
    ORANGE,
    RED,
    TEXT_COLOUR,
    format_si,
    panel_letter,
    plot_style,
    si_prefix,
)

DOTS = 60
"""Dots along each trajectory, at equal times."""
PATH = 600
"""Points of its line."""
SHADES = "cividis"
"""Of probabilities: even for the eye, and for the colour-blind."""


def trajectories_figure(
    groups: Sequence[Sequence[Any]], names: Sequence[str], scales: Any, title: str, window: float = 2.5
) -> Figure:
    """A panel for each kind of spin: lines of both bodies in the plane of the flight, dots at equal times.

    Parameters
    ----------
    groups : Sequence[Sequence[Any]]
        `Trajectory`s of each panel; names: of the panels.
    scales
        `Scales`, whose `capture` lengths are told in.
    window : float, optional
        half the width shown [b_max].
    """
    unit = scales.capture or scales.touch
    with plot_style():
        figure = RunFigure(figsize=(4.6 * len(groups) + 0.4, 4.9), dpi=DPI, layout="constrained")
        for k, axes in enumerate(np.atleast_1d(figure.subplots(1, len(groups)))):
            for one, colour in zip(groups[k], (c for _ in range(99) for c in LARGEST_COLOURS), strict=False):
                _draw_flight(axes, one, colour, unit, window)
            axes.set_xlim(-window, window)
            axes.set_ylim(-window, window)
            axes.set_aspect("equal")
            axes.set_xlabel("$x/b_\\mathrm{max}$" if scales.capture else "$x/(r_1+r_2)$")
            axes.set_ylabel("$y/b_\\mathrm{max}$" if scales.capture else "$y/(r_1+r_2)$")
            axes.set_title(f"spin: {names[k]}", loc="left", fontsize=8.0)
            axes.legend(loc="upper left", fontsize=6.5)
            panel_letter(axes, "abcdefgh"[k], -0.12)
        figure.suptitle(f"{title}; full lines: projectile, thin: target; dots at equal times", x=0.01, ha="left")
    return figure


def _draw_flight(axes: Axes, one: Any, colour: str, unit: float, window: float) -> None:
    """One flight as seen along z; what lies outside the window sets no clock."""
    near = np.abs(one.projectile[:, :2]).max(axis=1) < 1.4 * window * unit
    near |= np.abs(one.target[:, :2]).max(axis=1) < 1.4 * window * unit
    inside = np.flatnonzero(near)
    first, last = (one.time[inside[0]], one.time[inside[-1]]) if inside.size else (one.time[0], one.time[-1])
    label = f"b = {one.impact_parameter / unit:.4g}: {one.end}"
    for which, width, mark in ((0, 1.2, label), (1, 0.6, None)):
        line, dots = (one.at(np.linspace(first, last, n))[which][:, :2] / unit for n in (PATH, DOTS))
        axes.plot(line[:, 0], line[:, 1], color=colour, linewidth=width, label=mark)
        axes.plot(dots[:, 0], dots[:, 1], "o", color=colour, markersize=2.4 if mark else 1.6, markeredgewidth=0.0)
    if one.end == "hit":
        x, y = one.projectile[-1, :2] / unit
        axes.plot([x], [y], "*", color=colour, markersize=9.0, markeredgecolor=TEXT_COLOUR, markeredgewidth=0.5)


def map_figure(found: Any, title: str) -> Figure:
    """Left the probability over speed and impact parameter, with b_max; right as discs for four speeds, in b_max.

    Parameters
    ----------
    found
        a `ProbabilityMap`.
    """
    with plot_style():
        figure = RunFigure(figsize=(9.6, 4.4), dpi=DPI, layout="constrained")
        left, right = np.asarray(figure.subfigures(1, 2, width_ratios=(1.25, 1.0)))
        axes = left.subplots()
        shades = _draw_map(axes, found)
        panel_letter(axes, "a", -0.12)
        chosen = np.unique(np.linspace(0, found.speeds.size - 1, 4).round().astype(int))
        discs = np.atleast_1d(right.subplots(2, 2) if chosen.size > 1 else right.subplots()).ravel()
        for k, place in enumerate(discs):
            place.axis("off")
            if k < chosen.size:
                _draw_disc(place, found, int(chosen[k]), shades)
        panel_letter(discs[0], "b", 0.0)
        right.colorbar(shades, ax=list(discs), label="probability of a hit", shrink=0.8)
        figure.suptitle(f"{title}; dashed: $b_\\mathrm{{max}}$ (Eq. 14)", x=0.01, ha="left")
    return figure


def _draw_map(axes: Axes, found: Any) -> Any:
    """Cells of speed and impact parameter; each speed has cells of its own."""
    speeds, unit = found.speeds, found.geometric
    middle = 0.5 * (speeds[1:] + speeds[:-1])
    first = 1.5 * speeds[0] - 0.5 * speeds[1] if speeds.size > 1 else 0.9 * speeds[0]
    last = 1.5 * speeds[-1] - 0.5 * speeds[-2] if speeds.size > 1 else 1.1 * speeds[0]
    borders = np.concatenate([[max(first, 0.0)], middle, [last]])
    shades = None
    for v in range(speeds.size):
        column = found.probability[v][:, None]
        shades = axes.pcolormesh(borders[v : v + 2], found.edges[v] / unit, column, cmap=SHADES, vmin=0.0, vmax=1.0)
    if found.capture.any():
        axes.plot(speeds, found.capture / unit, "--", color=RED, linewidth=1.4)
    axes.set_xlim(borders[0], borders[-1])
    axes.set_ylim(0.0, found.edges.max() / unit)
    axes.set_xlabel("speed $v_\\infty$ [m/s]")
    axes.set_ylabel("impact parameter $b/(r_1+r_2)$")
    return shades


def _draw_disc(axes: Axes, found: Any, k: int, shades: Any) -> None:
    """Annuli of one speed as the projectile sees the target."""
    unit = found.capture[k] or found.geometric
    edges = found.edges[k] / unit
    for low, high, p in zip(edges[:-1], edges[1:], found.probability[k], strict=True):
        colour = shades.cmap(p)
        ring = Wedge((0.0, 0.0), high, 0.0, 360.0, width=high - low, facecolor=colour, edgecolor=colour, linewidth=0.4)
        axes.add_patch(ring)
    axes.add_patch(Circle((0.0, 0.0), 1.0, fill=False, linestyle="--", color=RED, linewidth=1.4))
    axes.set_xlim(-edges[-1], edges[-1])
    axes.set_ylim(-edges[-1], edges[-1])
    axes.set_aspect("equal")
    axes.set_title(format_si(float(found.speeds[k]), "m/s"), fontsize=8.0)


def sigma_figure(found: Sequence[Any], title: str) -> Figure:
    """Left σ against speed with Eq. 14 and the geometric cross-section, or for one speed P(b); right c = σ/σ_Eq14.

    Parameters
    ----------
    found : Sequence[Any]
        `CrossSection`s.
    """
    with plot_style():
        figure = RunFigure(figsize=(9.0, 3.9), dpi=DPI, layout="constrained")
        left, right = figure.subplots(1, 2)
        _draw_sigma(left, found)
        if len(found) > 1 and found[0].analytic > 0.0:
            speeds = [one.speed for one in found]
            right.errorbar(speeds, [one.c for one in found], [one.c_error for one in found], fmt="o", color=BLUE)
            right.axhline(1.0, linestyle="--", color=RED)
            right.set_xscale("log")
            right.set_ylim(bottom=0.0)
            right.set_xlabel("speed $v_\\infty$ [m/s]")
            right.set_ylabel("$c=\\sigma/\\sigma_\\mathrm{Eq.14}$")
        else:
            _draw_profile(right, found[0])
        panel_letter(left, "a", -0.14)
        panel_letter(right, "b", -0.14)
        figure.suptitle(title, x=0.01, ha="left")
    return figure


def _draw_sigma(axes: Axes, found: Sequence[Any]) -> None:
    one, name = si_prefix(max(c.sigma for c in found) ** 0.5, "m")
    speeds = np.array([c.speed for c in found])
    axes.errorbar(
        speeds,
        [c.sigma / one**2 for c in found],
        [c.sigma_error / one**2 for c in found],
        fmt="o",
        color=BLUE,
        label="measured",
    )
    if found[0].analytic > 0.0:
        fine = np.geomspace(0.8 * speeds.min(), 1.25 * speeds.max(), 50)
        line = found[0].analytic * (fine / speeds[0]) ** (-4.0 / 3.0)
        axes.plot(fine, line / one**2, "--", color=RED, label="Eq. 14")
    axes.axhline(found[0].geometric / one**2, color=MUTED, linewidth=0.9, label="$\\pi(r_1+r_2)^2$")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("speed $v_\\infty$ [m/s]")
    axes.set_ylabel(f"$\\sigma$ [{name}²]")
    axes.legend(loc="best")


def _draw_profile(axes: Axes, found: Any) -> None:
    """Part of the flights that hit, for each annulus."""
    low, high, tries, hits = found.profile.T
    unit = (found.analytic / np.pi) ** 0.5 or (found.geometric / np.pi) ** 0.5
    p = hits / np.maximum(tries, 1)
    axes.stairs(p, np.append(low, high[-1]) / unit, color=BLUE, fill=True, alpha=0.25)
    error = np.sqrt(p * (1 - p) / np.maximum(tries, 1) + 0.25 / np.maximum(tries, 1) ** 2)
    axes.errorbar(0.5 * (low + high) / unit, p, error, fmt=".", color=BLUE, elinewidth=0.8)
    axes.axvline(1.0, linestyle="--", color=RED)
    axes.axhline(0.5, color=ORANGE, linewidth=0.5)
    axes.set_ylim(0.0, 1.05)
    axes.set_xlim(0.0, high[-1] / unit)
    axes.set_xlabel("$b/b_\\mathrm{max}$" if found.analytic > 0.0 else "$b/(r_1+r_2)$")
    axes.set_ylabel("part of the flights that hit")
