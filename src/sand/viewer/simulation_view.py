"""The `view()` methods of simulations and opened runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..io.run_folder import TRAJECTORY
from .dataset import run_dataset
from .external_field import describe_field, read_field
from .show import show_dataset
from .snapshot import snapshot_dataset

if TYPE_CHECKING:
    from ..simulation.simulation import Simulation


def view_simulation(simulation: Simulation, path: str | Path | None) -> Any:
    """Show the frames of a simulation with a run folder, or the present state of one without (`Simulation.view`)."""
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
    return show_dataset(run_dataset(folder, read_field(folder)), path, folder, fallback)
