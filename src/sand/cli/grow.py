"""`sand grow CASE.toml`: runs the same box for many seeds."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

import click

from ..basics.threads import set_threads
from ..errors import BadInput
from . import options, parsing, report

DEFAULT_SEEDS = list(range(1, 9))


@parsing.command("grow", short_help="Run the same box for many seeds, for a joint analysis.")
@click.argument("case", metavar="CASE.toml", type=options.CASE_FILE)
@options.seeds("Seeds, one box each: '3', '1,2,5' or '1-8' (the default).")
@click.option(
    "--out", metavar="DIR", type=options.FOLDER, help="Folder for the folders of the boxes (default: the case's name)."
)
@options.workers
@options.scheduler
@options.wall_time
@options.imports
@options.threads
@options.output
def command(case: str, seeds: list[int] | None, out: str | None, threads: int | None, **how: Any) -> None:
    """Run the box that CASE.toml describes once for each seed, into DIR/seed-1 and so on.

    Each box is a run as by `sand run`; growth.json lists how they ended. Called again, the command continues unfinished
    boxes, also to a later end; after an interruption `sand resume DIR` does the same. `sand analyse DIR` measures the
    growth.
    """
    set_threads(threads)
    from ..experiments.growth_case import read_growth

    content, own = read_growth(case)
    folder = Path(out or Path(case).stem)
    if folder.exists() and not folder.is_dir():
        raise BadInput(f"{folder} is a file; give another folder with --out")
    boxes(content, seeds or own or DEFAULT_SEEDS, folder, threads=threads, **how)


def boxes(
    content: dict[str, Any], seeds: list[int], folder: Path, *, quiet: bool, as_json: bool, **execution: Any
) -> None:
    """Run or continue the boxes of a case; `execution` as for `job.running_job`.

    Raises
    ------
    BadInput
        As `experiments.growth_boxes.grow`; or if a worker process has died.
    """
    from ..experiments.growth_boxes import grow
    from .job import running_job

    outcomes: dict[int, str] = {}
    hidden = quiet or as_json
    with (
        # elsewhere the lines of the boxes show the progress
        report.progress_bar(len(seeds), hidden or not sys.stderr.isatty(), bar_format=report.LAYOUT) as bar,
        running_job(folder, quiet=quiet, **execution) as (executor, interrupts),
    ):

        def finished(seed: int, outcome: str) -> None:
            outcomes[seed] = outcome
            if not hidden:
                report.write_line(f"  seed {seed}: {outcome}  ({len(outcomes)} of {len(seeds)})")
            show()

        def show() -> None:
            bar.set_description_str(f"{len(outcomes)} of {len(seeds)} boxes", refresh=False)
            bar.update(len(outcomes) - bar.n)

        show()
        grow(content, seeds, folder, executor, finished, [interrupts])
    text = f"all boxes are in {folder}; measure them with: sand analyse {shlex.quote(str(folder))}"
    found = {"folder": str(folder), "seeds": seeds, "outcomes": outcomes}
    report.answer(found, text, [], as_json=as_json, quiet=quiet)
