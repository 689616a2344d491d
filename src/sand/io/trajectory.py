"""trajectory.gsd: frames for people and other programs (OVITO, MDAnalysis, freud read them); see `io.frame`."""

from __future__ import annotations

import contextlib
import ctypes
import os
import time as wall
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..box import Box
from ..errors import BadInput, FilesFailed
from ..grains import Grains
from .damage import set_aside
from .frame import Frame, FrameSequence, code_of, stored_frame
from .gsd_index import CHUNKS, cut, holds_data, make_room, mend, mend_or_keep, read_index, refuse_impossible_sizes

FLUSH_EVERY = 1.0
"""Seconds of wall time between flushes; GSD buffers, and what is not flushed dies with the process."""
MOST_WAITING = 50
"""Frames that wait for a flush at most."""
SINGLE_PER_GRAIN = 64
"""Bytes of a grain in a frame besides what is logged."""


class TrajectoryWriter:
    """Appends frames to trajectory.gsd.

    Parameters
    ----------
    path : Path
        of the file; made if missing.
    resume_at : int or None, optional
        number of the step from which an existing file is gone on with: later frames it holds already are not
        written twice, but those that are not whole are dropped, and so is what turns out to be of another history.
    written : Sequence[float], optional
        steps of the frames that the run has written up to that step.

    Raises
    ------
    FilesFailed
        the file cannot be written.

    A file that is beyond mending is moved aside, and of one that has lost frames a copy is kept, with a warning: frames
    are for looking, the checkpoint is what counts.
    """

    def __init__(self, path: Path, resume_at: int | None = None, written: Sequence[float] = ()):
        self.path = path
        self._file: Any = None  # closed between runs
        self._there: dict[int, tuple[int, int]] = {}  # later frames: number and check sum by step
        self._last = self._whole_until = -1 if resume_at is None else resume_at  # steps: of the last frame, and flush
        self._lost = False  # given up after an error
        self._waiting = self._pending = 0  # frames that wait for the next flush, and their bytes, about
        self._entries = 0  # of the index, at most
        self._flushed = wall.monotonic()
        try:
            if resume_at is not None and path.exists():
                try:
                    self._there, lost = mend_or_keep(path, resume_at, written)
                except (BadInput, RuntimeError):
                    lost = f"{path} is beyond mending; it is now {set_aside(path).name}, and a new one begins"
                if lost:
                    warnings.warn(lost, stacklevel=2)
            self._file = _opened(path, resume_at is not None and path.exists())
            self._entries = len(read_index(path)[1])
        except OSError as error:
            raise FilesFailed(f"cannot write {path}: {error.strerror or error}") from error

    def write(
        self,
        step: int,
        time: float,
        grains: Grains,
        box: Box,
        contacts: Mapping[str, np.ndarray],
        *,
        exact: bool = False,
    ) -> None:
        """Append one frame; `contacts` is a `ContactTable`, by column; lengths to the last bit if `exact`.

        Raises
        ------
        FilesFailed
            the frame could not be written; earlier ones stay.
        """
        frame = stored_frame(step, time, grains, box, contacts, exact=exact)
        if self._is_there(step, code_of(frame)):
            return
        self._waiting, self._entries = self._waiting + 1, self._entries + CHUNKS
        self._pending += sum(array.nbytes for array in frame.log.values()) + SINGLE_PER_GRAIN * len(grains)
        try:
            if self._file is None:
                self._file = _opened(self.path, True)
            self._file.append(frame)
        except OSError as error:
            raise self._given_up(error) from error
        self._last = step
        if wall.monotonic() - self._flushed > FLUSH_EVERY or self._waiting >= MOST_WAITING:
            self.flush()

    def _is_there(self, step: int, code: int) -> bool:
        """True if the file holds this very frame; if it holds another one, that and all later ones are dropped."""
        number, stored = self._there.pop(step, (-1, code))
        if number >= 0 and stored == code:
            return True
        others = [place for place, _ in self._there.values()] + [number] * (number >= 0)
        if others:
            self.close()
            cut(self.path, min(others))
            self._there = {}
        return False

    def flush(self, sync: bool = False) -> None:
        """Everything written so far survives a kill, and a power cut if it is to be in `sync` with the disk.

        Raises
        ------
        FilesFailed
            frames since the last flush may be lost; earlier ones stay.
        """
        if self._file is None:
            return
        try:
            make_room(self.path, self._entries, self._pending)
            self._file.flush()
            if sync:
                with open(self.path, "r+b") as same:  # Windows syncs no file that is open for reading only
                    os.fsync(same.fileno())
        except OSError as error:
            raise self._given_up(error) from error
        self._flushed, self._waiting, self._pending, self._whole_until = wall.monotonic(), 0, 0, self._last

    def _given_up(self, error: OSError) -> FilesFailed:
        """Let the file go as it is on the disk."""
        if self._file is not None:
            # GSD would write once more when its object dies, and spoil what is there (see `make_room`)
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._file.file))
        self._lost = True
        with contextlib.suppress(OSError, RuntimeError, BadInput):
            mend(self.path, self._whole_until)
        return FilesFailed(f"cannot write {self.path}: {error.strerror or error}")

    def rescue(self) -> None:
        """Flush what can be flushed, after another file could not be written; nothing is raised."""
        with contextlib.suppress(FilesFailed):
            if not self._lost:
                self.flush()

    def close(self) -> None:
        """Let the file go, so that it can be moved or removed on Windows, too; a further frame opens it again."""
        if self._file is not None:
            self._file.close()
            self._file = None


