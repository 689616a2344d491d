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
"""

from __future__ import annotations

import time as wall
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..core.box import Box
from ..core.errors import BadInput, FilesFailed
from ..core.grains import Grains

OPEN_MARGIN = 4.0
"""An open axis is drawn this much longer than the cloud of grains, because the format needs a box."""
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
    }
    return frame


class Frame:
    """One stored frame, back in SI: arrays (N, …) named as in the field table, and `pair` (C, 2)."""

    def __init__(self, stored: Any):
        self.step = int(stored.configuration.step)
        self.time = float(stored.log["time"][0])
        scale = float(stored.log["scale/length"][0])
        p = stored.particles
        self.position = np.asarray(p.position, dtype=np.float64) * scale
        self.radius = 0.5 * np.asarray(p.diameter, dtype=np.float64) * scale
        self.velocity, self.mass = np.asarray(p.velocity), np.asarray(p.mass)
        self.moment, self.spin = stored.log["particles/moment"], stored.log["particles/spin"]
        self.orientation = np.roll(np.asarray(p.orientation), -1, axis=1)
        self.pair = np.asarray(stored.bonds.group).reshape(-1, 2)
        periodic = stored.log["periodic"].astype(bool)
        lengths = np.asarray(stored.configuration.box[:3], dtype=np.float64) * scale
        x, y, z = (float(v) if on else None for v, on in zip(lengths, periodic, strict=True))
        self.box = Box((x, y, z))


def read_frames(path: str | Path) -> list[Frame]:
    """All frames of a trajectory.  Raises BadInput for a missing or foreign file."""
    import gsd.hoomd

    if not Path(path).exists():
        raise BadInput(f"there is no file {path}")
    try:
        with gsd.hoomd.open(str(path), "r") as file:
            return [Frame(stored) for stored in file]
    except (OSError, RuntimeError, KeyError) as error:
        raise BadInput(f"{path} is not a trajectory of SAND ({error})") from error
