"""trajectory.gsd: frames for people and other programs (OVITO, MDAnalysis, freud read them); see `files.frame`."""

from __future__ import annotations

import time as wall
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import overload

import numpy as np

from ..core.box import Box
from ..core.errors import BadInput, FilesFailed
from ..core.grains import Grains
from .frame import Frame, stored_frame

_ENTRY = np.dtype(
    [
        ("frame", "<u8"),
        ("rows", "<u8"),
        ("location", "<i8"),
        ("columns", "<u4"),
        ("name", "<u2"),
        ("type", "u1"),
        ("flags", "u1"),
    ]
)
"""An entry of a GSD file's index (gsd.readthedocs.io, file layer)."""
FLUSH_EVERY = 1.0
"""Seconds of wall time between flushes; GSD buffers, and what is not flushed dies with the process."""


class TrajectoryWriter:
    """Appends frames to trajectory.gsd.

    Args:
        path: of the file; made if missing.
        append: go on with an existing file; frames it holds already are not written twice.

    Raises:
        FilesFailed: the file cannot be written; BadInput: an existing file is not a trajectory.
    """

    def __init__(self, path: Path, *, append: bool = False):
        import gsd.hoomd

        self.path = path
        self.last_step = -1
        self._flushed = wall.monotonic()
        mode = "r+" if append and path.exists() else "w"
        try:
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
    ) -> None:
        """Append one frame; `contacts` holds `pair` (C, 2), `overlap` [m] and `formed` [s].

        Raises:
            FilesFailed: the frame could not be written; earlier ones stay.
        """
        if step <= self.last_step:
            return
        try:
            self._file.append(stored_frame(step, time, grains, box, contacts))
            self.last_step = step
            if wall.monotonic() - self._flushed > FLUSH_EVERY:
                self.flush()
        except OSError as error:
            raise FilesFailed(f"cannot write {self.path}: {error.strerror or error}") from error

    def flush(self) -> None:
        """Everything written so far survives a kill."""
        self._file.flush()
        self._flushed = wall.monotonic()

    def close(self) -> None:
        self._file.close()


def _refuse_impossible_sizes(path: Path) -> None:
    """Look at the index of a GSD file before anything is read: a broken one may ask for petabytes.

    Raises:
        BadInput: an entry lies outside the file.
    """
    size = path.stat().st_size
    with open(path, "rb") as file:
        head = np.frombuffer(file.read(16 * 8), np.uint64)
        if head.size < 5:
            raise BadInput(f"{path} is not a trajectory of SAND (it is cut off)")
        place, count = int(head[1]), int(head[2])
        if not 0 < place <= place + count * _ENTRY.itemsize <= size:
            raise BadInput(f"{path} is not a trajectory of SAND (its index lies outside the file)")
        file.seek(place)
        entries = np.frombuffer(file.read(count * _ENTRY.itemsize), _ENTRY)
    used = entries[entries["location"] != 0]
    wide = np.array([0, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8, 1] + [10**9] * 244, np.float64)[used["type"]]
    ends = used["location"].astype(np.float64) + used["rows"].astype(np.float64) * used["columns"] * wide
    if (used["location"] < 0).any() or (ends > size).any():
        raise BadInput(f"{path} is not a trajectory of SAND (parts of it lie outside the file)")


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
            _refuse_impossible_sizes(self.path)
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
