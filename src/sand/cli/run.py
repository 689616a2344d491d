"""`sand run CASE.toml`: the simulation that a case file describes."""

from __future__ import annotations

from pathlib import Path

import click

from . import options, report


@click.command("run", short_help="Run the simulation that a case file describes.")
@click.argument("case", metavar="CASE.toml")
@click.option("--out", metavar="DIR", help="Folder for the files (default: the case's name).")
@options.end_of_run('End of the run instead of that in the case, such as "5 us".')
@click.option("--seed", type=click.IntRange(min=0), metavar="N", help="Seed instead of that in the case.")
@click.option("--overwrite", is_flag=True, help="Replace the run that the folder holds.")
@options.as_json
@options.quiet
@options.debug
def command(
    case: str,
    out: str | None,
    until: str | None,
    seed: int | None,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Run the simulation that CASE.toml describes.

    Leaves in the folder: case.toml (as understood), trajectory.gsd, ledger.csv, summary.json, figure.png and
    checkpoints.  Ctrl-C stops at the next step; `sand resume` then goes on.
    """
    end = options.seconds(until)
    from ..run.build import simulation_of
    from ..run.case import read_case
    from .launch import End, launch, refuse_folder

    described = read_case(case)
    if end is not None:
        described.run.until, described.run.steps = end, None
    if seed is not None:
        described.run.seed = seed
    folder = Path(out or described.run.out or Path(case).stem)
    refuse_folder(folder, Path(case), overwrite=overwrite)
    return launch(
        lambda: report.blame(Path(case), lambda: simulation_of(described, folder, overwrite=overwrite)),
        folder,
        f"run {case}",
        End(described.run.until, described.run.steps),
        quiet=quiet,
        as_json=as_json,
    )
