"""A run told to those who look at it: its magnetic field, and what `view()` shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import BadInput
from ..forces.external.magnetic_field import Field
from ..io.run_folder import CASE, TRAJECTORY, read_toml
from ..numerics.vec import norm
from ..units import format_quantity

if TYPE_CHECKING:
    from ..simulation.simulation import Simulation

FieldDescription = tuple[str, Callable[[float], Sequence[float]]]


def describe_field(forces: Iterable[Any]) -> FieldDescription | None:
    """Magnetic fields among forces in words, and their flux density together [T] at a time [s]; None without one."""
    fields = [f for f in forces if hasattr(f, "flux_density_at") and f.flux_density_size() > 0.0]
    if not fields:
        return None
    text = " + ".join(_said(f) if isinstance(f, Field) else f.name for f in fields)
    return text, lambda time: np.sum([f.flux_density_at(time) for f in fields], axis=0)


def read_field(folder: Path) -> FieldDescription | None:
    """The same of the case in a run's folder; None, too, where there is no case, or one that cannot be read."""
    try:
        given = read_toml(folder / CASE).get("forces", {}).get("field")
        return None if given is None else describe_field([Field(**given)])
    except (BadInput, TypeError, AttributeError):
        return None


def _said(field: Field) -> str:
    constant = format_quantity(norm(field.flux_density), "T")
    if field.shape == "constant":
        return f"{constant}, constant"
    if field.shape == "ramp":
        return (
            f"from {constant} at {format_quantity(field.start, 's')} to {format_quantity(norm(field.final), 'T')} at "
            + format_quantity(field.end, "s")
        )
    swing = f"{format_quantity(norm(field.amplitude), 'T')}, {field.shape} at {format_quantity(field.frequency, 'Hz')}"
    return f"{constant}, constant, and {swing}" if norm(field.flux_density) > 0.0 else swing


def view_simulation(simulation: Simulation, path: str | Path | None) -> Any:
    """What `Simulation.view` gives: of the frames in its folder, or of its state of now where there are none."""
    from .dataset import run_dataset
    from .show import show_dataset
    from .snapshot import snapshot_dataset

    record, field = simulation.record, describe_field(simulation.forces)
    folder = None if record is None else record.folder
    if record is not None and (record.folder / TRAJECTORY).exists():
        record.flush()
        story = run_dataset(record.folder, field)
    else:
        story = snapshot_dataset(simulation, field)
    return show_dataset(story, path, folder, simulation.figure)


def view_folder(folder: Path, path: str | Path | None, instead: Callable[[], Any]) -> Any:
    """What `sand.open(DIR).view` gives; `instead` where the installation lacks the page."""
    from .dataset import run_dataset
    from .show import show_dataset

    return show_dataset(run_dataset(folder, read_field(folder)), path, folder, instead)
