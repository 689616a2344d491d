"""`sand reproduce NAME`: computes a figure of a paper and compares it with what the paper gives."""

from __future__ import annotations

from typing import Any

import click

from ..basics.threads import set_threads
from . import options, parsing, report


@parsing.command("reproduce", short_help="Compute a figure of a paper, and compare it with the paper.")
@click.argument("name", metavar="[NAME]", required=False)
@click.option("--small", is_flag=True, help="A small version, in seconds: a test of the installation, not of physics.")
@click.option("--known", is_flag=True, help="Take rows of the table that comes with SAND; compute only the others.")
@click.option("--out", metavar="DIR", type=options.FOLDER, help="Folder for the files (default: the name).")
@click.option("--retry", is_flag=True, help="Compute runs that failed again.")
@click.option("--dry-run", is_flag=True, help="List the runs and their expected cost, and compute nothing.")
@options.workers
@options.scheduler
@options.wall_time
@options.threads
@options.output
@options.drawing
def command(
    name: str | None, out: str | None, small: bool, known: bool, retry: bool, threads: int | None, **how: Any
) -> int | None:
    """Compute the figure NAME of a paper; without NAME, list all figures.

    Each is a sweep of collisions, or of packings that are compressed or stretched, whose case is in examples/papers,
    with a table of results, a figure, and a comparison with the paper: what it gives, what SAND finds with its 95 %
    interval, and whether they agree. Writes these to DIR/results. What is in DIR is not computed again: call the
    command again after an interruption, or in several processes at once.
    """
    set_threads(threads)
    from ..experiments.reproduce import FIGURES, Reproduction

    if name is None:
        found = {one: _listed(Reproduction(one, known=True)) for one in FIGURES}
        rows = [(one, text) for one, (text, _) in found.items()]
        content = {one: about for one, (_, about) in found.items()}
        report.answer(content, "figures of papers", rows, as_json=how["as_json"], quiet=how["quiet"])
        return None
    from .sweep import sweep

    job = Reproduction(name, out, small=small, known=known, retry=retry)
    return sweep(job, more=comparison_rows, **how)


def _listed(job: Any) -> tuple[str, dict[str, Any]]:
    """What a figure shows, its runs, and what those in the table that comes with SAND took, as text and numbers."""
    hours = sum(float(cells["cpu_seconds"]) for cells in job.known) / 3600.0
    about = {
        "title": job.figure.title,
        "papers": list(job.figure.references),
        "also": list(job.figure.also),
        "runs": len(job.names),
        "known": len(job.known),
        "core_hours": hours,
    }
    known = f"; {len(job.known)} come with SAND, which took {hours:.2g} core-hours" if job.known else ""
    names = f"; also {' and '.join(job.figure.also)}" if job.figure.also else ""
    return f"{job.figure.title} ({'; '.join(job.figure.references)}): {len(job.names)} runs{known}{names}", about


def comparison_rows(content: dict[str, Any]) -> report.Rows:
    """Each result of the paper beside that of SAND, and where the files are."""
    rows = [(one["what"], _compared(one, "note" in content)) for one in content["comparison"]]
    done = f"{content['rows']} of {content['design']}, {content['cpu_seconds'] / 3600.0:.2g} core-hours"
    noted = [("note", content["note"])] if "note" in content else []
    return [("rows", done), *rows, *noted, ("files", f"{content['folder']}/results/")]


def _compared(one: dict[str, Any], small: bool) -> str:
    """What SAND finds, what the paper gives, and the verdict; of a small version there is one for all, a note."""
    paper = f"; paper: {one['paper']}" if one["paper"] else ""
    return f"{one['ours']}{paper}" + (f": {one['verdict']}" if paper and one["verdict"] and not small else "")
