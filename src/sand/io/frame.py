"""Frames of trajectory.gsd in SI units, and sequences of frames; `frame_chunks` has the stored form."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, overload

import numpy as np

from ..basics.box import Box
from ..basics.errors import BadInput, NoSuchAttribute, did_you_mean, shown
from ..basics.own_quantities import OwnQuantities
from ..basics.schema import REST
from ..basics.units import format_quantity
from ..basics.virial import virials_of_frame
from .frame_chunks import IDENTITY, IN_FULL, OWN, VIRIAL, code_of, crc32_of, material_name


class Frame:
    """One stored frame in SI units, with arrays (N, …) named as the quantities of grains.

    `material` (N,) holds indices into the names `materials`; `id` (N,) is the identity of each grain, which stays when
    others are removed; `image` (N, 3) counts how often it has crossed the periodic box since the start of the run, and
    `unwrapped` (N, 3) are the positions without these jumps. `own` are the own quantities (N,) by name, also
    attributes: `frame.temperature`. `at_rest` (N,), True for grains of clusters at rest, single grains included, is
    None without `sand.RigidClusters`; `stored_virial` (N, 9) of `virial` is None in runs without stress. Arrays of
    contacts: `pair` (C, 2), `overlap` [m], `formed` [s], `twist` [rad]
    (C,), `force` [N], `slide`, `roll` [m] (C, 3), and `share` (C, 4) with columns `MODES`.
    """

    def __init__(self, stored: Any):
        if code_of(stored) != crc32_of(stored):
            raise ValueError("its checksum is wrong")
        self.step = int(stored.configuration.step)
        self.time = float(stored.log["time"][0])
        scale = float(stored.log["scale/length"][0])
        p = stored.particles
        single = {"position": np.asarray(p.position, np.float64) * scale}
        single |= {"radius": 0.5 * np.asarray(p.diameter, np.float64) * scale}
        single |= {"velocity": p.velocity, "mass": p.mass, "charge": p.charge}
        self.position, self.radius, self.velocity, self.mass, self.charge = (
            np.array(stored.log.get(f"particles/{name}", single[name])) for name in IN_FULL
        )
        self.image = np.asarray(p.image)
        self.id = np.asarray(stored.log.get(f"particles/{IDENTITY}", np.arange(p.N)), np.uint32)
        # before own quantities had names, the only one was this temperature
        before = {"internal_temperature": "K"} if "particles/internal_temperature" in stored.log else {}
        units = json.loads(stored.log[OWN].tobytes()) if OWN in stored.log else before
        self.own = OwnQuantities({name: stored.log[f"particles/{name}"] for name in units}, units)
        rest = stored.log.get(f"particles/{REST}")
        self.at_rest = None if rest is None else np.asarray(rest) == 1
        self.stored_virial = stored.log.get(f"particles/{VIRIAL}")
        self.materials, self.material = [material_name(name) for name in p.types], np.asarray(p.typeid)
        self.moment, self.spin = stored.log["particles/moment"], stored.log["particles/spin"]
        self.orientation = np.roll(np.asarray(p.orientation), -1, axis=1)
        self.pair = np.asarray(stored.bonds.group).reshape(-1, 2)
        self.overlap, self.formed, self.force, self.slide, self.roll, self.twist, self.share = (
            np.asarray(stored.log[f"bonds/{name}"], np.float64)
            for name in ("overlap", "formed", "force", "slide", "roll", "twist", "share")
        )
        periodic, lengths = stored.log["periodic"].astype(bool), stored.log["lengths"]
        x, y, z = (float(v) if on else None for v, on in zip(lengths[:3], periodic, strict=True))
        self.box = Box((x, y, z), float(lengths[3]) if len(lengths) > 3 else 0.0)  # the tilt, of a tilted box
        self.drawn = tuple(float(v) for v in lengths[:3])
        """Side lengths of the box as drawn [m], open axes included."""

    def __getattr__(self, name: str) -> np.ndarray:
        """Values of an own quantity."""
        own = self.__dict__.get("own", {})
        if name not in own:
            raise NoSuchAttribute(f"a frame has no '{name}'; {did_you_mean(name, (*vars(self), *own))}")
        return own[name]

    @property
    def unwrapped(self) -> np.ndarray:
        """Positions (N, 3) [m] that jump at no periodic boundary, for displacements: position + image × length."""
        return self.position + self.box.shift(self.image)

    @property
    def virial(self) -> np.ndarray:
        """Share (N, 3, 3) [J] of each grain in the virial of contacts, as `Simulation.at_grains` has it.

        From the contacts of grains in the frame; of runs with `stress = true` also from contacts with walls.
        """
        if self.stored_virial is None:
            return virials_of_frame(self)
        return np.asarray(self.stored_virial, np.float64).reshape(-1, 3, 3)

    def __len__(self) -> int:
        """Number of grains."""
        return len(self.radius)

    def __repr__(self) -> str:
        when = f"t = {format_quantity(self.time, 's')}, step {self.step}"
        return f"<frame at {when}: {len(self)} grains, {len(self.pair)} contacts>"


OF_GRAINS = (
    *("position", "velocity", "spin", "moment", "orientation", "radius", "mass", "charge"),
    *("material", "image", REST, VIRIAL),
)
OF_CONTACTS = ("pair", "overlap", "formed", "force", "slide", "roll", "twist", "share")


class FrameArrays(Sequence[np.ndarray]):
    """One array of each frame of a sequence of frames; a frame is read when its array is asked for.

    `arrays[3]` is the array of one frame, `arrays[-10:]` again such a sequence, and `arrays[-10:, 5]` an array of the
    entries 5 of ten frames. `np.asarray(arrays)` reads all frames.

    Parameters
    ----------
    frames : FrameSequence
        The frames.
    name : str
        Name of an array of `Frame`.
    chosen : range or None, optional
        Indices of the frames, by default all.
    """

    def __init__(self, frames: FrameSequence, name: str, chosen: range | None = None):
        if not isinstance(name, str) or not frames.has_array(name):
            known = (*OF_GRAINS, *OF_CONTACTS, *frames.own_units)
            raise BadInput(f"frames have no array {shown(name)}; {did_you_mean(shown(name), known)}")
        self.frames, self.name = frames, name
        self.chosen = range(len(frames)) if chosen is None else chosen

    def __len__(self) -> int:
        return len(self.chosen)

    @overload
    def __getitem__(self, index: int) -> np.ndarray: ...
    @overload
    def __getitem__(self, index: slice) -> FrameArrays: ...
    @overload
    def __getitem__(self, index: tuple[Any, ...]) -> np.ndarray: ...

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, tuple):
            first, *rest = index
            if isinstance(first, slice):
                return self._stacked([self._of(number)[tuple(rest)] for number in self.chosen[first]])
            return self[first][tuple(rest)]
        if isinstance(index, slice):
            return FrameArrays(self.frames, self.name, self.chosen[index])
        if not isinstance(index, (int, np.integer)) or not -len(self) <= index < len(self):
            raise NoSuchFrame(f"{self.name}[{shown(index)}]: there are {len(self)} frames, from 0 to {len(self) - 1}")
        return self._of(self.chosen[int(index)])

    def _of(self, number: int) -> np.ndarray:
        found = getattr(self.frames[number], self.name)
        if found is None:
            raise BadInput(f"{self.name}: frame {number} of {self.frames.path} has none; runs with rigid clusters do")
        return np.asarray(found)

    def _stacked(self, arrays: list[np.ndarray]) -> np.ndarray:
        if len({array.shape for array in arrays}) > 1:
            raise BadInput(f"{self.name}: frames differ in the number of entries; take them one by one")
        return np.array(arrays)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """All arrays as one, (frames, …)."""
        return self._stacked(list(self)).astype(dtype, copy=False)

    def __repr__(self) -> str:
        return f"<{self.name} of {len(self)} frames, read on access>"


class NoSuchFrame(BadInput, IndexError):
    """The requested frame does not exist; an IndexError, so that loops over frames end."""


class FrameSequence(Sequence[Frame]):
    """Frames of a file at `path`, by index or slice; subclasses define `__len__` and `_frame`."""

    path: Path
    steps: Any
    """Step of each frame (K,)."""

    @abstractmethod
    def _frame(self, number: int) -> Frame:
        """Read a frame, from 0 to the last.  Raises BadInput if it is incomplete."""

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...

    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        if not isinstance(index, (int, np.integer)) or isinstance(index, np.timedelta64):
            raise NoSuchFrame(f"frame {shown(index)} must be a whole number, from 0 to {len(self) - 1}")
        if not -len(self) <= index < len(self):
            raise NoSuchFrame(
                f"{self.path} has {len(self)} frames, from 0 to {len(self) - 1}; there is no {shown(index)}"
            )
        return self._frame(index % len(self))

    def material_names(self) -> list[str]:
        """Names of the materials of all frames, in the order in which they first appear; reads all frames."""
        return list(dict.fromkeys(name for frame in self for name in frame.materials))

    @property
    def own_units(self) -> dict[str, str]:
        """Units of the own quantities by name, those of the first frame."""
        return self[0].own.units if len(self) else {}

    def has_array(self, name: Any) -> bool:
        """Whether the frames have an array of this name; reads the first frame if it may be an own quantity."""
        return name in (*OF_GRAINS, *OF_CONTACTS) or name in self.own_units

    def arrays(self, name: str) -> FrameArrays:
        """One array of each frame, such as "position", read on access; also as `frames.position`.  Raises BadInput."""
        return FrameArrays(self, name)

    def __getattr__(self, name: str) -> FrameArrays:
        if name[0] == "_" or not self.has_array(name):
            known = [*OF_GRAINS, *OF_CONTACTS, *self.own_units, *(known for known in dir(self) if known[0] != "_")]
            raise NoSuchAttribute(f"frames have no '{name}'; {did_you_mean(name, known)}")
        return FrameArrays(self, name)
