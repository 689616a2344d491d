"""The trajectory of a run that may still be going; new frames are found on request."""

from __future__ import annotations

import contextlib
import threading
import time
from pathlib import Path

import numpy as np

from ..errors import BadInput
from .frame import Frame, FrameSequence
from .trajectory import Frames

INCOMPLETE_AT_MOST = 64
"""Incomplete frames at the end of a file above which the file counts as broken."""


class LiveTrajectory(FrameSequence):
    """Frames of a growing trajectory; can be read from several threads.

    Parameters
    ----------
    path : str or Path
        The trajectory.

    Attributes
    ----------
    times : ndarray
        Time of each frame [s], (K,).
    steps, contacts : ndarray
        Step and number of contacts of each frame, (K,).
    incomplete : int
        Number of incomplete frames at the end, which are left out.
    generation : int
        Counts how often the file was replaced by another trajectory.

    Raises
    ------
    BadInput
        If the file is missing, foreign or broken, or has no frame.
    """

    def __init__(self, path: str | Path):
        self.path, self.lock = Path(path), threading.RLock()
        self.times, self.steps, self.contacts = np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.int64)
        self.incomplete = self.generation = 0
        self._seen = self._stamp()
        self._frames = self._open()
        self._read_new()
        if not len(self):
            self.close()
            state = "no complete frame" if self.incomplete else "no frame yet"
            raise BadInput(f"{path} holds {state}: try again when the run has written one, or start it again")

    def _open(self) -> Frames:
        frames = Frames(self.path)
        if len(frames) and not frames.written_by_sand:
            frames.close()
            raise BadInput(f"{self.path} was not written by SAND and does not state its unit of length")
        return frames

    def _stamp(self) -> tuple[int, int, int]:
        """File identity, size and modification time."""
        try:
            found = self.path.stat()
        except OSError:
            return (0, 0, 0)
        return found.st_ino, found.st_size, found.st_mtime_ns

    def refresh(self) -> bool:
        """Find new frames; costs nothing if the file is unchanged.

        A file that cannot be read because it is being written, or that was replaced and has no frame yet, is tried
        again at the next call.

        Returns
        -------
        bool
            Whether there are new or different frames.
        """
        with self.lock:
            stamp = self._stamp()
            if stamp == self._seen:
                return False
            try:
                frames = self._open()
            except BadInput:
                return False
            old, before = self._frames, (len(self), self.generation)
            known = self.times, self.steps, self.contacts, self.incomplete
            self._frames = frames
            last = self._head(len(self) - 1)
            if last is None or last[:2] != (self.times[-1], self.steps[-1]):
                self.generation += 1
                self.times, self.steps, self.contacts = self.times[:0], self.steps[:0], self.contacts[:0]
            self._read_new()
            if not len(self):  # replaced by a file without a frame: keep the old frames until it has one
                self._frames, self.generation = old, before[1]
                self.times, self.steps, self.contacts, self.incomplete = known
                frames.close()
                return False
            self._seen = stamp
            with contextlib.suppress(OSError, RuntimeError):
                old.close()
            return before != (len(self), self.generation)

    @property
    def age(self) -> float:
        """Time since the file was last written to [s]; 0 if it no longer exists."""
        try:
            return max(time.time() - self.path.stat().st_mtime, 0.0)
        except OSError:
            return 0.0

    def _head(self, number: int) -> tuple[float, int, int] | None:
        """Time, step and number of contacts of a frame; None if it is missing or incomplete."""
        try:
            return self._frames.head(number)
        except BadInput:
            return None

    def _read_new(self) -> None:
        """Read times and steps of new frames, up to the last complete one."""
        count = len(self._frames)
        complete = count
        while complete > len(self) and count - complete < INCOMPLETE_AT_MOST and not self._is_complete(complete - 1):
            complete -= 1
        new = []
        for number in range(len(self), complete):
            if (head := self._head(number)) is None:
                break
            new.append(head)
        if new:
            times, steps, contacts = zip(*new, strict=True)
            self.times = np.concatenate([self.times, times])
            self.steps = np.concatenate([self.steps, steps]).astype(np.int64)
            self.contacts = np.concatenate([self.contacts, contacts]).astype(np.int64)
        self.incomplete = count - len(self)

    def _is_complete(self, number: int) -> bool:
        try:
            return len(self._frames[number]) > 0
        except BadInput:
            return False

    def __len__(self) -> int:
        return len(self.times)

    def _frame(self, number: int) -> Frame:
        with self.lock:
            return self._frames[number]

    def pairs(self, index: int) -> np.ndarray:
        """Grain indices (C, 2) of the contacts in a frame ≥ 0.  Raises BadInput if the frame is incomplete."""
        with self.lock:
            return self._frames.pairs(index)

    def close(self) -> None:
        """Close the file."""
        with self.lock:
            self._frames.close()
