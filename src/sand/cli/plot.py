"""`sand plot DIR`: figures of a run, and a still picture of a frame."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import click

from ..basics.errors import BadInput, did_you_mean
from . import options, parsing, report

STILL, SPECTRUM = "still", "mass_spectrum"
"""Of a frame: the picture of its grains, and s² n_s of its clusters."""
GROWTH, OF_GROWTH = "growth", ("impact_parameter", "reach", "growth_efficiency", "kind", "seed")
"""The figure of the growth efficiency, and the columns that it needs."""
FORMATS = ("png", "pdf", "svg")
FOLDER, SWEEP_TABLE, ENCOUNTERS = "plots", "sweep.csv", "encounters.csv"
# as `PLOTS`, `SWEEP_CSV` and `ENCOUNTERS` of `io.run_folder`, whose import is slow
LABORATORY = "laboratory"
"""The figure of packings that are loaded; also the name of the file with the results of such a job."""


class PrintSize(NamedTuple):
    """Size of a picture, in pixels (unit "") or lengths."""

    width: float
    height: float
    unit: str

    def pixels(self, dpi: int) -> tuple[int, int]:
        """Width and height in pixels at this number of pixels per inch."""
        scale = 1.0 if self.unit == "" else dpi / UNITS[self.unit]
        return round(self.width * scale), round(self.height * scale)


DPI = 160
"""Pixels per inch without --dpi; as `plotting.run_figure.DPI`, which takes long to import."""
UNITS = {"": 0.0, "in": 1.0, "cm": 2.54, "mm": 25.4}
"""Units of --size, per inch; "" are pixels."""
DEFAULT_SIZE = PrintSize(10.0, 6.25, "in")
"""1600 × 1000 pixels at 160 pixels per inch."""


class Source(NamedTuple):
    """The data to plot: a run, a trajectory alone, or a sweep."""

    path: Path
    frames: Any  # None for a sweep
    run: Any  # None for a trajectory


def _size(_context: click.Context, _option: click.Parameter, text: str | None) -> PrintSize | None:
    """Read '1600x1000' or '17x10.6 cm'.  Raises BadInput."""
    if text is None:
        return None
    numbers = text.lower().replace("×", "x").rstrip("cmin ")
    unit = text.lower().replace("×", "x")[len(numbers) :].strip()
    try:
        width, height = map(float, numbers.split("x"))
        if unit not in UNITS or (unit == "" and (width % 1.0 or height % 1.0)):
            raise ValueError
    except ValueError:
        raise BadInput(
            f"--size {text!r} must be width x height in pixels, such as 1600x1000, or with a unit, such as 17x10.6cm"
        ) from None
    return PrintSize(width, height, unit)


def _what(_context: click.Context, _option: click.Parameter, text: str | None) -> list[str] | None:
    """Read names of what to draw."""
    return None if text is None else list(dict.fromkeys(part.strip() for part in text.split(",")))


def _labels(_context: click.Context, _option: click.Parameter, text: str | None) -> list[str] | None:
    """Read labels of runs."""
    return None if text is None else [part.strip() for part in text.split(",")]


def _check_several(sources: list[str], values: Mapping[str, Any]) -> Iterator[str]:
    """Errors of what is given for several runs."""
    labels, names = values["labels"], values["what"] or []
    if labels is not None and len(labels) != len(sources):
        yield f"--labels names {len(labels)} of {len(sources)} runs; give one label for each, separated by commas"
    elif labels is not None and len(set(labels)) < len(labels):
        yield "--labels gives the same label twice; labels must differ"
    if len(sources) < 2:
        return
    if STILL in names:
        yield "--what still shows one run; give one, or leave still out"
    yield from (f"{one} holds a sweep or a job of packings; draw it alone" for one in sources if _is_many(Path(one)))


def _check(values: Mapping[str, Any]) -> Iterator[str]:
    """Errors of the values of options."""
    sources = list(values["source"] or ())
    yield from _check_several(sources, values)
    if all(values[name] is None for name in ("what", "colour", "bonds", "view", "size")):
        return
    from ..analysis.quantities import names_of
    from ..plotting.plots import HISTORY
    from ..plotting.render.still import check_picture_options

    given = {name: values[name] for name in options.READING}
    if any(_is_many(Path(one)) for one in sources):
        return
    one = _first_frame(Path(sources[0]), given) if sources else None
    allowed, names = (*HISTORY, STILL, SPECTRUM, *names_of(one)), values["what"] or []
    yield from (f"--what {name!r} is unknown; {did_you_mean(name, allowed)}" for name in names if name not in allowed)
    if values["cluster"] is not None and (others := [name for name in names if name != STILL]):
        yield f"--cluster is for the still picture; {', '.join(others)} would show all grains: leave them out"
    size = DEFAULT_SIZE if values["size"] is None else values["size"]
    shown = values["colour"] or "cluster", _bonds(values["bonds"]), values["view"] or "iso"
    try:
        check_picture_options(*shown, size.pixels(values["dpi"] or DPI), values["dpi"] or DPI, one)
    except BadInput as error:
        yield from error.problems


def _is_many(source: Path) -> bool:
    """Whether a folder holds a sweep, or a finished job of packings that are loaded."""
    return any((source / name).exists() for name in (SWEEP_TABLE, f"{LABORATORY}.json"))


def _bonds(given: str | None) -> str | None:
    return None if given == "none" else given


@parsing.command("plot", short_help="Draw figures of a run, and a still picture of a frame.", check=_check)
@click.argument("source", metavar="DIR…", type=options.RUN, nargs=-1, required=True)
@click.option("--labels", metavar="A,B,…", callback=_labels, help="Names of several runs in one figure (default: DIR).")
@click.option(
    "--what", metavar="WHAT,…", callback=_what, help="What to draw (default: all figures over time, and still)."
)
@click.option("--out", metavar="FOLDER", type=options.FOLDER, help="Folder for the files (default: 'plots' in DIR).")
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
@click.option("--cluster", metavar="K", type=options.COUNT, help="Draw one cluster only; the largest is 1.")
@click.option("--cut", is_flag=True, help="Draw clusters cut by the faces of the box, not whole.")
@click.option(
    "--view", metavar="VIEW", default="iso", help="iso, front, top, side, or the direction to the eye: 'x,y,z'."
)
@click.option("--perspective", is_flag=True, help="Perspective instead of parallel projection.")
@click.option(
    "--size",
    metavar="WxH",
    callback=_size,
    help="Size of the still picture, in pixels (1600x1000) or printed (17x10.6cm, also mm, in); default 10x6.25in.",
)
@click.option(
    "--dpi",
    type=options.WholeNumber(50, 1200),
    default=DPI,
    show_default=True,
    metavar="N",
    help="Pixels per inch of all figures, such as 600 for print; also saved in the file.",
)
@click.option("--transparent", is_flag=True, help="Transparent background.")
@click.option("--dark", is_flag=True, help="Dark background.")
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@options.reading
@options.output
@options.drawing
def command(
    source: tuple[str, ...],
    labels: list[str] | None,
    what: list[str] | None,
    out: str | None,
    form: str,
    frame: int,
    overwrite: bool,
    **how: Any,
) -> None:
    """Draw the run in DIR, or several: figures over time, a still picture of a frame, histograms over grains.

    DIR may also be a trajectory, or a file of grains: XYZ, columns, LAMMPS data and dump, GSD; or a sweep, of which
    WHAT are columns of results, such as largest_remnant or outcome, or growth: growth efficiency and kinds of outcomes
    over speed and impact parameter. Of packings that were loaded by `sand compress`, `stretch` or `shear`, in a job or
    a sweep, their figure is drawn, `laboratory`, or columns of the table of a job. Of several runs each figure shows
    all, named by --labels, in the folder plots.

    WHAT is size (of clusters, over time), energies, losses, contacts, balance, temperatures (of bodies), still,
    mass_spectrum (s² n_s over the number s of grains of clusters, n_s clusters per grain of a frame); or a
    QUANTITY of grains, of which a histogram is drawn: cluster, radius, coordination, speed, spin, kinetic_energy,
    pressure (by contacts, mean in the grain), alignment (of moments with the moment of their cluster), field_alignment,
    material, at_rest (with rigid clusters), or an own quantity of the run, such as temperature. As a colour of grains,
    size is the number of grains in their cluster.
    """
    from ..io.run_folder import make_folder, replace_file

    output = {name: how.pop(name) for name in ("as_json", "quiet")}
    places = [Path(one) for one in source]
    if _is_many(places[0]):
        what = _of_many(places[0], what)
    folder, names = _place(places, what, out, form, overwrite)
    how["size"] = _pixels(how["size"], how["dpi"])
    how["whole"], how["bonds"], how["vector"] = not how.pop("cut"), _bonds(how["bonds"]), form != "png"
    given = {name: how.pop(name) for name in options.READING}
    opened = [_open_source(one, given) for one in places]
    figures = (_draw if len(opened) == 1 else _draw_several)(opened, labels or _names_of(places), names, frame, how)
    from ..plotting.run_figure import figure_bytes

    pictures = [figure_bytes(one, form, how["transparent"], how["dpi"]) for one in figures]
    if not folder.exists():
        make_folder(folder)
    paths = [folder / f"{name}.{form}" for name in names]
    for path, content in zip(paths, pictures, strict=True):
        replace_file(path, content)
    rows = [("folder", str(folder)), ("files", ", ".join(path.name for path in paths))]
    report.answer({"files": [str(path) for path in paths]}, f"plot {' '.join(source)}", rows, **output)


def _pixels(size: PrintSize | None, dpi: int) -> tuple[int, int] | None:
    """Width and height of the still picture in pixels; None if those follow from the width of all figures."""
    from ..plotting.figure_format import format_width

    if size is None and format_width() is not None:
        return None
    return (size or DEFAULT_SIZE).pixels(dpi)


def _names_of(places: list[Path]) -> list[str]:
    """Names of runs: those of their folders, or their paths if these are the same."""
    names = [place.absolute().name for place in places]
    return names if len(set(names)) == len(names) else [str(place) for place in places]


def _of_many(folder: Path, what: list[str] | None) -> list[str]:
    """Columns of a sweep, or of the table of packings, to draw.  Raises BadInput for others."""
    from ..results import Sweep

    if not (folder / SWEEP_TABLE).exists():
        allowed = [LABORATORY, *_loaded(folder)[0]["table"]]
        return _allowed([LABORATORY] if what is None else what, allowed)
    sweep = Sweep(folder)
    if not len(sweep.done["run"]):
        raise BadInput(f"{folder} has no run that is done, and nothing to draw")
    if what is None:
        return sweep.shown
    allowed = [*sweep.results, *([GROWTH] if set(OF_GROWTH).issubset(sweep.table) else [])]
    allowed += [LABORATORY] * (LABORATORY in sweep.shown)
    mixed = [key for key in sweep.keys if key not in ("impact.speed", "impact.impact_parameter")]
    if GROWTH in what and mixed:
        raise BadInput(
            f"--what {GROWTH} would average over {', '.join(mixed)}; give columns, such as growth_efficiency"
        )
    if GROWTH in what and not {"impact.speed", "speed"} & sweep.table.keys() and GROWTH in allowed:
        raise BadInput(f"--what {GROWTH} needs a sweep over impact.speed; give columns, such as growth_efficiency")
    return _allowed(what, allowed)


def _allowed(what: list[str], allowed: list[str]) -> list[str]:
    """What to draw.  Raises BadInput for other names."""
    if wrong := [f"--what {name!r} is unknown; {did_you_mean(name, allowed)}" for name in what if name not in allowed]:
        raise BadInput(wrong)
    return what


def _loaded(folder: Path) -> list[dict[str, Any]]:
    """Results of a job of packings.  Raises BadInput."""
    from ..io.run_folder import read_json

    runs: list[dict[str, Any]] = read_json(folder / f"{LABORATORY}.json")["runs"]
    return runs


def _place(
    sources: list[Path], selection: list[str] | None, out: str | None, form: str, overwrite: bool
) -> tuple[Path, list[str]]:
    """Folder to write to and names of what to draw.  Raises BadInput, all errors."""
    from ..plotting.plots import HISTORY

    problems: list[str] = []
    source, several = sources[0], len(sources) > 1
    without_ledger = [one for one in sources if one.is_file()]
    shown = HISTORY[:1] if (source / ENCOUNTERS).exists() else HISTORY  # of encounters there are only sizes over time
    of_frames = (SPECTRUM,) if several else (STILL,)
    names = selection or list(of_frames if without_ledger else (*shown, *of_frames))
    for one in without_ledger:
        missing = [name for name in names if name in HISTORY]
        problems += [f"--what {name}: {one} has no ledger; give a run's folder" for name in missing]
    beside = source.with_name(f"{source.stem}-{FOLDER}") if source.is_file() else source / FOLDER
    folder = (Path(FOLDER) if several else beside) if out is None else Path(out)
    if not folder.is_dir() and (folder.exists() or (out is not None and not folder.parent.is_dir())):
        problems.append(f"--out {folder} cannot be a folder; give another one")
    existing = [name for name in names if (folder / f"{name}.{form}").exists()]
    if existing and not overwrite:
        problems.append(f"{folder / existing[0]}.{form} exists; give another --out, or --overwrite")
    if problems:
        raise BadInput(problems)
    return folder, names


def _open_source(path: Path, given: Mapping[str, Any]) -> Source:
    """Open a run, a trajectory or a file of grains.  Raises BadInput."""
    from ..io.file_frames import open_frames
    from ..results import Run, Sweep

    if path.is_file():
        return Source(path, open_frames(path, **given), None)
    options.refuse_reading(path, given)
    if _is_many(path):
        return Source(path, None, Sweep(path) if (path / SWEEP_TABLE).exists() else None)
    run = Run(path)
    return Source(path, run.frames, run)


def _first_frame(path: Path, given: Mapping[str, Any]) -> Any:
    """The first frame, for the names of own quantities; None if it cannot be read, which is reported later."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # notes appear when the frames are drawn
        try:
            frames = _open_source(path, given).frames
            return frames[0] if len(frames) else None
        except BadInput:
            return None


