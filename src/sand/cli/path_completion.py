"""Completion of paths in a shell: folders of runs, and case files."""

from __future__ import annotations

import shlex
from pathlib import Path

from click.shell_completion import CompletionItem

from ..io.run_folder import CASE, TRAJECTORY


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
