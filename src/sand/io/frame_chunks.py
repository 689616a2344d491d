"""Frames as trajectory.gsd stores them: content of the chunks, writing and reading them, check sums.

Positions, diameters and box are in units of a reference radius (in metres they would exceed the range of float32); all
other quantities are SI. Orientations are scalar first, as in GSD.

| chunk | meaning |
|---|---|
| configuration/step, log/time | step number; true time of the frame [s] |
| log/scale/length | the reference radius [m], the mean radius of the first frame in all frames of a file |
| log/periodic | 1 for each periodic axis, 0 for an open one, whose length in the box serves drawing only |
| log/lengths | side lengths of the box as drawn, to full precision [m] |
| particles/position, diameter; configuration/box | in reference radii |
| particles/velocity, mass, charge | m/s, kg, C |
| particles/orientation | rotation parameters, scalar first |
| particles/typeid, types | materials; a name keeps its number in all frames of a file |
| particles/image | how often each grain has crossed the box along each periodic axis since the start |
| log/particles/moment, spin | A m² and rad/s, laboratory frame |
| log/particles/position, radius, velocity, mass, charge | to full precision, SI; only in files of bodies |
| bonds/group | grains in contact |
| log/particles/id | identity of each grain; absent if it is the index, as long as no grain was removed |
| log/particles/NAME | an own quantity of the user, in SI |
| log/own | names and units of the own quantities, JSON as bytes: `{"temperature": "K"}`; absent without them |
| log/particles/virial | shares of grains in the virial of contacts and walls [J], rows xx, xy, … zz; with stress |
| log/particles/at_rest | 1 for grains of clusters at rest, 0 for awake ones; only with rigid clusters |
| log/bonds/overlap, formed | δ [m] and time of formation [s] |
| log/bonds/force | force on the first grain of each contact [N] |
| log/bonds/slide, roll, twist | sliding ζ [m], rolling ξ [m] and twisting φ [rad] displacement |
| log/bonds/share | stretch, slide, roll and twist as shares of their limits |
| late/particles/id, at_rest | the same, in files whose first frame has no log/particles/id, at_rest |
| log/crc32 | checksum of step, material names and all numbers of a frame |

Vectors are in the laboratory frame.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping, Sequence
from functools import cache
from operator import attrgetter
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..basics.box import Box
from ..basics.grains import Grains
from ..basics.schema import MODES, REST

OPEN_MARGIN = 4.0
"""Length of an open axis in the box that the format requires, in diameters of the cloud of grains."""
IDENTITY, LATE = "id", "late/"
"""Name of the identities of grains, and beginning of the names of chunks that the first frame lacks."""
OWN = "own"
"""Name of the array with names and units of own quantities."""
IN_FULL = ("position", "radius", "velocity", "mass", "charge")
"""Quantities that trajectories have in single precision, and files of bodies also in double precision."""
VIRIAL = "virial"
"""Name of the shares of the grains in the virial of contacts."""
SOMETIMES = tuple(f"particles/{name}" for name in (IDENTITY, REST, VIRIAL))
"""Logged arrays of grains that not all frames have."""
UNCHANGED = ("scale/length", "periodic", "lengths")
"""Logged arrays that are left out of frames in which they are those of the first one."""


def stored_frame(
    step: int,
    time: float,
    grains: Grains,
    box: Box,
    contacts: Mapping[str, np.ndarray],
    *,
    exact: bool = False,
    at_rest: np.ndarray | None = None,
    virial: np.ndarray | None = None,
    scale: float | None = None,
    materials: Sequence[str] = (),
) -> Any:
    """Frame as GSD reads it, of grains and contacts (columns as in `ContactTable`); `exact`: also `IN_FULL` in float64.

    `at_rest` (N,): which grains belong to clusters at rest, with rigid clusters. `virial` (N, 3, 3): shares of the
    grains in the virial of contacts [J]. `scale`: reference radius [m], by
    default the mean radius. `materials`: names that come first, also without a grain, and so keep their numbers.
    """
    arrays, own = grains.arrays, [m.name for m in grains.materials]
    scale = float(arrays.radius.mean()) if scale is None else scale
    cloud = np.zeros(3)
    if None in box.lengths:
        cloud = 2.0 * np.abs(arrays.position).max(axis=1) + 2.0 * arrays.radius.max()
    lengths = [v if v is not None else OPEN_MARGIN * cloud[axis] for axis, v in enumerate(box.lengths)]
    types = list(dict.fromkeys((*materials, *own)))
    particles = SimpleNamespace(
        N=len(grains),
        types=[name.encode("unicode_escape").decode() for name in types],
        typeid=np.array([types.index(name) for name in own], np.uint32)[arrays.material],
        position=_single(arrays.position / scale),
        diameter=_single(2.0 * arrays.radius / scale),
        velocity=_single(arrays.velocity),
        mass=_single(arrays.mass),
        charge=_single(arrays.charge),
        orientation=_single(arrays.orientation[[3, 0, 1, 2]]),
        image=np.ascontiguousarray(arrays.image.T, np.int32),
    )
    pair = np.ascontiguousarray(contacts["pair"], np.uint32)
    log = {
        "time": np.array([time]),
        "scale/length": np.array([scale]),
        "periodic": np.array([v is not None for v in box.lengths], dtype=np.uint8),
        "particles/moment": arrays.moment.T.copy(),
        "particles/spin": arrays.spin.T.copy(),
        "bonds/overlap": contacts["overlap"],
        "bonds/formed": contacts["formed"],
        "bonds/force": np.ascontiguousarray(contacts["force"], np.float32),
        "lengths": np.array([*lengths, *[box.tilt] * bool(box.tilt)], dtype=np.float64),
        "bonds/slide": np.ascontiguousarray(contacts["slide_vector"], np.float32),
        "bonds/roll": np.ascontiguousarray(contacts["roll_vector"], np.float32),
        "bonds/twist": contacts["twist"].astype(np.float32),
        "bonds/share": np.array([contacts[f"{mode}_share"] for mode in MODES], np.float32).T.copy(),
    }
    if grains.own_units:
        log[OWN] = np.frombuffer(json.dumps(grains.own_units).encode(), np.uint8)
        log |= {f"particles/{name}": values.copy() for name, values in grains.own.items()}
    if arrays.id[-1] != len(grains) - 1:  # they ascend
        log[f"particles/{IDENTITY}"] = np.array(arrays.id)
    if at_rest is not None:
        log[f"particles/{REST}"] = np.array(at_rest, dtype=np.uint8)
    if virial is not None:
        log[f"particles/{VIRIAL}"] = np.ascontiguousarray(virial.reshape(-1, 9), np.float32)
    if exact:
        log |= {f"particles/{name}": np.array(getattr(grains, name), np.float64, order="C") for name in IN_FULL}
    sides = np.array([*(np.array(lengths) / scale), 0.0, box.tilt / lengths[2], 0.0], np.float32)
    frame = SimpleNamespace(
        configuration=SimpleNamespace(step=step, box=sides),
        particles=particles,
        bonds=SimpleNamespace(N=len(pair), types=["contact"], typeid=np.zeros(len(pair), np.uint32), group=pair),
        log=log,
    )
    log["crc32"] = np.array([crc32_of(frame)], dtype=np.uint32)
    return frame


def _single(values: np.ndarray) -> np.ndarray:
    """Numbers (N,) or vectors (width, N) as a frame has them: (N,) or (N, width), in single precision."""
    return np.ascontiguousarray(values.T, np.float32)


@cache
def _letters(names: tuple[str, ...]) -> np.ndarray:
    """Names as GSD stores them: rows of characters, filled up with zeros."""
    width = max(map(len, names)) + 1
    return np.array(names, (bytes, width)).view(np.int8).reshape(len(names), width)


DEFAULTS: dict[str, np.ndarray] = {
    "configuration/step": np.array([0], np.uint64),
    "configuration/box": np.array([1, 1, 1, 0, 0, 0], np.float32),
    "particles/N": np.array([0], np.uint32),
    "particles/types": np.zeros(0, np.int8),
    "particles/typeid": np.array([0], np.uint32),
    "particles/mass": np.array([1], np.float32),
    "particles/charge": np.array([0], np.float32),
    "particles/diameter": np.array([1], np.float32),
    "particles/position": np.array([0, 0, 0], np.float32),
    "particles/orientation": np.array([1, 0, 0, 0], np.float32),
    "particles/velocity": np.array([0, 0, 0], np.float32),
    "particles/image": np.array([0, 0, 0], np.int32),
    "bonds/N": np.array([0], np.uint32),
    "bonds/types": np.zeros(0, np.int8),
    "bonds/typeid": np.array([0], np.uint32),
    "bonds/group": np.array([0, 0], np.uint32),
}
"""Chunks of GSD's schema that frames have, with the values of one grain or contact that readers assume without them.

