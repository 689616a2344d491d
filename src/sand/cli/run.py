"""`sand run CASE.toml`: runs the simulation that a case file describes."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from ..basics.errors import BadInput, naming
from ..basics.threads import set_threads
from ..io.run_folder import CASE, TRAJECTORY
from . import options, parsing, report


def _check(values: parsing.OptionValues) -> Iterator[str]:
    """Errors of options that need others."""
    if "source" not in values.given and values["frame"] is not None:
        yield "--frame selects the frame of --from FILE to start with; give --from, too"
    elif not {"source", "case"} & values.given:
        yield "give a case file: sand run CASE.toml; or an earlier run: sand run --from DIR"


@parsing.command("run", short_help="Run the simulation that a case file describes.", check=_check)
@click.argument("case", metavar="CASE.toml", required=False, type=options.CASE_FILE)
@click.option("--out", metavar="DIR", type=options.FOLDER, help="Folder for the files (default: the case's name).")
@click.option(
    "--from",
    "source",
    metavar="FILE",
    type=options.RUN,
    help="Trajectory, or folder of a run, to take grains and contacts from.",
)
@click.option("--frame", type=options.FRAME, metavar="K", help="Frame of --from, from 0 (default: −1, the last).")
@options.end_of_run('End of the run in place of that in the case, such as "5 us".')
@click.option("--seed", type=options.SEED, metavar="N", help="Seed in place of that in the case.")
@click.option("--overwrite", is_flag=True, help="Replace the run in the folder.")
@options.wall_time
@options.imports
@options.threads
@options.output
@options.drawing
def command(
    case: str | None,
    *,
    source: str | None,
    frame: int | None,
    out: str | None,
    until: float | None,
    seed: int | None,
    overwrite: bool,
    threads: int | None,
    wall_time: float | None,
    **output: bool,
) -> int:
    """Run the simulation that CASE.toml describes.

    Writes case.toml (with all defaults filled in), trajectory.gsd, ledger.csv, summary.json, figure.png and
    checkpoints to the folder. Ctrl-C stops after the current step; continue with `sand resume`.

    With --from, grains, contacts and box come from a frame of an earlier run, and time begins at 0; CASE.toml
    describes everything else, by default the case.toml of the earlier run.
    """
    set_threads(threads)
    if case is not None and Path(case).is_dir():
        folder = Path(case)
        advice = "give a case file: sand run CASE.toml"
        if report.is_resumable(folder):
            advice = f"to continue its run: {report.resume_line(folder)}"
        elif (folder / TRAJECTORY).exists():
            advice = f"to start from its last frame: sand run --from {shlex.quote(case)}"
        elif (folder / CASE).exists():
            advice = f"to run its case: sand run {shlex.quote(str(folder / CASE))}"
        raise BadInput(f"{case} is a folder; {advice}")
    from ..config.case import GrainsSection, read_case
    from .launch import launch, refuse_folder

    grains = None if source is None else _source(source)
    name = _case_name(case, grains)
    described = read_case(name)
    if grains is not None:
        number = -1 if frame is None else frame
        described.grains = GrainsSection(kind="file", file=str(grains.absolute()), frame=number)
        if case is None:  # another seed, so that a gas does not repeat the kicks of the earlier run
            described.run.seed += 1 + number % 1_000_000
    if until is not None:
        described.run.until, described.run.steps = until, None
    if seed is not None:
        described.run.seed = seed
    usual = described.run.out or Path(name).stem
    if grains is not None:  # never the folder of the earlier run
        usual = f"{grains.parent.name}-from-{'last' if frame is None or frame < 0 else frame}"
    folder = Path(out or usual)
    refuse_folder(folder, Path(name), overwrite=overwrite)

    def build() -> Any:
        from ..config.build import simulation_of  # slow: after all checks of the case

        with naming(name):
            return simulation_of(described, folder, overwrite=overwrite)

    heading = f"run {name}" + (f" from {source}" if source else "")
    ends = described.run.until, described.run.steps, described.run.stop
    return launch(build, folder, heading, ends, wall_time, **output)


def _source(source: str) -> Path:
    """The trajectory to take grains from.  Raises BadInput."""
    place = Path(source).absolute().resolve()
    if not place.exists():
        raise BadInput(f"--from: there is no file or folder {source}")
    if place.is_dir() and not (place / TRAJECTORY).exists():
        raise BadInput(f"--from: {source} is not the folder of a run: there is no {TRAJECTORY} in it")
    if place.suffix in (".toml", ".npz", ".csv", ".json", ".png"):
        raise BadInput(f"--from: {source} holds no grains; give the folder of a run, or its {TRAJECTORY}")
    return place / TRAJECTORY if place.is_dir() else place


def _case_name(case: str | None, source: Path | None) -> str:
    """The case file given, or that of the run whose grains are taken.  Raises BadInput."""
    if case is not None:
        return case
    if source is None or not (source.parent / CASE).exists():
        raise BadInput(f"--from: there is no {CASE} beside {source}; give a case file before --from")
    return str(source.parent / CASE)
