"""The index of a GSD file, looked at before anything in it is believed, and mended after a full disk."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadInput
from .damage import DAMAGED, set_aside
from .frame import Frame, code_of

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
"""An entry of a GSD file's index (gsd.readthedocs.io, file layer)."""
SPARE = 65536
"""Bytes that GSD may want besides data and index."""
CHUNKS = 40
"""More than a frame of ours has."""
MAGIC = np.uint64(0x65DF65DF65DF65DF).tobytes()
"""What every GSD file begins with."""
HEADER, NAME = 256, 64
"""Bytes of the head of a GSD file, and of each name in its list of them."""
WIDTHS = np.array([0, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8, 1] + [10**9] * 244, np.float64)
"""Bytes of a number by its type there; impossible for types that are none."""


def read_index(path: Path) -> tuple[int, np.ndarray]:
    """Place of the index in the file and its entries, those in use being the first; a damaged one may be among them.

    Raises
    ------
    BadInput
        it lies outside the file.
    """
    size = path.stat().st_size
    with open(path, "rb") as file:
        begin = file.read(16 * 8)
        if begin[:8] != MAGIC[: len(begin)]:
            raise BadInput(f"{path} is not a trajectory of SAND (it is no GSD file)")
        place, count = (int(number) for number in np.frombuffer(begin.ljust(16 * 8, b"\0"), np.uint64)[1:3])
        if not 0 < place <= place + count * ENTRY.itemsize <= size:
            raise BadInput(
                f"{path} is a trajectory that was cut off, its index is missing: copy it again, or go on with "
                "'sand resume', which begins a new one"
            )
        file.seek(place)
        entries = np.frombuffer(file.read(count * ENTRY.itemsize), ENTRY)
    used = np.flatnonzero(entries["location"] != 0)
    return place, entries[: used[-1] + 1 if used.size else 0]


def holds_data(path: Path) -> bool:
    """True if there is more in a GSD file than its head, its index and its list of names."""
    with open(path, "rb") as file:
        head = np.frombuffer(file.read(5 * 8), np.uint64).astype(float)
    return path.stat().st_size > HEADER + head[2] * ENTRY.itemsize + head[4] * NAME


def make_room(path: Path, wanted: int, pending: int) -> None:
    """See that the disk has room for what GSD is about to write: data, and an index that holds it.

    GSD (up to 5.0 at least) goes on after it failed to lengthen its index, and writes entries over the first frames.

    Parameters
    ----------
    wanted : int
        entries that the index is to hold, at most; pending: bytes [B] of data that wait to be written.

    Raises
    ------
    OSError
        there is no room.
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
        elif shutil.disk_usage(path.parent).free < needed:  # quotas are not seen this way
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _impossible(path: Path, entries: np.ndarray) -> np.ndarray:
    """True for entries whose data lie outside the file, or of a frame before that of an earlier entry."""
    length = entries["rows"].astype(np.float64) * entries["columns"] * WIDTHS[entries["type"]]
    outside = (entries["location"] <= 0) | (entries["location"].astype(np.float64) + length > path.stat().st_size)
    frame = entries["frame"]
    late = frame > len(entries)  # each frame has an entry
    late[:-1] |= frame[:-1] > np.minimum.accumulate(frame[::-1])[::-1][1:]
    return outside | late


def refuse_impossible_sizes(path: Path) -> None:
    """A broken index may ask for petabytes.

    Raises
    ------
    BadInput
        an entry lies outside the file.
    """
    _, entries = read_index(path)
    if _impossible(path, entries).any():
        raise BadInput(f"{path} is not a trajectory of SAND (parts of it lie outside the file)")


def mend(path: Path, step: int) -> dict[int, tuple[int, int]]:
    """Drop the first frame after `step` that is not whole, and all that follow; whole ones stay.

    A disk that fills up, or a power cut, can leave an index that promises more than there is.

    Returns
    -------
    dict[int, tuple[int, int]]
        Number and check sum of each whole frame after `step`, by its step.

    Raises
    ------
    BadInput
        it is no trajectory.
    """
    import gsd.hoomd

    _, entries = read_index(path)
    bad = np.flatnonzero(_impossible(path, entries))
    if bad.size:
        before = int(entries["frame"][bad[0] - 1]) if bad[0] else 0
        own = int(entries["frame"][bad[0]])
        cut(path, own if own == before + 1 else before)
    whole: dict[int, tuple[int, int]] = {}
    with gsd.hoomd.open(str(path), "r") as file:
        for number in range(_frames_until(file, step), len(file)):
            try:
                stored = file[number]
                whole[Frame(stored).step] = (number, code_of(stored))
            except Exception:  # whatever a broken file makes the reader do
                break
        else:
            return whole
    cut(path, number)
    return whole


def mend_or_keep(path: Path, step: int, written: Sequence[float]) -> tuple[dict[int, tuple[int, int]], str]:
    """The same, of a file whose run has written frames of these steps; if it lacks some, it is kept as it was.

    What was written before the first frame that is there, to a file that has gone since, is not missed.

    Returns
    -------
    tuple[dict[int, tuple[int, int]], str]
        What `mend` gives, and what is to be said, empty if no frame up to `step` is lost.

    Raises
    ------
    BadInput
        it is no trajectory, or holds data but no frame; it is as it was then.
    OSError
        it cannot be copied or mended.
    """
    import gsd.hoomd

    _, entries = read_index(path)
    bad = bool(_impossible(path, entries).any())
    kept = any(path.parent.glob(f"{path.name}{DAMAGED}*"))  # of an earlier loss, which has been told
    aside = set_aside(path, copy=True) if bad else None
    try:
        whole = mend(path, step)
        with gsd.hoomd.open(str(path), "r") as file:
            there = _frames_until(file, step)
            first = _step(file, 0) if there else step + 1
            if not len(file) and holds_data(path):
                raise BadInput(f"{path} has no frame that is whole")
    except (BadInput, RuntimeError):
        if aside is not None:
            aside.replace(path)
        raise
    frames = sum(first <= one <= step for one in written)
    if there >= frames or (kept and not bad):
        if aside is not None:
            aside.unlink()
        return whole, ""
    aside = aside or set_aside(path, copy=True)
    return (
        whole,
        f"{path} is damaged: {frames - there} of its {frames} frames are lost; as it was it is now {aside.name}",
    )


def _frames_until(file: Any, step: int) -> int:
    """Number of frames up to a step, looked for from the end."""
    number = len(file)
    while number > 0 and _step(file, number - 1) > step:
        number -= 1
    return number


def _step(file: Any, number: int) -> int:
    """Step of a frame."""
    chunk = "configuration/step"  # missing where it is 0
    return int(file.file.read_chunk(number, chunk)[0]) if file.file.chunk_exists(number, chunk) else 0


def cut(path: Path, frame: int) -> None:
    """Let a file end before a frame: its entries, and those after them, become unused ones."""
    place, entries = read_index(path)
    late = np.flatnonzero((entries["frame"] >= frame) | _impossible(path, entries))
    if not late.size:
        return
    with open(path, "r+b") as file:
        file.seek(place + int(late[0]) * ENTRY.itemsize)
        file.write(bytes((len(entries) - int(late[0])) * ENTRY.itemsize))
        file.flush()
        os.fsync(file.fileno())