Names of types have a default, too, but a first frame has them all the same, see `read_materials`.
"""
_DEFAULTS = {
    name: (attrgetter(name.replace("/", ".")), value.dtype, value.tobytes()) for name, value in DEFAULTS.items()
}


def append_frame(file: Any, frame: Any, first: dict[str, bytes]) -> None:
    """Append a frame to an open GSD file; `first`: of `first_chunks`, filled in when this is the first frame.

    A chunk is left out, as by gsd.hoomd, where readers find the same bytes without it: those of the first frame or, if
    that has no such chunk, the default; of logged arrays only `UNCHANGED`. GSD reads no logged array that the first
    frame lacks: identities and what is at rest that appear later are chunks of names that begin with `LATE`.
    """
    is_first, write = not first, file.file.write_chunk
    for name, (value_in, dtype, default) in _DEFAULTS.items():
        value = value_in(frame)
        chunk = _letters(tuple(value)) if name.endswith("/types") else np.array(value, dtype, copy=None, ndmin=1)
        content = chunk.tobytes()
        if content == (default * (len(content) // len(default)) if default and name not in first else first.get(name)):
            continue
        write(name, chunk)
        if is_first:
            first[name] = content
    for name, values in frame.log.items():
        known = first.get(f"log/{name}")
        if name in UNCHANGED and known == values.tobytes():
            continue
        write(f"{LATE if name in SOMETIMES and known is None and not is_first else 'log/'}{name}", values)
        if is_first and name in (*UNCHANGED, *SOMETIMES):
            first[f"log/{name}"] = values.tobytes()
    file.file.end_frame()
    if is_first:
        file.flush()


def first_chunks(file: Any) -> dict[str, bytes]:
    """Bytes of the chunks of the first frame that `append_frame` compares with; empty if there is no frame."""
    names = [*_DEFAULTS, *(f"log/{name}" for name in (*UNCHANGED, *SOMETIMES))]
    return {name: file.file.read_chunk(0, name).tobytes() for name in names if file.file.chunk_exists(0, name)}


def read_number(file: Any, frame: int, chunk: str) -> int:
    """An integer of a frame; GSD omits values equal to those of the first frame, and zeros in the first."""
    at = next((k for k in (frame, 0) if file.chunk_exists(k, chunk)), None)
    return 0 if at is None else int(file.read_chunk(at, chunk)[0])


_GROUPS = ("angles", "dihedrals", "impropers", "constraints", "pairs")
OF_OTHERS = {"particles/N": "particles/position", **{f"{name}/N": f"{name}/group" for name in ("bonds", *_GROUPS)}}
OF_SAND = OF_OTHERS | {"particles/N": "log/particles/moment", "bonds/N": "log/bonds/overlap"}
"""Arrays by the chunk with their number of rows, in files of other programs and of SAND."""


def read_snapshot(file: Any, number: int, arrays: Mapping[str, str]) -> Any:
    """A frame as gsd.hoomd reads it, after a check of its numbers: it fills arrays that a frame lacks to any length.

    Raises
    ------
    ValueError
        If a number is not that of the rows of its array in `arrays`, of this frame or the first.
    """
    for chunk, array in arrays.items():
        count = read_number(file.file, number, chunk)
        at = next((k for k in (number, 0) if file.file.chunk_exists(k, array)), None)
        rows = min(count, 1) if at is None else len(file.file.read_chunk(at, array))
        if rows != count:
            raise ValueError(f"{chunk} is {count}, but {array} has {rows} rows")
    return file[number]


def read_stored(file: Any, number: int) -> Any:
    """A frame as it was given to `append_frame`.  Raises ValueError, or an exception of the reader, if it is broken."""
    stored = read_snapshot(file, number, OF_SAND)
    for name in SOMETIMES:
        if file.file.chunk_exists(number, LATE + name):
            stored.log[name] = file.file.read_chunk(number, LATE + name)
        elif name in stored.log and not file.file.chunk_exists(number, f"log/{name}"):
            del stored.log[name]  # of the first frame
    return stored


def read_materials(file: Any, count: int) -> list[str]:
    """Names of the materials of the first `count` frames of a GSD file, in the order in which they first appear.

    Raises BadInput, or an exception of the reader, for a broken file.
    """
    names: dict[str, None] = {}
    for number in range(count):
        if file.file.chunk_exists(number, "particles/types"):  # absent where they are those of the first frame
            rows = file.file.read_chunk(number, "particles/types")
            names |= dict.fromkeys(material_name(row.tobytes().split(b"\0")[0].decode()) for row in rows)
    return list(names)


def material_name(stored: str) -> str:
    """Name of a material as it was before `unicode_escape`, which makes it ASCII."""
    return stored.encode().decode("unicode_escape")


def read_identities(file: Any, number: int, count: int) -> np.ndarray:
    """Identities (N,) of the grains of a frame with N = `count` grains."""
    for name in (f"{LATE}particles/{IDENTITY}", f"log/particles/{IDENTITY}"):
        if file.file.chunk_exists(number, name):
            return np.asarray(file.file.read_chunk(number, name))
    return np.arange(count, dtype=np.uint32)


def code_of(stored: Any) -> int:
    """The stored checksum of a frame.  Raises ValueError if there is none."""
    if "crc32" not in stored.log:
        raise ValueError("it has no checksum: another program or a development version of SAND wrote it")
    return int(stored.log["crc32"][-1])


def crc32_of(stored: Any) -> int:
    """CRC-32 of step, material names and all numbers of a frame as stored."""
    p = stored.particles
    code = zlib.crc32(f"{int(stored.configuration.step)} {list(p.types)}".encode())
    single = (p.position, p.diameter, p.velocity, p.mass, p.charge, p.orientation)
    parts = [np.asarray(part, np.float32) for part in single]
    parts += [np.asarray(part, np.uint32) for part in (p.typeid, stored.bonds.group)]
    parts += [stored.log[name] for name in sorted(stored.log) if name != "crc32"]
    if np.any(p.image):  # earlier versions did not count crossings
        parts.append(np.asarray(p.image, np.int32))
    with np.errstate(invalid="ignore"):  # a damaged file may hold any bits
        for part in parts:
            # + 0 makes −0 and 0 equal, which GSD does not distinguish
            content: Any = np.ascontiguousarray(part + 0.0 if part.dtype.kind == "f" else part)
            code = zlib.crc32(content, code)
    return code
