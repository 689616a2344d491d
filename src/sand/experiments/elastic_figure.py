"""Figure of packings at rest: moduli over strain, and arrivals of pulses over distance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..plotting.papers import Curve, Guide, Panel, panels_figure

MODULI = {"bulk": "$K$", "longitudinal": "$M$", "shear": "$G$"}
"""Moduli that are drawn."""


def elastic_figure(runs: Sequence[dict[str, Any]]) -> Figure:
    """Figure of the outcomes of a job, with the range of its seeds.

    Parameters
    ----------
    runs : Sequence[dict]
        Outcomes, as `experiments.elastic.Moduli.to_dict`.
    """
    strain = np.array(runs[0]["table"]["strain"])
    curves = []
    for name, label in MODULI.items():
        values = np.array([run["table"][name] for run in runs])
        curves.append(Curve(label, strain, values.mean(axis=0), values.min(axis=0), values.max(axis=0)))
    ends = np.array([strain.min() / 1.5, strain.max() * 1.5])
    affine = float(np.mean([run["affine_longitudinal"] for run in runs]))
    laws = [Guide("$M$ of affine motion", ends, np.full(2, affine))]
    panels = [Panel("strain", "modulus [Pa]", curves, laws, "xy")]
    if runs[0]["waves"]:
        panels.append(_arrivals(runs))
    filling = float(np.mean([run["filling"] for run in runs]))
    seeds = f"{len(runs)} seed{'s' * (len(runs) > 1)}"
    return panels_figure(panels, rf"elastic: {runs[0]['grains']} grains, {seeds}; $\phi$ = {filling:.3g}")


def _arrivals(runs: Sequence[dict[str, Any]]) -> Panel:
    """Arrivals over distance, means of all seeds and axes, and lines with the speeds that follow from the moduli."""
    curves, guides = [], []
    for kind in ("longitudinal", "transverse"):
        waves = [w for run in runs for w in run["waves"] if (w["along"] == w["polarised"]) == (kind == "longitudinal")]
        times, distances = (
            1e9 * np.array([w["arrivals"] for w in waves]),
            1e6 * np.array([w["distances"] for w in waves]),
        )
        curves.append(Curve(kind, times.mean(axis=0), distances.mean(axis=0)))
        speed = float(np.mean([run[f"speed_{kind}_static"] for run in runs]))
        ends = np.array([0.0, distances.max()])
        guides.append(Guide(f"{speed:.3g} m/s", 1e3 * ends / speed, ends))
    return Panel("time [ns]", "distance [µm]", curves, guides, "", legend="lines: of the moduli")
