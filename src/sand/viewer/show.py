"""The `view()` methods of simulations and opened runs: a widget in a notebook, otherwise a page, written and opened."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.ledger_columns import LedgerColumns
from ..basics.errors import BadInput
from ..basics.paths import user_path
from ..io.frame import Frame
from ..io.frame_chunks import stored_frame
from ..io.page_bundle import read_bundle
from ..io.run_folder import TRAJECTORY, VIEW
from ..plotting.run_figure import in_notebook
from .browser import open_page
from .dataset import RunDataset, run_dataset
from .external_field import FieldDescription, describe_field, read_field
from .html import frame_stride, write_page
from .notebook import has_widgets, widget

if TYPE_CHECKING:
    from ..simulation.simulation import Simulation

MAX_BYTES = 150e6
"""Size of frames in a page [bytes] above which `view()` leaves out frames."""


def show_dataset(dataset: RunDataset, path: str | Path | None, folder: Path | None, fallback: Callable[[], Any]) -> Any:
    """Show a dataset in a notebook or browser.

    Parameters
    ----------
    dataset : RunDataset
        Data of a run.
    path : str or Path or None
        Path of the page. None shows a widget in notebooks that have anywidget; elsewhere it means view.html in
        `folder`.
    folder : Path or None
        Run folder; None means a new temporary folder.
    fallback : callable
        Shows the figure of the run, if the viewer page is not installed.

    Returns
    -------
    GrainWidget or Path or Figure
        The widget, the path of the page, or the result of `fallback`.

    Raises
    ------
    BadInput, FilesFailed
        If the page cannot be written.
    """
    try:
        read_bundle()
    except BadInput as error:
        warnings.warn(f"{error}; showing the figure instead", stacklevel=4)
        return fallback()
    if path is None and in_notebook() and has_widgets():
        return widget(dataset)
    if path is None:
        path = (folder or Path(tempfile.mkdtemp(prefix="sand-"))) / VIEW
    page = user_path(path)
    if not page.parent.is_dir():
        raise BadInput(f"there is no folder {page.parent}; create it first")
    dataset.compact = True
    if (stride := frame_stride(dataset, MAX_BYTES)) > 1:
        dataset.select(slice(None, None, stride), f"one frame of {stride}, to limit the size of the page")
    write_page(dataset, page)
    if not open_page(page.resolve().as_uri()):
        warnings.warn(f"wrote {page}, but no browser could be opened; open the file in a browser", stacklevel=4)
    return page


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


class Snapshot:
    """A single frame with the interface of `io.live_trajectory.LiveTrajectory`."""

    incomplete = generation = 0

    def __init__(self, frame: Frame):
        self._frame = frame
        self.times, self.steps = np.array([frame.time]), np.array([frame.step])
        self.contacts = np.array([len(frame.pair)])

    def refresh(self) -> bool:
        """Return False: there are no new frames."""
        return False

    def __len__(self) -> int:
        return 1

    def __getitem__(self, index: int) -> Frame:
        return self._frame

    def pairs(self, index: int) -> np.ndarray:
        """Grains in contact (C, 2)."""
        return self._frame.pair


def snapshot_dataset(simulation: Simulation, field: FieldDescription | None) -> RunDataset:
    """Present state of a simulation and its ledger so far; later steps do not change the dataset."""
    state = simulation.state
    grains, contacts = state.grains.copy(), simulation.contacts
    stored: Any = stored_frame(state.steps, state.time, grains, state.box, contacts, at_rest=state.at_rest)
    ledger = LedgerColumns(simulation.ledger.columns, simulation.ledger.rows)
    frames = Snapshot(Frame(stored))
    dataset = RunDataset(frames, "simulation", "in memory", ledger=lambda: ledger, summary=dict, field=field)
    dataset.notes.append("this simulation has no run folder: only its present state and its ledger are shown")
    return dataset
