"""Viewer data of a simulation without a run folder: its present state as the only frame, and its ledger."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.ledger_columns import LedgerColumns
from ..io.frame import Frame, stored_frame
from .dataset import RunDataset

if TYPE_CHECKING:
    from ..simulation.simulation import Simulation
    from .external_field import FieldDescription


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
    stored: Any = stored_frame(state.steps, state.time, state.grains.copy(), state.box, simulation.contacts)
    ledger = LedgerColumns(simulation.ledger.columns, simulation.ledger.rows)
    frames = Snapshot(Frame(stored))
    dataset = RunDataset(frames, "simulation", "in memory", ledger=lambda: ledger, summary=dict, field=field)
    dataset.notes.append("this simulation has no run folder: only its present state and its ledger are shown")
    return dataset
