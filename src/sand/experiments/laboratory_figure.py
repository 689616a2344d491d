"""Figure of packings that were compressed, stretched or sheared: stress, shares of what is dissipated, coordination."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..plotting.papers import Curve, Guide, Panel, panels_figure
from ..theory.compression import (
    CLOSEST,
    arakawa_coordination,
    kataoka_pressure,
    tatsuuma_pressure,
    tatsuuma_strength,
)
from .laboratory_table import CHANNELS

POINTS = 60
"""Largest number of points of a curve."""
MOST_SHARES = 4
"""Largest number of groups whose shares of what is dissipated are drawn."""
NOUNS = {"compress": "pressure", "stretch": "tension", "shear": "shear stress"}
FILLING = r"filling factor $\phi$"
TOO_FAST, RISING = "open: too fast for a static stress", "rises to the end: no strength"
UNBALANCED = 0.2
"""Difference of the mean pressures on floor and lid, in those of the larger one, above which a row is not static."""

Columns = Mapping[str, np.ndarray]


def curve_of(tables: Sequence[Columns], x: str, y: str, label: str) -> Curve:
    """Mean and range of a column over the tables of several seeds, within the range of x that all of them have.

    Points are `weak` where a packing was loaded too fast, or the pressures on floor and lid differ.
    """
    logarithmic = x == "mean_filling"
    if logarithmic:
        tables = [_rising(table, x) for table in tables]
    low, high = max(table[x].min() for table in tables), min(table[x].max() for table in tables)
    number = min(POINTS, *(len(table[x]) for table in tables))
    places = np.geomspace(low, high, number) if logarithmic else np.linspace(low, high, number)
    values = np.array([np.interp(places, table[x], table[y]) for table in tables])
    if logarithmic and y == "stress":  # fast compressions begin with noise, which a logarithm cannot show
        values[values <= 0.0] = np.nan
    fast = np.max([np.interp(places, table[x], _fast(table)) for table in tables], axis=0) > 1.0
    return Curve(label, places, values.mean(axis=0), values.min(axis=0), values.max(axis=0), np.asarray(fast))


def _fast(table: Columns) -> np.ndarray:
    """The rate over the largest that is slow enough; 2 where the inertia of packing and lid shows as a difference."""
    if "mean_pressure_floor" not in table:
        return table["rate_ratio"]
    both = np.array([table["mean_pressure_floor"], table["mean_pressure_lid"]])
    return np.where(np.abs(both[0] - both[1]) > UNBALANCED * np.abs(both).max(axis=0), 2.0, table["rate_ratio"])


def shares_of(tables: Sequence[Columns], x: str) -> list[Curve]:
    """Curves of the shares of what is dissipated, see `laboratory_table.shares`."""
    others = [1.0 - np.sum([one[f"share_{name}"] for name in CHANNELS], axis=0) for one in tables]
    whole = [{**one, "share_others": rest} for one, rest in zip(tables, others, strict=True)]
    return [curve_of(whole, x, f"share_{name}", name)._replace(weak=None) for name in (*CHANNELS, "others")]


def laboratory_figure(runs: Sequence[dict[str, Any]], column: str | None = None) -> Figure:
    """Figure of the outcomes of a job, with the range of its seeds, or of those of a sweep.

    Parameters
    ----------
    runs : Sequence[dict]
        Outcomes, as `experiments.laboratory.Loaded.to_dict`; of a sweep also with "group", the values of its keys. Each
        group has a curve, and a panel with the shares of what is dissipated; of many groups some, from first to last.
    column : str or None, optional
        A column of the table to draw alone.
    """
    groups: dict[str, list[Columns]] = {}
    for run in runs:
        table = {name: np.array(column[1:], float) for name, column in run["table"].items()}
        groups.setdefault(run.get("group", ""), []).append(table)
    first = runs[0]
    compressed = first["kind"] == "compress"
    x, label = ("mean_filling", FILLING) if compressed else ("strain", "strain")
    tables = next(iter(groups.values()))
    seeds = f"{len(tables)} seed{'s' * (len(tables) > 1)}"

    def curves(name: str) -> list[Curve]:
        return [curve_of(some, x, name, group or seeds) for group, some in groups.items()]

    title = f"{first['kind']}: {first['grains']} grains, {seeds}"
    if column is not None:
        return panels_figure([Panel(label, column, curves(column), (), "x" * compressed)], title)
    stress, number = curves("stress"), curves("coordination")
    laws, numbers = _laws(first, stress[0].x) if len({run["pressure_scale"] for run in runs}) == 1 else ([], [])
    log = "x" * compressed
    notes = [TOO_FAST] if any(one.weak is not None and one.weak.any() for one in stress) else []
    notes += [RISING] if not compressed and any(run["largest_at_end"] for run in runs) else []
    panels = [
        Panel(label, f"{NOUNS[first['kind']]} [Pa]", stress, laws, "xy" * compressed, not compressed, "; ".join(notes)),
        Panel(label, "coordination number $Z$", number, numbers, log),
    ]
    names = list(groups)
    for k in np.unique(np.linspace(0, len(names) - 1, min(len(names), MOST_SHARES)).round().astype(int)):
        shares = shares_of(groups[names[k]], x)
        panels.append(Panel(label, "share of what is dissipated", shares, (), log, legend=names[k]))
    if first["largest_load"]:  # one pressure does not show how the packing yields
        over, unit = ("time", " [s]") if compressed else ("strain", "")
        free = [
            Curve((name or "each seed") * (k == 0), one[over], one["filling"], look=look)
            for look, (name, some) in enumerate(groups.items())
            for k, one in enumerate(some)
        ]
        panels.insert(0, Panel(over + unit, FILLING, free, log=""))
    energy = rf"$E_\mathrm{{roll}}=12\pi^2\gamma R\xi_\mathrm{{c}}$ = {first['roll_energy']:.3g} J, $R=r/2$"
    return panels_figure(panels, f"{title}; {energy}")


def _rising(table: Columns, name: str) -> Columns:
    """Rows in which a column is larger than in all before; under a given load a packing may also expand."""
    column = table[name]
    larger = column > np.maximum.accumulate(np.concatenate([[-np.inf], column[:-1]]))
    return {key: values[larger] for key, values in table.items()}


def _laws(run: dict[str, Any], x: np.ndarray) -> tuple[list[Guide], list[Guide]]:
    """Laws of the literature: of the stress, and of the coordination number."""
    if run["kind"] == "compress":
        scale, below = run["pressure_scale"], x[x < CLOSEST]
        return [
            Guide(r"$(E_\mathrm{roll}/r^3)\,\phi^3$, Kataoka et al. 2013", x, kataoka_pressure(x, scale)),
            Guide("Tatsuuma et al. 2023", below, tatsuuma_pressure(below, scale)),
        ], [Guide("Arakawa et al. 2019", x, arakawa_coordination(x))]
    if run["kind"] == "stretch":
        strength = tatsuuma_strength(run["filling_at_start"], run["surface_energy"], run["radius"])
        return [Guide("strength, Tatsuuma et al. 2019", x, np.full(len(x), strength))], []
    return [], []
