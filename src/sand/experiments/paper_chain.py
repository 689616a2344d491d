"""Growth of an aggregate by collisions with copies of itself: Suyama et al. 2008."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..analysis.fits import power_law
from ..plotting.papers import Curve, Guide, Panel
from .paper_figure import MEMORY, Compared, PaperFigure, Row, grouped
from .seed_table import Interval, seed_table

SMALLEST = 8
"""Number of grains from which r_g ∝ N^(1/D) is fitted; smaller aggregates are not self-similar."""


def chain_panels(rows: Sequence[Row]) -> list[Panel]:
    """Panels: radius of gyration and contacts against the number of grains, for each speed."""
    size: list[Curve] = []
    contacts: list[Curve] = []
    for speed, some in grouped(rows, "speed").items():
        for curves, name in ((size, "gyration"), (contacts, "contacts_per_grain")):
            found = seed_table({(row["seed"], row["grains"]): row[name] for row in some})
            curves.append(Curve(f"{speed:g} m/s", found.x, found.mean, *found.limits))
    x = np.array([SMALLEST, max(row["grains"] for row in rows)], float)
    start = float(np.interp(SMALLEST, size[0].x, size[0].y))
    laws = [Guide(rf"$\propto N^{{1/{d:g}}}$", x, start * (x / SMALLEST) ** (1.0 / d)) for d in (1.9, 2.5)]
    number = "number of grains $N$"
    return [
        Panel(number, "radius of gyration / radius of a grain", size, laws, "xy"),
        Panel(number, "contacts per grain", contacts),
    ]


def compare_chain(rows: Sequence[Row]) -> list[Compared]:
    """Dimension D of r_g ∝ N^(1/D), where collisions stick without compression and where they compress."""
    compared = []
    for is_fast, stated, paper, within in ((False, "about 1.9, that of BCCA", 1.9, 0.1), (True, "about 2.5", 2.5, 0.1)):
        chosen = [r for r in rows if r["grains"] >= SMALLEST and (r["impact_energy"] >= r["roll_energy"]) == is_fast]
        if len({row["grains"] for row in chosen}) < 3:
            continue
        size, grains, seed = (np.array([row[name] for row in chosen]) for name in ("gyration", "grains", "seed"))
        fit = power_law(grains, size, seed)
        found = Interval(1.0 / fit.exponent, 1.0 / fit.high, 1.0 / fit.low)
        what = f"D of N ∝ r_g^D for E_imp {'≥' if is_fast else '<'} E_roll"
        verdict = found.verdict(paper, "the range of N is short, and D changes with N", within)
        compared.append(Compared(what, f"{stated} ({MEMORY})", found.text(), verdict))
    return compared


FIGURES = (
    PaperFigure(
        "suyama2008",
        "Growth of an aggregate of ice by head-on collisions with copies of itself",
        ("Suyama, Wada & Tanaka 2008, ApJ 684, 1310",),
        compare_chain,
        chain_panels,
        {"sequence.collisions": 4},
        {"seeds": 2, "vary": {"impact.speed": ["4 m/s"]}},
        ("largest", "impact_energy", "contacts_after", "gyration_after"),
    ),
)
