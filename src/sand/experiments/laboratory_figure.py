"""Figure of packings that were compressed, stretched or sheared: stress, shares of what is dissipated, coordination."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..analysis.ledger_columns import ALWAYS_LOST, DAMPED
from ..plotting.papers import Curve, Guide, Panel, panels_figure
from ..theory.compression import (
    CLOSEST,
    arakawa_coordination,
    kataoka_pressure,
    tatsuuma_pressure,
    tatsuuma_strength,
)

POINTS = 60
"""Largest number of points of a curve."""
CHANNELS = ("rolling", "sliding", "twisting")
"""Losses that are drawn one by one; all others are drawn as one."""
NOUNS = {"compress": "pressure", "stretch": "tension", "shear": "shear stress"}


def laboratory_figure(runs: Sequence[dict[str, Any]]) -> Figure:
    """Figure of the outcomes of a job, with the range of its seeds.

    Parameters
    ----------
    runs : Sequence[dict]
        Outcomes, as `experiments.laboratory.Loaded.to_dict`.
    """
    first = runs[0]
    compressed = first["kind"] == "compress"
    name, label = ("mean_filling", r"filling factor $\phi$") if compressed else ("strain", "strain")
    whole = [_columns(run["table"]) for run in runs]
    tables = [_rising(table, name) for table in whole] if compressed else whole
    low, high = max(table[name].min() for table in tables), min(table[name].max() for table in tables)
    number = min(POINTS, *(len(table[name]) for table in tables))
    x = np.geomspace(low, high, number) if compressed else np.linspace(low, high, number)

    def curve(column: str, text: str) -> Curve:
        values = np.array([np.interp(x, table[name], table[column]) for table in tables])
        if compressed and column == "stress":  # fast compressions begin with noise, which a logarithm cannot show
            values[values <= 0.0] = np.nan
        return Curve(text, x, values.mean(axis=0), values.min(axis=0), values.max(axis=0))

    laws, numbers = [], []
    if compressed:
        scale, below = first["pressure_scale"], x[x < CLOSEST]
        laws = [
            Guide(r"$(E_\mathrm{roll}/r^3)\,\phi^3$, Kataoka et al. 2013", x, kataoka_pressure(x, scale)),
            Guide("Tatsuuma et al. 2023", below, tatsuuma_pressure(below, scale)),
        ]
        numbers = [Guide("Arakawa et al. 2019", x, arakawa_coordination(x))]
    if first["kind"] == "stretch":
        strength = tatsuuma_strength(first["filling_at_start"], first["surface_energy"], first["radius"])
        laws = [Guide("strength, Tatsuuma et al. 2019", x, np.full(len(x), strength))]
    seeds = f"{len(runs)} seed{'s' * (len(runs) > 1)}"
    parts = [curve(channel, channel) for channel in (*CHANNELS, "others")]
    log = "x" * compressed
    panels = [
        Panel(label, f"{NOUNS[first['kind']]} [Pa]", [curve("stress", seeds)], laws, "xy" * compressed, not compressed),
        Panel(label, "share of what is dissipated", parts, (), log),
        Panel(label, "coordination number $Z$", [curve("coordination", seeds)], numbers, log),
    ]
    if first["load"]:  # one pressure does not show how the packing yields
        over, unit = ("time", " [s]") if compressed else ("strain", "")
        free = [Curve("each seed" * (k == 0), one[over], one["filling"]) for k, one in enumerate(whole)]
        panels.insert(0, Panel(over + unit, r"filling factor $\phi$", free, log=""))
    energy = rf"$E_\mathrm{{roll}}=12\pi^2\gamma R\xi_\mathrm{{c}}$ = {first['roll_energy']:.3g} J, $R=r/2$"
    return panels_figure(panels, f"{first['kind']}: {first['grains']} grains, {seeds}; {energy}")


def _rising(table: dict[str, np.ndarray], name: str) -> dict[str, np.ndarray]:
    """Rows in which a column is larger than in all before; under a given load a packing may also expand."""
    column = table[name]
    larger = column > np.maximum.accumulate(np.concatenate([[-np.inf], column[:-1]]))
    return {key: values[larger] for key, values in table.items()}


def _columns(table: dict[str, list[float]]) -> dict[str, np.ndarray]:
    """Columns of a table without its first row, with the shares of what is dissipated in each of the others."""
    columns = {name: np.array(column, float) for name, column in table.items()}
    lost = {name: np.diff(columns[name]) for name in (*ALWAYS_LOST, *DAMPED) if name in columns}
    total = np.sum(list(lost.values()), axis=0)
    dissipates = total > 0.0
    shares = {
        name: np.where(dissipates, lost[f"lost_{name}"] / np.where(dissipates, total, 1.0), 0.0) for name in CHANNELS
    }
    shares["others"] = 1.0 - np.sum(list(shares.values()), axis=0)
    return {name: column[1:] for name, column in columns.items()} | shares
