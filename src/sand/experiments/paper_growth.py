"""Growth efficiency against speed, and the speed above which it is negative: Wada et al. 2013, Arakawa et al. 2022."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..analysis.fits import power_law
from ..plotting.papers import Curve, Guide, Panel
from .paper_figure import MEMORY, Compared, Row, grouped
from .seed_table import Interval, SeedTable, ring_average, seed_table

WADA_2013 = "Wada et al. 2013, A&A 559, A62"
ARAKAWA_ROLLING = "Arakawa, Tanaka & Kokubo 2022, ApJ 939, 100, arXiv:2210.00913"
ARAKAWA_VISCOUS = "Arakawa, Tanaka & Kokubo 2022, ApJ 933, 144, arXiv:2205.13768"
EQUAL_MASSES = (
    "for equal masses about 50 m/s for ice is also what Wada et al. 2009 and Arakawa et al. 2022 find (from memory); "
    "the formula was fitted to many mass ratios"
)


def averaged(rows: Sequence[Row]) -> SeedTable:
    """Growth efficiency averaged over impact parameters, for each seed and speed that has all of them."""
    offsets = {row["offset"] for row in rows}
    values = {}
    for key, some in grouped(rows, "seed", "speed").items():
        if {row["offset"] for row in some} == offsets:
            values[key] = ring_average(*np.array([(row["offset"], row["growth_efficiency"]) for row in some]).T)
    return seed_table(values)


def break_up_speed(row: Row) -> float:
    """20 √(E_break/m) [m/s], the critical speed of Wada et al. (2013); m is the mass of a grain."""
    return 20.0 * math.sqrt(row["break_energy"] / row["grain_mass"])


def growth_panels(key: str, label: str, rows: Sequence[Row], guides: Sequence[Guide] = ()) -> list[Panel]:
    """Panels: f averaged over impact parameters for each value of a parameter; f of each impact parameter.

    Parameters
    ----------
    key, label : str
        The parameter, and how the legend shows its value.
    """
    by_value = grouped(rows, key)
    curves = []
    for value, some in by_value.items():
        found = averaged(some)
        curves.append(Curve(label.format(value), found.x, found.mean, *found.limits))
    single = []
    for offset, some in grouped(next(iter(by_value.values())), "offset").items():
        found = seed_table({(row["seed"], row["speed"]): row["growth_efficiency"] for row in some})
        single.append(Curve(f"{offset:.2f}", found.x, found.mean))
    x, y = "speed [m/s]", r"growth efficiency $(N_\mathrm{largest} - N_\mathrm{target})/N_\mathrm{projectile}$"
    title = rf"{curves[0].label}, $b/b_\mathrm{{max}}$:"
    return [Panel(x, y, curves, guides, zero=True), Panel(x, y, single, legend=title, zero=True)]


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
        verdict = found.verdict(paper, EQUAL_MASSES)
        compared.append(Compared(f"critical speed of {name}", stated, found.text("m/s"), verdict))
        values += [found.value] if math.isfinite(found.value) else []
    if len(values) > 1:
        what, stated = "largest over smallest critical speed", "no strong dependence on the mass ratio (abstract)"
        ratio = Interval(max(values) / min(values))
        verdict = ratio.verdict(1.0, "they differ by more than half", within=0.5)
        compared.append(Compared(what, stated, ratio.text(), verdict))
    return compared


def compare_parameter(key: str, symbol: str, unit: str, rows: Sequence[Row]) -> list[Compared]:
    """Critical speeds for all values of a parameter of the contacts, on which they hardly depend in the paper."""
    found = {value: averaged(some).falls_below(0.0) for value, some in grouped(rows, key).items()}
    compared = [
        Compared(f"critical speed, {symbol} = {value:g} {unit}", "", one.text("m/s"), "")
        for value, one in found.items()
    ]
    known = {value: one.value for value, one in found.items() if math.isfinite(one.value) and value > 0.0}
    if len(known) > 2:
        fit = power_law(np.array(list(known)), np.array(list(known.values())))
        slope = Interval(fit.exponent, fit.low, fit.high)
        verdict = slope.verdict(0.0, "the critical speed depends on it", within=0.1)
        what, stated = f"d ln v/d ln {symbol} of the critical speed v", "0: it hardly depends on it (abstract)"
        compared.append(Compared(what, stated, slope.text(), verdict))
    return compared
