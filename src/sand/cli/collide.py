"""`sand collide CASE.toml`: collides two bodies, once or for many seeds."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from ..basics.threads import set_threads
from . import options, parsing, report

SHOWN = 12
"""Collisions listed one by one on the screen; collision.json has all of them."""


@parsing.command("collide", short_help="Collide two bodies that a case file describes.")
@options.job_of_seeds
@options.workers
@options.wall_time
@options.imports
@options.threads
@options.output
@options.drawing
def command(
    case: str, out: str | None, seeds: list[int] | None, overwrite: bool, threads: int | None, **how: Any
) -> None:
    """Collide the bodies that CASE.toml describes and follow them until the outcome is decided.

    Writes collision.json and a figure to the folder; for a single seed also the trajectory, the ledger and all other
    files of `sand run`. Ctrl-C interrupts it; continue with `sand resume`.
    """
    set_threads(threads)
    from ..experiments.collision_job import CollisionJob
    from .launch import refuse_folder

    job = CollisionJob(case, out, seeds, overwrite=overwrite)
    refuse_folder(job.folder, Path(case), overwrite=overwrite)
    collide(job, threads=threads, **how)


def collide(job: Any, *, as_json: bool, quiet: bool, **execution: Any) -> None:
    """Run a `CollisionJob` and print the results; `execution` as for `job.run_job`. Raises BadInput as it does."""
    from .job import run_job

    content = run_job(job, as_json=as_json, quiet=quiet or as_json, **execution)
    heading = f"resume {job.folder}" if job.resume else f"collide {job.path}"
    rows = [*collision_rows(content["collisions"]), ("files", f"{job.folder}/")]
    report.answer(content, heading, rows, as_json=as_json, quiet=quiet)


def collision_rows(results: list[dict[str, Any]]) -> report.Rows:
    """The first SHOWN collisions, and how often each outcome occurred."""
    rows = [(f"seed {r['seed'] if r['seed'] is not None else '-'}", _collision(r)) for r in results]
    counts = Counter(r["outcome"] for r in results)
    return [*report.first_of(rows, SHOWN), ("outcomes", ", ".join(f"{n} × {name}" for name, n in counts.most_common()))]


def _collision(r: dict[str, Any]) -> str:
    bodies = len(r["fragments"])
    pieces = f"{bodies} bod{'ies' if bodies > 1 else 'y'}, largest {r['largest_remnant']:.0%} of the mass"
    lost = sum(r["lost"].values()) / r["impact_energy"]
    events = f"contacts {r['made']} formed, {r['broken']} broken, {r['moved']} slips"
    unfinished = "" if r["quiet"] else " (stopped before it was decided)"
    if "kind" in r:  # results of earlier versions lack it
        energy = r["impact_energy"] / sum(r["grains_before"])
        scales = " and ".join(f"{energy / r[f'{name}_energy']:.2g} E_{name}" for name in ("roll", "break"))
        pieces += f"; {r['kind']}, f = {r['growth_efficiency']:.2f}; impact energy per grain {scales}"
    if r["outcome"] in ("miss", "undecided") and r.get("end"):
        return f"{r['outcome']}: no contact formed; {r['end']}; drift {r['drift']:.1e}"
    return (
        f"{r['outcome']}{unfinished}: {pieces}; {events}; lost {lost:.2g} of the impact energy; drift {r['drift']:.1e}"
    )
