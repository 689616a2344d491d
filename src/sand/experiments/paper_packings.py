"""Packings that are compressed and stretched: Kataoka 2013, Tatsuuma 2019 and 2023, Arakawa 2019."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from ..analysis.fits import power_law
from ..plotting.papers import Curve, Guide, Panel
from ..theory.compression import CLOSEST, arakawa_coordination, kataoka_pressure, tatsuuma_pressure, tatsuuma_strength
from .laboratory_figure import FILLING, TOO_FAST, curve_of, shares_of
from .laboratory_table import CHANNELS
from .paper_figure import MEMORY, Compared, PaperFigure, Row, grouped
from .seed_table import OUTSIDE, Interval, mean_of, seed_table

NEAR, NEAR_DENSE = 0.15, 0.03
"""Relative range of φ on either side over which a value at φ is averaged; in dense packings it fluctuates less."""
FLUFFY, DENSE = (0.03, 0.05, 0.07, 0.1), (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
"""Filling factors at which pressures are compared with the laws of fluffy and of dense packings."""
RUNNING = 5
"""Rows of a stretch over which the tension is averaged, before its largest value is taken: a strain of 0.1."""
SHARES = tuple(f"share_{name}" for name in CHANNELS)


def near(rows: Sequence[Row], value: Callable[[Row], float], filling: float, width: float = NEAR) -> Interval:
    """Mean of a value over rows near a filling factor, and over seeds, with its interval; NaN unless all are there."""
    means = []
    for some in grouped(rows, "seed").values():
        chosen = [value(row) for row in some if abs(math.log(row["mean_filling"] / filling)) <= math.log1p(width)]
        means.append(float(np.mean(chosen)) if max(row["mean_filling"] for row in some) > 0.97 * filling else math.nan)
    return mean_of(means)


def tables_of(rows: Sequence[Row], *names: str) -> list[dict[str, np.ndarray]]:
    """Columns of the rows of each run."""
    return [{name: np.array([r[name] for r in some]) for name in names} for some in grouped(rows, "run").values()]


def rates_of(rows: Sequence[Row]) -> dict[float, list[Row]]:
    """Rows by their rate of strain in units of 1/t_c, the fastest first."""
    found = grouped([row | {"rate_of_contact": float(f"{row['rate'] * row['contact_time']:.3g}")} for row in rows],
                    "rate_of_contact")  # fmt: skip
    return dict(reversed(found.items()))


def compression_panels(rows: Sequence[Row]) -> list[Panel]:
    """Panels: pressure with two laws, over that of Kataoka et al., shares of what is dissipated, coordination."""
    scale, stress, ratio, number = rows[0]["pressure_scale"], list[Curve](), list[Curve](), list[Curve]()
    for rate, some in rates_of(rows).items():
        tables = tables_of(some, "mean_filling", "stress", "coordination", "rate_ratio", *SHARES)
        over = [one | {"stress": one["stress"] / kataoka_pressure(one["mean_filling"], scale)} for one in tables]
        name = rf"$C_v$ = {rate:g}"
        stress.append(curve_of(tables, "mean_filling", "stress", name))
        ratio.append(curve_of(over, "mean_filling", "stress", name))
        number.append(curve_of(tables, "mean_filling", "coordination", name))
    whole, x = next(iter(rates_of(rows).values())), np.geomspace(stress[0].x[0], stress[0].x[-1], 60)
    below = x[x < CLOSEST]
    kataoka, tatsuuma = r"$(E_\mathrm{roll}/r^3)\,\phi^3$", r"$(E_\mathrm{roll}/r^3)(1/\phi-1/\phi_\mathrm{max})^{-3}$"
    laws = [
        Guide(kataoka, x, kataoka_pressure(x, scale)),
        Guide(tatsuuma, below, tatsuuma_pressure(below, scale)),
    ]
    relative = [
        Guide(kataoka, x, np.ones(len(x))),
        Guide(tatsuuma, below, tatsuuma_pressure(below, 1.0) / kataoka_pressure(below, 1.0)),
    ]
    shares = shares_of(tables_of(whole, "mean_filling", "rate_ratio", *SHARES), "mean_filling")
    return [
        Panel(FILLING, "pressure [Pa]", stress, laws, "xy", legend=TOO_FAST),
        Panel(FILLING, f"pressure over {kataoka}", ratio, relative, "xy"),
        Panel(FILLING, "share of what is dissipated", shares),
        Panel(
            FILLING, "coordination number $Z$", number, [Guide("$2+9.38\\,\\phi^{1.62}$", x, arakawa_coordination(x))]
        ),
    ]


def compare_pressures(rows: Sequence[Row]) -> list[Compared]:
    """Pressures of Kataoka et al. 2013 and Tatsuuma et al. 2023, what dissipates, and Z of Arakawa et al. 2019."""
    compared = []
    for rate, some in rates_of(rows).items():
        for filling in FLUFFY:
            found = near(some, _over(kataoka_pressure), filling)
            fast = near(some, itemgetter("rate_ratio"), filling).value
            what = f"P/((E_roll/r³) φ³) at φ = {filling:g}, C_v = {rate:g}"
            compared.append(_compared(what, found, _reason(fast, found), 0.2))
    dense = next(iter(rates_of(rows).values()))
    for filling in DENSE:
        found = near(dense, _over(tatsuuma_pressure), filling, NEAR_DENSE)
        what = f"P/((E_roll/r³)(1/φ − 1/{CLOSEST})⁻³) at φ = {filling:g}"
        compared.append(_compared(what, found, "form and φ_max are from memory", 0.2))
    for filling in DENSE:
        found = near(
            dense, lambda row: row["coordination"] / arakawa_coordination(row["mean_filling"]), filling, NEAR_DENSE
        )
        compared.append(_compared(f"Z/(2 + 9.38 φ^1.62) at φ = {filling:g}", found, "no reason is known", 0.05))
    for name in CHANNELS:
        values = {f"{filling:g}": near(dense, itemgetter(f"share_{name}"), filling, NEAR_DENSE) for filling in DENSE}
        known = {filling: one.value for filling, one in values.items() if math.isfinite(one.value)}
        text = ", ".join(f"{max(value, 0.0):.2f}" for value in known.values())  # rounding gives -1e-16
        compared.append(Compared(f"share of {name} in what is dissipated at φ = {', '.join(known)}", "", text, ""))
    return [one for one in compared if one.ours not in ("", OUTSIDE)]


def _over(law: Callable[..., Any]) -> Callable[[Row], float]:
    """Pressure of a row over that of a law."""
    return lambda row: float(row["stress"] / law(row["mean_filling"], row["pressure_scale"]))


def _reason(fast: float, ratio: Interval) -> str:
    """Why a ratio differs from 1: a box that is too fast makes the stress larger, never smaller."""
    explains = fast > 1.0 and ratio.value > 1.0
    return f"perhaps the rate: the box is {fast:.2g} times too fast" if explains else "no reason is known"


def _compared(what: str, ratio: Interval, reason: str, most: float) -> Compared:
    """A ratio to a law from memory; `reason`: why it differs by more than `most`."""
    near_one = abs(ratio.value - 1.0) <= most
    return Compared(
        what, f"1 ({MEMORY})", ratio.text(), ratio.verdict(1.0, f"within {most:.0%}" if near_one else reason)
    )


def strengths(rows: Sequence[Row]) -> list[Row]:
    """Strength of each run, the largest running mean of its tension, its strain, and whether it is at the end."""
    found = []
    for some in grouped(rows, "run").values():
        tension = np.convolve([row["stress"] for row in some], np.ones(RUNNING) / RUNNING, "valid")
        k = int(tension.argmax())
        found.append(some[k + RUNNING // 2] | {"strength": float(tension[k]), "at_end": k == len(tension) - 1})
    return found


def strength_panels(rows: Sequence[Row]) -> list[Panel]:
    """Panels: strength over φ at the start, with the law; tension over strain for each φ."""
    found, first = strengths(rows), rows[0]
    table = seed_table({(row["seed"], row["aggregate.filling"]): row["strength"] for row in found})
    x = np.geomspace(0.9 * table.x[0], 1.1 * table.x[-1], 30)
    law = Guide(
        r"$6\times10^5\,\mathrm{Pa}\,\phi^{1.8}$", x, tatsuuma_strength(x, first["surface_energy"], first["radius"])
    )
    curves = [
        curve_of(tables_of(some, "strain", "stress", "rate_ratio"), "strain", "stress", f"{filling:g}")
        for filling, some in grouped(rows, "aggregate.filling").items()
    ]
    points = [Curve("mean and range of the seeds", table.x, table.mean, *table.limits)]
    start = f"{FILLING} at the start"
    return [
        Panel(start, "tensile strength [Pa]", points, [law], "xy"),
        Panel("strain", "tension [Pa]", curves, (), "", True, r"$\phi$ at the start; " + TOO_FAST),
    ]


def compare_strengths(rows: Sequence[Row]) -> list[Compared]:
    """Tensile strengths beside 6e5 φ^1.8 Pa of Tatsuuma et al. 2019, and the exponent."""
    compared, found = [], strengths(rows)
    for filling, some in grouped(found, "aggregate.filling").items():
        law = tatsuuma_strength([row["filling_at_start"] for row in some], some[0]["surface_energy"], some[0]["radius"])
        ratio = mean_of(np.array([row["strength"] for row in some]) / law)
        fast, rising = max(row["rate_ratio"] for row in some), sum(row["at_end"] for row in some)
        reason = f"still rising at the end of {rising} of {len(some)} runs" if rising else _reason(fast, ratio)
        what = f"tensile strength/(6e5 Pa φ^1.8) at φ = {filling:g}"
        compared.append(_compared(what, ratio, reason, 0.3))
    ended = [row for row in found if not row["at_end"]]
    values = np.array([(row["filling_at_start"], row["strength"], row["seed"]) for row in ended]).T
    if len({row["aggregate.filling"] for row in ended}) > 2 and (values[1] > 0.0).all():
        fit = power_law(*values)
        slope = Interval(fit.exponent, fit.low, fit.high)
        verdict = slope.verdict(1.8, "no reason is known", within=0.1)
        compared.append(Compared("exponent x of a strength ∝ φ^x", f"1.8 ({MEMORY})", slope.text(), verdict))
    return compared


FIGURES = (
    PaperFigure(
        "kataoka2013",
        "Pressure, coordination and dissipation in compressed aggregates of ice (BCCA)",
        (
            "Kataoka, Tanaka, Okuzumi & Wada 2013, A&A 554, A4",
            "Tatsuuma, Kataoka, Okuzumi & Tanaka 2023, ApJ 953, 6",
            "Arakawa, Takemoto & Nakamoto 2019, PTEP 2019, 093E02",
        ),
        compare_pressures,
        compression_panels,
        {"aggregate.grains": 64},
        {"seeds": 2, "together": [{"compression.rate": ["3e-4 /t_c", "1e-4 /t_c"], "compression.to": [0.12, 0.1]}]},
        ("mean_filling", "stress", "coordination", "rate_ratio", *SHARES),
        ("tatsuuma2023", "arakawa2019"),
    ),
    PaperFigure(
        "tatsuuma2019",
        "Tensile strength of aggregates of ice (BCCA) that were compressed",
        ("Tatsuuma, Kataoka & Tanaka 2019, ApJ 874, 159",),
        compare_strengths,
        strength_panels,
        {"stretch.rate": "3e-3 /t_c", "stretch.to": 0.3},
        {"seeds": 2, "vary": {"aggregate.filling": [0.1, 0.2]}},
        ("strain", "stress", "rate_ratio"),
        compressed={"aggregate.grains": 64, "compression.rate": "1e-3 /t_c", "compression.to": 0.22},
    ),
)
