"""Frames of files of grains of any format, as those of a trajectory, for figures, the viewer and exports."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, warn
from ..basics.grains import ROUNDED
from ..basics.material import PRESETS, SILICA, Material, as_material
from .bodies import contacts_of, read_frame
from .frame import Frame, FrameSequence
from .frame_chunks import stored_frame
from .grain_files import is_gsd, open_grains
from .trajectory import Frames


def open_frames(path: str | Path, radius: Any = None, length: str | None = None, material: Any = None) -> FrameSequence:
    """Open a trajectory of SAND, or a file of grains of another format.

    Parameters
    ----------
    path : str or Path
        The file; its content tells the format.
    radius, length, material : optional
        As for `io.bodies.read_grains`, for files that lack them.

    Raises
    ------
    BadInput
        If the file is missing or in no known format, or a trajectory of SAND is given one of the other arguments.
    """
    file = Path(path)
    if is_gsd(file) or file.suffix == ".gsd":
        frames = Frames(file)
        if frames.written_by_sand or not len(frames):
            given = {"radius": radius, "length": length, "material": material}
            if wrong := [name for name, value in given.items() if value is not None]:
                frames.close()
                raise BadInput(f"{wrong[0]}: the trajectory {path} has it; leave {wrong[0]} out")
            return frames
        frames.close()
    return FileFrames(file, radius, length, material)


class _Known(Mapping[str, Material]):
    """Materials by name: presets, and for all other names the constants of silica."""

    def __getitem__(self, name: str) -> Material:
        return PRESETS[name] if name in PRESETS else SILICA.but(name=name or "unnamed")

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str)

    def __iter__(self) -> Iterator[str]:
        return iter(PRESETS)

    def __len__(self) -> int:
        return len(PRESETS)


class FileFrames(FrameSequence):
    """Frames of a file of grains that is no trajectory of SAND, with the interface of `LiveTrajectory`.

    Grains that touch, up to the rounding of coordinates, are in contact. Masses of grains of unknown materials are
    those of silica, unless the file has masses; a note says so. Frames without a time are one second apart. The text of
    a file is read once, and only one frame is kept, so that a long file takes little more memory than its text.

    Parameters
    ----------
    path, radius, length, material
        As `open_frames`.

    Raises
    ------
    BadInput
        As `io.bodies.read_grains`.
    """

    incomplete = generation = 0
    age = 0.0

    @checked
    def __init__(self, path: Path, radius: Any = None, length: str | None = None, material: Any = None):
        self.path, self._opened = path, open_grains(path)
        self._kept: tuple[int, Frame] | None = None  # the last one that was asked for, and its number
        self._given = None if material is None else as_material(material), radius, length
        found = self._read(0)
        notes = list(found.notes)
        names = [m.name for m in found.grains.materials]
        if unknown := [name for name in names if name not in PRESETS and material is None]:
            notes.append(
                f"{path}: material {', '.join(unknown)} is unknown here; it is drawn with the density of silica"
            )
        for note in notes:
            warn(note)

    def _read(self, number: int) -> Any:
        material, radius, length = self._given
        return read_frame(self.path, self._opened, radius, length, (material, _Known(), SILICA), number)

    def _frame(self, number: int) -> Frame:
        if self._kept is None or self._kept[0] != number:
            found = self._read(number)
            if found.centre is not None:  # boxes of SAND have their centre at the origin
                found.grains.arrays.position[...] -= found.centre[:, None]
            time = float(number) if found.time is None else found.time
            contacts = contacts_of(found.grains, found.box, ROUNDED)
            step = number if found.step is None else found.step
            self._kept = number, Frame(stored_frame(step, time, found.grains, found.box, contacts, exact=True))
        return self._kept[1]

    def __len__(self) -> int:
        return self._opened.frame_count

    def refresh(self) -> bool:
        """Return False: the file is read once."""
        return False

    def pairs(self, index: int) -> np.ndarray:
        """Grains in contact (C, 2) of a frame ≥ 0."""
        return self[index].pair

    def identities(self, index: int) -> np.ndarray:
        """Identities (N,) of the grains of a frame ≥ 0."""
        return self[index].id

    @cached_property
    def _heads(self) -> list[tuple[float, int, int]]:
        """Time [s], step and number of contacts of each frame."""
        return [(frame.time, frame.step, len(frame.pair)) for frame in self]

    @property
    def times(self) -> np.ndarray:
        """Time of each frame [s]."""
        return np.array([time for time, _, _ in self._heads])

    @property
    def steps(self) -> np.ndarray:
        """Step of each frame."""
        return np.array([step for _, step, _ in self._heads])

    @property
    def contacts(self) -> np.ndarray:
        """Number of contacts of each frame."""
        return np.array([contacts for _, _, contacts in self._heads])

    def close(self) -> None:
        """Do nothing: the file is open only while it is read."""
