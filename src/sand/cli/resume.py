"""`sand resume DIR`: go on with a run from its newest checkpoint."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..core.errors import BadInput
from . import options, report


@click.command("resume", short_help="Go on with a run from its newest checkpoint.")
@click.argument("folder", metavar="DIR")
@options.end_of_run('A later end than planned, such as "10 us".')
@options.as_json
@options.quiet
@options.debug
def command(folder: str, until: str | None, as_json: bool, quiet: bool) -> int:
    """Go on with the run in DIR from its newest checkpoint, to its planned end or to --until."""
    asked = options.seconds(until)
    from ..run.build import resume
    from .launch import launch

    place = Path(folder)
    simulation = report.with_notes(lambda: resume(place))
    end = _end_of(simulation, asked, until, place)
    if end is None:
        return _nothing_to_do(simulation, place, quiet=quiet, as_json=as_json)
    return launch(lambda: simulation, place, f"resume {folder}", end, quiet=quiet, as_json=as_json)


def _end_of(simulation: Any, asked: float | None, until: str | None, folder: Path) -> float | None:
    """Where to go on to [s]; None if the planned end is reached and no later one is asked for."""
    from ..core.units import spoken

    time, planned = simulation.time, simulation.planned_end
    if asked is None and planned is None:
        raise BadInput(f"the run in {folder} has no planned end; give one, such as --until '5 us'")
    if asked is not None and asked <= time:
        raise BadInput(f"--until = {until!r} is not later than {spoken(time, 's')}, where {folder} stands")
    end = planned if asked is None else asked
    return end if end > time else None


def _nothing_to_do(simulation: Any, folder: Path, *, quiet: bool, as_json: bool) -> int:
    from ..core.units import spoken
    from ..files.folder import SUMMARY, read_json

    if as_json:
        there = (folder / SUMMARY).exists()
        report.emit({**(read_json(folder / SUMMARY) if there else {}), "folder": str(folder)})
    elif not quiet:
        click.echo(
            f"{folder} has reached its planned end, t = {spoken(simulation.planned_end, 's')}; "
            f"to go further: {report.resume_line(folder)} --until TIME"
        )
    return 0
