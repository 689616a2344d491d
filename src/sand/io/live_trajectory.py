"""The trajectory of a run that may still be going; new frames are found on request."""

from __future__ import annotations

import contextlib
import threading
import time
from pathlib import Path

import numpy as np

from ..basics.errors import BadInput
from ..basics.paths import user_path
from .frame import Frame, FrameSequence
from .trajectory import Frames

INCOMPLETE_AT_MOST = 64
"""Incomplete frames at the end of a file above which the file counts as broken."""
Head = tuple[float, int, int]  # time [s], step and number of contacts of a frame


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
        self.path, self.lock, self.generation = user_path(path), threading.RLock(), 0
        self._seen = self._stamp()
        frames = self._open()
        self._use(frames, _heads(frames, []))
        if not len(self):
            self.close()
            state = "no complete frame" if self.incomplete else "no frame yet"
            raise BadInput(f"{path} holds {state}: try again when the run has written one, or start it again")

    def _use(self, frames: Frames, heads: list[Head]) -> None:
        """Take over an open trajectory, of which the frames with these heads are complete."""
        self._frames, self._heads, self.incomplete = frames, heads, len(frames) - len(heads)
        self.times = np.array([time for time, _, _ in heads])
        self.steps = np.array([step for _, step, _ in heads], np.int64)
        self.contacts = np.array([contacts for _, _, contacts in heads], np.int64)

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
            is_same = _starts_with(frames, self._heads)
            heads = _heads(frames, self._heads if is_same else [])
            if not heads:  # replaced by a file without a frame: keep the old frames until it has one
                frames.close()
                return False
            is_new = not is_same or len(heads) > len(self)
            self.close()
            self._use(frames, heads)
            self.generation += not is_same
            self._seen = stamp
            return is_new

    @property
    def age(self) -> float:
        """Time since the file was last written to [s]; 0 if it no longer exists."""
        try:
            return max(time.time() - self.path.stat().st_mtime, 0.0)
        except OSError:
            return 0.0

    def __len__(self) -> int:
        return len(self._heads)

    def _frame(self, number: int) -> Frame:
        with self.lock:
            return self._frames[number]

    def pairs(self, index: int) -> np.ndarray:
        """Grain indices (C, 2) of the contacts in a frame ≥ 0.  Raises BadInput if the frame is incomplete."""
        with self.lock:
            return self._frames.pairs(index)

    def identities(self, index: int) -> np.ndarray:
        """Identities (N,) of the grains of a frame ≥ 0.  Raises BadInput if the frame is incomplete."""
        with self.lock:
            return self._frames.identities(index)

    def close(self) -> None:
        """Close the file."""
        with self.lock, contextlib.suppress(OSError, RuntimeError):
            self._frames.close()


def _starts_with(frames: Frames, heads: list[Head]) -> bool:
    """Whether a trajectory holds the last of these frames at its place."""
    try:
        return frames.head(len(heads) - 1)[:2] == heads[-1][:2]
    except BadInput:
        return False


def _heads(frames: Frames, known: list[Head]) -> list[Head]:
    """Heads of the frames up to the last complete one; those of the first ones are `known`."""
    complete, heads = len(frames), list(known)
    while len(known) < complete > len(frames) - INCOMPLETE_AT_MOST and not _is_complete(frames, complete - 1):
        complete -= 1
    with contextlib.suppress(BadInput):
        for number in range(len(known), complete):
            heads.append(frames.head(number))
    return heads


def _is_complete(frames: Frames, number: int) -> bool:
    try:
        return len(frames[number]) > 0
    except BadInput:
        return False
