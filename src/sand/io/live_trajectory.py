"""The frames of a run that may still be going: what has come since is found when asked for."""

from __future__ import annotations

import contextlib
import threading
import time
from pathlib import Path

import numpy as np

from ..errors import BadInput
from .frame import Frame, FrameSequence
from .trajectory import Frames

TORN_AT_MOST = 64
"""Frames at the end of a file that are looked at before it is said to be broken."""


class LiveTrajectory(FrameSequence):
    """Frames of a trajectory that grows; safe to be read from several threads.

    Parameters
    ----------
    path : str or Path
        of the file.

    Raises
    ------
    BadInput
        a missing, foreign or broken file, or one without a frame.

    `times` (K,) [s], `steps` (K,) and `contacts` (K,), numbers, of all frames are kept; `torn` counts frames at the end
    that are not whole, and are not among them; `generation` goes up when the file has become another one.
    """

    def __init__(self, path: str | Path):
        self.path, self.lock = Path(path), threading.RLock()
        self.times, self.steps, self.contacts = np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.int64)
        self.torn = self.generation = 0
        self._seen = self._stamp()
        self._frames = self._opened()
        self._read_on()
        if not len(self):
            self.close()
            torn = "no whole frame" if self.torn else "no frame yet"
            raise BadInput(f"{path} holds {torn}: look again when the run has written one, or start it again")

    def _opened(self) -> Frames:
        frames = Frames(self.path)
        if len(frames) and not frames.is_ours:
            frames.close()
            raise BadInput(
                f"{self.path} was not written by SAND: it does not say how long its unit is; give one that was"
            )
        return frames

    def _stamp(self) -> tuple[int, int, int]:
        """Changes when the file does."""
        try:
            found = self.path.stat()
        except OSError:
            return (0, 0, 0)
        return found.st_ino, found.st_size, found.st_mtime_ns

    def refresh(self) -> bool:
        """Look for new frames, at no cost if the file is as it was; True if there are any, or others.

        A file that is just being written to, and cannot be read, is left for the next time; so is one that has been
        begun anew and has no frame yet.
        """
        with self.lock:
            stamp = self._stamp()
            if stamp == self._seen:
                return False
            try:
                frames = self._opened()
            except BadInput:
                return False
            old, before = self._frames, (len(self), self.generation)
            known = self.times, self.steps, self.contacts, self.torn
            self._frames = frames
            if len(self) and not self._goes_on(len(self) - 1):
                self.generation += 1
                self.times, self.steps, self.contacts = self.times[:0], self.steps[:0], self.contacts[:0]
            self._read_on()
            if before[0] and not len(self):  # begun anew, without a frame so far: the old ones stay until there is one
                self._frames, self.generation = old, before[1]
                self.times, self.steps, self.contacts, self.torn = known
                frames.close()
                return False
            self._seen = stamp
            with contextlib.suppress(OSError, RuntimeError):
                old.close()
            return before != (len(self), self.generation)

    @property
    def age(self) -> float:
        """Seconds since the file was last written to; 0 if it has gone."""
        try:
            return max(time.time() - self.path.stat().st_mtime, 0.0)
        except OSError:
            return 0.0

    def _goes_on(self, last: int) -> bool:
        """True if the last frame known is still the one that the file has in its place."""
        head = self._head(last) if last < len(self._frames) else None
        return head is not None and head[:2] == (self.times[last], self.steps[last])

    def _head(self, number: int) -> tuple[float, int, int] | None:
        """Time, step and number of contacts of a frame; None if it is not whole."""
        try:
            return self._frames.head(number)
        except BadInput:
            return None

    def _read_on(self) -> None:
        """Times and steps of new frames, up to the last whole one."""
        count = len(self._frames)
        whole = count
        while whole > len(self) and count - whole < TORN_AT_MOST and not self._is_whole(whole - 1):
            whole -= 1
        new = []
        for number in range(len(self), whole):
            if (head := self._head(number)) is None:
                break
            new.append(head)
        if new:
            times, steps, contacts = zip(*new, strict=True)
            self.times = np.concatenate([self.times, times])
            self.steps = np.concatenate([self.steps, steps]).astype(np.int64)
            self.contacts = np.concatenate([self.contacts, contacts]).astype(np.int64)
        self.torn = count - len(self)

    def _is_whole(self, number: int) -> bool:
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
        """Grains in contact (C, 2) in a frame ≥ 0.  Raises BadInput for one that is not whole."""
        with self.lock:
            return self._frames.pairs(index)

    def close(self) -> None:
        """Let the file go."""
        with self.lock:
            self._frames.close()
