"""Compression and disruption of two equal fluffy aggregates (BCCA) in head-on collisions: Wada et al. 2007, 2008."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..analysis.fits import power_law
from ..plotting.papers import Curve, Guide, Panel
from .paper_figure import MEMORY, Compared, PaperFigure, Row
from .seed_table import Interval, SeedTable, seed_table

ONSET = 10.0
"""Impact energy over E_roll at which the fit of the radius of gyration begins; it ends at N E_roll."""
ROLL, BREAK = r"$E_\mathrm{imp}/(N E_\mathrm{roll})$", r"$E_\mathrm{imp}/(N_k E_\mathrm{break})$"


def against_energy(rows: Sequence[Row], value: str, breaking: bool = False) -> SeedTable:
    """A result against E_imp/(N E_roll), or E_imp/(N_k E_break), for each seed.

    N is the number of grains of both bodies, N_k that of their contacts before the collision.
    """
    scale = [r["contacts_before"] * r["break_energy"] if breaking else r["grains"] * r["roll_energy"] for r in rows]
    unit = float(np.mean(scale))
    return seed_table({(r["seed"], float(f"{r['impact_energy'] / unit:.6g}")): r[value] for r in rows})


def _curve(found: SeedTable) -> list[Curve]:
    return [Curve("mean and range of the seeds", found.x, found.mean, *found.limits)]


def compression_panels(rows: Sequence[Row]) -> list[Panel]:
    """Panels: radius of gyration and contacts of the largest remnant, and its mass."""
    size, contacts = against_energy(rows, "gyration"), against_energy(rows, "contacts_per_grain")
    mass = against_energy(rows, "largest_remnant", breaking=True)
    x = np.array([ONSET / rows[0]["grains"], 1.0])
    law = Guide(r"$\propto E_\mathrm{imp}^{-0.1}$", x, np.interp(0.1, size.x, size.mean) * (x / 0.1) ** -0.1)
    disrupted = Guide("10", np.array([10.0]), np.zeros(1))
    return [
        Panel(ROLL, "radius of gyration / radius of a grain", _curve(size), [law], "xy"),
        Panel(ROLL, "contacts per grain", _curve(contacts)),
        Panel(BREAK, "largest remnant / total mass", _curve(mass), [disrupted]),
    ]


def compare_compression(rows: Sequence[Row]) -> list[Compared]:
    """Exponent of the radius of gyration, and energy of disruption."""
    energy, seed = (np.array([row[name] for row in rows]) for name in ("impact_energy", "seed"))
    roll, compared = rows[0]["roll_energy"], []
    used = (energy >= ONSET * roll) & (energy <= rows[0]["grains"] * roll)
    if len(set(energy[used])) > 2:
        fit = power_law(energy[used], np.array([row["gyration"] for row in rows])[used], seed[used])
        slope = Interval(fit.exponent, fit.low, fit.high)
        what = f"exponent of r_g ∝ E_imp^x, {ONSET:g} E_roll to N E_roll"
        verdict = slope.verdict(-0.1, "the scaling law is for larger aggregates than these", within=0.02)
        compared.append(
            Compared(what, f"−0.1 ({MEMORY}; that there is such a law: 2008, abstract)", slope.text(), verdict)
        )
    broken = against_energy(rows, "largest_remnant", breaking=True).falls_below(0.5)
    what, stated = (
        "E_imp/(N_k E_break) beyond which less than half of the mass stays together",
        "about 10 (2007, abstract)",
    )
    verdict = broken.verdict(10.0, "the paper's aggregates are two-dimensional", within=1.0)
    return [*compared, Compared(what, stated, broken.text(), verdict)]


def _of_material(name: str, material: str, speeds: list[str]) -> PaperFigure:
    return PaperFigure(
        name,
        f"Head-on collisions of equal aggregates of {material} (BCCA)",
        ("Wada, Tanaka, Suyama, Kimura & Yamamoto 2007, ApJ 661, 320", "the same authors 2008, ApJ 677, 1296"),
        compare_compression,
        compression_panels,
        {"target.grains": 8, "projectile.grains": 8},
        {"seeds": 2, "vary": {"impact.speed": speeds}},
    )


FIGURES = (
    _of_material("wada2008-ice", "ice", ["4 m/s", "20 m/s", "60 m/s"]),
    _of_material("wada2008-quartz", "quartz", ["0.4 m/s", "2 m/s", "6 m/s"]),
)
