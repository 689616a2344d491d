"""`sand analyse DIR`: how aggregates grew, in one run or in many."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ..errors import BadInput
from . import options, report


@click.command("analyse", short_help="Measure growth, moments and fractal dimension of runs.")
@click.argument("folders", metavar="DIR...", nargs=-1, required=True, type=options.PLACE)
@click.option(
    "--out",
    metavar="FOLDER",
    type=options.PLACE,
    help="Write analysis.json, growth.csv, aggregates.csv and growth.png there.",
)
@click.option("--window", nargs=2, type=float, metavar="S1 S2", help="Values of S between which z is fitted.")
@click.option("--overwrite", is_flag=True, help="Replace an earlier analysis in FOLDER.")
@options.as_json
@options.debug
def command(
    folders: tuple[str, ...],
    out: str | None,
    window: tuple[float, float] | None,
    overwrite: bool,
    as_json: bool,
) -> int:
    """Measure how aggregates grew in each DIR: a run, or a folder of runs alike but for their seeds (`sand grow`).

    S(t) with its exponent z, moments against size, the fractal dimension, each with an error from the scatter
    between boxes. Two DIRs are also compared with each other.
    """
    from ..experiments.growth_report import NAMES, compare_growth, ensemble_summary, read_ensemble, write_analysis

    if window is not None and not 1.0 <= window[0] < window[1]:
        raise BadInput(f"--window {window[0]:g} {window[1]:g}: the first must be at least 1, the second above it")
    if len({Path(folder).absolute() for folder in folders}) < len(folders):
        raise BadInput("the same folder is given twice")
    place = None if out is None else _place(Path(out), NAMES, overwrite)
    ensembles = [read_ensemble(folder, window) for folder in folders]
    content = {"ensembles": [ensemble_summary(one) for one in ensembles], "comparison": compare_growth(ensembles)}
    if place is not None:
        write_analysis(place, ensembles, content)
    if as_json:
        report.emit(content)
    else:
        _tell(content, place)
    return 0


def _place(folder: Path, names: Sequence[str], overwrite: bool) -> Path:
    there = [name for name in names if (folder / name).exists()]
    if there and not overwrite:
        raise BadInput(f"{folder / there[0]} exists; give another --out, or --overwrite")
    if not folder.parent.is_dir() or (folder.exists() and not folder.is_dir()):
        raise BadInput(f"--out {folder} cannot be a folder; give another one")
    return folder


def _tell(content: dict[str, Any], place: Path | None) -> None:
    from ..units import format_quantity

    for one in content["ensembles"]:
        rows = [
            ("boxes", f"{one['boxes']} of {one['grains']} grains"),
            ("S", f"{one['mean_size']:.3g}{_pm(one['mean_size_error'])} at {format_quantity(one['time'], 's')}"),
            (
                "z",
                _line(
                    one,
                    "z",
                    "S = (1 + t/zτ)^",
                    f", fitted from S = {one['window'][0]:g} until a box has {one['window'][1]:.4g}",
                ),
            ),
            ("", _line(one, "slope", "ln S over ln t has slope ", "") if one["slope"] else ""),
            ("moments", _line(one, "moment", "μ ∝ N^", "; the paper: 0.63")),
            ("", _line(one, "moment_without_rings", "without rings N^", "") if one["moment"] else ""),
            ("D_f", _line(one, "dimension", "", " from N(r_g)")),
        ]
        report.show(one["name"], [row for row in rows if row[1]])
    comparison = content["comparison"]
    if comparison is not None:
        report.show(
            f"{comparison['first']} against {comparison['second']}",
            [
                (
                    "ln S",
                    f"apart by {comparison['sigma']:.3g} standard errors at {format_quantity(comparison['time'], 's')}",
                ),
                ("S", f"apart by {comparison['sigma_of_size']:.3g}"),
            ],
        )
    if place is not None:
        report.show("files", [("folder", str(place))])


def _pm(error: float | None) -> str:
    return "" if error is None or error != error else f" ± {error:.2g}"


def _line(one: dict[str, Any], key: str, before: str, after: str) -> str:
    """A law in words, or why there is none."""
    law = one[key]
    if law is None:
        return f"not known: {one['missing'].get(key, '')}" if key in one["missing"] else ""
    value = law.get("exponent", law.get("value"))
    low, high = law.get("low"), law.get("high")
    known = low is not None and low == low
    between = f" (95 % from {low:.3g} to {high:.3g})" if known else ""
    return f"{before}{value:.3g}{_pm(law['error'])}{between}{after}"
