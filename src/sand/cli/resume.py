"""`sand resume DIR`: continues an interrupted run or job of any command."""

from __future__ import annotations

import math
import shlex
from importlib import import_module
from pathlib import Path
from typing import Any

import click

from ..basics.errors import BadInput
from ..basics.threads import set_threads
from ..config.commands import LOADINGS
from ..config.folders import content_of, job_in
from ..io.run_folder import (
    CASE,
    COLLISION,
    ENCOUNTERS,
    GROWTH,
    LABORATORY,
    SCATTERING,
    SUMMARY,
    SWEEP,
    SWEEP_CSV,
    read_json,
)
from . import options, parsing, report
from .collide import collide
from .exits import PHYSICS
from .grow import grow
from .laboratory import laboratory
from .scatter import scatter
from .sweep import sweep

JOBS = {
    "collide": (COLLISION, "collision_job", "CollisionJob", collide),
    "scatter": (SCATTERING, "scattering.job", "ScatterJob", scatter),
    "grow": (GROWTH, "growth_boxes", "GrowthJob", grow),
    **dict.fromkeys(LOADINGS, (LABORATORY, "laboratory_job", "LaboratoryJob", laboratory)),
    "elastic": (LABORATORY, "elastic_job", "ElasticJob", laboratory),
    "sweep": (SWEEP, "sweep_job", "SweepJob", sweep),
}
"""Results file, module and class of each job, and what runs it and prints its results."""


@parsing.command("resume", short_help="Continue an interrupted run or job of any command.")
@click.argument("folder", metavar="DIR", type=options.RUN)
@options.end_of_run('For a run: a new end instead of the planned one, such as "10 us".')
@options.wall_time
@options.imports
@options.workers
@options.scheduler
@options.threads
@options.output
@options.drawing
def command(
    folder: str,
    until: float | None,
    workers: int,
    scheduler: str | None,
    threads: int | None,
    wall_time: float | None,
    **output: bool,
) -> int | None:
    """Continue the run in DIR from its newest checkpoint to its planned end, or to --until.

    A run whose condition (`stop`) was met goes on with another condition in its case.toml, or to --until.

    Jobs of all other commands, such as `sand collide`, are continued as well: finished parts are kept, and the results
    are those of an uninterrupted job.
    """
    set_threads(threads)
    place = Path(folder)
    kind, case = _kind(place)
    if kind == "grow" and (place / ENCOUNTERS).exists():
        return _population(place, case, wall_time, **output)
    if kind != "run":
        if until is not None:
            raise BadInput(f"--until applies to runs; {folder} holds {content_of(place)}")
        if scheduler is not None and kind == "collide":
            raise BadInput("--scheduler does not apply to jobs of `sand collide`; use --workers")
        how = {"workers": workers, "scheduler": scheduler, "threads": threads, "wall_time": wall_time}
        return _job(kind, place, case, {**how, **output})
    if workers > 1 or scheduler is not None:
        raise BadInput("--workers and --scheduler apply to jobs of many parts; for a run use --threads")
    return _run(place, until, wall_time, **output)


def _population(place: Path, case: Path, wall_time: float | None, *, quiet: bool, as_json: bool) -> int | None:
    """Continue one population of dilute dust; returns the exit code."""
    from ..experiments.dilute_case import population_of
    from ..io.run_folder import read_toml
    from .job import running_job

    content = read_toml(case)
    with running_job(place, 1, wall_time=wall_time, quiet=quiet) as (_, interrupts):
        outcome = population_of(content, content["run"]["seed"], place, [interrupts]).outcome
    report.answer({"folder": str(place), "outcome": outcome}, f"{place}: {outcome}", [], as_json=as_json, quiet=quiet)
    return None if outcome == "finished" else PHYSICS


def _kind(folder: Path) -> tuple[str, Path]:
    """The command that created the content of a folder, and its case file.  Raises BadInput if it is a file."""
    if folder.is_file():
        raise BadInput(f"{folder} is a file; give the folder of a run")
    kind, case, begun = job_in(folder)
    if kind not in (None, "run") and not begun:
        raise BadInput(
            f"{folder} is not the folder of a run or job: {case.name} in it is a case file; "
            f"to start it: sand {kind} {shlex.quote(str(case))}"
        )
    return kind or "run", case


def _job(kind: str, folder: Path, case: Path, how: dict[str, Any]) -> int | None:
    """Continue a job; returns the exit code."""
    file, module, name, command = JOBS[kind]
    if (folder / file).exists():
        content = {**read_json(folder / file), "folder": str(folder)}
        text = f"{folder} is finished; its results are in {folder / (SWEEP_CSV if kind == 'sweep' else file)}"
        if failed := content.get("failed"):  # of a sweep
            text += f"; {failed} of its {content['runs']} runs failed: to compute them again, sand sweep with --retry"
        report.answer(content, text, [], as_json=how["as_json"], quiet=how["quiet"])
        return PHYSICS if failed else None
    if kind == "scatter":
        del how["threads"]  # a flight uses one thread
    made = getattr(import_module(f"sand.experiments.{module}"), name)
    return command(made(case, folder, resume=True), **how)


def _run(place: Path, until: float | None, wall_time: float | None, *, quiet: bool, as_json: bool) -> int | None:
    """Continue a run; returns the exit code, None if its planned end is reached."""
    from ..basics.units import format_quantity
    from ..config.build import resume
    from ..simulation.condition import GIVEN
    from .launch import launch

    simulation = resume(place)
    (end, last_step, stop), now = simulation.planned, format_quantity(simulation.time, "s")
    met = stop is not None and simulation.met_condition == stop
    if until is None and (met or simulation.time >= end or simulation.steps >= last_step):
        how = f"{report.resume_line(place)} --until TIME"
        text = f"{place} has reached its planned end at t = {now}; to continue it further: {how}"
        if met:
            text = (
                f"{place} ended at t = {now}, as its condition is met: {stop}; to continue it, change stop in "
                f"{place / CASE}, or: {how}, which ignores this condition"
            )
        summary = read_json(place / SUMMARY) if as_json and (place / SUMMARY).exists() else {}
        report.answer({**summary, "folder": str(place)}, text, [], as_json=as_json, quiet=quiet)
        return None
    if until is not None and until <= simulation.time:
        new = format_quantity(until, "s")
        raise BadInput(f"--until = {new} is not later than {now}, the present time of {place}")
    if until is not None and until < end < math.inf:
        new, planned = format_quantity(until, "s"), format_quantity(end, "s")
        report.note(f"{place} now ends at {new} instead of {planned}, as --until is earlier than the planned end")
    if until is not None and stop is not None:
        if stop == GIVEN:
            report.note("the condition that ended this run is a function of a script; it no longer applies")
        elif met:
            report.note(f"the condition {stop} is met and no longer applies")
    kept = None if until is None or met or stop == GIVEN else stop
    ends = (until, None, kept)
    return launch(lambda: simulation, place, f"resume {place}", ends, wall_time, quiet=quiet, as_json=as_json)
