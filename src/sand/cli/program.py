"""The `sand` command: parses the command line, calls one command, and turns errors into exit codes."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

import click

from ..basics.descriptions import docstring
from ..basics.errors import SandError
from ..basics.version import __version__
from . import (
    analyse,
    build,
    cite,
    collide,
    completion,
    compress,
    elastic,
    export,
    grow,
    info,
    methods,
    new,
    options,
    parsing,
    plot,
    report,
    reproduce,
    resume,
    run,
    scatter,
    shear,
    stretch,
    sweep,
    view,
)
from .exits import BAD_INPUT, DONE, FAILED, INTERRUPTED

COMMANDS = (
    *(new, run, resume, build, collide, scatter, grow, compress, stretch, shear, elastic, sweep, reproduce),
    *(analyse, plot, view, export, info, methods, cite, completion),
)
"""One module per command, with a click command named `command`."""


@click.group(cls=parsing.Group, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="sand", message="%(prog)s %(version)s")
@options.debug
@click.pass_context
def sand(context: click.Context) -> None:
    """SAND: grain-by-grain simulation of dust aggregates with adhesive contacts and magnetic dipoles.

    Exit codes: 0 done, 2 an error in the input or of files, 3 stopped by physics, 4 the wall time is used up,
    130 interrupted.
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


sand.help = docstring(sand.callback)
for _module in COMMANDS:
    sand.add_command(_module.command)


def run_command(words: list[str], interrupted: Callable[[], bool]) -> int:
    """Run one command; errors become lines and an exit code, unless --debug is given.

    Parameters
    ----------
    words : list[str]
        Arguments after `sand`.
    interrupted : Callable[[], bool]
        Whether Ctrl-C has been pressed.

    Returns
    -------
    int
        The exit code.
    """
    if (code := completion.answer_shell(sand)) is not None:
        return code
    try:
        with sand.make_context("sand", list(words)) as context, report.notes():
            return sand.invoke(context) or DONE
    except click.exceptions.Exit as stop:  # --help, --version
        return stop.exit_code
    except BrokenPipeError:  # the reader has ended, as in `sand info DIR | head -1`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or flushing at exit would fail
        return DONE
    except (KeyboardInterrupt, click.Abort) as stop:
        return _fail([str(stop) or "interrupted"], getattr(stop, "exit_code", INTERRUPTED), words)
    except Exception as error:
        if interrupted() and not isinstance(error, (SandError, click.ClickException)):
            return _fail(["interrupted"], INTERRUPTED, words)  # an interrupted import can raise anything
        if "--debug" in words and not isinstance(error, click.ClickException):
            raise
        return _fail(*_explain(error), words)


def _explain(error: Exception) -> tuple[list[str], int]:
    """Error message in lines, and the exit code."""
    if isinstance(error, SandError):
        return str(error).splitlines(), BAD_INPUT
    if isinstance(error, click.UsageError):
        where = error.ctx.command_path if error.ctx else "sand"
        *others, last = getattr(error, "lines", [_one_line(error.format_message()).rstrip(".")])
        return [*others, f"{last}; see {where} --help"], BAD_INPUT
    if isinstance(error, MemoryError):
        return ["not enough memory; use fewer grains"], BAD_INPUT
    text = _one_line(f"{type(error).__name__}: {error}")
    return [f"internal error ({text}); run again with --debug and report the output"], FAILED


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _fail(lines: list[str], code: int, words: list[str]) -> int:
    for line in lines:
        report.note(line)
    if "--json" in words:
        report.emit({"error": lines, "exit_code": code})
    return code
