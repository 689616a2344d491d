"""`sand plot DIR`: figures of a run, and a still picture of a frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import click

from ..errors import BadInput, did_you_mean
from . import options, report
from .exits import DONE

STILL = "still"
FORMATS = ("png", "pdf", "svg")
FOLDER = "plots"


class Source(NamedTuple):
    """What is plotted: a run's folder, or a trajectory alone."""

    path: Path
    frames: Any
    run: Any  # None for a trajectory


@click.command("plot", short_help="Draw figures of a run, and a still picture of a frame.")
@click.argument("source", metavar="DIR", type=options.PLACE)
@click.option("--what", metavar="WHAT,…", help="Which (default: all over time, and still).")
@click.option("--out", metavar="FOLDER", type=options.PLACE, help="Where to (default: 'plots' in DIR).")
@click.option("--format", "form", type=click.Choice(FORMATS), default="png", show_default=True, help="Of the files.")
@click.option(
    "--frame", metavar="K", type=options.FRAME, default=-1, help="Which frame, as in Python (default: the last)."
)
@click.option("--colour", metavar="QUANTITY", default="cluster", show_default=True, help="What colours grains show.")
@click.option("--bonds", type=click.Choice(["load", "mode", "none"]), default="none", help="What contacts show.")
@click.option("--arrows/--no-arrows", default=True, help="Moments as arrows (default: they are).")
@click.option("--cluster", metavar="K", type=int, help="One cluster by itself; the largest is 1.")
@click.option("--cut", is_flag=True, help="Clusters cut by the faces of the box, not whole.")
@click.option("--view", metavar="VIEW", default="iso", help="iso, front, top, side, or the way to the eye: 'x,y,z'.")
@click.option("--perspective", is_flag=True, help="What is nearer is larger.")
@click.option("--size", metavar="WxH", default="1600x1000", show_default=True, help="Pixels of the still picture.")
@click.option("--transparent", is_flag=True, help="Without a ground.")
@click.option("--dark", is_flag=True, help="On a dark ground.")
@click.option("--overwrite", is_flag=True, help="Replace files that are there.")
@options.as_json
@options.debug
def command(
    source: str, what: str | None, out: str | None, form: str, frame: int, overwrite: bool, as_json: bool, **how: Any
) -> int:
    """Draw the run in DIR, or a .gsd of SAND: figures over time, a still picture of a frame, histograms over grains.

    WHAT is size (of clusters, over time), energies, losses, contacts, balance, still; or a QUANTITY of grains, whose
    histogram is drawn: cluster, radius, coordination, speed, spin, kinetic_energy, alignment (of moments with that of
    their cluster), field_alignment, material. As a colour of grains, size is the number of grains in their cluster.
    """
    from ..io.run_folder import make_folder, replace_file

    place, names = _asked(Path(source), what, out, form, overwrite, how)
    drawn = report.with_notes(lambda: _drawn(_source(Path(source)), names, frame, form, how))
    if not place.exists():
        make_folder(place)
    for path, content in zip((place / f"{name}.{form}" for name in names), drawn, strict=True):
        replace_file(path, content)
    if as_json:
        report.emit({"files": [str(place / f"{name}.{form}") for name in names]})
    else:
        report.show(f"plot {source}", [("folder", str(place)), ("files", ", ".join(f"{n}.{form}" for n in names))])
    return DONE


