"""Packets: arrays as the page of a run takes them, see grainview/README.md."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import BadInput
from ..io.run_folder import plain

MAGIC = b"SANDPKT1"
TYPES: dict[str, np.dtype[Any]] = {
    "f4": np.dtype("<f4"),
    "f2": np.dtype("<f2"),
    "u4": np.dtype("<u4"),
    "u1": np.dtype("u1"),
}
LARGEST_HALF = 65504.0
"""The largest number of half precision; with it as the largest of an array, nine decades below keep 11 bits."""
WHOLE_PRECISION = ("position", "radius", "mass", "charge")
"""Arrays that are never stored in half precision: a shift of 2⁻¹¹ of a box is more than a grain."""


def encode(header: Mapping[str, Any], arrays: Mapping[str, np.ndarray], compact: bool = False) -> bytes:
    """One packet.

    Parameters
    ----------
    header : Mapping[str, Any]
        what else to say; `arrays` is added to it.
    arrays : Mapping[str, ndarray]
        of floats, uint32 or uint8, in the order in which they are to be stored.
    compact : bool, optional
        floats in half precision with a scale, but for those of WHOLE_PRECISION.
    """
    listed, parts, offset = [], [], 0
    for name, array in arrays.items():
        kind, scale, stored = _stored(name, array, compact)
        entry: dict[str, Any] = {"name": name, "type": kind, "shape": list(stored.shape), "offset": offset}
        listed.append(entry if scale == 1.0 else {**entry, "scale": scale})
        parts.append(stored.tobytes())
        offset += len(parts[-1])
        parts.append(bytes(-offset % 8))
        offset += -offset % 8
    text = json.dumps(plain({**header, "arrays": listed}), allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-(len(MAGIC) + 4 + len(text)) % 8)
    return b"".join([MAGIC, len(text).to_bytes(4, "little"), text, *parts])


def _stored(name: str, array: np.ndarray, compact: bool) -> tuple[str, float, np.ndarray]:
    """Type, scale and contiguous array of a packet."""
    if array.dtype.kind != "f":
        kind = "u1" if array.dtype.itemsize == 1 else "u4"
        return kind, 1.0, np.ascontiguousarray(array, TYPES[kind])
    if not compact or name in WHOLE_PRECISION:
        with np.errstate(over="ignore"):  # what is beyond single precision is infinite there
            return "f4", 1.0, np.ascontiguousarray(array, TYPES["f4"])
    values = np.asarray(array, np.float64)
    peak = float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))
    scale = peak / LARGEST_HALF if peak > 1e-300 else 1.0
    return "f2", scale, np.ascontiguousarray(values / scale, TYPES["f2"])


def decode(packet: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Header and arrays (float64 for floats) of a packet.

    Raises
    ------
    BadInput
        it is not a packet, or cut off.
    """
    if packet[:8] != MAGIC:
        raise BadInput("this is not a packet of SAND")
    start = 12 + int.from_bytes(packet[8:12], "little")
    header = json.loads(packet[12:start])
    arrays = {}
    for entry in header["arrays"]:
        kind, shape, begin = TYPES[entry["type"]], entry["shape"], start + entry["offset"]
        length = int(np.prod(shape)) * kind.itemsize
        if begin + length > len(packet):
            raise BadInput(f"a packet is cut off in '{entry['name']}'")
        stored = np.frombuffer(packet, kind, int(np.prod(shape)), begin).reshape(shape)
        arrays[entry["name"]] = stored.astype(np.float64) * entry.get("scale", 1.0) if kind.kind == "f" else stored
    return header, arrays


def grains_packet(frame: Any, unit: float) -> bytes:
    """What stays of the grains of a frame: radius in `unit` [m], mass, material, charge.

    Raises
    ------
    BadInput
        more materials than a byte counts.
    """
    if len(frame.materials) > 256:
        raise BadInput(f"there are {len(frame.materials)} materials; the page can tell 256 apart")
    arrays = {
        "radius": frame.radius / unit,
        "mass": frame.mass,
        "material": frame.material.astype(np.uint8),
        "charge": frame.charge,
    }
    return encode({}, arrays)


def frame_packet(number: int, frame: Any, names: np.ndarray, unit: float, compact: bool = False) -> bytes:
    """A frame; `names` (N,) of the clusters its grains are in, lengths in `unit` [m]."""
    header = {
        "frame": number,
        "step": frame.step,
        "time": frame.time,
        "box": [float(length / unit) for length in frame.drawn],
    }
    arrays = {
        "position": frame.position / unit,
        "velocity": frame.velocity,
        "spin": frame.spin,
        "moment": frame.moment,
        "cluster": names.astype(np.uint32),
        "pair": frame.pair.astype(np.uint32),
        "force": frame.force,
        "share": frame.share,
        "overlap": frame.overlap,
        "formed": frame.formed,
    }
    return encode(header, arrays, compact)


def frame_bytes(grains: int, contacts: int, compact: bool = False) -> int:
    """Length of a frame's packet, about: its header is a kilobyte."""
    wide = 2 if compact else 4
    return 1000 + grains * (3 * 4 + 9 * wide + 4) + contacts * (8 + 9 * wide)
