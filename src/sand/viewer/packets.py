"""Binary packets of arrays for the viewer page (format: grainview/README.md)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..analysis.quantities import measured
from ..basics.errors import BadInput
from ..basics.schema import REST
from ..io.run_folder import plain

MAGIC = b"SANDPKT1"
TYPES: dict[str, np.dtype[Any]] = {
    "f4": np.dtype("<f4"),
    "f2": np.dtype("<f2"),
    "u4": np.dtype("<u4"),
    "u1": np.dtype("u1"),
}
HALF_MAX = 65504.0
"""Largest number in half precision; arrays scaled to it keep 11 bits over the nine decades below their maximum."""
SINGLE_PRECISION = ("position", "radius", "mass", "charge")
"""Arrays that are never stored in half precision: 2⁻¹¹ of a box is more than a grain."""
OWN = "own/"
"""Beginning of the names of own quantities, also in single precision: 2⁻¹¹ of 300 K may be all that varies."""


def compact_json(content: Mapping[str, Any]) -> str:
    """JSON without spaces; NaN and infinities become null."""
    return json.dumps(plain(content), allow_nan=False, separators=(",", ":"))


def encode(header: Mapping[str, Any], arrays: Mapping[str, np.ndarray], compact: bool = False) -> bytes:
    """Encode a header and arrays as one packet.

    Parameters
    ----------
    header : Mapping[str, Any]
        Entries of the JSON header; `arrays` is added to them.
    arrays : Mapping[str, ndarray]
        Arrays of floats, uint32 or uint8 by name, in the order in which they are stored.
    compact : bool, optional
        Store floats in half precision with a scale, except those in SINGLE_PRECISION.

    Returns
    -------
    bytes
        The packet.
    """
    entries, parts, offset = [], [], 0
    for name, array in arrays.items():
        kind, scale, stored = _converted(name, array, compact)
        entry: dict[str, Any] = {"name": name, "type": kind, "shape": list(stored.shape), "offset": offset}
        entries.append(entry if scale == 1.0 else {**entry, "scale": scale})
        parts.append(stored.tobytes())
        offset += len(parts[-1])
        parts.append(bytes(-offset % 8))
        offset += -offset % 8
    text = compact_json({**header, "arrays": entries}).encode()
    text += b" " * (-(len(MAGIC) + 4 + len(text)) % 8)
    return b"".join([MAGIC, len(text).to_bytes(4, "little"), text, *parts])


def _converted(name: str, array: np.ndarray, compact: bool) -> tuple[str, float, np.ndarray]:
    """Type, scale and contiguous array as stored in a packet."""
    if array.dtype.kind != "f":
        kind = "u1" if array.dtype.itemsize == 1 else "u4"
        return kind, 1.0, np.ascontiguousarray(array, TYPES[kind])
    if not compact or name in SINGLE_PRECISION or name.startswith(OWN):
        with np.errstate(over="ignore"):  # values beyond single precision become infinite
            return "f4", 1.0, np.ascontiguousarray(array, TYPES["f4"])
    values = np.asarray(array, np.float64)
    peak = float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))
    scale = peak / HALF_MAX if peak > 1e-300 else 1.0
    return "f2", scale, np.ascontiguousarray(values / scale, TYPES["f2"])


def grains_packet(frame: Any, unit: float) -> bytes:
    """Packet of the grain properties that do not change: radius, mass and material.

    Parameters
    ----------
    frame : Frame
        Any frame of the run.
    unit : float
        Unit of lengths [m].

    Raises
    ------
    BadInput
        If there are more than 256 materials, the limit of the uint8 index.
    """
    if len(frame.materials) > 256:
        raise BadInput(f"the run has {len(frame.materials)} materials; the viewer supports at most 256")
    arrays = {"radius": frame.radius / unit, "mass": frame.mass, "material": frame.material.astype(np.uint8)}
    return encode({}, arrays)


def frame_packet(number: int, frame: Any, names: np.ndarray, unit: float, compact: bool = False) -> bytes:
    """Packet of one frame.

    Parameters
    ----------
    number : int
        Number of the frame on the page.
    frame : Frame
        The frame.
    names : ndarray
        (N,) name of the cluster of each grain.
    unit : float
        Unit of positions and box lengths [m].
    compact : bool, optional
        Half precision, see `encode`.
    """
    header = {
        "frame": number,
        "step": frame.step,
        "time": frame.time,
        "box": [float(length / unit) for length in frame.drawn],
        **({"tilt": frame.box.tilt / unit} if frame.box.tilt else {}),
    }
    arrays = {
        "position": frame.position / unit,
        **{name: getattr(frame, name) for name in ("velocity", "spin", "moment")},
        "cluster": names.astype(np.uint32),
        **({"charge": frame.charge} if np.any(frame.charge) else {}),
        **{f"{OWN}{name}": values for name, values in frame.own.items()},
        **({} if getattr(frame, "stored_virial", None) is None else {"pressure": measured(frame, "pressure")}),
        **({} if getattr(frame, REST, None) is None else {REST: np.asarray(frame.at_rest, np.uint8)}),
        "pair": frame.pair.astype(np.uint32),
        **{name: getattr(frame, name) for name in ("force", "share", "overlap", "formed")},
    }
    return encode(header, arrays, compact)


def frame_bytes(grains: int, contacts: int, compact: bool = False, own: int = 0) -> int:
    """Approximate size of a frame packet [bytes] with a number of own quantities, and a header of 1 kB."""
    width = 2 if compact else 4
    return 1000 + grains * (3 * 4 + 9 * width + 4 + 4 * own) + contacts * (8 + 9 * width)
