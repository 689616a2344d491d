"""trajectory.gsd: frames for people and other programs (OVITO, MDAnalysis, freud read them).

Positions, diameters and box are in units of a reference radius (float32 would not do in metres); the rest is
SI.  Orientations are scalar first, as GSD has them.

| chunk | meaning |
|---|---|
| configuration/step, log/time | step number; true time of the frame [s] |
| log/scale/length | the reference radius [m] |
| log/periodic | 1 for each periodic axis, 0 for an open one, whose length in the box is only for drawing |
| particles/position, diameter; configuration/box | in reference radii |
| particles/velocity, mass, charge | m/s, kg, C |
| particles/orientation | rotation parameters, scalar first |
| particles/typeid, types | materials |
| log/particles/moment, spin | A m² and rad/s, laboratory frame |
| bonds/group | grains in contact |
| log/bonds/overlap, formed | δ [m] and time of first touch [s] |
| log/crc32 | check sum over all of a frame; runs before 0.1.0 have none |
| log/bonds/force | force on the first grain of each contact [N], laboratory frame; runs before 0.1.0 have none |
"""

from __future__ import annotations

import time as wall
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, overload

import numpy as np

from ..core.box import Box
from ..core.errors import BadInput, FilesFailed
from ..core.grains import Grains

OPEN_MARGIN = 4.0
"""An open axis is drawn this much longer than the cloud of grains, because the format needs a box."""
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
LOGGED = (
    "time",
    "scale/length",
    "periodic",
    "particles/moment",
    "particles/spin",
    "bonds/overlap",
    "bonds/formed",
    "bonds/force",
)
"""Logged arrays that the check sum is over, in its order."""
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
            self._file.append(_frame(step, time, grains, box, contacts))
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


def _frame(step: int, time: float, grains: Grains, box: Box, contacts: Mapping[str, np.ndarray]) -> Any:
    import gsd.hoomd

    scale = float(grains.radius.mean())
    frame = gsd.hoomd.Frame()
    frame.configuration.step = step
    cloud = 2.0 * np.abs(grains.position).max(axis=0) + 2.0 * grains.radius.max()
    lengths = [v if v is not None else OPEN_MARGIN * cloud[axis] for axis, v in enumerate(box.lengths)]
    frame.configuration.box = [*(np.array(lengths) / scale), 0.0, 0.0, 0.0]
    p = frame.particles
    p.N = len(grains)
    p.types = [m.name for m in grains.materials]
    p.typeid = grains.material
    p.position = grains.position / scale
    p.diameter = 2.0 * grains.radius / scale
    p.velocity, p.mass, p.charge = grains.velocity, grains.mass, grains.charge
    p.orientation = np.roll(grains.orientation, 1, axis=1)
    frame.bonds.N = len(contacts["pair"])
    frame.bonds.types = ["contact"]
    frame.bonds.typeid = np.zeros(frame.bonds.N, dtype=np.uint32)
    frame.bonds.group = contacts["pair"]
    frame.log = {
        "time": np.array([time]),
        "scale/length": np.array([scale]),
        "periodic": np.array([v is not None for v in box.lengths], dtype=np.uint8),
        "particles/moment": np.ascontiguousarray(grains.moment),
        "particles/spin": np.ascontiguousarray(grains.spin),
        "bonds/overlap": contacts["overlap"],
        "bonds/formed": contacts["formed"],
        "bonds/force": contacts["force"].astype(np.float32),
    }
    frame.log["crc32"] = np.array([_crc32(frame)], dtype=np.uint32)
    return frame


def _crc32(stored: Any) -> int:
    """CRC-32 over all numbers of a frame, as the file holds them."""
    p, code = stored.particles, 0
    single = (p.position, p.diameter, p.velocity, p.mass, p.charge, p.orientation)
    parts = [np.asarray(part, np.float32) for part in single]
    parts += [np.asarray(part, np.uint32) for part in (p.typeid, stored.bonds.group)]
    for part in [*parts, *(stored.log[name] for name in LOGGED if name in stored.log)]:
        # + 0 makes −0 and 0 the same, which GSD takes for no change
        code = zlib.crc32((np.ascontiguousarray(part) + np.zeros(1, part.dtype)).tobytes(), code)
    return code


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


class Frame:
    """One stored frame, back in SI: arrays (N, …) named as in the field table.

    `material` (N,) counts in `materials`, their names; `pair` (C, 2), `overlap` [m], `formed` [s] (C,) and `force` [N]
    (C, 3) are those of the contacts, `force` NaN where the file has none.
    """

    def __init__(self, stored: Any):
        if "crc32" in stored.log and int(stored.log["crc32"][0]) != _crc32(stored):
            raise ValueError("its check sum is wrong")
        self.step = int(stored.configuration.step)
        self.time = float(stored.log["time"][0])
        scale = float(stored.log["scale/length"][0])
        p = stored.particles
        self.position = np.asarray(p.position, dtype=np.float64) * scale
        self.radius = 0.5 * np.asarray(p.diameter, dtype=np.float64) * scale
        self.velocity, self.mass = np.asarray(p.velocity), np.asarray(p.mass)
        self.charge = np.asarray(p.charge)
        self.materials, self.material = list(p.types), np.asarray(p.typeid)
        self.moment, self.spin = stored.log["particles/moment"], stored.log["particles/spin"]
        self.orientation = np.roll(np.asarray(p.orientation), -1, axis=1)
        self.pair = np.asarray(stored.bonds.group).reshape(-1, 2)
        self.overlap, self.formed = stored.log["bonds/overlap"], stored.log["bonds/formed"]
        self.force = np.asarray(stored.log.get("bonds/force", np.full((len(self.pair), 3), np.nan)), np.float64)
        periodic = stored.log["periodic"].astype(bool)
        lengths = np.asarray(stored.configuration.box[:3], dtype=np.float64) * scale
        x, y, z = (float(v) if on else None for v, on in zip(lengths, periodic, strict=True))
        self.box = Box((x, y, z))
        self.drawn = tuple(float(v) for v in lengths)
        """Lengths of the box as drawn [m], open axes too."""

    def __len__(self) -> int:
        """Number of grains."""
        return len(self.radius)


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
