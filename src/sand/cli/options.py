"""Options that several commands share."""

from __future__ import annotations

from typing import Any

import click

from ..arguments import MOST_GRAINS, MOST_PROCESSES, MOST_SEED
from ..io.run_folder import checked_name


class PathName(click.ParamType):
    """The name of a file or folder: not empty, and not longer than systems take."""

    name = "place"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The same text.  Raises BadInput."""
        name = "a name" if param is None else param.opts[0] if param.opts[0].startswith("-") else str(param.metavar)
        return checked_name(str(value), name)


PLACE = PathName()
SEED = click.IntRange(0, MOST_SEED)
FRAME = click.IntRange(-(2**31), 2**31 - 1)
COUNT = click.IntRange(1, MOST_GRAINS)

workers = click.option(
    "--workers",
    type=click.IntRange(1, MOST_PROCESSES),
    default=1,
    metavar="N",
    help="Processes that share the work (default 1).",
)

scheduler = click.option("--scheduler", metavar="ADDRESS", help="A running dask scheduler instead, tcp://host:port.")

as_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")

quiet = click.option("--quiet", is_flag=True, help="Print notes and errors only.")

# main() looks for the word itself, because what goes wrong may do so before options are understood.
debug = click.option("--debug", is_flag=True, expose_value=False, help="Show where in the program an error arose.")


threads = click.option(
    "--threads",
    type=click.IntRange(1, MOST_PROCESSES),
    metavar="N",
    help="Threads for a large simulation (default: one for each core, or $SAND_THREADS); results are the same.",
)


def end_of_run(text: str) -> Any:
    """The option --until, with `text` as its help."""
    return click.option("--until", metavar="TIME", help=text)


def seconds(text: str | None, name: str = "--until") -> float | None:
    """A time from the command line [s], checked as in a case file; a bare number is SI there and here.

    Raises
    ------
    BadInput
        wrong unit, not a number, not above 0, too short for anything to happen.
    """
    from ..simulation.stop import duration

    if text is None:
        return None
    try:
        value: float | str = float(text)
    except ValueError:
        value = text
    return duration(value, name)
