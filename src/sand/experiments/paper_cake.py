"""A cake of silica that a lid compresses, with stiffer rolling and sliding and without: Seizinger et al. 2012."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..plotting.papers import Curve, Guide, Panel
from ..theory.compression import guettler_filling
from .paper_figure import MEMORY, Compared, PaperFigure, Row, grouped
from .seed_table import Interval, mean_of

PRESSURES = (1e3, 3e3, 1e4)
"""Pressures [Pa] at which filling factors are compared."""
ROLL, SLIDE = "forces.contact.roll_factor", "forces.contact.slide_factor"
SOFT = "grains with the stiffness of the theory roll and slide too easily, as the paper says (abstract)"
STIFF = "the factors mend a part of the difference; no other reason is known"


def filling_at(rows: Sequence[Row], pressure: float) -> float:
    """Filling factor at which the pressure of one run exceeds a value [Pa] for good, interpolated in ln P; or NaN."""
    load, filling = (np.array([row[name] for row in rows]) for name in ("stress", "mean_filling"))
    below = np.flatnonzero(load < pressure)
    if not below.size or below[-1] + 1 == len(load):
        return math.nan
    k = int(below[-1])
    if load[k] <= 0.0:
        return float(filling[k + 1])
    part = math.log(pressure / load[k]) / math.log(load[k + 1] / load[k])
    return float(filling[k] + part * (filling[k + 1] - filling[k]))


def at_pressure(rows: Sequence[Row], pressure: float) -> Interval:
    """Mean filling factor of the seeds at a pressure [Pa], with its interval."""
    return mean_of([filling_at(some, pressure) for some in grouped(rows, "seed").values()])


def compare_cakes(rows: Sequence[Row]) -> list[Compared]:
    """Filling factors at three pressures beside the curve of Güttler et al. 2009, and the forces on floor and lid."""
    compared = []
    for (roll, slide), some in sorted(grouped(rows, ROLL, SLIDE).items(), reverse=True):
        name = f"rolling x {roll:g}, sliding x {slide:g}"
        for pressure in PRESSURES:
            paper, found = float(guettler_filling(pressure)), at_pressure(some, pressure)
            what = f"φ at {pressure / 1e3:g} kPa, {name}"
            verdict = found.verdict(paper, STIFF if roll > 1.0 else SOFT, within=0.02)
            stated = f"{paper:.3g} (Güttler et al. 2009, measured; {MEMORY})"
            compared.append(Compared(what, stated, found.text(), verdict))
        loaded = [row for row in some if row["stress"] > PRESSURES[0]]
        apart = [abs(row["mean_pressure_floor"] / row["mean_pressure_lid"] - 1.0) for row in loaded]
        if apart:
            text = f"{max(apart):.2g} at most, {np.mean(apart):.2g} in the mean"
            what = f"forces on floor and lid differ by, above 1 kPa, {name}"
            compared.append(Compared(what, "0, at rest", text, ""))
    return compared


def cake_panels(rows: Sequence[Row]) -> list[Panel]:
    """Panels: filling factor over pressure with the measured curve, and coordination number."""
    curves, numbers = [], []
    for (roll, slide), some in sorted(grouped(rows, ROLL, SLIDE).items(), reverse=True):
        for k, run in enumerate(grouped(some, "seed").values()):
            label = f"rolling x {roll:g}, sliding x {slide:g}" if k == 0 else "_"
            phi, load, z = (np.array([row[name] for row in run]) for name in ("mean_filling", "stress", "coordination"))
            curves.append(Curve(label, np.where(load > 0.0, load, math.nan), phi))
            numbers.append(Curve(label, phi, z))
    x = np.geomspace(30.0, 3e4, 60)
    measured = Guide("Güttler et al. 2009", x, guettler_filling(x))
    filling = r"filling factor $\phi$"
    return [
        Panel("pressure [Pa]", filling, curves, [measured]),
        Panel(filling, "coordination number $Z$", numbers, log=""),
    ]


FIGURES = (
    PaperFigure(
        "seizinger2012",
        "Compression of a cake of silica (ballistic deposit) between walls",
        ("Seizinger, Speith & Kley 2012, A&A 541, A59", "Güttler, Krause, Geretshauser et al. 2009, ApJ 701, 130"),
        compare_cakes,
        cake_panels,
        {"aggregate.grains": 60, "aggregate.width": "6 um", "compression.rate": "1 m/s"},
        columns=("mean_filling", "stress", "coordination", "mean_pressure_floor", "mean_pressure_lid"),
    ),
)
