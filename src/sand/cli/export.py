"""`sand export DIR --to FORMAT`: exports frames to other programs."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import BadInput
from . import options, report

SUFFIXES = {"xyz": ".xyz", "lammps-dump": ".dump", "lammps-data": "-*.data", "vtk": ".pvd"}
"""Pattern of the end of the file names, by format."""


@click.command("export", short_help="Export the frames of a run to other programs.")
@click.argument("folder", metavar="DIR", type=options.PATH)
@click.option("--to", "form", required=True, type=click.Choice(list(SUFFIXES)), help="Format of the files.")
@click.option("--out", metavar="PATH", type=options.PATH, help="Path without suffix (default: 'trajectory' in DIR).")
@click.option("--frames", metavar="SLICE", default=":", help="Frames, as in Python: '-1', '10:', '::5'.")
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@options.output
def command(folder: str, form: str, out: str | None, frames: str, overwrite: bool, as_json: bool) -> None:
    """Export the frames of the run in DIR to other programs.

    vtk: a .vtp for each frame and a .pvd with their times, for ParaView; xyz: extended XYZ in ångström, for OVITO and
    ASE; lammps-dump and lammps-data: `units si`.
    """
    from ..io.run_folder import TRAJECTORY
    from ..results import Run

    run = Run(folder)
    stem = Path(out) if out else Path(folder) / Path(TRAJECTORY).stem
    existing = sorted(stem.parent.glob(stem.name + SUFFIXES[form]))
    if existing and not overwrite:
        raise BadInput(f"{existing[0]} exists; give another --out, or --overwrite")
    report.reading(folder)
    written = run.export(form, stem, chosen(frames))
    more = f" and {len(written) - 1} more" if len(written) > 1 else ""
    content = {"files": [str(path) for path in written]}
    report.answer(content, f"export {folder}", [("files", f"{written[0]}{more}")], as_json=as_json)


def chosen(text: str) -> slice:
    """Read '-1', '3', '10:' or '::5' as a slice.  Raises BadInput."""
    parts = text.split(":")
    try:
        numbers = [int(part) if part.strip() else None for part in parts]
        if len(numbers) == 1 and numbers[0] is not None:
            first = numbers[0]
            return slice(first, first + 1 if first != -1 else None)
        if not 2 <= len(numbers) <= 3:
            raise ValueError
        return slice(*numbers)
    except ValueError:
        raise BadInput(f"--frames {text!r} must be a frame or a slice such as '-1', '10:', '0:100:5'") from None
