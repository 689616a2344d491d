"""`sand export DIR --to FORMAT`: exports frames to other programs."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import BadInput, warn
from . import options, parsing, report

SUFFIXES = {"xyz": ".xyz", "lammps-dump": ".dump", "lammps-data": "-*.data", "vtk": ".pvd"}
"""Pattern of the end of the file names, by format."""


@parsing.command("export", short_help="Export the frames of a run to other programs.")
@click.argument("folder", metavar="DIR", type=options.RUN)
@click.option("--to", "form", required=True, type=click.Choice(list(SUFFIXES)), help="Format of the files.")
@click.option("--out", metavar="PATH", type=options.FILE, help="Path without suffix (default: 'trajectory' in DIR).")
@options.frames
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@options.output
def command(folder: str, form: str, out: str | None, frames: slice, overwrite: bool, **output: bool) -> None:
    """Export the frames of the run in DIR to other programs.

    vtk: a .vtp for each frame and a .pvd with their times, for ParaView; xyz: extended XYZ in ångström, for OVITO and
    ASE; lammps-dump and lammps-data: `units si`.
    """
    from ..io.export import stale_files
    from ..io.run_folder import TRAJECTORY
    from ..results import Run

    run = Run(folder)
    stem = Path(out) if out else Path(folder) / Path(TRAJECTORY).stem
    existing = sorted(stem.parent.glob(stem.name + SUFFIXES[form]))
    if existing and not overwrite:
        raise BadInput(f"{existing[0]} exists; give another --out, or --overwrite")
    if not output["quiet"]:
        report.reading(folder)
    written = run.export(form, stem, frames)
    if left := stale_files(stem, form, written):
        warn(
            f"{len(left)} files of an earlier export stay: {left[0]}{' …' * (len(left) > 1)}; they are not listed below"
        )
    more = f" and {len(written) - 1} more" if len(written) > 1 else ""
    content = {"files": [str(path) for path in written]}
    report.answer(content, f"export {folder}", [("files", f"{written[0]}{more}")], **output)
