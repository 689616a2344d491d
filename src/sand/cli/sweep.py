"""`sand sweep CASE.toml`: runs a case for many values of its keys."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from typing import Any

import click

from ..basics.errors import BadInput
from ..basics.threads import set_threads
from . import options, parsing, report
from .exits import PHYSICS

SHOWN = 20
"""Runs, and failed runs, that are listed on the screen; --json and the table have all of them."""


def _varied(_context: click.Context, _option: click.Parameter, texts: tuple[str, ...]) -> dict[str, Any]:
    """Read --vary options, as keys of [sweep].  Raises BadInput."""
    if not texts:
        return {}
    from ..experiments.sweep_design import read_varied

    tables = [read_varied(text) for text in texts]
    keys = [key for table in tables for key in table]
    if twice := [key for key in dict.fromkeys(keys) if keys.count(key) > 1]:
        raise BadInput(f"--vary {twice[0]} is given twice; give all its values at once, --vary {twice[0]}=1,2")
    alone = {key: value for table in tables if len(table) == 1 for key, value in table.items()}
    return {"vary": alone, "together": [table for table in tables if len(table) > 1]}


def _seeds(context: click.Context, option: click.Parameter, text: str | None) -> Any:
    """Read '3' as a number of seeds, and all else as a list of them.  Raises BadInput."""
    if text is not None and text.isdecimal() and len(text) < 19:
        return int(text)
    return options.read_seeds(context, option, text)


@parsing.command("sweep", short_help="Run a case for many values of its keys, into one table.")
@click.argument("case", metavar="CASE.toml", type=options.CASE_FILE)
@click.option(
    "--vary",
    metavar="KEY=VALUES",
    multiple=True,
    callback=_varied,
    help="A key of the case and its values; 'KEY=VALUES; KEY=VALUES' for keys that change together.",
)
@click.option(
    "--seeds", metavar="N|LIST", callback=_seeds, help="Number of seeds, '3' (1, 2, 3), or seeds: '1,2,5', '4-8'."
)
@click.option("--samples", type=options.COUNT, metavar="N", help="A random design with N combinations of values.")
@click.option(
    "--design",
    type=click.Choice(["latin hypercube", "sobol", "halton", "random"]),
    help="The random design (default: that of the case, or latin hypercube).",
)
@click.option("--design-seed", type=options.SEED, metavar="S", help="Seed of the random design (default 0).")
@click.option("--files", type=click.Choice(["all", "none"]), help="Files that are kept of each run (default: all).")
@click.option("--out", metavar="DIR", type=options.FOLDER, help="Folder (default: the case's name and '-sweep').")
@click.option("--retry", is_flag=True, help="Compute runs that failed again.")
@click.option("--dry-run", is_flag=True, help="List the runs and their expected cost, and compute nothing.")
@click.option("--parquet", is_flag=True, help="Write the table as sweep.parquet, too; needs pyarrow.")
@options.execution
@options.output
def command(
    case: str, out: str | None, retry: bool, dry_run: bool, parquet: bool, threads: int | None, **how: Any
) -> int | None:
    """Run the case in CASE.toml for each combination of values and each seed.

    \b
    sand sweep collision.toml --vary projectile.grains=500,4000
        --vary impact.speed="log(10 m/s, 200 m/s, 10)" --seeds 3 --workers 8

    The case is one of `sand run`, `collide`, `scatter`, `grow`, `compress`, `stretch` or `shear`; its table [sweep] has
    the same settings as the options. Writes sweep.csv, one row for each run with its values, results and cost. What is
    in DIR is not computed again: call the command again after an interruption, with more values, or in several
    processes at once.
    """
    set_threads(threads)
    from ..experiments.sweep_job import SweepJob

    settings = how.pop("vary") | {
        name: how.pop(name) for name in ("seeds", "samples", "design", "design_seed", "files")
    }
    job = SweepJob(case, out, settings, retry=retry, parquet=parquet)
    return sweep(job, dry_run=dry_run, threads=threads, **how)


def sweep(
    job: Any,
    *,
    dry_run: bool = False,
    more: Callable[[dict[str, Any]], report.Rows] = lambda content: [],
    quiet: bool,
    as_json: bool,
    **execution: Any,
) -> int | None:
    """Run or continue a `SweepJob`, and print the results.

    Parameters
    ----------
    more : callable, optional
        Further rows of results.
    **execution
        As for `job.run_job`.

    Returns
    -------
    int or None
        The exit code, if a run failed.

    Raises
    ------
    BadInput
        As the job; or if the disk is too small for the files of all runs.
    """
    from .job import run_job

    job.refuse_others()
    left = job.left()
    expected = job.expected(left)
    opening = [("runs", f"{len(job.rows)}, {len(left)} left"), *costs_of(expected, len(left), execution["workers"])]
    if dry_run:
        names = {row.name for row in left}
        runs = [{"run": r.name, "left": r.name in names, **r.values, "seed": r.seed} for r in job.rows]
        rows = report.first_of([(one["run"], _listed(one)) for one in runs], SHOWN)
        content = {"runs": runs, "left": len(left), "expected": expected._asdict()}
        report.answer(
            content, f"sweep {job.path}, nothing is computed", [*rows, *opening], as_json=as_json, quiet=quiet
        )
        return None
    _refuse_small_disk(job, expected)
    if not (quiet or as_json):
        report.show(f"sweep {job.path}", [*opening, ("folder", str(job.folder))])
    content = run_job(job, quiet=quiet, as_json=as_json, **execution)
    rows = [*_rows(content), *more(content)]
    report.answer(content, "done" if not content["left"] else "so far", rows, as_json=as_json, quiet=quiet)
    if content["left"]:
        report.note(f"{content['left']} runs are computed by other processes")
    return PHYSICS if content["failed"] else None


def costs_of(expected: Any, number: int, workers: int) -> report.Rows:
    """Expected cost of all runs that are left."""
    if not number:
        return []
    at_once = max(min(workers, number), 1)
    time = "depends on the conditions of the runs"
    if expected.seconds is not None:
        time = f"about {report.format_wall_time(float(f'{expected.seconds / at_once:.2g}'))}"
        time += f" by {at_once} worker{'s' * (at_once > 1)}, without compilation"
    memory = f"about {report.format_bytes(at_once * expected.memory)}"
    disk = "not known" if expected.disk is None else f"about {report.format_bytes(expected.disk)}"
    return [("wall time", time), *([("memory", memory)] if expected.memory else []), ("disk", disk)]


def _refuse_small_disk(job: Any, expected: Any) -> None:
    """Raise BadInput if the files of the runs do not fit on the disk."""
    place = next(path for path in (job.folder.absolute(), *job.folder.absolute().parents) if os.path.exists(path))
    free = shutil.disk_usage(place).free
    if expected.disk is not None and expected.disk > free:
        need, there = report.format_bytes(expected.disk), report.format_bytes(free)
        raise BadInput(
            f"the files of all runs need about {need}, and {there} are free in {place}; give another folder with "
            "--out, or --files none, which keeps the table alone"
        )


def _listed(one: dict[str, Any]) -> str:
    values = [f"{key} = {value}" for key, value in one.items() if key not in ("run", "left")]
    return f"{', '.join(values)}{'' if one['left'] else ' (has ended)'}"


def _rows(content: dict[str, Any]) -> report.Rows:
    """Numbers of runs, failed ones with their messages, and the table."""
    counts = f"{content['done']} of {content['runs']} done, {content['failed']} failed, {content['left']} left"
    failures = [(f"failed {name}", text) for name, text in content["failures"].items()]
    return [("runs", counts), *report.first_of(failures, SHOWN), ("table", f"{content['folder']}/sweep.csv")]
