"""The figure of an ensemble: S(t), moments and sizes of aggregates, with the paper's lines beside them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from .style import BLUE, FAINT, GREEN, INK, PURPLE, RED, styled, with_prefix

COLOURS = (RED, BLUE, GREEN, PURPLE)
PAPER = {"z, Brownian": 2.0, "z, magnetic": 3.2, "moment": 0.63}
"""Exponents of Dominik & Nübold (2002): growth of S (section 3.3), and μ(N) (Figure 1)."""


def growth_figure(ensembles: Sequence[tuple[str, Any, dict[str, Any]]]) -> Figure:
    """S(t), μ(N) and N(r_g) of one or more ensembles.

    Parameters
    ----------
    ensembles : Sequence[tuple[str, Any, dict[str, Any]]]
        name, `experiments.growth.GrowthResult`, and the aggregates of all boxes with `unit_moment` [A m²] and
        `unit_radius` [m] of a grain.
    """
    with styled():
        figure = Figure(figsize=(9.6, 3.3), layout="constrained")
        left, middle, right = figure.subplots(1, 3)
        size, unit = with_prefix(max(float(growth.time[-1]) for _, growth, _ in ensembles), "s")
        for (name, growth, rows), colour in zip(ensembles, cycle(COLOURS), strict=False):
            _growth(left, name, growth, size, colour)
            _moments(middle, growth, rows, colour)
            _dimension(right, growth, rows, colour)
        for axes in (left, middle, right):
            axes.set(xscale="log", yscale="log")
            for one in (axes.xaxis, axes.yaxis):
                one.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=8))
                one.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
                one.set_minor_formatter(NullFormatter())
        left.set(xlabel=f"time [{unit}]", ylabel="mean size S")
        left.legend(loc="upper left")
        middle.set(xlabel="grains N", ylabel="moment, of one grain's")
        right.set(xlabel="radius of gyration, in grain radii", ylabel="grains N")
        for axes, place in ((middle, "lower right"), (right, "upper left")):
            if axes.get_legend_handles_labels()[0]:
                axes.legend(loc=place)
            else:
                axes.text(0.5, 0.5, "no aggregates to show", ha="center", color=FAINT, transform=axes.transAxes)
    return figure


def _growth(axes: Axes, name: str, growth: Any, size: float, colour: str) -> None:
    """Each box faint, the mean with its error, the fit, and the paper's slopes through the middle of the fit."""
    time = growth.time / size
    later = growth.time > 0.0
    for one in growth.sizes:
        axes.plot(time[later], one[later], color=colour, alpha=0.25, lw=0.6)
    label = name if growth.z is None else f"{name}: $z = {_spoken(growth.z)}$"
    axes.plot(time[later], growth.mean[later], color=colour, lw=1.8, label=label)
    if len(growth.sizes) > 1:
        low, high = growth.mean - growth.error, growth.mean + growth.error
        axes.fill_between(time[later], low[later], high[later], color=colour, alpha=0.2, lw=0)
    if growth.z is None:
        return
    used = (growth.mean >= growth.window[0]) & (growth.sizes.max(axis=0) <= growth.window[1]) & later
    axes.plot(time[used], growth.z.at(growth.time[used]), color=INK, lw=0.8, ls="--")
    axes.axhline(growth.window[1], color=FAINT, lw=0.6, ls=":")
    centre = np.exp(np.log(growth.time[used]).mean())
    for text, z in (("2", PAPER["z, Brownian"]), ("3.2", PAPER["z, magnetic"])):
        reach = centre * np.array([0.7, 1.4])
        height = float(growth.z.at(centre)) * (reach / centre) ** z
        axes.plot(reach / size, height, color=FAINT, lw=0.8)
        axes.annotate(f"$t^{{{text}}}$", (reach[1] / size, height[1]), color=FAINT, fontsize=7)


def _moments(axes: Axes, growth: Any, rows: dict[str, Any], colour: str) -> None:
    if growth.moment is None:
        return
    moment = rows["moment"] / rows["unit_moment"]
    free = rows["rings"] == 0
    axes.plot(rows["grains"][free], moment[free], ".", ms=3, color=colour, alpha=0.5, label="without rings")
    axes.plot(rows["grains"][~free], moment[~free], "x", ms=3, mew=0.6, color=FAINT, alpha=0.7, label="with rings")
    n = np.array([2.0, rows["grains"].max()])
    axes.plot(n, growth.moment.at(n), color=INK, ls="--", lw=0.9, label=f"all: $N^{{{_spoken(growth.moment)}}}$")
    if growth.moment_without_rings is not None:
        text = f"without rings: $N^{{{_spoken(growth.moment_without_rings)}}}$"
        axes.plot(n, growth.moment_without_rings.at(n), color=colour, lw=0.9, label=text)
    axes.plot(n, n ** PAPER["moment"], color=FAINT, lw=0.9, label="the paper: $N^{0.63}$")
    axes.set_ylim(bottom=0.1)


def _dimension(axes: Axes, growth: Any, rows: dict[str, Any], colour: str) -> None:
    if growth.dimension is None:
        return
    size = rows["gyration_radius"] / rows["unit_radius"]
    axes.plot(size, rows["grains"], ".", ms=3, color=colour, alpha=0.4)
    fit, n = growth.dimension, np.array(growth.dimension.window)
    error = "" if np.isnan(fit.error) else f" ± {fit.error:.2f}"
    text = f"$D_f$ = {fit.value:.2f}{error}"
    axes.plot((n / fit.prefactor) ** (1.0 / fit.value), n, color=INK, ls="--", lw=0.9, label=text)


def _spoken(law: Any) -> str:
    return f"{law.exponent:.2f}" + ("" if np.isnan(law.error) else rf" \pm {law.error:.2f}")
