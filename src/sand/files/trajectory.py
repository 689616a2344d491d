"""trajectory.gsd: frames for people and other programs (OVITO, MDAnalysis, freud read them); see `files.frame`."""

from __future__ import annotations

import contextlib
import ctypes
import os
import time as wall
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, overload

import numpy as np

from ..core.box import Box
from ..core.errors import BadInput, FilesFailed
from ..core.grains import Grains
from .frame import Frame, stored_frame
from .gsd_index import make_room, mend, refuse_impossible_sizes

FLUSH_EVERY = 1.0
"""Seconds of wall time between flushes; GSD buffers, and what is not flushed dies with the process."""
SINGLE_PER_GRAIN = 64
"""Bytes of a grain in a frame besides what is logged."""


class TrajectoryWriter:
    """Appends frames to trajectory.gsd.

    Args:
        path: of the file; made if missing.
        resume_at: number of the step from which an existing file is gone on with: later frames it holds already are not
            written twice, but those that are not whole are dropped.

    Raises:
        FilesFailed: the file cannot be written; BadInput: an existing file is not a trajectory.
    """

    def __init__(self, path: Path, resume_at: int | None = None):
        import gsd.hoomd

        self.path = path
        self.last_step = -1
        self._whole_until = -1  # step of the last flush
        self._lost = False  # given up after an error
        self._pending = 0  # bytes that wait for the next one, about
        self._flushed = wall.monotonic()
        mode = "w" if resume_at is None or not path.exists() else "r+"
        try:
            if mode == "r+" and resume_at is not None:
                mend(path, resume_at)
            self._file = gsd.hoomd.open(str(path), mode)
            if mode == "r+" and len(self._file):
                self.last_step = int(self._file[len(self._file) - 1].configuration.step)
        except OSError as error:
            raise FilesFailed(f"cannot write {path}: {error.strerror or error}") from error
        except RuntimeError as error:
            raise BadInput(f"{path} is not a trajectory: {error}") from error

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

        Raises:
            FilesFailed: the frame could not be written; earlier ones stay.
        """
        if step <= self.last_step:
            return
        frame = stored_frame(step, time, grains, box, contacts, exact=exact)
        self._pending += sum(array.nbytes for array in frame.log.values()) + SINGLE_PER_GRAIN * len(grains)
        try:
            self._file.append(frame)
        except OSError as error:
            raise self._given_up(error) from error
        self.last_step = step
        if wall.monotonic() - self._flushed > FLUSH_EVERY:
            self.flush()

    def flush(self, sync: bool = False) -> None:
        """Everything written so far survives a kill, and a power cut if it is to be in `sync` with the disk.

        Raises:
            FilesFailed: frames since the last flush may be lost; earlier ones stay.
        """
        try:
            make_room(self.path, self._pending)
            self._file.flush()
            if sync:
                with open(self.path, "rb") as same:
                    os.fsync(same.fileno())
        except OSError as error:
            raise self._given_up(error) from error
        self._flushed, self._whole_until, self._pending = wall.monotonic(), self.last_step, 0

    def _given_up(self, error: OSError) -> FilesFailed:
        """Let the file go as it is on the disk."""
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
        """Let the file go."""
        self._file.close()


class Frames(Sequence[Frame]):
    """The frames of a trajectory, each read when asked for.

    Args:
        path: of the file.

    Raises:
        BadInput: a missing, foreign or broken file; also later, for a frame that is not whole.
    """

    def __init__(self, path: str | Path):
        import gsd.hoomd

        self.path = Path(path)
        if not self.path.exists():
            raise BadInput(f"there is no file {path}")
        try:
            refuse_impossible_sizes(self.path)
            self._file = gsd.hoomd.open(str(path), "r")
        except (OSError, RuntimeError, ValueError, MemoryError) as error:
            raise BadInput(f"{path} is not a trajectory of SAND ({error})") from error

    def __len__(self) -> int:
        return len(self._file)

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...

    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        if not -len(self) <= index < len(self):
            raise IndexError(f"{self.path} has {len(self)} frames, from 0 to {len(self) - 1}; there is no {index}")
        try:
            return Frame(self._file[index % len(self)])
        except Exception as error:  # whatever a broken file makes the reader do
            raise BadInput(f"frame {index} of {self.path} is not one of SAND ({error})") from error

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
