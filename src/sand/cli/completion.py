"""`sand completion SHELL`: the script by which a shell completes commands, options, runs and case files."""

from __future__ import annotations

import os

import click
from click.shell_completion import get_completion_class, shell_complete

from . import options, parsing

VARIABLE = "_SAND_COMPLETE"
"""Environment variable by which a shell asks for completions."""
SHELLS = ("bash", "zsh", "fish")


@parsing.command("completion", short_help="Print the script that completes words in a shell.")
@click.argument("shell", metavar="SHELL", type=click.Choice(SHELLS))
@options.debug
def command(shell: str) -> None:
    """Print the script by which SHELL (bash, zsh or fish) completes commands, options, run folders and case files.

    \b
    bash  in ~/.bashrc:  eval "$(sand completion bash)"
    zsh   in ~/.zshrc, after compinit:  eval "$(sand completion zsh)"
    fish  once:  sand completion fish > ~/.config/fish/completions/sand.fish
    """
    kind = get_completion_class(shell)
    if kind is not None:
        click.echo(kind(click.get_current_context().find_root().command, {}, "sand", VARIABLE).source())


def answer_shell(program: click.Command) -> int | None:
    """Answer a shell that asks for completions; returns the exit code, None if none asks."""
    asked = os.environ.get(VARIABLE)
    return shell_complete(program, {}, "sand", VARIABLE, asked) if asked else None