def _draw(sources: list[Source], labels: list[str], names: list[str], frame: int, how: dict[str, Any]) -> list[Any]:
    """Figures of a run, all before the first is written.  Raises BadInput."""
    (source,) = sources
    if source.frames is None:
        return _draw_many(source, names)
    from ..analysis.ledger_columns import LedgerColumns
    from ..basics.temperature import kinetic_temperature
    from ..io.ledger_table import read_ledger
    from ..io.run_folder import LEDGER
    from ..plotting.overlay import Overlaid, spectrum_figure
    from ..plotting.plots import HISTORY, grains_figure, history_figure
    from ..plotting.render.still import still_picture

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
        if name == SPECTRUM:
            return spectrum_figure([Overlaid(labels[0], frame=one)], how["dark"])
        return grains_figure(one, name, field, dark=how["dark"])

    return [draw(name) for name in names]


def _draw_several(
    sources: list[Source], labels: list[str], names: list[str], frame: int, how: dict[str, Any]
) -> list[Any]:
    """Figures of several runs.  Raises BadInput."""
    from ..analysis.ledger_columns import LedgerColumns
    from ..io.ledger_table import read_ledger
    from ..io.run_folder import LEDGER
    from ..plotting.overlay import Overlaid, overlaid_grains, overlaid_history, spectrum_figure
    from ..plotting.plots import HISTORY

    runs = [Overlaid(label) for label in labels]
    if any(name in HISTORY for name in names):
        read = [LedgerColumns.from_rows(read_ledger(source.path / LEDGER)) for source in sources]
        runs = [run._replace(ledger=ledger) for run, ledger in zip(runs, read, strict=True)]
    if any(name not in HISTORY for name in names):
        frames = [_frame(source, frame) for source in sources]
        fields = [s.run.flux_density(f.time) if s.run else None for s, f in zip(sources, frames, strict=True)]
        runs = [run._replace(frame=f, field=b) for run, f, b in zip(runs, frames, fields, strict=True)]

    def draw(name: str) -> Any:
        if name in HISTORY:
            return overlaid_history(runs, name, how["dark"])
        return spectrum_figure(runs, how["dark"]) if name == SPECTRUM else overlaid_grains(runs, name, how["dark"])

    return [draw(name) for name in names]


