"""The index of a GSD file: checked before reading, repaired after a full disk or a power failure."""

from __future__ import annotations

import errno
import math
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.errors import BadInput
from .damage import DAMAGED, set_aside
from .frame import Frame
from .frame_chunks import code_of, read_number, read_stored

ENTRY = np.dtype(
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
"""Entry of the index of a GSD file (gsd.readthedocs.io, file layer)."""
SPARE = 65536
"""Bytes that GSD may need besides data and index."""
CHUNKS = 40
"""Upper bound of the index entries of one frame."""
MAGIC = np.uint64(0x65DF65DF65DF65DF).tobytes()
"""First bytes of every GSD file."""
HEADER, NAME = 256, 64
"""Bytes of the header of a GSD file, and of each entry in its list of names."""
WIDTHS = np.array([0, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8, 1] + [10**9] * 244, np.float64)
"""Bytes of a number by its type code; impossibly large for invalid codes."""


def read_index(path: Path) -> tuple[int, np.ndarray]:
    """Read the offset of the index and its used entries, which may include damaged ones.

    Raises
    ------
    BadInput
        If the index lies outside the file, or the file is not GSD.
    """
    size = path.stat().st_size
    with open(path, "rb") as file:
        begin = file.read(16 * 8)
        if begin[:8] != MAGIC[: len(begin)]:
            raise BadInput(f"{path} is not a trajectory of SAND (it is not a GSD file)")
        offset, count = (int(number) for number in np.frombuffer(begin.ljust(16 * 8, b"\0"), np.uint64)[1:3])
        if not 0 < offset <= offset + count * ENTRY.itemsize <= size:
            raise BadInput(
                f"{path} is a trajectory that was cut off, its index is missing: copy it again, or continue the run "
                "with 'sand resume', which begins a new one"
            )
        file.seek(offset)
        entries = np.frombuffer(file.read(count * ENTRY.itemsize), ENTRY)
    used = np.flatnonzero(entries["location"] != 0)
    return offset, entries[: used[-1] + 1 if used.size else 0]


def holds_data(path: Path) -> bool:
    """Whether a GSD file holds more than header, index and list of names."""
    with open(path, "rb") as file:
        head = np.frombuffer(file.read(5 * 8), np.uint64).astype(float)
    return path.stat().st_size > HEADER + head[2] * ENTRY.itemsize + head[4] * NAME


def reserve_space(path: Path, wanted: int, pending: int) -> None:
    """Make sure that the disk can hold what GSD is about to write: data, and an index for it.

    GSD (up to 5.0 at least) does not stop if it cannot extend its index, and overwrites the first frames with entries.

    Parameters
    ----------
    wanted : int
        Upper bound of the entries that the index is to hold.
    pending : int
        Size of the data that wait to be written [B].

    Raises
    ------
    OSError
        If there is not enough space.
    """
    with open(path, "r+b") as file:
        allocated = int(np.frombuffer(file.read(24), np.uint64)[2])
        longer = allocated
        while longer <= wanted:
            longer *= 2
        needed = pending + (longer > allocated) * longer * ENTRY.itemsize + SPARE
        if hasattr(os, "posix_fallocate"):
            size = os.fstat(file.fileno()).st_size
            try:
                os.posix_fallocate(file.fileno(), size, needed)
            finally:
                os.ftruncate(file.fileno(), size)
        elif shutil.disk_usage(path.parent).free < needed:  # ignores quotas
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _impossible(path: Path, entries: np.ndarray) -> np.ndarray:
    """Mask of entries whose data lie outside the file, or whose frame precedes that of an earlier entry."""
    length = entries["rows"].astype(np.float64) * entries["columns"] * WIDTHS[entries["type"]]
    outside = (entries["location"] <= 0) | (entries["location"].astype(np.float64) + length > path.stat().st_size)
    frame = entries["frame"]
    late = frame > len(entries)  # each frame has an entry
    late[:-1] |= frame[:-1] > np.minimum.accumulate(frame[::-1])[::-1][1:]
    return outside | late


def refuse_impossible_sizes(path: Path) -> None:
    """Refuse a broken index, which may request petabytes of memory.

    Raises
    ------
    BadInput
        If an entry lies outside the file.
    """
    _, entries = read_index(path)
    if _impossible(path, entries).any():
        raise BadInput(f"{path} is not a trajectory of SAND (parts of it lie outside the file)")


def repair(path: Path, time: float) -> dict[float, tuple[int, int]]:
    """Delete the first incomplete frame after `time` [s] and all that follow; complete ones stay.

    After a full disk or a power failure, the index may list more data than exist.

    Returns
    -------
    dict[float, tuple[int, int]]
        Index and checksum of each complete frame after `time`, by its time.

    Raises
    ------
    BadInput
        If the file is not a trajectory.
    """
    import gsd.hoomd

    _, entries = read_index(path)
    bad = np.flatnonzero(_impossible(path, entries))
    if bad.size:
        before = int(entries["frame"][bad[0] - 1]) if bad[0] else 0
        own = int(entries["frame"][bad[0]])
        cut(path, own if own == before + 1 else before)
    complete: dict[float, tuple[int, int]] = {}
    with gsd.hoomd.open(str(path), "r") as file:
        for number in range(_frames_until(file, time), len(file)):
            try:
                stored = read_stored(file, number)
                complete[Frame(stored).time] = (number, code_of(stored))
            except Exception:  # gsd raises various exceptions for broken files
                break
        else:
            return complete
    cut(path, number)
    return complete


def repair_or_keep(path: Path, time: float, written: Sequence[float]) -> tuple[dict[float, tuple[int, int]], str]:
    """As `repair`, for a run that has written frames of the times `written` [s]; a copy is kept if frames are lost.

    Frames before the first one in the file are not missed: they were written to a file that has been removed.

    Returns
    -------
    tuple[dict[float, tuple[int, int]], str]
        The result of `repair`, and a warning, which is empty if no frame up to `time` is lost.

    Raises
    ------
    BadInput
        If the file is not a trajectory, or holds data but no frame; it is unchanged then.
    OSError
        If it cannot be copied or repaired.
    """
    import gsd.hoomd

    _, entries = read_index(path)
    bad = bool(_impossible(path, entries).any())
    kept = any(path.parent.glob(f"{path.name}{DAMAGED}*"))  # of an earlier loss, which was reported
    aside = set_aside(path, copy=True) if bad else None
    try:
        complete = repair(path, time)
        with gsd.hoomd.open(str(path), "r") as file:
            present = _frames_until(file, time)
            first = time_of(file, 0) if present else math.inf
            if not len(file) and holds_data(path):
                raise BadInput(f"{path} has no complete frame")
    except (BadInput, RuntimeError):
        if aside is not None:
            aside.replace(path)
        raise
    frames = sum(first <= one <= time for one in written)
    if present >= frames or (kept and not bad):
        if aside is not None:
            aside.unlink()
        return complete, ""
    aside = aside or set_aside(path, copy=True)
    lost = f"{path} is damaged: {frames - present} of its {frames} frames are lost; a copy of it is {aside.name}"
    return complete, lost


def _frames_until(file: Any, time: float) -> int:
    """Number of frames up to a time [s]."""
    number = len(file)
    while number > 0 and time_of(file, number - 1) > time:
        number -= 1
    return number


def step_of(file: Any, frame: int) -> int:
    """Step of a frame."""
    return read_number(file.file, frame, "configuration/step")


def time_of(file: Any, frame: int) -> float:
    """Time of a frame [s]."""
    return float(file.file.read_chunk(frame, "log/time")[0])


def cut(path: Path, frame: int) -> None:
    """Truncate a file before a frame: its entries and all later ones become unused."""
    offset, entries = read_index(path)
    late = np.flatnonzero((entries["frame"] >= frame) | _impossible(path, entries))
    if not late.size:
        return
    with open(path, "r+b") as file:
        file.seek(offset + int(late[0]) * ENTRY.itemsize)
        file.write(bytes((len(entries) - int(late[0])) * ENTRY.itemsize))
        file.flush()
        os.fsync(file.fileno())
