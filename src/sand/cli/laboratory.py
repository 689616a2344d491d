"""What `sand compress`, `stretch`, `shear` and `elastic` share: their options, and the rows that they print."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import click

from ..basics.threads import set_threads
from . import options, parsing, report

SHOWN = 12
"""Runs listed one by one on the screen; laboratory.json has all of them."""


RUNS = "Runs each seed in DIR/seed-N, with all files of `sand run`, and writes"
"""What a command does with seeds that have folders of their own."""


def command_of(
    name: str, short: str, what: str, job_of: tuple[str, str] = ("laboratory_job", "LaboratoryJob"), does: str = RUNS
) -> click.Command:
    """The command of a kind of loading; `job_of`: module and class of its job."""

    @parsing.command(name, short_help=short)
    @options.job_of_seeds
    @options.execution
    @options.output
    @options.drawing
    def command(
        case: str, out: str | None, seeds: list[int] | None, overwrite: bool, threads: int | None, **how: Any
    ) -> None:
        set_threads(threads)
        from .launch import refuse_folder

        module, kind = job_of
        made = getattr(import_module(f"sand.experiments.{module}"), kind)
        job = made(case, out, seeds, name, overwrite=overwrite)
        refuse_folder(job.folder, Path(case), overwrite=overwrite)
        laboratory(job, threads=threads, **how)

    command.help = (
        f"{what}\n\n{does} laboratory.json, results.csv with the rows of all seeds, and a figure "
        "to the folder. Ctrl-C interrupts it; continue with `sand resume`."
    )
    return command


def laboratory(job: Any, *, as_json: bool, quiet: bool, **execution: Any) -> None:
    """Run a `LaboratoryJob` and print the results; `execution` as for `job.run_job`. Raises BadInput as it does."""
    from .job import run_job

    content = run_job(job, as_json=as_json, quiet=quiet or as_json, lines=True, **execution)
    heading = f"resume {job.folder}" if job.resume else f"{job.COMMAND} {job.path}"
    rows = [*run_rows(content["runs"]), ("files", report.listed(job.folder))]
    report.answer(content, heading, rows, as_json=as_json, quiet=quiet)


def run_rows(runs: list[dict[str, Any]]) -> report.Rows:
    """The first SHOWN runs."""
    from ..basics.units import format_quantity

    def text(run: dict[str, Any]) -> str:
        if "bulk" in run:
            return moduli_text(run)
        last, most = (format_quantity(float(f"{run[name]:.3g}"), "Pa") for name in ("stress", "largest_stress"))
        ends = f"filling factor {run['filling_at_start']:.3g} to {run['filling']:.3g}, strain {run['strain']:.3g}"
        if run["kind"] == "compress":
            where = ""
        elif run["largest_at_end"]:
            where = ", where it still rises: that is no strength"
        else:
            where = f", at strain {run['strain_of_largest']:.3g}"
        stress = f"stress {last} at the end, {most} at most{where}; {run['coordination']:.2f} contacts per grain"
        rest = "at rest; " if run.get("at_rest") else "not at rest; " if "at_rest" in run else ""
        return f"{ends}; {stress}; {rest}{run['step']} steps, drift {run['drift']:.1e}"

    return report.first_of([(f"seed {run['seed']}", text(run)) for run in runs], SHOWN)


def moduli_text(run: dict[str, Any]) -> str:
    """Moduli and speeds of a packing at rest in words."""
    from ..basics.units import format_quantity

    bulk, shear, residual = (format_quantity(float(f"{run[name]:.3g}"), "Pa") for name in ("bulk", "shear", "residual"))
    waves = " and ".join(f"{run[f'speed_{kind}']:.3g}" for kind in ("longitudinal", "transverse"))
    static = " and ".join(f"{run[f'speed_{kind}_static']:.3g}" for kind in ("longitudinal", "transverse"))
    sound = f"sound {waves} m/s" if run["waves"] else "sound not measured"
    return (
        f"filling factor {run['filling']:.3g}, residual pressure {residual}; K {bulk}, G {shear}, linear up to "
        f"a strain of {run['linear_to']:g}; {sound}, of the moduli {static} m/s; "
        f"{run['coordination']:.2f} contacts per grain"
    )
