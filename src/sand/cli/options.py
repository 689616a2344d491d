"""Options shared by several commands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from ..arguments import MOST_GRAINS, MOST_PROCESSES, MOST_SEED
from ..errors import BadInput
from ..paths import checked_name


class PathName(click.ParamType):
    """The name of a file or folder: not empty, and not longer than systems allow."""

    name = "path"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Check the name.  Raises BadInput."""
        name = "a name" if param is None else param.opts[0] if param.opts[0].startswith("-") else str(param.metavar)
        return checked_name(str(value), name)


PATH = PathName()
SEED = click.IntRange(0, MOST_SEED)
FRAME = click.IntRange(-(2**31), 2**31 - 1)
COUNT = click.IntRange(1, MOST_GRAINS)

workers = click.option(
    "--workers",
    type=click.IntRange(1, MOST_PROCESSES),
    default=1,
    metavar="N",
    help="Number of worker processes (default 1).",
)

scheduler = click.option("--scheduler", metavar="ADDRESS", help="Use a running dask scheduler, tcp://host:port.")

_as_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")

_quiet = click.option("--quiet", is_flag=True, help="Print notes and errors only.")

# read from the command line by `program`, because errors may occur before options are parsed
debug = click.option("--debug", is_flag=True, expose_value=False, help="Show the traceback of an error.")


def output(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options --json and --debug."""
    return _as_json(debug(command))


def quiet_output(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options --json, --quiet and --debug."""
    return _as_json(_quiet(debug(command)))


threads = click.option(
    "--threads",
    type=click.IntRange(1, MOST_PROCESSES),
    metavar="N",
    help="Threads for a large simulation (default: one per core, or $SAND_THREADS); results do not depend on it.",
)


def _import(_context: click.Context, _option: click.Parameter, names: tuple[str, ...]) -> None:
    if names:
        from ..forces.own import import_modules

        import_modules(names)


imports = click.option(
    "--import",
    metavar="MODULE",
    multiple=True,
    callback=_import,
    expose_value=False,
    help="Module or file that defines a force of your own, which the case uses; may be repeated.",
)


def end_of_run(text: str) -> Any:
    """The option --until with the help text `text`; its value is in seconds."""
    return click.option("--until", metavar="TIME", callback=_seconds, help=text)


def _seconds(_context: click.Context, _option: click.Parameter, text: str | None) -> float | None:
    """Convert a time to seconds, checked as in a case file; a bare number is SI.  Raises BadInput."""
    if text is None:
        return None
    from ..simulation.cadence import duration

    try:
        value: float | str = float(text)
    except ValueError:
        value = text
    return duration(value, "--until")


def seeds(text: str) -> Any:
    """The option --seeds with the help text `text`; its value is a list of integers."""
    return click.option("--seeds", metavar="LIST", callback=_seeds, help=text)


def _seeds(_context: click.Context, _option: click.Parameter, text: str | None) -> list[int] | None:
    """Read '3', '1,2,5' or '1-20' as integers.  Raises BadInput."""
    if text is None:
        return None
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        ends = [first, last or first]
        valid = all(end.isdecimal() and len(end) < 20 for end in ends) and (last or not dash)
        if not valid or int(ends[1]) - int(ends[0]) > 100_000 or int(ends[1]) > MOST_SEED:
            shown = text if len(text) <= 40 else f"{text[:40]}…"
            raise BadInput(f"--seeds {shown!r} must be whole numbers below 2^63 such as '3', '1,2,5' or '1-20'")
        found += range(int(ends[0]), int(ends[1]) + 1)
    if not found:
        raise BadInput(f"--seeds {text!r} names no seed: the first number must not be above the last")
    return list(dict.fromkeys(found))
