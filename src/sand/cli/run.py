"""`sand run CASE.toml`: the simulation that a case file describes."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import BadInput
from ..io.run_folder import CASE, TRAJECTORY
from ..threads import set_threads
from . import options, report


@click.command("run", short_help="Run the simulation that a case file describes.")
@click.argument("case", metavar="CASE.toml", required=False, type=options.PLACE)
@click.option("--out", metavar="DIR", type=options.PLACE, help="Folder for the files (default: the case's name).")
@click.option(
    "--from",
    "source",
    metavar="FILE",
    type=options.PLACE,
    help="Trajectory, or folder of a run, whose grains and contacts to take.",
)
@click.option("--frame", type=options.FRAME, metavar="K", help="Which frame of it, from 0; −1, the last, by default.")
@options.end_of_run('End of the run instead of that in the case, such as "5 us".')
@click.option("--seed", type=options.SEED, metavar="N", help="Seed instead of that in the case.")
@click.option("--overwrite", is_flag=True, help="Replace the run that the folder holds.")
@options.threads
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
    threads: int | None,
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
    set_threads(threads)
    if case is not None and Path(case).is_dir():
        raise BadInput(
            f"{case} is a folder; to go on with a run: sand resume {case}; to start from its last frame: "
            f"sand run --from {case}"
        )
    from ..config.build import simulation_of
    from ..config.case import GrainsSection, read_case
    from .launch import End, launch, refuse_folder

    if source is None and frame is not None:
        raise BadInput("--frame says which frame of --from FILE to start with; give that, too")
    grains = None if source is None else _source(source)
    name = _case_name(case, grains)
    described = read_case(name)
    if grains is not None:
        number = -1 if frame is None else frame
        described.grains = GrainsSection(kind="file", file=str(grains.absolute()), frame=number)
        if case is None:  # a gas is not to kick as it did in the run before
            described.run.seed += 1 + number % 1_000_000
    if end is not None:
        described.run.until, described.run.steps = end, None
    if seed is not None:
        described.run.seed = seed
    folder = Path(out or _usual_folder(described.run.out, Path(name), grains, frame))
    refuse_folder(folder, Path(name), overwrite=overwrite)
    return launch(
        lambda: report.blame(Path(name), lambda: simulation_of(described, folder, overwrite=overwrite)),
        folder,
        f"run {name}" + (f" from {source}" if source else ""),
        End(described.run.until, described.run.steps),
        quiet=quiet,
        as_json=as_json,
    )


def _source(source: str) -> Path:
    """The file that grains are to be taken from.  Raises BadInput."""
    place = Path(source).expanduser().absolute().resolve()
    if not place.exists():
        raise BadInput(f"--from: there is no file or folder {source}")
    if place.is_dir() and not (place / TRAJECTORY).exists():
        raise BadInput(f"--from: {source} is not the folder of a run: there is no {TRAJECTORY} in it")
    if place.suffix in (".toml", ".npz", ".csv", ".json", ".png"):
        raise BadInput(f"--from: {source} holds no grains; give the folder of a run, or its {TRAJECTORY}")
    return place / TRAJECTORY if place.is_dir() else place


def _case_name(case: str | None, source: Path | None) -> str:
    """The case file: what was given, or that of the run whose grains are taken.  Raises BadInput."""
    if case is not None:
        return case
    if source is None:
        raise BadInput("give a case file: sand run CASE.toml; or an earlier run: sand run --from DIR")
    if not (source.parent / CASE).exists():
        raise BadInput(f"--from: there is no {CASE} beside {source}; give a case file before --from")
    return str(source.parent / CASE)


def _usual_folder(told: str | None, case: Path, source: Path | None, frame: int | None) -> Path:
    """Where files go if --out does not say: what the case says, or its name; never into the earlier run."""
    if source is None:
        return Path(told or case.stem)
    return Path(f"{source.parent.name}-from-{'last' if frame is None or frame < 0 else frame}")
