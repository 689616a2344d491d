"""Growth efficiency against speed, and the speed above which it is negative: Wada et al. 2013, Arakawa et al. 2022."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..analysis.fits import power_law
from ..analysis.impact_average import impact_weights
from ..plotting.papers import Curve, Guide, Panel
from .paper_figure import MEMORY, Compared, PaperFigure, Row, grouped
from .seed_table import Interval, SeedTable, seed_table

EQUAL_MASSES = (
    "equal masses are below the formula in other papers, too: about 50 m/s for ice in Wada et al. 2009 and Arakawa et "
    "al. 2022 (from memory); it was fitted to many mass ratios"
)
HARDLY = 0.05
"""Slope d ln v/d ln x up to which v hardly depends on x: 26 % for a factor of 100."""


def averaged(rows: Sequence[Row]) -> SeedTable:
    """Growth efficiency averaged over impact parameters, for each seed and speed that has all of them."""
    values = {}
    for key, some in grouped(rows, "seed", "speed").items():
        if len(some) == some[0]["offsets"]:
            offset, efficiency = np.array([(row["offset"], row["growth_efficiency"]) for row in some]).T
            values[key] = float(impact_weights(offset, 1.0) @ efficiency)
    return seed_table(values)


def break_up_speed(row: Row) -> float:
    """20 √(E_break/m) [m/s], the critical speed of Wada et al. (2013); m is the mass of a grain."""
    return 20.0 * math.sqrt(row["break_energy"] / row["grain_mass"])


def growth_panels(
    key: str, label: str, rows: Sequence[Row], guides: Sequence[Guide] = (), unit: float = 1.0
) -> list[Panel]:
    """Panels: f averaged over impact parameters for each value of a parameter; f of each impact parameter.

    Parameters
    ----------
    key, label : str
        The parameter, and how the legend shows its value.
    unit : float, optional
        Unit of a value that is a number [SI].
    """
    by_value = grouped(rows, key)
    curves = []
    for value, some in by_value.items():
        found = averaged(some)
        curves.append(Curve(label.format(_in_unit(value, unit)), found.x, found.mean, *found.limits))
    single = []
    for offset, some in grouped(next(iter(by_value.values())), "offset").items():
        found = seed_table({(row["seed"], row["speed"]): row["growth_efficiency"] for row in some})
        single.append(Curve(f"{offset:.2f}", found.x, found.mean))
    x, y = "speed [m/s]", r"growth efficiency $(N_\mathrm{largest} - N_\mathrm{target})/N_\mathrm{projectile}$"
    title = rf"{curves[0].label}, $b/b_\mathrm{{max}}$:"
    return [Panel(x, y, curves, guides, zero=True), Panel(x, y, single, legend=title, zero=True)]


def _in_unit(value: Any, unit: float) -> str:
    return f"{value / unit:.3g}" if isinstance(value, float) else str(value)


def mass_ratio_panels(rows: Sequence[Row]) -> list[Panel]:
    """Growth efficiencies of all pairs of bodies, with the critical speed of the paper."""
    speed = break_up_speed(rows[0])
    guide = Guide(r"$20\,\sqrt{E_\mathrm{break}/m}$", np.array([speed]), np.zeros(1))
    return growth_panels("bodies", "{}", rows, [guide])


def compare_mass_ratios(rows: Sequence[Row]) -> list[Compared]:
    """Critical speeds of all pairs of bodies beside that of Wada et al. 2013."""
    paper = break_up_speed(rows[0])
    stated = f"{paper:.3g} m/s = 20 √(E_break/m) ({MEMORY})"
    compared, values = [], []
    for name, some in grouped(rows, "bodies").items():
        found = averaged(some).falls_below(0.0)
        verdict = found.verdict(paper, EQUAL_MASSES if some[0]["mass_ratio"] == 1.0 else "no reason is known")
        compared.append(Compared(f"critical speed of {name}", stated, found.text("m/s"), verdict))
        values += [found.value] if math.isfinite(found.value) else []
    if len(values) > 1:
        what, stated = "largest over smallest critical speed", "no strong dependence on the mass ratio (abstract)"
        ratio = Interval(max(values) / min(values))
        verdict = ratio.verdict(1.0, "they differ by more than half", within=0.5)
        compared.append(Compared(what, stated, ratio.text(), verdict))
    return compared


def compare_parameter(key: str, symbol: str, unit: str, size: float, rows: Sequence[Row]) -> list[Compared]:
    """Critical speeds for all values of a parameter of the contacts, on which they hardly depend in the paper.

    Parameters
    ----------
    key, symbol, unit, size
        The parameter, its symbol, the unit in which it is shown, and the size of this unit [SI].
    """
    found = {value: averaged(some).falls_below(0.0) for value, some in grouped(rows, key).items()}
    compared = [
        Compared(f"critical speed, {symbol} = {value / size:.3g} {unit}", "", one.text("m/s"), "")
        for value, one in found.items()
    ]
    known = {value: one.value for value, one in found.items() if math.isfinite(one.value) and value > 0.0}
    if len(known) > 2:
        fit = power_law(np.array(list(known)), np.array(list(known.values())))
        slope = Interval(fit.exponent, fit.low, fit.high)
        verdict = slope.verdict(0.0, "the critical speed depends on it", within=HARDLY)
        what, stated = f"d ln v/d ln {symbol} of the critical speed v", "0: it hardly depends on it (abstract)"
        compared.append(Compared(what, stated, slope.text(), verdict))
    return compared


def _small(speeds: list[str], keys: dict[str, Any] | None = None) -> dict[str, Any]:
    """[sweep] of a small version: two speeds, two impact parameters, two seeds."""
    given = {"impact.speed": speeds, "impact.impact_parameter": ["0.289 c", "0.764 c"]} | (keys or {})
    return {"seeds": 2, "vary": given}


def _of_parameter(name: str, what: str, paper: str, key: str, symbol: str, unit: tuple[str, float]) -> PaperFigure:
    """Figure of the growth efficiency for several values of a parameter of the contacts."""
    label = f"{symbol} = {{}} {unit[0]}"
    return PaperFigure(
        name,
        f"Growth efficiency of equal aggregates of ice (BPCA), {what}",
        (paper,),
        lambda rows: compare_parameter(key, symbol, *unit, rows),
        lambda rows: growth_panels(key, label, rows, unit=unit[1]),
        SMALL,
        _small(["4 m/s", "80 m/s"]),
    )


WADA_2013 = ("Wada, Tanaka, Okuzumi, Kobayashi, Suyama, Kimura & Yamamoto 2013, A&A 559, A62",)
SMALL = {"target.grains": 8, "projectile.grains": 8}
"""Bodies of the small versions."""
FIGURES = (
    PaperFigure(
        "wada2013-ice",
        "Growth efficiency of aggregates of ice (BPCA) of two sizes and mass ratios 1 and 8",
        WADA_2013,
        compare_mass_ratios,
        mass_ratio_panels,
        SMALL,
        _small(["4 m/s", "80 m/s"]) | {"together": [{"target.grains": [8, 16], "projectile.grains": [8, 8]}]},
    ),
    PaperFigure(
        "wada2013-silica",
        "Growth efficiency of equal aggregates of silica (BPCA)",
        WADA_2013,
        compare_mass_ratios,
        mass_ratio_panels,
        SMALL,
        _small(["0.4 m/s", "8 m/s"]),
    ),
    _of_parameter(
        "arakawa2022-rolling",
        "five rolling limits",
        "Arakawa, Tanaka & Kokubo 2022, ApJ 939, 100, arXiv:2210.00913",
        "forces.contact.rolling_limit",
        "ξ",
        ("Å", 1e-10),
    ),
    _of_parameter(
        "arakawa2022-viscosity",
        "five viscous times",
        "Arakawa, Tanaka & Kokubo 2022, ApJ 933, 144, arXiv:2205.13768",
        "forces.contact.viscous_time",
        "T",
        ("ps", 1e-12),
    ),
)