def _asked(
    source: Path, what: str | None, out: str | None, form: str, overwrite: bool, how: dict[str, Any]
) -> tuple[Path, list[str]]:
    """The folder to write to and what to draw; `how` made ready for the picture.  Raises BadInput for all mistakes."""
    from ..analysis.quantities import GRAIN_NAMES
    from ..plotting.plots import HISTORY
    from ..plotting.render.still import check_picture_options

    wrong: list[str] = []
    alone = source.is_file()
    usual = (STILL,) if alone else (*HISTORY, STILL)
    names = list(dict.fromkeys(part.strip() for part in what.split(","))) if what is not None else list(usual)
    allowed = (*HISTORY, STILL, *GRAIN_NAMES)
    wrong += [f"--what {name!r} is none; {did_you_mean(name, allowed)}" for name in names if name not in allowed]
    if alone:
        wrong += [f"--what {name}: {source} has no ledger; give a run's folder" for name in names if name in HISTORY]
    if how["cluster"] is not None and what is not None and (others := [name for name in names if name != STILL]):
        wrong.append(f"--cluster is for the still picture; {', '.join(others)} would show all grains: leave them out")
    size = _size(how["size"])
    if size is None:
        wrong.append(f"--size {how['size']!r} must be width x height in pixels, such as 1600x1000")
    how["size"], how["whole"] = size or (1600, 1000), not how.pop("cut")
    how["bonds"] = None if how["bonds"] == "none" else how["bonds"]
    try:
        check_picture_options(how["colour"], how["bonds"], how["view"], how["size"])
    except BadInput as error:
        wrong += error.problems
    default = source.with_name(f"{source.stem}-{FOLDER}") if alone else source / FOLDER
    place = default if out is None else Path(out)
    if not place.is_dir() and (place.exists() or (out is not None and not place.parent.is_dir())):
        wrong.append(f"--out {place} cannot be a folder; give another one")
    there = [name for name in names if (place / f"{name}.{form}").exists()]
    if there and not overwrite:
        wrong.append(f"{place / there[0]}.{form} exists; give another --out, or --overwrite")
    if wrong:
        raise BadInput(wrong)
    return place, names


def _size(text: str) -> tuple[int, int] | None:
    parts = text.lower().replace("×", "x").split("x")
    if len(parts) != 2 or not all(part.strip().isdecimal() and len(part) < 9 for part in parts):
        return None
    return int(parts[0]), int(parts[1])


def _source(path: Path) -> Source:
    """Raises BadInput: there is nothing of ours."""
    from ..io.trajectory import Frames
    from ..results import Run

    if not path.is_file():
        run = Run(path)
        return Source(path, run.frames, run)
    frames = Frames(path)
    if not frames.written_by_sand:
        raise BadInput(f"{path} is not a trajectory of SAND, or has no frame")
    return Source(path, frames, None)


def _drawn(source: Source, names: list[str], frame: int, form: str, how: dict[str, Any]) -> list[bytes]:
    """All files, in memory, so that none is written unless all can be drawn.  Raises BadInput."""
    from ..plotting.plots import HISTORY, figure_bytes, grains_figure, history_figure
    from ..plotting.render.still import still_picture

    history = _history(source) if any(name in HISTORY for name in names) else None
    one, field = None, None
    if any(name not in HISTORY for name in names):
        one = _frame(source, frame)
        field = None if source.run is None else source.run.flux_density(one.time)

    def draw(name: str) -> Any:
        if history is not None and name in HISTORY:
            return history_figure(history[0], name, *history[1:], dark=how["dark"])
        if name == STILL:
            return still_picture(one, field=field, **how)
        return grains_figure(one, name, field, dark=how["dark"])

    return [figure_bytes(draw(name), form, how["transparent"]) for name in names]


def _history(source: Source) -> tuple[Any, int, float]:
    """The ledger, the number of grains, and their temperature at the start [K].  Raises BadInput."""
    from ..analysis.ledger_columns import LedgerColumns
    from ..forces.pair.dipoles import kinetic_temperature
    from ..io.ledger_table import read_ledger
    from ..io.run_folder import LEDGER

    books = LedgerColumns.from_rows(read_ledger(source.path / LEDGER))
    first = _frame(source, 0)
    return books, len(first), kinetic_temperature(first)


def _frame(source: Source, number: int) -> Any:
    """Raises BadInput: there is none of that number."""
    if not len(source.frames):
        raise BadInput(f"{source.path} has no frame yet")
    try:
        return source.frames[number]
    except IndexError:
        last = len(source.frames) - 1
        raise BadInput(f"--frame {number}: {source.path} has frames 0 to {last}, or -1 to {-last - 1}") from None
