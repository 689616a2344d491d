"""`sand collide CASE.toml`: two bodies hit each other, once or for many seeds."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import click

from ..errors import BadInput
from ..threads import set_threads
from . import options, report
from .exits import DONE, INTERRUPTED

SHOWN = 12
"""Collisions listed one by one on the screen; all of them are in collision.json."""


@click.command("collide", short_help="Collide two bodies that a case file describes.")
@click.argument("case", metavar="CASE.toml", type=options.PLACE)
@click.option("--out", metavar="DIR", type=options.PLACE, help="Folder for the files (default: the case's name).")
@click.option("--seeds", metavar="LIST", help="Seeds instead of those in the case: '3', '1,2,5' or '1-20'.")
@options.workers
@options.threads
@click.option("--overwrite", is_flag=True, help="Replace the run that the folder holds.")
@options.as_json
@options.debug
def command(
    case: str, out: str | None, seeds: str | None, workers: int, threads: int | None, overwrite: bool, as_json: bool
) -> int:
    """Collide the bodies that CASE.toml describes, until nothing happens any more.

    Leaves collision.json and a figure in the folder; for a single seed also the trajectory, the ledger and all
    that `sand run` leaves.  Ctrl-C stops it; `sand resume` then goes on.
    """
    set_threads(threads)
    chosen = None if seeds is None else read_seeds(seeds)
    from ..experiments.collision_job import CollisionJob
    from .launch import refuse_folder

    job = CollisionJob(case, None if out is None else Path(out), chosen, overwrite=overwrite)
    refuse_folder(job.folder, Path(case), overwrite=overwrite)
    return collide(job, f"collide {case}", workers, threads, as_json)


def collide(job: Any, heading: str, workers: int, threads: int | None, as_json: bool, quiet: bool = False) -> int:
    """Do a `CollisionJob`, tell how it ended; returns the exit code.

    Raises
    ------
    BadInput
        as the job; or a worker process has died.
    """
    from concurrent.futures import BrokenExecutor

    from ..experiments.executors import executor_for
    from .interrupt import Watch

    many = len(job.case.impact.seeds) > 1
    try:
        with (
            report.compiling(as_json or quiet),
            Watch() as watch,
            executor_for(workers if many else 1, threads=threads) as executor,
        ):
            content = report.with_notes(lambda: job.run(executor, [watch]))
    except KeyboardInterrupt:
        report.note(f"interrupted; {report.way_on(job.folder)}")
        return INTERRUPTED
    except BrokenExecutor:
        raise BadInput(f"a worker process died; {report.way_on(job.folder)}") from None
    if as_json:
        report.emit(content)
    elif not quiet:
        _tell(heading, job.folder, content["collisions"])
    return DONE


def counts(results: list[dict[str, Any]]) -> Counter[str]:
    """How often each outcome came."""
    return Counter(result["outcome"] for result in results)


def read_seeds(text: str) -> list[int]:
    """'3', '1,2,5', '1-20' as whole numbers.  Raises BadInput."""
    seeds: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        ends = [first, last or first]
        known = all(end.isdecimal() and len(end) < 20 for end in ends) and (last or not dash)
        if not known or int(ends[1]) - int(ends[0]) > 100_000 or int(ends[1]) > options.MOST_SEED:
            shown = text if len(text) <= 40 else f"{text[:40]}…"
            raise BadInput(f"--seeds {shown!r} must be whole numbers below 2^63 such as '3', '1,2,5' or '1-20'")
        seeds += range(int(ends[0]), int(ends[1]) + 1)
    if not seeds:
        raise BadInput(f"--seeds {text!r} names no seed: the first number must not be above the last")
    return list(dict.fromkeys(seeds))


def _tell(heading: str, folder: Path, results: list[dict[str, Any]]) -> None:
    rows = [(f"seed {r['seed'] if r['seed'] is not None else '-'}", line(r)) for r in results[:SHOWN]]
    if len(results) > SHOWN:
        rows.append(("…", f"and {len(results) - SHOWN} more"))
    tally = ", ".join(f"{n} × {name}" for name, n in counts(results).most_common())
    rows += [("outcomes", tally), ("files", f"{folder}/")]
    report.show(heading, rows)


def line(r: dict[str, Any]) -> str:
    """One collision on one line."""
    pieces = f"{len(r['fragments'])} bodies, largest {r['largest_remnant']:.0%} of the mass"
    lost = sum(r["lost"].values()) / r["impact_energy"]
    events = f"contacts {r['made']} made, {r['moved']} moved, {r['broken']} broken"
    busy = "" if r["quiet"] else " (stopped while still busy)"
    return f"{r['outcome']}{busy}: {pieces}; {events}; lost {lost:.2g} of the impact energy; drift {r['drift']:.1e}"
