"""`sand export DIR --to FORMAT`: exports frames to other programs."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from ..basics.errors import BadInput, warn
from . import options, parsing, report

SUFFIXES = {
    "xyz": ".xyz",
    "lammps-dump": ".dump",
    "lammps-data": "-*.data",
    "vtk": ".pvd",
    "adda": "-*.geom",
    "ddscat": "-*.dat",
    "mstm": "-*.pos",
}
"""Pattern of the end of the file names, by format."""
USE = {
    "adda": "adda -shape read FILE -eq_rad A -lambda L -m N K: A, a_eff in um, is in the first line; L in um",
    "ddscat": "CSHAPE = FROM_FILE, the file as shape.dat; a_eff in um for ddscat.par is in its first line",
    "mstm": "sphere_data_input_file FILE, number_spheres its lines, length_scale_factor 2 pi/(wavelength in um)",
}
"""How other programs read files for optics."""


def _check(values: parsing.OptionValues) -> Iterable[str]:
    """Options that the format does not use, and values that cannot be read."""
    from ..basics.units import si

    form = values["form"]
    if values["spacing"] is not None and form in SUFFIXES:
        if form not in ("adda", "ddscat"):
            yield "--spacing is for --to adda and ddscat; leave it out"
        try:
            si(values["spacing"], "m", "--spacing", above=0.0)
        except BadInput as error:
            yield from error.problems
    for text in values["index"] or ():
        if form in SUFFIXES and form != "mstm":
            yield "--index is for --to mstm; leave it out"
        if _index(text) is None:
            yield f"--index {text!r} must be a material and its refractive index, such as 'ice=1.31+0.01i'"


def _index(text: str) -> tuple[str, complex] | None:
    """A material and its refractive index n + ik; None if the text is something else."""
    name, equals, number = text.rpartition("=")
    try:
        index = complex(number.replace("i", "j").replace(" ", ""))
    except ValueError:
        return None
    return (name.strip(), index) if equals and name.strip() and math.isfinite(abs(index)) and index.real > 0.0 else None


@parsing.command("export", short_help="Export the frames of a run to other programs.", check=_check)
@click.argument("folder", metavar="DIR", type=options.RUN)
@click.option("--to", "form", required=True, type=click.Choice(list(SUFFIXES)), help="Format of the files.")
@click.option("--out", metavar="PATH", type=options.FILE, help="Path without suffix (default: 'trajectory' in DIR).")
@options.frames
@click.option("--spacing", metavar="D", help="Spacing of dipoles, adda and ddscat (default: 1/10 of a diameter).")
@click.option("--index", metavar="M=N+Ki", multiple=True, help="Refractive index of a material, for mstm.")
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@options.reading
@options.output
def command(
    folder: str,
    form: str,
    out: str | None,
    frames: slice,
    spacing: str | None,
    index: tuple[str, ...],
    overwrite: bool,
    **how: Any,
) -> None:
    """Export the frames of the run in DIR to other programs.

    DIR may also be a trajectory, or a file of grains: XYZ, columns, LAMMPS data and dump, GSD.

    vtk: a .vtp for each frame and a .pvd with their times, for ParaView; xyz: extended XYZ in ångström, for OVITO and
    ASE; lammps-dump and lammps-data: `units si`. For optics, the largest cluster of each frame: adda, shape file;
    ddscat, shape.dat of FROM_FILE; mstm, x y z radius in um.
    """
    from ..analysis.clusters import cluster_labels
    from ..basics.units import si
    from ..io.export import export_frames, stale_files
    from ..io.file_frames import open_frames
    from ..io.optics import Optics
    from ..io.run_folder import TRAJECTORY
    from ..results import Run

    source, given = Path(folder), {name: how.pop(name) for name in options.READING}
    if source.is_file():
        opened: Any = open_frames(source, **given)
        stem = Path(out) if out else source.with_name(f"{source.stem}-frames")
    else:
        options.refuse_reading(folder, given)
        opened = Run(folder).frames
        stem = Path(out) if out else source / Path(TRAJECTORY).stem
    existing = sorted(stem.parent.glob(stem.name + SUFFIXES[form]))
    if existing and not overwrite:
        raise BadInput(f"{existing[0]} exists; give another --out, or --overwrite")
    if any(source.is_file() and one.samefile(source) for one in existing):
        raise BadInput(f"--out {stem}: this is the file that is exported; give another name")
    if not how["quiet"]:
        report.reading(folder)
    optics = Optics(
        None if spacing is None else si(spacing, "m", "--spacing"), dict(filter(None, (_index(text) for text in index)))
    )
    written = export_frames(opened, stem, form, cluster_labels, frames, optics)
    if left := stale_files(stem, form, written):
        warn(
            f"{len(left)} files of an earlier export stay: {left[0]}{' …' * (len(left) > 1)}; they are not listed below"
        )
    more = f" and {len(written) - 1} more" if len(written) > 1 else ""
    content = {"files": [str(path) for path in written]}
    use = [("use", USE[form])] if form in USE else []
    report.answer(content, f"export {folder}", [("files", f"{written[0]}{more}"), *use], **how)
