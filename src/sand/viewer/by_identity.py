"""Frames of a run whose grains change, as the viewer page needs them: every frame has a row for every grain."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from ..basics.errors import BadInput
from ..basics.own_quantities import OwnQuantities

CONSTANT = ("radius", "mass")
"""Quantities of a grain that the page takes as constant."""
MOVING = ("velocity", "spin", "moment", "charge")
"""Quantities that are 0 for absent grains."""


class ByIdentity:
    """Frames with the interface of `LiveTrajectory`, in which row k is the grain with the k-th identity of the run.

    A frame of which a grain is absent has the position NaN for it, which the page does not draw, and no velocity. As
    long as the grains are the same in all frames, frames are those of the trajectory.

    Parameters
    ----------
    frames : LiveTrajectory
        The frames of the run.

    Attributes
    ----------
    identity : ndarray
        Identities (N,) of all grains of the run, ascending.
    """

    def __init__(self, frames: Any):
        self._frames, self._grown = frames, 0
        self._start()

    def __getattr__(self, name: str) -> Any:
        """Times, steps, numbers of contacts and others of the trajectory."""
        return getattr(self._frames, name)

    def _start(self) -> None:
        self.identity = np.zeros(0, np.uint32)
        self.materials: list[str] = []
        self._seen, self._inner = 0, self._frames.generation
        self._constant: dict[str, np.ndarray] = {name: np.zeros(0) for name in (*CONSTANT, "material")}
        self._look()

    @property
    def generation(self) -> int:
        """Counts how often the trajectory was replaced, or new grains were added."""
        return int(self._frames.generation + self._grown)

    def refresh(self) -> bool:
        """Find new frames, and new grains in them; returns whether there are any."""
        is_new = bool(self._frames.refresh())
        if self._frames.generation != self._inner:
            self._start()
        elif is_new:
            before = len(self.identity)
            self._look()
            self._grown += len(self.identity) > before
        return is_new

    def _look(self) -> None:
        """Find the grains of the frames that were not looked at yet."""
        for number in range(self._seen, len(self._frames)):
            self._seen = number + 1
            try:
                own = self._frames.identities(number)
                if np.isin(own, self.identity, assume_unique=True).all():
                    continue
                self._take(self._frames[number])
            except BadInput:
                continue

    def _take(self, frame: Any) -> None:
        """Take over the constant quantities of grains that no earlier frame has."""
        new = ~np.isin(frame.id, self.identity, assume_unique=True)
        self.materials += [name for name in frame.materials if name not in self.materials]
        values = {name: np.asarray(getattr(frame, name)) for name in CONSTANT}
        values["material"] = np.array([self.materials.index(name) for name in frame.materials])[frame.material]
        identity = np.concatenate([self.identity, frame.id[new]])
        order = np.argsort(identity)
        self.identity = identity[order]
        for name, column in values.items():
            self._constant[name] = np.concatenate([self._constant[name], column[new]])[order]

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, number: int) -> Any:
        frame = self._frames[number]
        if np.array_equal(frame.id, self.identity) and list(frame.materials) == self.materials:
            return frame
        rows, count, whole = np.searchsorted(self.identity, frame.id), len(self.identity), copy.copy(frame)
        columns = {name: array.copy() for name, array in self._constant.items()}
        columns["material"] = columns["material"].astype(np.uint32)
        for name, absent in {"position": np.nan, **dict.fromkeys((*MOVING, "orientation"), 0.0)}.items():
            stored = np.asarray(getattr(frame, name))
            columns[name] = np.full((count, *stored.shape[1:]), absent, stored.dtype)
            columns[name][rows] = stored
        own = {name: np.full(count, np.nan) for name in frame.own}
        for name, values in own.items():
            values[rows] = frame.own[name]
        whole.own = OwnQuantities(own, frame.own.units)
        if frame.at_rest is not None:
            columns["at_rest"] = np.ones(count, bool)
            columns["at_rest"][rows] = frame.at_rest
        if frame.stored_virial is not None:
            columns["stored_virial"] = np.full((count, 9), np.nan)
            columns["stored_virial"][rows] = frame.stored_virial
        columns |= {"id": self.identity, "pair": rows[frame.pair]}
        for name, column in columns.items():
            setattr(whole, name, column)
        whole.materials = self.materials
        return whole

    def pairs(self, index: int) -> np.ndarray:
        """Rows (C, 2) of the grains in contact in a frame ≥ 0.  Raises BadInput if the frame is incomplete."""
        pair = self._frames.pairs(index)
        own = self._frames.identities(index)
        return pair if np.array_equal(own, self.identity) else np.searchsorted(self.identity, own)[pair]