def _opened(path: Path, go_on: bool) -> Any:
    """The file to be written, from its beginning or its end."""
    import gsd.hoomd

    if not go_on:
        path.touch()  # GSD makes files that others cannot read, but leaves the mode of one that exists
    return gsd.hoomd.open(str(path), "r+" if go_on else "w")


class Frames(FrameSequence):
    """The frames of a trajectory, each read when asked for.

    Parameters
    ----------
    path : str or Path
        of the file.

    Raises
    ------
    BadInput
        a missing, foreign or broken file; also later, for a frame that is not whole.
    """

    def __init__(self, path: str | Path):
        import gsd.hoomd

        self.path = Path(path)
        if not self.path.exists():
            raise BadInput(f"there is no file {path}")
        try:
            refuse_impossible_sizes(self.path)
            self._file = gsd.hoomd.open(str(path), "r")
        except BadInput:
            raise
        except (OSError, RuntimeError, ValueError, MemoryError) as error:
            raise BadInput(f"{path} is not a trajectory of SAND ({error})") from error
        if not len(self._file) and holds_data(self.path):
            self._file.close()
            raise BadInput(
                f"{path} holds data but no frame: its index is damaged, or its first frame is just being written; "
                "look again, or go on with 'sand resume'"
            )

    def __len__(self) -> int:
        return len(self._file)

    def _frame(self, number: int) -> Frame:
        try:
            return Frame(self._file[number])
        except Exception as error:  # whatever a broken file makes the reader do
            raise BadInput(f"frame {number} of {self.path} is not one of SAND ({error})") from error

    @property
    def is_ours(self) -> bool:
        """Whether SAND has written it; others do not say how long their unit is."""
        return bool(len(self._file)) and self._file.file.chunk_exists(0, "log/scale/length")

    def stored(self, index: int) -> Any:
        """A frame as the file has it.  Raises BadInput for one that is not whole."""
        try:
            return self._file[index % len(self._file)]
        except Exception as error:  # whatever a broken file makes the reader do
            raise BadInput(f"frame {index} of {self.path} cannot be read ({error})") from error

    def pairs(self, index: int) -> np.ndarray:
        """Grains in contact (C, 2) in a frame ≥ 0, and nothing else of it; its check sum is not looked at.

        Raises
        ------
        BadInput
            the frame is not whole, or names grains that it does not have.
        """
        file = self._file.file
        try:
            count = self._number(index, "bonds/N")
            at = index if file.chunk_exists(index, "bonds/group") else 0
            pair = file.read_chunk(at, "bonds/group").reshape(count, 2) if count else np.zeros((0, 2), np.uint32)
            if pair.size and int(pair.max()) >= (grains := self._number(index, "particles/N")):
                raise ValueError(f"a contact of grain {pair.max()}, of {grains} grains")
            return pair
        except Exception as error:  # whatever a broken file makes the reader do
            raise BadInput(f"frame {index} of {self.path} is not one of SAND ({error})") from error

    def head(self, index: int) -> tuple[float, int, int]:
        """True time [s], step and number of contacts of a frame ≥ 0.  Raises BadInput for one that is not whole."""
        try:
            time = float(self._file.file.read_chunk(index, "log/time")[0])
            return time, self._number(index, "configuration/step"), self._number(index, "bonds/N")
        except Exception as error:  # whatever a broken file makes the reader do
            raise BadInput(f"frame {index} of {self.path} is not one of SAND ({error})") from error

    def _number(self, index: int, chunk: str) -> int:
        """A count of a frame; what is as in the first frame is not written again, nor what is 0 there."""
        file = self._file.file
        at = next((k for k in (index, 0) if file.chunk_exists(k, chunk)), None)
        return 0 if at is None else int(file.read_chunk(at, chunk)[0])

    @property
    def times(self) -> np.ndarray:
        """True time of each frame [s]."""
        return np.array([float(self._file.file.read_chunk(k, "log/time")[0]) for k in range(len(self))])

    def close(self) -> None:
        """Let the file go."""
        self._file.close()


def read_frames(path: str | Path) -> list[Frame]:
    """All frames of a trajectory.  Raises BadInput for a missing or foreign file."""
    frames = Frames(path)
    try:
        return list(frames)
    finally:
        frames.close()
