"""Options shared by several commands."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any

import click

from ..basics.arguments import MOST_GRAINS, MOST_PROCESSES, MOST_SEED
from ..basics.errors import BadInput, each_once
from ..basics.paths import checked_name


class PathName(click.ParamType):
    """The name of a file or folder: not empty, and not longer than systems allow.

    Parameters
    ----------
    wanted : str
        What a shell completes, see `path_completion.path_items`.
    """

    name = "path"

    def __init__(self, wanted: str):
        self.wanted = wanted

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
        """Completions of the beginning of a path."""
        from .path_completion import path_items

        return path_items(incomplete, self.wanted)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Check the name.  Raises BadInput."""
        name = "a name" if param is None else param.opts[0] if param.opts[0].startswith("-") else str(param.metavar)
        return checked_name(str(value), name)


class WholeNumber(click.IntRange):
    """A whole number in a range, named so in error messages."""

    name = "whole number"


FILE, FOLDER, RUN, CASE_FILE, RUN_OR_CASE = map(PathName, ("file", "folder", "run", "case", "run or case"))
SEED = WholeNumber(0, MOST_SEED)
FRAME = WholeNumber(-(2**31), 2**31 - 1)
COUNT = WholeNumber(1, MOST_GRAINS)

workers = click.option(
    "--workers",
    type=WholeNumber(1, MOST_PROCESSES),
    default=1,
    metavar="N",
    help="Number of worker processes (default 1).",
)

scheduler = click.option("--scheduler", metavar="ADDRESS", help="Use a running dask scheduler, tcp://host:port.")

as_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")

_quiet = click.option("--quiet", is_flag=True, help="Print notes and errors only, neither results nor progress.")

# read from the command line by `program`, because errors may occur before options are parsed
debug = click.option("--debug", is_flag=True, expose_value=False, help="Show the traceback of an error.")


def output(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options --json, --quiet and --debug of every command with results; values `as_json` and `quiet`."""
    return as_json(_quiet(debug(command)))


threads = click.option(
    "--threads",
    type=WholeNumber(1, MOST_PROCESSES),
    metavar="N",
    help="Threads for a large simulation (default: one per core, or $SAND_THREADS); results do not depend on it.",
)


def _read_width(_context: click.Context, _option: click.Parameter, text: str | None) -> str | None:
    """Check a width.  Raises BadInput."""
    if text is not None:
        from ..plotting.figure_format import width_in_inches

        width_in_inches(text, "--width")
    return text


def _read_style(_context: click.Context, _option: click.Parameter, text: str | None) -> str | None:
    """Check a style of matplotlib.  Raises BadInput."""
    if text is not None:
        from ..plotting.figure_format import style_settings

        style_settings(text, "--style")
    return text


def drawing(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options --width and --style of every command that draws figures, which hold while it runs."""

    @functools.wraps(command)
    def drawn(*given: Any, figure_width: str | None, figure_style: str | None, **named: Any) -> Any:
        if figure_width is None and figure_style is None:
            return command(*given, **named)
        from ..plotting.figure_format import figure_format

        with figure_format(figure_width, figure_style):
            return command(*given, **named)

    width = click.option(
        "--width",
        "figure_width",
        metavar="WIDTH",
        callback=_read_width,
        help="Width of figures, such as 3.4in or 86mm.",
    )
    style = click.option(
        "--style",
        "figure_style",
        metavar="FILE",
        type=FILE,
        callback=_read_style,
        help="Style file of matplotlib (.mplstyle), or name of a style, for fonts and lines of figures.",
    )
    return width(style(drawn))


READING = ("radius", "length", "material")
"""Names of the options of `reading`."""


def reading(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options --radius, --length and --material of commands that read files of grains of other programs."""
    radius = click.option("--radius", metavar="R", help="Radius of the grains of a file without radii.")
    length = click.option("--length", metavar="LENGTH", help="Unit of length of a file of another program, as '1 nm'.")
    material = click.option("--material", metavar="M", help="Material of a file that names none (silica).")
    return radius(length(material(command)))


def refuse_reading(folder: Any, given: Mapping[str, Any]) -> None:
    """Refuse options of `reading` that were given for the folder of a run.  Raises BadInput."""
    if wrong := [
        f"--{name}: the run in {folder} has it; leave --{name} out" for name in given if given[name] is not None
    ]:
        raise BadInput(wrong)


def _import(context: click.Context, _option: click.Parameter, names: tuple[str, ...]) -> None:
    if names and not context.resilient_parsing:  # not while a shell completes a word
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


def _seconds(context: click.Context, option: click.Parameter, text: str | None) -> float | None:
    """Convert a time to seconds, checked as in a case file; a bare number is SI.  Raises BadInput."""
    if text is None or context.resilient_parsing:
        return None
    from ..simulation.cadence import duration

    try:
        value: float | str = float(text)
    except ValueError:
        value = text
    return duration(value, option.opts[0])


wall_time = click.option(
    "--wall-time",
    metavar="TIME",
    callback=_seconds,
    help="Stop after this wall time, such as 23h, with a checkpoint and exit code 4; continue with `sand resume`.",
)


def seeds(text: str) -> Any:
    """The option --seeds with the help text `text`; its value is a list of integers."""
    return click.option("--seeds", metavar="LIST", callback=read_seeds, help=text)


def read_seeds(_context: click.Context, _option: click.Parameter, text: str | None) -> list[int] | None:
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
    return each_once(found, "--seeds")


overwrite = click.option("--overwrite", is_flag=True, help="Replace the job in the folder.")


def job_of_seeds(command: Callable[..., Any]) -> Callable[..., Any]:
    """CASE.toml, --out, --seeds and --overwrite of a command that begins a job with one part for each seed."""
    case = click.argument("case", metavar="CASE.toml", type=CASE_FILE)
    out = click.option("--out", metavar="DIR", type=FOLDER, help="Folder for the files (default: the case's name).")
    return case(out(seeds("Seeds in place of those in the case: '3', '1,2,5' or '1-20'.")(overwrite(command))))


def execution(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options of how a job is computed: --workers, --scheduler, --wall-time, --import and --threads."""
    return workers(scheduler(wall_time(imports(threads(command)))))


def _frames(_context: click.Context, _option: click.Parameter, text: str) -> slice:
    """Read '-1', '3', '10:' or '::5' as a slice.  Raises BadInput."""
    parts = text.split(":")
    try:
        numbers = [int(part) if part.strip() else None for part in parts]
        if len(numbers) == 1 and numbers[0] is not None:
            first = numbers[0]
            return slice(first, first + 1 if first != -1 else None)
        if not 2 <= len(numbers) <= 3:
            raise ValueError
        return slice(*numbers)
    except ValueError:
        raise BadInput(f"--frames {text!r} must be a frame or a slice such as '-1', '10:', '0:100:5'") from None


frames = click.option(
    "--frames", metavar="SLICE", default=":", callback=_frames, help="Frames, as in Python: '-1', '10:', '::5'."
)
