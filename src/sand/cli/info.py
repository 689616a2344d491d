"""`sand info DIR|FILE`: describes a run, a job or one of their files on one screen."""

from __future__ import annotations

from pathlib import Path

import click

from . import options, parsing, report


@parsing.command("info", short_help="Describe a run or one of its files.")
@click.argument("path", metavar="DIR|FILE", type=options.RUN_OR_CASE)
@options.imports
@options.output
def command(path: str, **output: bool) -> None:
    """Describe the folder of a run, a case file, trajectory.gsd, ledger.csv, summary.json or a checkpoint.

    Also describes cases, folders and results of jobs, such as those of `sand collide`, `sand compress` or `sand sweep`.

    A case file is checked as by `sand run`, but not run.
    """
    from .info_paths import describe

    heading, rows, content = describe(Path(path))
    report.answer(content, f"{path}: {heading}", rows, **output)
