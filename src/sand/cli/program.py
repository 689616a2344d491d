"""The `sand` command: parse, call one command, turn errors into exit codes."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

import click

from ..errors import SandError
from ..version import __version__
from . import analyse, build, cite, collide, export, grow, info, options, plot, report, resume, run, scatter, view
from .exits import DONE, FAILED, INTERRUPTED, MISTAKE

COMMANDS = (run, resume, build, collide, scatter, grow, analyse, plot, view, export, info, cite)
"""One module per command; each has a `command`."""


@click.group(invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="sand", message="%(prog)s %(version)s")
@options.debug
@click.pass_context
def sand(context: click.Context) -> None:
    """SAND: dust aggregates, grain by grain, with sticking contacts and magnetic dipoles.

    Exit codes: 0 done, 2 a mistake in what was asked for, 3 stopped by physics, 130 interrupted.
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


for _module in COMMANDS:
    sand.add_command(_module.command)


def run_command(words: list[str], asked: Callable[[], bool]) -> int:
    """One command; returns the exit code.

    Parameters
    ----------
    words : list[str]
        after `sand`.
    asked : Callable[[], bool]
        says whether Ctrl-C has been pressed.
    """
    try:
        return _call(words, asked)
    except BrokenPipeError:  # the reader went away, as in `sand info DIR | head -1`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or flushing at exit would complain
        return DONE


def _call(words: list[str], asked: Callable[[], bool]) -> int:
    """Run the command; its errors become lines and an exit code, unless --debug."""
    try:
        with sand.make_context("sand", list(words)) as context, report.notes():
            return sand.invoke(context) or DONE
    except click.exceptions.Exit as stop:  # --help, --version
        return stop.exit_code
    except BrokenPipeError:
        raise
    except (KeyboardInterrupt, click.Abort):
        return _fail(["interrupted"], INTERRUPTED, words)
    except Exception as error:
        if asked() and not isinstance(error, (SandError, click.ClickException)):
            return _fail(["interrupted"], INTERRUPTED, words)  # an import that is cut short fails in any way
        if "--debug" in words and not isinstance(error, click.ClickException):
            raise
        return _fail(*_explained(error), words)


def _explained(error: Exception) -> tuple[list[str], int]:
    """What to say of an error, and the exit code."""
    if isinstance(error, SandError):
        return str(error).splitlines(), MISTAKE
    if isinstance(error, click.UsageError):
        where = error.ctx.command_path if error.ctx else "sand"
        return [f"{_one_line(error.format_message()).rstrip('.')}; see {where} --help"], MISTAKE
    if isinstance(error, click.ClickException):
        return [_one_line(error.format_message())], MISTAKE
    if isinstance(error, MemoryError):
        return ["not enough memory for this; take fewer grains"], MISTAKE
    told = _one_line(f"{type(error).__name__}: {error}")
    return [f"internal error ({told}); run again with --debug and report what it prints"], FAILED


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _fail(lines: list[str], code: int, words: list[str]) -> int:
    for line in lines:
        report.note(line)
    if "--json" in words:
        report.emit({"error": lines, "exit_code": code})
    return code
