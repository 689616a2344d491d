"""Figure of an ensemble of growth simulations: S(t), local degree, moments, sizes, temperatures; the paper's laws."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from .overlay import draw_spectrum
from .run_figure import figure_with_panels
from .style import BLUE, GREEN, MUTED, PURPLE, RED, TEXT_COLOUR, legend_above, plot_style, points, si_prefix

COLOURS = (RED, BLUE, GREEN, PURPLE)
PAPER_EXPONENTS = {"z, Brownian": 2.0, "z, magnetic": 3.2, "moment": 0.63}
"""Exponents of Dominik & Nübold (2002): growth of S (section 3.3), and μ(N) (Figure 1)."""
TEMPERATURE_STYLES = (("translation", "o-"), ("rotation, mean", "^--"), ("rotation, median", "v:"))
"""Label and line of each temperature."""


def growth_figure(ensembles: Sequence[tuple[str, Any, dict[str, Any]]], guides: bool = False) -> Figure:
    """Figure of S(t), λ(S), temperatures of bodies, μ(N), N(r_g) and s² n_s of one or more ensembles.

    Parameters
    ----------
    ensembles : Sequence[tuple[str, GrowthResult, dict]]
        For each ensemble its name, its `experiments.growth.GrowthResult`, and the aggregates of all boxes with
        `unit_moment` [A m²] and `unit_radius` [m], the moment and radius of one grain, `temperatures` (K, 4), times [s]
        and `BodyTemperatures` [K], and `sizes`, grains of each cluster in the last frames of all boxes; with
        `coagulation`, times [s] and S of the coagulation equation, if solved.
    guides : bool, optional
        Whether lines show the power laws of the paper.
    """
    with plot_style():
        figure, panels = figure_with_panels(6, (4.8, 3.1 + 0.3 * len(ensembles)), 3)
        left, degrees, last, middle, right, spectrum = panels
        size, unit = si_prefix(max(float(growth.time[-1]) for _, growth, _ in ensembles), "s")
        for (name, growth, rows), colour in zip(ensembles, cycle(COLOURS), strict=False):
            _draw_growth(left, name, growth, size, colour, guides)
            time, mean = rows.get("coagulation", ((), ()))
            if len(time):
                left.plot(time[1:] / size, mean[1:], color=colour, lw=1.2, ls=":", label="Smoluchowski, its kernel")
            _draw_degrees(degrees, name, growth, colour)
            _draw_moments(middle, growth, rows, colour, guides)
            _draw_dimension(right, growth, rows, colour)
            _draw_temperatures(last, name, rows["temperatures"], size, colour)
            if rows["sizes"].size:
                draw_spectrum(spectrum, rows["sizes"], colour, label=f"{name}: last frames")
        logarithmic = (left, middle, right, last, spectrum)
        for axes in logarithmic:
            axes.set(xscale="log", yscale="log")
        degrees.set_xscale("log")
        for axis in (degrees.xaxis, *(axes.xaxis for axes in logarithmic), *(axes.yaxis for axes in logarithmic)):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=8))
            axis.set_major_formatter(lambda value, _: f"{value:g}")
            axis.set_minor_formatter(NullFormatter())
        left.set(xlabel=f"time [{unit}]", ylabel="mean size $S$ [grains]")
        degrees.set(xlabel="mean size $S$ [grains]", ylabel=r"local degree $\lambda = d\ln\dot S/d\ln S$")
        middle.set(xlabel="number of grains $N$", ylabel=r"moment $\mu/\mu_\mathrm{grain}$")
        right.set(xlabel=r"radius of gyration $r_\mathrm{g}/r_\mathrm{grain}$", ylabel="number of grains $N$")
        last.set(xlabel=f"time [{unit}]", ylabel="temperature of bodies [K]")
        texts = {left: "no time has passed", degrees: "$S$ grows too little", last: "all bodies are at rest"}
        for axes in panels:
            text = texts.get(axes, "no aggregates")
            if axes.get_legend_handles_labels()[0]:
                legend_above(axes)
            else:
                axes.text(0.5, 0.5, text, ha="center", color=MUTED, transform=axes.transAxes)
    return figure


def _draw_growth(axes: Axes, name: str, growth: Any, size: float, colour: str, guides: bool) -> None:
    """S(t) of each box, the mean with its error, the fit, and with `guides` the slopes of the paper."""
    time = growth.time / size
    positive = growth.time > 0.0
    if not positive.any():  # a logarithmic axis without a value cannot be drawn
        return
    for sizes in growth.sizes:
        axes.plot(time[positive], sizes[positive], color=colour, alpha=0.25, lw=0.6)
    label = name if growth.z is None else f"{name}: {_exponent(growth.z)}"
    axes.plot(time[positive], growth.mean[positive], color=colour, lw=1.8, label=label)
    if len(growth.sizes) > 1:
        low, high = growth.mean - growth.error, growth.mean + growth.error
        axes.fill_between(time[positive], low[positive], high[positive], color=colour, alpha=0.2, lw=0)
    if growth.z is None:
        return
    axes.plot(time[growth.fitted], growth.z.at(growth.time[growth.fitted]), color=TEXT_COLOUR, lw=0.8, ls="--")
    axes.axhline(growth.window[1], color=MUTED, lw=0.6, ls=":", zorder=0)
    centre = np.exp(np.log(growth.time[growth.fitted]).mean())
    for z in (PAPER_EXPONENTS["z, Brownian"], PAPER_EXPONENTS["z, magnetic"]) if guides else ():
        ends = centre * np.array([0.7, 1.4])
        height = float(growth.z.at(centre)) * (ends / centre) ** z
        axes.plot(ends / size, height, color=MUTED, lw=0.8)
        axes.annotate(f"$t^{{{z:g}}}$", (ends[1] / size, height[1]), color=MUTED, fontsize=points(7.0))


def _draw_degrees(axes: Axes, name: str, growth: Any, colour: str) -> None:
    """λ(S) in windows of S with standard errors, and the 95 % interval of the degree of the kernel."""
    found = growth.local_degrees
    if found:
        low, high, degree, error = np.array([(one.low_size, one.high_size, one.degree, one.error) for one in found]).T
        centre = np.sqrt(low * high)
        style: dict[str, Any] = {"fmt": "o", "ms": 3, "color": colour, "lw": 0.9}
        spread = None if np.isnan(error).any() else error
        axes.errorbar(centre, degree, spread, [centre - low, high - centre], label=f"{name}: $\\lambda(S)$", **style)
    if growth.z is not None:
        ends = growth.window[0], min(growth.window[1], growth.z.largest)
        axes.plot(ends, [growth.z.degree] * 2, color=colour, ls="--", lw=0.9)
        if not np.isnan(growth.z.degree_low):
            label = f"{name}: degree of the kernel, 95 %"
            axes.fill_between(
                ends, growth.z.degree_low, growth.z.degree_high, color=colour, alpha=0.12, lw=0, label=label
            )


def _draw_moments(axes: Axes, growth: Any, rows: dict[str, Any], colour: str, guides: bool) -> None:
    if growth.moment is None:
        return
    moment = rows["moment"] / rows["unit_moment"]
    without_rings = rows["rings"] == 0
    axes.plot(
        rows["grains"][without_rings], moment[without_rings], ".", ms=3, color=colour, alpha=0.5, label="without rings"
    )
    ring_style: dict[str, Any] = {"ms": 3, "mew": 0.6, "color": MUTED, "alpha": 0.7, "label": "with rings"}
    axes.plot(rows["grains"][~without_rings], moment[~without_rings], "x", **ring_style)
    n = np.array([2.0, rows["grains"].max()])
    text = f"all: $N^{{{_with_error(growth.moment)}}}$"
    axes.plot(n, growth.moment.at(n), color=TEXT_COLOUR, ls="--", lw=0.9, label=text)
    if growth.moment_without_rings is not None:
        text = f"without rings: $N^{{{_with_error(growth.moment_without_rings)}}}$"
        axes.plot(n, growth.moment_without_rings.at(n), color=colour, lw=0.9, label=text)
    if guides:
        axes.plot(n, n ** PAPER_EXPONENTS["moment"], color=MUTED, lw=0.9, label="the paper: $N^{0.63}$")
    axes.set_ylim(bottom=0.1)


def _draw_dimension(axes: Axes, growth: Any, rows: dict[str, Any], colour: str) -> None:
    if growth.dimension is None:
        return
    size = rows["gyration_radius"] / rows["unit_radius"]
    axes.plot(size, rows["grains"], ".", ms=3, color=colour, alpha=0.4)
    fit, n = growth.dimension, np.array(growth.dimension.window)
    error = "" if np.isnan(fit.error) else f" ± {fit.error:.2f}"
    text = f"$D_f$ = {fit.value:.2f}{error}"
    axes.plot((n / fit.prefactor) ** (1.0 / fit.value), n, color=TEXT_COLOUR, ls="--", lw=0.9, label=text)


def _exponent(law: Any) -> str:
    """z with its 95 % interval, which is not symmetric."""
    value = f"$z = {law.exponent:.2f}$" if np.isfinite(law.exponent) else r"$z = \infty$"
    if np.isnan(law.low):
        return value
    return f"{value} (95 %: " + (f"> {law.low:.2f})" if np.isinf(law.high) else f"{law.low:.2f} to {law.high:.2f})")


def _draw_temperatures(axes: Axes, name: str, rows: np.ndarray, size: float, colour: str) -> None:
    """Temperatures of translation and rotation over time, of all bodies of the ensemble."""
    for column, (label, style) in enumerate(TEMPERATURE_STYLES, 1):
        positive = rows[:, column] > 0.0
        if positive.any():
            time, values = rows[positive, 0] / size, rows[positive, column]
            axes.plot(time, values, style, color=colour, ms=3, lw=1.0, label=f"{name}: {label}")


def _with_error(law: Any) -> str:
    return f"{law.exponent:.2f}" + ("" if np.isnan(law.error) else rf" \pm {law.error:.2f}")
