"""A simulation that keeps no files, told to a page: its state of now as the only frame, and its ledger."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.ledger_columns import Books
from ..io.frame import Frame, stored_frame
from .dataset import FieldDescription, RunDataset

if TYPE_CHECKING:
    from ..simulation.simulation import Simulation


class Snapshot:
    """One frame, as `io.live_trajectory.Following` has many."""

    incomplete = generation = 0

    def __init__(self, frame: Frame):
        self._frame, self.lock = frame, threading.RLock()
        self.times, self.steps = np.array([frame.time]), np.array([frame.step])
        self.contacts = np.array([len(frame.pair)])

    def refresh(self) -> bool:
        """Nothing comes after it."""
        return False

    def __len__(self) -> int:
        return 1

    def __getitem__(self, index: int) -> Frame:
        return self._frame

    def pairs(self, index: int) -> np.ndarray:
        """Grains in contact (C, 2)."""
        return self._frame.pair


def snapshot_dataset(simulation: Simulation, field: FieldDescription | None) -> RunDataset:
    """The state of a simulation and what happened until then; later steps are not in it."""
    state = simulation.state
    stored: Any = stored_frame(state.steps, state.time, state.grains, state.box, simulation.contacts)
    books = Books(simulation.ledger.columns, simulation.ledger.rows)
    now = Snapshot(Frame(stored))
    story = RunDataset(now, "simulation", "in memory", books=lambda: books, summary=dict, field=field)
    story.notes.append("this simulation keeps no files: its state of now, and what its ledger holds")
    return story
