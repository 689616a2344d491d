"""`sand scatter CASE.toml`: cross-sections, maps and trajectories of two bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from ..basics.errors import BadInput
from ..io.run_folder import FLIGHTS
from . import options, parsing, report


def _check(values: Mapping[str, Any]) -> Iterator[str]:
    """Errors of options that exclude each other."""
    if values["resume"] and values["overwrite"]:
        yield "--resume and --overwrite exclude each other"


@parsing.command(
    "scatter", short_help="Compute cross-sections and trajectories of two bodies from a case file.", check=_check
)
@click.argument("case", metavar="CASE.toml", type=options.CASE_FILE)
@click.option("--out", metavar="DIR", type=options.FOLDER, help="Folder for the files (default: the case's name).")
@options.workers
@options.scheduler
@options.wall_time
@click.option("--resume", is_flag=True, help="Continue the flights in the folder, as `sand resume` does.")
@options.overwrite
@options.output
@options.drawing
def command(case: str, out: str | None, resume: bool, overwrite: bool, **how: Any) -> None:
    """Compute the encounters of two bodies that CASE.toml describes.

    Writes scattering.json, results.csv and a figure to the folder, and for cross-sections and maps flights.csv with
    every flight. The numbers do not depend on the number of workers or on interruptions; continue an interrupted job
    with `sand resume`.
    """
    from ..experiments.scattering.job import ScatterJob
    from .launch import refuse_folder

    job = ScatterJob(case, out, resume=resume, overwrite=overwrite)
    if not resume:
        refuse_folder(job.folder, Path(case), overwrite=overwrite)
    elif not (job.folder / FLIGHTS).exists():
        raise BadInput(f"there is nothing to resume in {job.folder}: no {FLIGHTS}")
    scatter(job, **how)


def scatter(job: Any, *, quiet: bool, as_json: bool, **execution: Any) -> None:
    """Run a `ScatterJob` and print the results; `execution` as for `job.run_job`. Raises BadInput as it does."""
    from .job import run_job

    content = run_job(job, quiet=quiet, as_json=as_json, **execution)
    rows = [*result_rows(content), ("files", report.listed(job.folder))]
    content["folder"] = str(job.folder)
    report.answer(content, f"scatter {job.path}", rows, as_json=as_json, quiet=quiet)


def result_rows(content: dict[str, Any]) -> report.Rows:
    """The most important results."""
    if "cross_sections" in content:
        return [row for one in content["cross_sections"] for row in _cross_section(one)]
    if "cells" in content:
        hits, flights = (sum(cell[k] for cell in content["cells"]) for k in ("hits", "flights"))
        return [("cells", f"{len(content['cells'])}, {flights} flights, {hits} hits{_drift(content)}")]
    from ..experiments.scattering.flights import LARGEST_DRIFT

    unit = content["b_max"]
    return [
        (
            f"set-up {one['setup']}, b = {one['impact_parameter'] / unit:.4g} b_max" if unit else "flight",
            one["end"]
            + (f"; the target has {one['exchanged']:.1%} of the energy" if one["end"] != "hit" else "")
            + f"; drift {one['drift']:.0e}"
            + (f", above {LARGEST_DRIFT:g}: lower the tolerance" if one["drift"] > LARGEST_DRIFT else ""),
        )
        for one in content["trajectories"]
    ]


def _cross_section(one: dict[str, Any]) -> report.Rows:
    text = f"sigma = {one['sigma']:.4g} +- {one['sigma_error']:.1g} m^2, {one['enhancement']:.4g} pi (r1 + r2)^2"
    if one["analytic"] > 0.0:
        text += f", c = {one['c']:.3f} +- {one['c_error']:.3f}"
    rate = one["flights"] / max(one["seconds"], 1e-9)
    lost = "".join(f", {one[k]} {k}" for k in ("bound", "failed") if one[k])
    return [(f"{one['speed']:.4g} m/s", f"{text} ({one['flights']} flights{lost}, {rate:.0f}/s{_drift(one)})")]


def _drift(one: dict[str, Any]) -> str:
    """The largest energy error, and how many flights exceed its limit."""
    from ..experiments.scattering.flights import LARGEST_DRIFT

    above = f", {one['inaccurate']} above {LARGEST_DRIFT:g}" if one["inaccurate"] else ""
    return f"; drift up to {one['drift']:.0e}{above}"
