"""A frame of a trajectory as a new start."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..arguments import checked
from ..box import Box
from ..errors import BadInput, did_you_mean, refuse_other
from ..grains import Grains
from ..material import Material
from ..units import format_quantity

APART = 1e-9
"""Gap that pairs which do not touch get, if single precision has brought them to overlap, in their mean radius."""
ROUNDS = 30
SINGLE = 6e-8
"""Rounding of single precision; diameters and masses are kept in it."""


class Bonds(NamedTuple):
    """Contacts at the start of a simulation, with what they remember; laboratory frame.

    Grains that overlap are in contact anyway, unstrained; this is for stretched and for strained contacts.
    """

    pair: np.ndarray  # (C, 2) grains
    slide: np.ndarray  # (C, 3) sliding displacement ζ [m]
    roll: np.ndarray  # (C, 3) rolling displacement ξ [m]
    twist: np.ndarray  # (C,) twisting angle φ [rad]


class Start(NamedTuple):
    """Give `grains` and `contacts` to a Simulation, with `box`."""

    grains: Grains
    contacts: Bonds | None
    box: Box
    note: str  # where they came from, and what was done to them


@checked
def from_frame(frame: Any, materials: Mapping[str, Material]) -> Start:
    """Grains and contacts of one frame, as `sand.open(DIR).frames` gives it.

    A frame holds positions in single precision, overlaps in double: positions are moved by as little as gives each
    contact its overlap again and keeps apart what does not touch.  No contact is made or broken by that.

    Parameters
    ----------
    frame
        a `sand.io.trajectory.Frame`.
    materials : Mapping[str, Material]
        those of the run by name.

    Raises
    ------
    BadInput
        an unknown material, or overlaps that do not fit the positions.
    """
    refuse_other(frame, "materials", "pair", "overlap", "position")
    if unknown := [name for name in frame.materials if name not in materials]:
        raise BadInput(
            f"the frame has grains of '{unknown[0]}', which is no known material; describe it in "
            f"[materials.{unknown[0]}]; {did_you_mean(unknown[0], list(materials))}"
        )
    for name in ("position", "velocity", "spin", "moment", "overlap"):
        if not np.isfinite(getattr(frame, name)).all():
            raise BadInput(f"step {frame.step}: {name} has numbers that are not finite; take an earlier frame")
    pair = np.asarray(frame.pair, dtype=np.int64)
    position = healed(frame.position, frame.radius, frame.box, pair, frame.overlap)
    blank = Grains(position, frame.radius, [materials[frame.materials[k]] for k in frame.material])
    rounded = np.abs(frame.mass - blank.mass) <= 8.0 * SINGLE * blank.mass
    grains = Grains(
        position,
        frame.radius,
        [materials[frame.materials[k]] for k in frame.material],
        velocity=frame.velocity,
        spin=frame.spin,
        moment=frame.moment,
        charge=frame.charge,
        mass=np.where(rounded, blank.mass, frame.mass),
    )
    moved = float(np.abs(frame.box.nearest(position - frame.position)).max())
    kept = f"{len(pair)} contact{'s' * (len(pair) != 1)} kept"
    known = not np.isnan(frame.twist).any()
    if len(pair) and not known:
        kept += " unstrained, because the file does not say how they were strained"
    bonds = Bonds(pair, *(np.nan_to_num(given) for given in (frame.slide, frame.roll, frame.twist)))
    note = f"step {frame.step}, {format_quantity(frame.time, 's')}, of an earlier run; {kept}"
    if moved > 0.0:
        note += f", grains moved by at most {moved:.2g} m to give them the overlaps they had"
    return Start(grains, bonds, frame.box, note)


def healed(position: np.ndarray, radius: np.ndarray, box: Box, pair: np.ndarray, overlap: np.ndarray) -> np.ndarray:
    """Positions (N, 3) [m] next to the given ones, where each of these pairs has its overlap and no other touches.

    Newton's method; each round takes the smallest displacement, in the sense of least squares, that mends all pairs.

    Parameters
    ----------
    pair, overlap : ndarray
        (C, 2) and (C,) [m] of the contacts.

    Raises
    ------
    BadInput
        there are no such positions within 1e-3 of a radius.
    """
    unit = float(radius.mean())
    begun, size = position / unit, radius / unit
    place, known = begun, {tuple(sorted(p)) for p in pair.tolist()}
    apart_by = np.zeros((0, 2), dtype=np.int64)  # pairs that single precision brought to touch
    room = Box(tuple(None if v is None else v / unit for v in box.lengths))  # type: ignore[arg-type]
    rounding = float(np.abs(begun).max())
    tolerance = 64.0 * np.finfo(float).eps * max(1.0, rounding)
    wanted = size[pair].sum(axis=1) - overlap / unit
    for _ in range(ROUNDS):
        touching = [p for p in _overlapping(place, size, room) if tuple(sorted(p)) not in known]
        known |= {tuple(sorted(p)) for p in touching}
        apart_by = np.concatenate([apart_by, np.array(touching, dtype=np.int64).reshape(-1, 2)])
        held = np.concatenate([pair, apart_by])
        lacking, n = _lacking(place, held, np.concatenate([wanted, size[apart_by].sum(axis=1)]), room)
        free = np.arange(len(held)) >= len(pair)
        # of what must not touch, only what does is pushed, and a hair further than needed
        lacking = np.where(free, np.where(lacking >= 0.0, lacking + max(APART, 4.0 * tolerance), 0.0), lacking)
        if not len(held) or np.abs(lacking).max() <= tolerance:
            break
        use = ~free | (lacking > 0.0)
        place = place + _least_shift(held[use], n[use], lacking[use], len(place))
    else:
        i, j = held[int(np.abs(lacking).argmax())]
        raise BadInput(f"the overlap of grains {i} and {j} does not fit their positions; the frame is damaged")
    if np.abs(place - begun).max() > max(1e-3, 64.0 * SINGLE * rounding):
        raise BadInput("the overlaps of the frame do not fit its positions; it is damaged, or not of SAND")
    # what needs no mending is not to be rounded either
    return np.where(place == begun, position, place * unit)


def _lacking(place: np.ndarray, pair: np.ndarray, wanted: np.ndarray, box: Box) -> tuple[np.ndarray, np.ndarray]:
    """What each pair's distance (C,) lacks, and its direction (C, 3)."""
    apart = box.nearest(place[pair[:, 0]] - place[pair[:, 1]])
    distance = np.linalg.norm(apart, axis=1)
    return wanted - distance, apart / distance[:, None]


def _overlapping(place: np.ndarray, size: np.ndarray, box: Box) -> list[tuple[int, int]]:
    """Pairs of spheres that touch."""
    pairs = box.close_pairs(place, 2.0 * float(size.max()))
    apart = np.linalg.norm(box.nearest(place[pairs[:, 0]] - place[pairs[:, 1]]), axis=1)
    return [(int(i), int(j)) for i, j in pairs[apart <= size[pairs].sum(axis=1)]]


def _least_shift(pair: np.ndarray, n: np.ndarray, lacking: np.ndarray, count: int) -> np.ndarray:
    """The smallest displacements (N, 3) that lengthen each distance by what it lacks, to first order."""
    from scipy.sparse import csr_array
    from scipy.sparse.linalg import lsqr

    rows = np.repeat(np.arange(len(pair)), 6)
    columns = (3 * pair[:, :, None] + np.arange(3)).reshape(-1)
    jacobian = csr_array((np.stack([n, -n], axis=1).reshape(-1), (rows, columns)), shape=(len(pair), 3 * count))
    return lsqr(jacobian, lacking, atol=1e-12, btol=1e-12)[0].reshape(count, 3)
