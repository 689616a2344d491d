"""trajectory.gsd: frames for analysis and for other programs (OVITO, MDAnalysis, freud read them); see `io.frame`."""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from ..basics.box import Box
from ..basics.errors import BadInput, FilesFailed, shown, warn
from ..basics.grains import Grains
from ..basics.paths import user_path
from ..basics.units import format_quantity, si
from . import gsd_index
from .damage import set_aside
from .frame import Frame, FrameSequence
from .frame_chunks import (
    OF_OTHERS,
    append_frame,
    code_of,
    first_chunks,
    read_identities,
    read_materials,
    read_number,
    read_snapshot,
    read_stored,
    stored_frame,
)
from .run_folder import give_own_content

FLUSH_EVERY = 1.0
"""Wall time [s] between flushes; GSD buffers, and unflushed frames are lost if the process is killed."""
MOST_WAITING = 50
"""Largest number of frames that wait for a flush."""
SINGLE_PER_GRAIN = 64
"""Bytes per grain in a frame, logged arrays excepted."""


class TrajectoryWriter:
    """Appends frames to trajectory.gsd.

    A file that cannot be repaired is moved aside, and a copy is kept of a file that has lost frames, both with a
    warning; a run is resumed from its checkpoint, not from its frames.

    Parameters
    ----------
    path : Path
        The file; created if missing.
    resume_at : float or None, optional
        Time [s] of the last frame of a run that is resumed: later frames in the file are not written twice; incomplete
        frames and frames that differ from the resumed run are deleted.
    written : Sequence[float], optional
        Times of the frames [s] that the run has written up to that time.
    report : callable, optional
        Called with the text of a warning.

    Raises
    ------
    FilesFailed
        If the file cannot be written.
    """

    def __init__(
        self,
        path: Path,
        resume_at: float | None = None,
        written: Sequence[float] = (),
        report: Callable[[str], None] = warn,
    ):
        self.path = path
        self._file: Any = None  # closed between runs
        self._first: dict[str, bytes] = {}  # chunks of the first frame
        self._later: dict[float, tuple[int, int]] = {}  # frames after resume_at: index and checksum by time
        # times of the last frame, and of the last one that was flushed
        self._last = self._whole_until = -math.inf if resume_at is None else resume_at
        self._abandoned = False  # after an error
        self._waiting = self._pending = 0  # frames that wait for the next flush, and their approximate bytes
        self._entries = 0  # upper bound of the index entries
        self._flushed = monotonic()
        self._scale: float | None = None  # reference radius of the file [m]
        self._materials: list[str] = []  # names of the materials of its frames
        try:
            if resume_at is not None:
                give_own_content(path)
            if resume_at is not None and path.exists():
                try:
                    self._later, lost = gsd_index.repair_or_keep(path, resume_at, written)
                except (BadInput, RuntimeError):
                    lost = f"{path} cannot be repaired; it is now {set_aside(path).name}, and a new one begins"
                if lost:
                    report(lost)
            self._open(resume_at is not None and path.exists())
            self._entries = len(gsd_index.read_index(path)[1])
            file: Any = self._file
            if kept := len(file) - len(self._later):
                self._scale = float(file.file.read_chunk(0, "log/scale/length")[0])
                self._materials = read_materials(file, kept)
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
        at_rest: np.ndarray | None = None,
        virial: np.ndarray | None = None,
    ) -> None:
        """Append one frame; columns of `contacts` as in `ContactTable`; `exact`: `frame.IN_FULL` in float64.

        `at_rest` (N,): which grains belong to clusters at rest, with rigid clusters. `virial` (N, 3, 3): shares of the
        grains in the virial of contacts [J].

        Raises
        ------
        FilesFailed
            If the frame cannot be written; earlier ones stay.
        """
        fixed: Any = {"scale": self._scale, "materials": self._materials}
        frame = stored_frame(step, time, grains, box, contacts, exact=exact, at_rest=at_rest, virial=virial, **fixed)
        self._scale = float(frame.log["scale/length"][0])
        self._materials += [m.name for m in grains.materials if m.name not in self._materials]
        if self._is_stored(time, code_of(frame)):
            return
        self._waiting, self._entries = self._waiting + 1, self._entries + gsd_index.CHUNKS + len(grains.own_units)
        self._pending += sum(array.nbytes for array in frame.log.values()) + SINGLE_PER_GRAIN * len(grains)
        try:
            if self._file is None:
                self._open(True)
            append_frame(self._file, frame, self._first)
        except OSError as error:
            raise self._abandon(error) from error
        self._last = time
        if monotonic() - self._flushed > FLUSH_EVERY or self._waiting >= MOST_WAITING:
            self.flush()

    def _open(self, append: bool) -> None:
        """Open the file for appending, or create it."""
        if not append:
            self.path.touch()  # GSD creates files that other users cannot read, but keeps the mode of an existing one
        self._file = _open_gsd(self.path, "r+" if append else "w")
        self._first = first_chunks(self._file)

    def _is_stored(self, time: float, code: int) -> bool:
        """Whether the file has this frame already; a different frame of this time and all later ones are deleted."""
        number, stored = self._later.pop(time, (-1, code))
        if number >= 0 and stored == code:
            return True
        others = [later for later, _ in self._later.values()] + [number] * (number >= 0)
        if others:
            self.close()
            gsd_index.cut(self.path, min(others))
            self._later = {}
        return False

    def flush(self, sync: bool = False) -> None:
        """Make everything written so far survive a kill, and with `sync` a power failure.

        Raises
        ------
        FilesFailed
            If frames since the last flush may be lost; earlier ones stay.
        """
        if self._file is None:
            return
        try:
            gsd_index.reserve_space(self.path, self._entries, self._pending)
            self._file.flush()
            if sync:
                with open(self.path, "r+b") as same:  # Windows does not sync a file that is open for reading only
                    os.fsync(same.fileno())
        except OSError as error:
            raise self._abandon(error) from error
        self._flushed, self._waiting, self._pending, self._whole_until = monotonic(), 0, 0, self._last

    def _abandon(self, error: OSError) -> FilesFailed:
        """Give up writing after an error and repair the file; returns the exception to raise."""
        if self._file is not None:
            # when GSD's object is destroyed it would write once more and damage the file (see `reserve_space`): leak it
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._file.file))
            self._file.closes_at_exit.detach()
        self._abandoned = True
        with contextlib.suppress(OSError, RuntimeError, BadInput):
            gsd_index.repair(self.path, self._whole_until)
        return FilesFailed(f"cannot write {self.path}: {error.strerror or error}")

    def rescue(self) -> None:
        """Flush what can be flushed after another file could not be written; raises nothing."""
        with contextlib.suppress(FilesFailed):
            if not self._abandoned:
                self.flush()

    def close(self) -> None:
        """Close the file, so that Windows can move or remove it; the next frame opens it again."""
        if self._file is not None:
            self._file.close()
            self._file = None


