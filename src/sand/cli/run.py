"""`sand run CASE.toml`: the simulation that a case file describes."""

from __future__ import annotations

from pathlib import Path

import click

from ..core.errors import BadInput
from ..files.folder import CASE
from . import options, report


@click.command("run", short_help="Run the simulation that a case file describes.")
@click.argument("case", metavar="CASE.toml", required=False)
@click.option("--out", metavar="DIR", help="Folder for the files (default: the case's name).")
@click.option(
    "--from", "source", metavar="FILE", help="Trajectory, or folder of a run, whose grains and contacts to take."
)
@click.option("--frame", type=int, metavar="K", help="Which frame of it, from 0; −1, the last, by default.")
@options.end_of_run('End of the run instead of that in the case, such as "5 us".')
@click.option("--seed", type=click.IntRange(min=0), metavar="N", help="Seed instead of that in the case.")
@click.option("--overwrite", is_flag=True, help="Replace the run that the folder holds.")
@options.as_json
@options.quiet
@options.debug
def command(
    case: str | None,
    source: str | None,
    frame: int | None,
    out: str | None,
    until: str | None,
    seed: int | None,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Run the simulation that CASE.toml describes.

    Leaves in the folder: case.toml (as understood), trajectory.gsd, ledger.csv, summary.json, figure.png and
    checkpoints.  Ctrl-C stops at the next step; `sand resume` then goes on.

    With --from, grains, contacts and box are those of a frame of an earlier run, time begins at 0, and CASE.toml
    says everything else; without it, the earlier run's own case.toml does.
    """
    end = options.seconds(until)
    from ..run.build import simulation_of
    from ..run.case import GrainsSection, read_case
    from .launch import End, launch, refuse_folder

    if source is None:
        if frame is not None:
            raise BadInput("--frame says which frame of --from FILE to start with; give that, too")
        if case is None:
            raise BadInput("give a case file: sand run CASE.toml; or an earlier run: sand run --from DIR")
    elif not Path(source).exists():
        raise BadInput(f"--from: there is no file or folder {source}")
    elif case is None:
        case = str(_folder_of(source) / CASE)
    described = read_case(case)
    if source is not None:
        described.grains = GrainsSection(
            kind="file", file=str(Path(source).absolute()), frame=-1 if frame is None else frame
        )
    if end is not None:
        described.run.until, described.run.steps = end, None
    if seed is not None:
        described.run.seed = seed
    folder = Path(out or _usual_folder(described.run.out, Path(case), source, frame))
    refuse_folder(folder, Path(case), overwrite=overwrite)
    return launch(
        lambda: report.blame(Path(case), lambda: simulation_of(described, folder, overwrite=overwrite)),
        folder,
        f"run {case}" + (f" from {source}" if source else ""),
        End(described.run.until, described.run.steps),
        quiet=quiet,
        as_json=as_json,
    )


def _folder_of(source: str) -> Path:
    """The folder of the run that `source` names, itself or its trajectory."""
    return Path(source) if Path(source).is_dir() else Path(source).parent


def _usual_folder(told: str | None, case: Path, source: str | None, frame: int | None) -> Path:
    """Where files go if --out does not say: what the case says, or its name; never into the earlier run."""
    if source is None:
        return Path(told or case.stem)
    return Path(f"{_folder_of(source).absolute().name}-from-{'last' if frame is None else frame}")
