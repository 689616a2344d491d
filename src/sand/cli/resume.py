"""`sand resume DIR`: continues an interrupted run or job of any command."""

from __future__ import annotations

import math
import shlex
from pathlib import Path
from typing import Any

import click

from ..config.commands import command_for
from ..errors import BadInput
from ..io.run_folder import (
    CASE,
    COLLISION,
    GROWTH,
    ONE_COLLISION,
    SCATTERING,
    is_job,
    read_json,
    read_toml,
)
from ..threads import set_threads
from . import options, report
from .exits import DONE

RESULTS = {"collide": COLLISION, "scatter": SCATTERING, "grow": GROWTH}
"""Results file of a finished job, by command."""


@click.command("resume", short_help="Continue an interrupted run or job of any command.")
@click.argument("folder", metavar="DIR", type=options.PATH)
@options.end_of_run('For a run: a new end instead of the planned one, such as "10 us".')
@options.workers
@options.scheduler
@options.threads
@options.as_json
@options.quiet
@options.debug
def command(
    folder: str,
    until: str | None,
    workers: int,
    scheduler: str | None,
    threads: int | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Continue the run in DIR from its newest checkpoint to its planned end, or to --until.

    Jobs of `sand collide`, `sand scatter` and `sand grow` are continued as well: finished parts are kept, and the
    results are those of an uninterrupted job.
    """
    asked = options.seconds(until)
    set_threads(threads)
    place = Path(folder)
    kind = _kind(place)
    if kind != "run":
        if until is not None:
            raise BadInput(f"--until applies to runs; {folder} holds a job of `sand {kind}`")
        if scheduler is not None and kind == "collide":
            raise BadInput("--scheduler applies to jobs of `sand scatter` and `sand grow`; use --workers")
        how = {"workers": workers, "threads": threads, "quiet": quiet, "as_json": as_json}
        return _job(kind, place, scheduler, how)
    if workers > 1 or scheduler is not None:
        raise BadInput("--workers and --scheduler apply to jobs of many parts; for a run use --threads")
    return _run(place, until, asked, quiet=quiet, as_json=as_json)


def _kind(folder: Path) -> str:
    """The command that created the content of a folder.  Raises BadInput if it is a file."""
    if folder.is_file():
        raise BadInput(f"{folder} is a file; give the folder of a run")
    one = folder / ONE_COLLISION
    case = one if one.exists() else folder / CASE
    kind = command_for(read_toml(case)) if case.exists() else None
    if kind not in (None, "run") and not is_job(folder, case):
        raise BadInput(
            f"{folder} is not the folder of a run or job: {case.name} in it is a case file; "
            f"to start it: sand {kind} {shlex.quote(str(case))}"
        )
    return kind or "run"


def _job(kind: str, folder: Path, scheduler: str | None, how: dict[str, Any]) -> int:
    """Continue a job of `sand collide`, `sand scatter` or `sand grow`; returns the exit code."""
    from .collide import collide
    from .grow import boxes
    from .scatter import scatter

    if (folder / RESULTS[kind]).exists():
        if how["as_json"]:
            report.emit({**read_json(folder / RESULTS[kind]), "folder": str(folder)})
        elif not how["quiet"]:
            report.write_line(f"{folder} is finished; its results are in {folder / RESULTS[kind]}")
        return DONE
    if kind == "grow":
        from ..experiments.growth_case import read_growth

        content, seeds = read_growth(folder / CASE)
        return boxes(content, seeds or [], folder, scheduler=scheduler, **how)
    if kind == "scatter":
        from ..experiments.scattering.case import read_scattering

        del how["threads"]  # a flight uses one thread
        read = read_scattering(folder / CASE)
        return scatter(folder / CASE, read, folder, resume=True, scheduler=scheduler, **how)
    from ..experiments.collision_job import CollisionJob

    one = folder / ONE_COLLISION
    job = CollisionJob(one if one.exists() else folder / CASE, folder, resume=True)
    return collide(job, f"resume {folder}", **how)


def _run(place: Path, until: str | None, asked: float | None, *, quiet: bool, as_json: bool) -> int:
    """Continue a run; returns the exit code."""
    from ..config.build import resume
    from ..units import format_quantity
    from .launch import End, launch

    simulation = report.with_notes(lambda: resume(place))
    if asked is not None and asked <= simulation.time:
        raise BadInput(f"--until = {until!r} is not later than {_stand(simulation)}, the present time of {place}")
    if asked is not None and asked < simulation.planned[0] < math.inf:
        planned, new = format_quantity(simulation.planned[0], "s"), format_quantity(asked, "s")
        report.note(f"{place} now ends at {new} instead of {planned}, as --until is earlier than the planned end")
    if asked is None and _is_there(simulation):
        return _nothing_to_do(simulation, place, quiet=quiet, as_json=as_json)
    end = None if asked is None else End(asked)
    return launch(lambda: simulation, place, f"resume {place}", end, quiet=quiet, as_json=as_json)


def _is_there(simulation: Any) -> bool:
    """Whether the planned end is reached."""
    end, last_step = simulation.planned
    return simulation.time >= end or simulation.steps >= last_step


def _stand(simulation: Any) -> str:
    from ..units import format_quantity

    return format_quantity(simulation.time, "s")


def _nothing_to_do(simulation: Any, folder: Path, *, quiet: bool, as_json: bool) -> int:
    from ..io.run_folder import SUMMARY

    if as_json:
        there = (folder / SUMMARY).exists()
        report.emit({**(read_json(folder / SUMMARY) if there else {}), "folder": str(folder)})
    elif not quiet:
        report.write_line(
            f"{folder} has reached its planned end at t = {_stand(simulation)}; "
            f"to continue it further: {report.resume_line(folder)} --until TIME"
        )
    return DONE
