"""`sand analyse DIR`: measures the growth of aggregates in one or many runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from ..basics.errors import BadInput
from . import options, parsing, report


def _check(values: Mapping[str, Any]) -> Iterator[str]:
    """Errors of the values of options."""
    window, folders = values["window"], values["folders"] or ()
    if window is not None and not 1.0 <= window[0] < window[1]:
        yield f"--window {window[0]:g} {window[1]:g}: the first must be at least 1, the second above it"
    if len({Path(folder).absolute() for folder in folders}) < len(folders):
        yield "the same folder is given twice"


@parsing.command("analyse", short_help="Measure growth, moments and fractal dimension of runs.", check=_check)
@click.argument("folders", metavar="DIR...", nargs=-1, required=True, type=options.RUN)
@click.option(
    "--out",
    metavar="FOLDER",
    type=options.FOLDER,
    help="Folder for analysis.json, growth.csv, degrees.csv, aggregates.csv and growth.png.",
)
@click.option("--window", nargs=2, type=float, metavar="S1 S2", help="Range of S, mean over boxes, for z and λ(S).")
@click.option("--guides", is_flag=True, help="Draw the power laws of the paper in growth.png, too.")
@click.option("--overwrite", is_flag=True, help="Replace an earlier analysis in FOLDER.")
@options.output
@options.drawing
def command(
    folders: tuple[str, ...],
    out: str | None,
    window: tuple[float, float] | None,
    guides: bool,
    overwrite: bool,
    **output: bool,
) -> None:
    """Measure how aggregates grew in each DIR: a run, or a folder of runs that differ in their seeds (`sand grow`).

    Results are S(t) with its exponent z and local degree λ(S) = d ln(dS/dt)/d ln S, moments against size, the fractal
    dimension, and the temperatures of single grains and of clusters, each with an error from the scatter between boxes;
    that of z includes the unknown kernel. Two DIRs are also compared with each other.
    """
    from ..experiments.growth_report import NAMES, compare_growth, ensemble_summary, read_ensemble, write_analysis

    target = None if out is None else _output_folder(Path(out), NAMES, overwrite)
    ensembles = []
    for folder in folders:
        if not output["quiet"]:
            report.reading(folder)
        ensembles.append(read_ensemble(folder, window))
    content = {"ensembles": [ensemble_summary(one) for one in ensembles], "comparison": compare_growth(ensembles)}
    if target is not None:
        write_analysis(target, ensembles, content, guides)
    if output["as_json"]:
        report.emit(content)
    elif not output["quiet"]:
        _show(content, target)


def _output_folder(folder: Path, names: Sequence[str], overwrite: bool) -> Path:
    existing = [name for name in names if (folder / name).exists()]
    if existing and not overwrite:
        raise BadInput(f"{folder / existing[0]} exists; give another --out, or --overwrite")
    if not folder.parent.is_dir() or (folder.exists() and not folder.is_dir()):
        raise BadInput(f"--out {folder} cannot be a folder; give another one")
    return folder


def _show(content: dict[str, Any], folder: Path | None) -> None:
    from ..basics.units import format_quantity

    for one in content["ensembles"]:
        fitted = f" for large S; fitted from S = {one['window'][0]:g} to {one['window'][1]:.4g}"
        rows = [
            ("boxes", f"{one['boxes']} of {one['grains']} grains"),
            ("S", f"{one['mean_size']:.3g}{_error(one['mean_size_error'])} at {format_quantity(one['time'], 's')}"),
            ("z", _law(one, "z", "S ∝ t^", fitted)),
            ("λ", _kernels(one["z"]) if one["z"] else ""),
            ("λ(S)", _local_degrees(one)),
            ("", _law(one, "slope", "slope of ln S over ln t: ") if one["slope"] else ""),
            ("moments", _law(one, "moment", "μ ∝ N^", "; the paper: 0.63")),
            ("", _law(one, "moment_without_rings", "without rings N^") if one["moment"] else ""),
            ("D_f", _law(one, "dimension", "", " from N(r_g)")),
            ("kernel", _capture(one)),
            *_temperatures(one["temperatures"]),
        ]
        report.show(one["name"], [row for row in rows if row[1]])
    comparison = content["comparison"]
    if comparison is not None:
        when = format_quantity(comparison["time"], "s")
        rows = [
            ("ln S", f"differ by {comparison['sigma']:.3g} standard errors at {when}"),
            ("S", f"differ by {comparison['sigma_of_size']:.3g}"),
        ]
        report.show(f"{comparison['first']} and {comparison['second']}", rows)
    if folder is not None:
        report.show("files", [("folder", str(folder))])


def _kernels(law: dict[str, Any]) -> str:
    """Degree λ = 1 − 1/z with its error from the scatter between boxes, and what each kernel gives."""
    each = ", ".join(f"{degree:.2f} ({name})" for name, degree in law["degrees"].items())
    return f"1 − 1/z = {law['degree']:.2f}{_error(law['degree_error'])} of the kernel: {each}"


def _local_degrees(one: dict[str, Any]) -> str:
    """λ(S) in each window of S, or why it is unknown."""
    if one["local_degrees"] is None:
        return f"unknown: {one['missing']['local_degrees']}"
    return ", ".join(
        f"{found['degree']:.2f}{_error(found['error'])} (S {found['low_size']:.3g} to {found['high_size']:.3g})"
        for found in one["local_degrees"]
    )


def _capture(one: dict[str, Any]) -> str:
    """c and γ of the kernel of populations of dilute dust, or why they are unknown; empty for others."""
    kernel = one.get("kernel")
    if kernel is None:
        return ""
    law = kernel["law"]
    if law is None:
        return f"unknown: {kernel['missing']['law']}"
    texts = {name: f"{found['value']:.3g}{_interval(found['low'], found['high'])}" for name, found in law.items()}
    power, net = f"{texts['factor']} with μ = μ₁ N^{texts['exponent']}", f"{texts['net_factor']} with net moments"
    return f"c ⟨π b_max² v⟩, c = {power}, {net}"


def _temperatures(kinds: dict[str, Any]) -> list[tuple[str, str]]:
    """Temperatures of single grains and of clusters, a line each."""
    rows = []
    for kind, name in (("single", "single grains"), ("clusters", "clusters")):
        found = kinds.get(kind, {})
        if found.get("rotation") is None:
            continue
        translation, rotation, median = (
            f"{found[key]:.3g}{_error(math.nan if found[f'{key}_error'] is None else found[f'{key}_error'])} K"
            for key in ("translation", "rotation", "rotation_median")
        )
        rows.append((name, f"translation {translation}, rotation {rotation} (median {median})"))
    return rows


def _error(error: float) -> str:
    return f" ± {error:.2g}" if math.isfinite(error) else ""


def _law(one: dict[str, Any], key: str, before: str, after: str = "") -> str:
    """One fitted law as text, or why it could not be fitted."""
    law = one[key]
    if law is None:
        return f"unknown: {one['missing'][key]}"
    value, low, high = law.get("exponent", law.get("value")), law.get("low", math.nan), law.get("high", math.nan)
    error = "" if key == "z" else _error(law["error"])  # the interval of z is not symmetric
    return f"{before}{value:.3g}{error}{_interval(low, high)}{after}"


def _interval(low: float, high: float) -> str:
    """A 95 % interval as text, empty if there is none."""
    ends = f"above {low:.3g}" if math.isinf(high) else f"from {low:.3g} to {high:.3g}"
    return "" if math.isnan(low) else f" (95 % {ends})"