def _open_gsd(path: Path, mode: str) -> Any:
    """Open a GSD file that is closed before the program ends, because GSD's objects cannot close it afterwards."""
    import gsd.fl
    import gsd.hoomd

    if mode == "w":
        gsd.hoomd.open(str(path), mode).close()
        mode = "r+"
    try:  # GSD writes notes about each chunk, which nobody reads but which take time
        file = gsd.hoomd.HOOMDTrajectory(gsd.fl.GSDFile(str(path), mode, None, None, None, debug=False))
    except TypeError:  # earlier versions have no such option
        file = gsd.hoomd.open(str(path), mode)
    file.closes_at_exit = weakref.finalize(file, _close_gsd, file.file)
    return file


def _close_gsd(file: Any) -> None:
    """Close a GSD file that is in use no more; on a full disk, frames that were not flushed are lost."""
    with contextlib.suppress(OSError, RuntimeError):
        file.close()


class Frames(FrameSequence):
    """The frames of a trajectory; each is read on access.

    Parameters
    ----------
    path : str or Path
        The trajectory.

    Raises
    ------
    BadInput
        If the file is missing, foreign or broken; also later, for an incomplete frame.
    """

    def __init__(self, path: str | Path):
        self.path = user_path(path)
        if not self.path.exists():
            raise BadInput(f"there is no file {path}")
        try:
            gsd_index.refuse_impossible_sizes(self.path)
            self._file = _open_gsd(self.path, "r")
        except BadInput:
            raise
        except (OSError, RuntimeError, ValueError, MemoryError) as error:
            raise BadInput(f"{path} is not a trajectory of SAND ({error})") from error
        if not len(self._file) and gsd_index.holds_data(self.path):
            self._file.close()
            raise BadInput(
                f"{path} holds data but no frame: its index is damaged, or its first frame is being written; "
                "try again, or continue the run with 'sand resume'"
            )

    def __len__(self) -> int:
        return len(self._file)

    @contextlib.contextmanager
    def _reading(self, index: int, problem: str = "is not one of SAND") -> Iterator[None]:
        """Turn exceptions of the reader into BadInput; gsd raises various ones for broken files."""
        try:
            yield
        except Exception as error:
            raise BadInput(f"frame {index} of {self.path} {problem} ({error})") from error

    def _frame(self, number: int) -> Frame:
        with self._reading(number):
            return Frame(read_stored(self._file, number))

    def material_names(self) -> list[str]:
        """Names of the materials of all frames, in the order in which they first appear; reads little else."""
        with self._reading(0):
            return read_materials(self._file, len(self))

    @property
    def written_by_sand(self) -> bool:
        """Whether SAND wrote the file; files of other programs do not state their unit of length."""
        return bool(len(self._file)) and self._file.file.chunk_exists(0, "log/scale/length")

    def stored(self, index: int) -> Any:
        """A frame as stored by GSD.  Raises BadInput if it is incomplete."""
        with self._reading(index, "cannot be read"):
            return read_snapshot(self._file, index % len(self._file), OF_OTHERS)

    def pairs(self, index: int) -> np.ndarray:
        """Grain indices (C, 2) of the contacts in a frame ≥ 0; reads nothing else and does not verify the checksum.

        Raises
        ------
        BadInput
            If the frame is incomplete, or a contact names a grain that does not exist.
        """
        file = self._file.file
        with self._reading(index):
            count = read_number(file, index, "bonds/N")
            at = index if file.chunk_exists(index, "bonds/group") else 0
            pair = file.read_chunk(at, "bonds/group").reshape(count, 2) if count else np.zeros((0, 2), np.uint32)
            if pair.size and int(pair.max()) >= (grains := read_number(file, index, "particles/N")):
                raise ValueError(f"a contact of grain {pair.max()}, of {grains} grains")
            return pair

    def identities(self, index: int) -> np.ndarray:
        """Identities (N,) of the grains of a frame ≥ 0, ascending; reads nothing else.  Raises BadInput."""
        with self._reading(index):
            count = read_number(self._file.file, index, "particles/N")
            return read_identities(self._file, index, count)

    def head(self, index: int) -> tuple[float, int, int]:
        """Time [s], step and number of contacts of a frame ≥ 0.  Raises BadInput if it is incomplete."""
        with self._reading(index):
            time = gsd_index.time_of(self._file, index)
            contacts = read_number(self._file.file, index, "bonds/N")
            return time, gsd_index.step_of(self._file, index), contacts

    def __repr__(self) -> str:
        ends = [format_quantity(self.head(k)[0], "s") for k in (0, len(self) - 1)] if len(self) else []
        return f"<{len(self)} frame{'' if len(self) == 1 else 's'} of {self.path}, t = {' to '.join(ends) or 'none'}>"

    @property
    def times(self) -> np.ndarray:
        """Time of each frame [s]."""
        return np.array([gsd_index.time_of(self._file, k) for k in range(len(self))])

    @property
    def steps(self) -> np.ndarray:
        """Step of each frame; frames that lie within one step have its number."""
        return np.array([gsd_index.step_of(self._file, k) for k in range(len(self))], np.int64)

    def at(self, time: Any) -> Frame:
        """The frame nearest to a time, in seconds or as text; of two equally near ones the earlier.

        Raises
        ------
        BadInput
            If there is no frame, or the time lies before the first or after the last.
        """
        now, times = si(time, "s", "time"), self.times
        if not len(times) or not times[0] <= now <= times[-1]:
            ends = [format_quantity(float(t), "s") for t in times[[0, -1]]] if len(times) else []
            held = f"has frames from {ends[0]} to {ends[1]}" if ends else "has no frame"
            raise BadInput(f"time = {shown(time)}: {self.path} {held}")
        return self[int(np.argmin(np.abs(times - now)))]

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_frames(path: str | Path) -> list[Frame]:
    """Read all frames of a trajectory.  Raises BadInput for a missing or foreign file."""
    with contextlib.closing(Frames(path)) as frames:
        return list(frames)
