"""`sand grow CASE.toml`: the same box for many seeds."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import click

from ..errors import BadInput
from ..threads import set_threads
from . import options, report
from .collide import read_seeds
from .exits import DONE, INTERRUPTED

USUAL_SEEDS = list(range(1, 9))


@click.command("grow", short_help="Run the same box for many seeds, to be analysed together.")
@click.argument("case", metavar="CASE.toml", type=options.PLACE)
@click.option("--seeds", metavar="LIST", help="One box each: '3', '1,2,5' or '1-8' (the default).")
@click.option(
    "--out", metavar="DIR", type=options.PLACE, help="Folder for the boxes' folders (default: the case's name)."
)
@options.workers
@options.scheduler
@options.threads
@options.as_json
@options.quiet
@options.debug
def command(
    case: str,
    seeds: str | None,
    out: str | None,
    workers: int,
    scheduler: str | None,
    threads: int | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Run the box that CASE.toml describes once for each seed, into DIR/seed-1 and so on.

    Each is a run as of `sand run`; growth.json says how they ended. Called again it goes on with what is not finished,
    also to a later end; `sand resume DIR` does so after an interruption. `sand analyse DIR` says how aggregates grew.
    """
    set_threads(threads)
    chosen = None if seeds is None else read_seeds(seeds)
    from ..experiments.growth_case import read_growth

    content, own = read_growth(case)  # all mistakes at once, with the file's name
    folder = Path(out or Path(case).stem)
    if folder.exists() and not folder.is_dir():
        raise BadInput(f"{folder} is a file; give another folder with --out")
    how: dict[str, Any] = {
        "workers": workers,
        "scheduler": scheduler,
        "threads": threads,
        "quiet": quiet,
        "as_json": as_json,
    }
    return boxes(content, chosen or own or USUAL_SEEDS, folder, **how)


def boxes(
    content: dict[str, Any],
    seeds: list[int],
    folder: Path,
    *,
    workers: int,
    scheduler: str | None,
    threads: int | None,
    quiet: bool,
    as_json: bool,
) -> int:
    """Run the boxes of a case, or go on with them; returns the exit code.

    Raises
    ------
    BadInput
        as `experiments.growth_boxes.grow`; or a worker process has died.
    """
    from concurrent.futures import BrokenExecutor

    from ..experiments.executors import executor_for
    from ..experiments.growth_boxes import grow
    from .interrupt import Watch

    outcomes: dict[int, str] = {}

    def told(seed: int, outcome: str) -> None:
        outcomes[seed] = outcome
        if not (quiet or as_json):
            report.say(f"  seed {seed}: {outcome}  ({len(outcomes)} of {len(seeds)})")

    try:
        with report.compiling(quiet), Watch() as watch, executor_for(workers, scheduler, threads) as executor:
            report.with_notes(lambda: grow(content, seeds, folder, executor, told, [watch]))
    except KeyboardInterrupt:
        report.note(f"interrupted; {report.way_on(folder)}")
        return INTERRUPTED
    except BrokenExecutor:
        raise BadInput(f"a worker process died; {report.way_on(folder)}") from None
    if as_json:
        report.emit({"folder": str(folder), "seeds": seeds, "outcomes": outcomes})
    elif not quiet:
        report.say(f"all boxes are in {folder}; measure them with: sand analyse {shlex.quote(str(folder))}")
    return DONE
