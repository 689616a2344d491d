"""`sand completion SHELL`: the script by which a shell completes commands, options, runs and case files."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import click
from click.shell_completion import CompletionItem, get_completion_class, shell_complete

from ..io.run_folder import CASE, TRAJECTORY
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


def path_items(start: str, wanted: str) -> list[CompletionItem]:
    """Completions of the beginning of a path.

    Parameters
    ----------
    start : str
        The text so far.
    wanted : str
        Words out of "run" (folders of runs and jobs), "case" (files ending in .toml), "file" and "folder" (any).

    Returns
    -------
    list of CompletionItem
        Runs and case files, with the folders on the way to others; if there are none, the shell completes files.
    """
    usual = [CompletionItem(start, type="dir" if wanted in ("run", "folder") else "file")]
    folder, _, beginning = start.rpartition("/")
    place = Path(f"{folder}/" if folder or start.startswith("/") else ".")
    try:
        entries = sorted(entry for entry in place.iterdir() if entry.name.startswith(beginning))
    except OSError:
        return usual
    before = start.removesuffix(beginning) if beginning else start
    found, others = [], []
    for entry in entries:
        if entry.name.startswith(".") and not beginning:
            continue
        if entry.is_dir() and "run" in wanted and _is_run(entry):
            found.append(f"{before}{entry.name}")
        elif entry.is_dir():
            others.append(f"{before}{entry.name}/")
        elif "case" in wanted and entry.suffix == ".toml":
            found.append(f"{before}{entry.name}")
    # the shell itself quotes names with blanks
    if not found or any(shlex.quote(name) != name for name in [*found, *others]):
        return usual
    return [CompletionItem(name) for name in [*found, *others]]


def _is_run(folder: Path) -> bool:
    """Whether a folder holds a run or a job."""
    return any((folder / name).exists() for name in (CASE, TRAJECTORY))
