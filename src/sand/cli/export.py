"""`sand export DIR --to FORMAT`: exports frames to other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..basics.errors import BadInput, warn
from . import options, parsing, report

SUFFIXES = {"xyz": ".xyz", "lammps-dump": ".dump", "lammps-data": "-*.data", "vtk": ".pvd"}
"""Pattern of the end of the file names, by format."""


@parsing.command("export", short_help="Export the frames of a run to other programs.")
@click.argument("folder", metavar="DIR", type=options.RUN)
@click.option("--to", "form", required=True, type=click.Choice(list(SUFFIXES)), help="Format of the files.")
@click.option("--out", metavar="PATH", type=options.FILE, help="Path without suffix (default: 'trajectory' in DIR).")
@options.frames
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@options.reading
@options.output
def command(folder: str, form: str, out: str | None, frames: slice, overwrite: bool, **how: Any) -> None:
    """Export the frames of the run in DIR to other programs.

    DIR may also be a trajectory, or a file of grains: XYZ, columns, LAMMPS data and dump, GSD.

    vtk: a .vtp for each frame and a .pvd with their times, for ParaView; xyz: extended XYZ in ångström, for OVITO and
    ASE; lammps-dump and lammps-data: `units si`.
    """
    from ..analysis.clusters import cluster_labels
    from ..io.export import export_frames, stale_files
    from ..io.file_frames import open_frames
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
    written = export_frames(opened, stem, form, cluster_labels, frames)
    if left := stale_files(stem, form, written):
        warn(
            f"{len(left)} files of an earlier export stay: {left[0]}{' …' * (len(left) > 1)}; they are not listed below"
        )
    more = f" and {len(written) - 1} more" if len(written) > 1 else ""
    content = {"files": [str(path) for path in written]}
    report.answer(content, f"export {folder}", [("files", f"{written[0]}{more}")], **how)
