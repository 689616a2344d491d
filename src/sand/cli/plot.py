"""`sand plot DIR`: figures of a run, and a still picture of a frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import click

from ..errors import BadInput, did_you_mean
from . import options, report

STILL = "still"
FORMATS = ("png", "pdf", "svg")
FOLDER = "plots"


class Source(NamedTuple):
    """The data to plot: a run, or a trajectory alone."""

    path: Path
    frames: Any
    run: Any  # None for a trajectory


@click.command("plot", short_help="Draw figures of a run, and a still picture of a frame.")
@click.argument("source", metavar="DIR", type=options.PATH)
@click.option("--what", metavar="WHAT,…", help="What to draw (default: all figures over time, and still).")
@click.option("--out", metavar="FOLDER", type=options.PATH, help="Folder for the files (default: 'plots' in DIR).")
@click.option("--format", "form", type=click.Choice(FORMATS), default="png", show_default=True, help="File format.")
@click.option(
    "--frame", metavar="K", type=options.FRAME, default=-1, help="Frame, numbered as in Python (default: the last)."
)
@click.option(
    "--colour", metavar="QUANTITY", default="cluster", show_default=True, help="Quantity that colours grains."
)
@click.option(
    "--bonds", type=click.Choice(["load", "mode", "none"]), default="none", help="Quantity shown by contacts."
)
@click.option("--arrows/--no-arrows", default=True, help="Draw moments as arrows (default) or not.")
@click.option("--cluster", metavar="K", type=int, help="Draw one cluster only; the largest is 1.")
@click.option("--cut", is_flag=True, help="Draw clusters cut by the faces of the box, not whole.")
@click.option(
    "--view", metavar="VIEW", default="iso", help="iso, front, top, side, or the direction to the eye: 'x,y,z'."
)
@click.option("--perspective", is_flag=True, help="Perspective instead of parallel projection.")
@click.option("--size", metavar="WxH", default="1600x1000", show_default=True, help="Size of the picture in pixels.")
@click.option("--transparent", is_flag=True, help="Transparent background.")
@click.option("--dark", is_flag=True, help="Dark background.")
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@options.output
def command(
    source: str, what: str | None, out: str | None, form: str, frame: int, overwrite: bool, as_json: bool, **how: Any
) -> None:
    """Draw the run in DIR, or a .gsd of SAND: figures over time, a still picture of a frame, histograms over grains.

    WHAT is size (of clusters, over time), energies, losses, contacts, balance, temperatures (of bodies), still; or a
    QUANTITY of grains, of which a histogram is drawn: cluster, radius, coordination, speed, spin, kinetic_energy,
    alignment (of moments with the moment of their cluster), field_alignment, material, at_rest (with rigid clusters).
    As a colour of grains, size is the number of grains in their cluster.
    """
    from ..io.run_folder import make_folder, replace_file

    folder, names = _check_options(Path(source), what, out, form, overwrite, how)
    pictures = _draw(_open_source(Path(source)), names, frame, form, how)
    if not folder.exists():
        make_folder(folder)
    paths = [folder / f"{name}.{form}" for name in names]
    for path, content in zip(paths, pictures, strict=True):
        replace_file(path, content)
    rows = [("folder", str(folder)), ("files", ", ".join(path.name for path in paths))]
    report.answer({"files": [str(path) for path in paths]}, f"plot {source}", rows, as_json=as_json)


def _check_options(
    source: Path, selection: str | None, out: str | None, form: str, overwrite: bool, how: dict[str, Any]
) -> tuple[Path, list[str]]:
    """Folder to write to and names of what to draw; converts `how` for the picture.  Raises BadInput, all errors."""
    from ..analysis.quantities import GRAIN_NAMES
    from ..plotting.plots import HISTORY
    from ..plotting.render.still import check_picture_options

    problems: list[str] = []
    is_trajectory = source.is_file()
    default = (STILL,) if is_trajectory else (*HISTORY, STILL)
    names = list(default if selection is None else dict.fromkeys(part.strip() for part in selection.split(",")))
    allowed = (*HISTORY, STILL, *GRAIN_NAMES)
    problems += [f"--what {name!r} is unknown; {did_you_mean(name, allowed)}" for name in names if name not in allowed]
    if is_trajectory:
        missing = [name for name in names if name in HISTORY]
        problems += [f"--what {name}: {source} has no ledger; give a run's folder" for name in missing]
    if how["cluster"] is not None and selection is not None and (others := [name for name in names if name != STILL]):
        problems.append(
            f"--cluster is for the still picture; {', '.join(others)} would show all grains: leave them out"
        )
    try:
        width, height = map(int, how["size"].lower().replace("×", "x").split("x"))
    except ValueError:
        problems.append(f"--size {how['size']!r} must be width x height in pixels, such as 1600x1000")
        width, height = 1600, 1000
    how["size"], how["whole"] = (width, height), not how.pop("cut")
    how["bonds"] = None if how["bonds"] == "none" else how["bonds"]
    try:
        check_picture_options(how["colour"], how["bonds"], how["view"], how["size"])
    except BadInput as error:
        problems += error.problems
    beside = source.with_name(f"{source.stem}-{FOLDER}") if is_trajectory else source / FOLDER
    folder = beside if out is None else Path(out)
    if not folder.is_dir() and (folder.exists() or (out is not None and not folder.parent.is_dir())):
        problems.append(f"--out {folder} cannot be a folder; give another one")
    existing = [name for name in names if (folder / f"{name}.{form}").exists()]
    if existing and not overwrite:
        problems.append(f"{folder / existing[0]}.{form} exists; give another --out, or --overwrite")
    if problems:
        raise BadInput(problems)
    return folder, names


def _open_source(path: Path) -> Source:
    """Open a run or a trajectory.  Raises BadInput if there is none of SAND."""
    from ..io.trajectory import Frames
    from ..results import Run

    if not path.is_file():
        run = Run(path)
        return Source(path, run.frames, run)
    frames = Frames(path)
    if not frames.written_by_sand:
        raise BadInput(f"{path} is not a trajectory of SAND, or has no frame")
    return Source(path, frames, None)


def _draw(source: Source, names: list[str], frame: int, form: str, how: dict[str, Any]) -> list[bytes]:
    """Draw all files in memory, so that none is written unless all can be drawn.  Raises BadInput."""
    from ..analysis.ledger_columns import LedgerColumns
    from ..forces.pair.dipoles import kinetic_temperature
    from ..io.ledger_table import read_ledger
    from ..io.run_folder import LEDGER
    from ..plotting.plots import HISTORY, grains_figure, history_figure
    from ..plotting.render.still import still_picture
    from ..plotting.run_figure import figure_bytes

    if any(name in HISTORY for name in names):
        ledger, first = LedgerColumns.from_rows(read_ledger(source.path / LEDGER)), _frame(source, 0)
        start = (len(first), kinetic_temperature(first))
    if any(name not in HISTORY for name in names):
        one = _frame(source, frame)
        field = None if source.run is None else source.run.flux_density(one.time)

    def draw(name: str) -> Any:
        if name in HISTORY:
            return history_figure(ledger, name, *start, dark=how["dark"])
        if name == STILL:
            return still_picture(one, field=field, **how)
        return grains_figure(one, name, field, dark=how["dark"])

    return [figure_bytes(draw(name), form, how["transparent"]) for name in names]


def _frame(source: Source, number: int) -> Any:
    """Read a frame.  Raises BadInput if it does not exist."""
    if not len(source.frames):
        raise BadInput(f"{source.path} has no frame yet")
    return source.frames[number]
