"""`sand grow CASE.toml`: the same box for many seeds."""

from __future__ import annotations

from pathlib import Path

import click

from ..core.errors import BadInput
from . import options, report
from .collide import read_seeds
from .exits import INTERRUPTED


@click.command("grow", short_help="Run the same box for many seeds, to be analysed together.")
@click.argument("case", metavar="CASE.toml")
@click.option("--seeds", metavar="LIST", default="1-8", help="One box each: '3', '1,2,5' or '1-8' (the default).")
@click.option("--out", metavar="DIR", help="Folder for the boxes' folders (default: the case's name).")
@click.option("--workers", type=click.IntRange(min=1), default=1, help="Processes that share the boxes (default 1).")
@click.option("--scheduler", metavar="ADDRESS", help="A dask scheduler of your own instead, tcp://host:port.")
@options.as_json
@options.quiet
@options.debug
def command(
    case: str, seeds: str, out: str | None, workers: int, scheduler: str | None, as_json: bool, quiet: bool
) -> int:
    """Run the box that CASE.toml describes once for each seed, into DIR/seed-1 and so on.

    Each is a run as of `sand run`. Called again it goes on with what is not finished, also to a later end.
    `sand analyse DIR` then says how aggregates grew.
    """
    from ..experiments.executors import executor_for
    from ..experiments.growth import grow
    from ..files.folder import read_toml
    from ..run.case import read_case

    read_case(case)  # all mistakes at once, with the file's name
    chosen = read_seeds(seeds)
    folder = Path(out or Path(case).stem)
    if folder.exists() and not folder.is_dir():
        raise BadInput(f"{folder} is a file; give another folder with --out")
    outcomes: dict[int, str] = {}

    def told(seed: int, outcome: str) -> None:
        outcomes[seed] = outcome
        if not (quiet or as_json):
            click.echo(f"  seed {seed}: {outcome}  ({len(outcomes)} of {len(chosen)})")

    try:
        with report.compiling(quiet), executor_for(workers, scheduler) as executor:
            report.with_notes(lambda: grow(read_toml(case), chosen, folder, executor, told))
    except KeyboardInterrupt:
        report.note(f"interrupted; the same command goes on with the boxes in {folder}")
        return INTERRUPTED
    if as_json:
        report.emit({"folder": str(folder), "seeds": chosen, "outcomes": outcomes})
    elif not quiet:
        click.echo(f"all boxes are in {folder}; measure them with: sand analyse {folder}")
    return 0
