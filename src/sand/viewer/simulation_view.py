"""Description of the external magnetic field of a run, and the `view()` methods of simulations and opened runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import BadInput
from ..forces.external.magnetic_field import Field
from ..io.run_folder import CASE, TRAJECTORY, read_toml
from ..numerics.vec import norm
from ..units import format_quantity

if TYPE_CHECKING:
    from ..simulation.simulation import Simulation


class FieldDescription(NamedTuple):
    """External magnetic field: text for display, and the flux density [T] as a function of time [s]."""

    text: str
    flux_density: Callable[[float], Sequence[float]]


def describe_field(forces: Iterable[Any]) -> FieldDescription | None:
    """Describe the sum of the external magnetic fields among `forces`.

    Returns
    -------
    FieldDescription or None
        None if there is no field, or all fields are zero.
    """
    fields = [f for f in forces if hasattr(f, "flux_density_at") and f.flux_density_size() > 0.0]
    if not fields:
        return None
    text = " + ".join(_field_text(f) if isinstance(f, Field) else f.name for f in fields)
    return FieldDescription(text, lambda time: np.sum([f.flux_density_at(time) for f in fields], axis=0))


def read_field(folder: Path) -> FieldDescription | None:
    """Describe the external magnetic field in the case file of a run folder.

    Returns
    -------
    FieldDescription or None
        None if the case has no field, or the case file is missing or invalid.
    """
    try:
        settings = read_toml(folder / CASE).get("forces", {}).get("field")
        return None if settings is None else describe_field([Field(**settings)])
    except (BadInput, TypeError, AttributeError):
        return None


def _field_text(field: Field) -> str:
    constant = format_quantity(norm(field.flux_density), "T")
    if field.shape == "constant":
        return f"{constant}, constant"
    if field.shape == "ramp":
        return (
            f"from {constant} at {format_quantity(field.start, 's')} to {format_quantity(norm(field.final), 'T')} at "
            + format_quantity(field.end, "s")
        )
    amplitude = format_quantity(norm(field.amplitude), "T")
    varying = f"{amplitude}, {field.shape} at {format_quantity(field.frequency, 'Hz')}"
    return f"{constant}, constant, and {varying}" if norm(field.flux_density) > 0.0 else varying


def view_simulation(simulation: Simulation, path: str | Path | None) -> Any:
    """Show the frames of a simulation with a run folder, or the present state of one without (`Simulation.view`)."""
    from .dataset import run_dataset
    from .show import show_dataset
    from .snapshot import snapshot_dataset

    record, field = simulation.writer, describe_field(simulation.forces)
    folder = None if record is None else record.folder
    if record is not None and (record.folder / TRAJECTORY).exists():
        record.flush()
        dataset = run_dataset(record.folder, field)
    else:
        dataset = snapshot_dataset(simulation, field)
    return show_dataset(dataset, path, folder, simulation.figure)


def view_folder(folder: Path, path: str | Path | None, fallback: Callable[[], Any]) -> Any:
    """Show the run in a folder (`sand.open(DIR).view`); `fallback()` if the viewer page is not installed."""
    from .dataset import run_dataset
    from .show import show_dataset

    return show_dataset(run_dataset(folder, read_field(folder)), path, folder, fallback)
