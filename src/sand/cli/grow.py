"""`sand grow CASE.toml`: runs the same box for many seeds."""

from __future__ import annotations

import shlex
from typing import Any

import click

from ..basics.errors import BadInput
from ..basics.threads import set_threads
from . import options, parsing, report


@parsing.command("grow", short_help="Run the same box for many seeds, for a joint analysis.")
@click.argument("case", metavar="CASE.toml", type=options.CASE_FILE)
@options.seeds("Seeds, one box each: '3', '1,2,5' or '1-8' (the default).")
@click.option(
    "--out", metavar="DIR", type=options.FOLDER, help="Folder for the folders of the boxes (default: the case's name)."
)
@options.execution
@options.output
@options.drawing
def command(case: str, seeds: list[int] | None, out: str | None, threads: int | None, **how: Any) -> None:
    """Run the box that CASE.toml describes once for each seed, into DIR/seed-1 and so on.

    Each box is a run as by `sand run`; growth.json lists how they ended. Called again, the command continues unfinished
    boxes, also to a later end; after an interruption `sand resume DIR` does the same. `sand analyse DIR` measures the
    growth.
    """
    set_threads(threads)
    from ..experiments.growth_boxes import GrowthJob

    job = GrowthJob(case, out, seeds)
    if job.folder.exists() and not job.folder.is_dir():
        raise BadInput(f"{job.folder} is a file; give another folder with --out")
    grow(job, threads=threads, **how)


def grow(job: Any, *, quiet: bool, as_json: bool, **execution: Any) -> None:
    """Run or continue the boxes of a case; `execution` as for `job.run_job`. Raises BadInput as it does."""
    from .job import run_job

    content = run_job(job, quiet=quiet, as_json=as_json, lines=True, **execution)
    text = f"all boxes are in {job.folder}; measure them with: sand analyse {shlex.quote(str(job.folder))}"
    report.answer(content, text, [], as_json=as_json, quiet=quiet)