def _draw_many(source: Source, names: list[str]) -> list[Any]:
    """Draw columns of a sweep, or packings."""
    from ..experiments.laboratory_figure import laboratory_figure
    from ..experiments.sweep_cases import units_of
    from ..io.run_folder import CASE, read_toml
    from ..plotting.collisions import growth_figure
    from ..plotting.sweeps import sweep_figure

    sweep, units = source.run, dict[str, str]()
    with contextlib.suppress(BadInput, KeyError):  # a folder without the case of its sweep
        units = {} if sweep is None else units_of(read_toml(source.path / CASE), sweep.done)

    def draw(name: str) -> Any:
        if sweep is None or name == LABORATORY:
            runs = _loaded(source.path) if sweep is None else sweep.loaded
            return laboratory_figure(runs, None if name == LABORATORY else name)
        if name != GROWTH:
            return sweep_figure(sweep.done, sweep.keys, name, units, source.path.resolve().name)
        columns = {name: sweep.done[name].tolist() for name in OF_GROWTH}
        columns["speed"] = sweep.done["impact.speed" if "impact.speed" in sweep.keys else "speed"].tolist()
        rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
        return growth_figure(rows, f"{len(rows)} collisions")

    return [draw(name) for name in names]


def _frame(source: Source, number: int) -> Any:
    """Read a frame.  Raises BadInput if it does not exist."""
    if not len(source.frames):
        raise BadInput(f"{source.path} has no frame yet")
    return source.frames[number]
