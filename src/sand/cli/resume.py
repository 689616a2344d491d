"""`sand resume DIR`: go on with a run from its newest checkpoint."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..core.errors import BadInput
from ..core.threads import set_threads
from . import options, report


@click.command("resume", short_help="Go on with a run from its newest checkpoint.")
@click.argument("folder", metavar="DIR")
@options.end_of_run('A later end than planned, such as "10 us".')
@options.threads
@options.as_json
@options.quiet
@options.debug
def command(folder: str, until: str | None, threads: int | None, as_json: bool, quiet: bool) -> int:
    """Go on with the run in DIR from its newest checkpoint, to its planned end or to --until."""
    asked = options.seconds(until)
    set_threads(threads)
    from ..run.build import resume
    from .launch import End, launch

    place = Path(folder)
    simulation = report.with_notes(lambda: resume(place))
    if asked is not None and asked <= simulation.time:
        raise BadInput(f"--until = {until!r} is not later than {_stand(simulation)}, where {folder} stands")
    if asked is None and _is_there(simulation):
        return _nothing_to_do(simulation, place, quiet=quiet, as_json=as_json)
    end = None if asked is None else End(asked)
    return launch(lambda: simulation, place, f"resume {folder}", end, quiet=quiet, as_json=as_json)


def _is_there(simulation: Any) -> bool:
    """True if the planned end is reached."""
    end, last_step = simulation.planned
    return simulation.time >= end or simulation.steps >= last_step


def _stand(simulation: Any) -> str:
    from ..core.units import spoken

    return spoken(simulation.time, "s")


def _nothing_to_do(simulation: Any, folder: Path, *, quiet: bool, as_json: bool) -> int:
    from ..files.folder import SUMMARY, read_json

    if as_json:
        there = (folder / SUMMARY).exists()
        report.emit({**(read_json(folder / SUMMARY) if there else {}), "folder": str(folder)})
    elif not quiet:
        click.echo(
            f"{folder} has reached its planned end, it stands at t = {_stand(simulation)}; "
            f"to go further: {report.resume_line(folder)} --until TIME"
        )
    return 0
