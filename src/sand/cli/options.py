"""Options that several commands share."""

from __future__ import annotations

from typing import Any

import click

as_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")

quiet = click.option("--quiet", is_flag=True, help="Print notes and errors only.")

# main() looks for the word itself, because what goes wrong may do so before options are understood.
debug = click.option("--debug", is_flag=True, expose_value=False, help="Show where in the program an error arose.")


threads = click.option(
    "--threads",
    type=click.IntRange(min=1),
    metavar="N",
    help="Threads for a large simulation (default: one for each core, or $SAND_THREADS); results are the same.",
)


def end_of_run(text: str) -> Any:
    """The option --until, with `text` as its help."""
    return click.option("--until", metavar="TIME", help=text)


def seconds(text: str | None, name: str = "--until") -> float | None:
    """A time from the command line [s], checked as in a case file; a bare number is SI there and here.

    Raises:
        BadInput: wrong unit, not a number, not above 0.
    """
    from ..core.units import si

    if text is None:
        return None
    try:
        value: float | str = float(text)
    except ValueError:
        value = text
    return si(value, "s", name, above=0.0)
