"""Initial conditions from a frame of a trajectory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.box import Box
from ..basics.errors import BadInput, did_you_mean, refuse_other
from ..basics.grains import Grains
from ..basics.initial_pairs import StrainedContacts
from ..basics.material import Material, as_material
from ..basics.units import format_quantity
from ..io.bodies import SINGLE_PRECISION
from .overlap_fit import APART, ITERATIONS, deficit, least_shift, overlapping, scaled_box


class Start(NamedTuple):
    """Arguments of a `Simulation`: `grains`, `contacts` and `box`."""

    grains: Grains
    contacts: StrainedContacts | None
    box: Box
    note: str  # origin and corrections


@checked
def from_frame(frame: Any, materials: Mapping[str, Material]) -> Start:
    """Restore grains and contacts from one frame of `sand.open(DIR).frames`.

    A frame holds positions in single precision but overlaps in double precision. Positions are corrected by the
    smallest displacements that restore the overlap of each contact and separate all other pairs; no contact is formed
    or broken.

    Parameters
    ----------
    frame : Frame
        A `sand.io.trajectory.Frame`.
    materials : mapping of str to Material
        Materials of the run by name.

    Returns
    -------
    Start
        Grains, contacts and box, and a note on their origin.

    Raises
    ------
    BadInput
        If a material is unknown, or the overlaps do not fit the positions.
    """
    refuse_other(frame, "materials", "pair", "overlap", "position")
    materials = dict(materials)  # exact names: case counts in what SAND has written
    if unknown := [name for name in frame.materials if name not in materials]:
        raise BadInput(
            f"the frame has grains of the unknown material '{unknown[0]}'; define it in "
            f"[materials.{unknown[0]}]; {did_you_mean(unknown[0], list(materials))}"
        )
    for name in dict.fromkeys(frame.materials):
        as_material(materials[name])
    for name in ("position", "velocity", "spin", "moment", "overlap"):
        if not np.isfinite(getattr(frame, name)).all():
            raise BadInput(f"step {frame.step}: {name} has values that are not finite; use an earlier frame")
    pair = np.asarray(frame.pair, dtype=np.int64)
    position = restore_overlaps(frame.position, frame.radius, frame.box, pair, frame.overlap)
    kinds = [materials[frame.materials[k]] for k in frame.material]
    nominal = Grains(position, frame.radius, kinds).mass
    rounded = np.abs(frame.mass - nominal) <= 8.0 * SINGLE_PRECISION * nominal
    grains = Grains(
        position,
        frame.radius,
        kinds,
        velocity=frame.velocity,
        spin=frame.spin,
        moment=frame.moment,
        charge=frame.charge,
        own=frame.own,
        mass=np.where(rounded, nominal, frame.mass),
    )
    moved = float(np.abs(frame.box.nearest(position - frame.position)).max())
    kept = f"{len(pair)} contact{'s' * (len(pair) != 1)} kept"
    bonds = StrainedContacts(pair, frame.slide, frame.roll, frame.twist)
    note = f"step {frame.step}, {format_quantity(frame.time, 's')}, of an earlier run; {kept}"
    if moved > 0.0:
        note += f", positions corrected by at most {moved:.2g} m to restore the overlaps"
    return Start(grains, bonds, frame.box, note)


def restore_overlaps(
    position: np.ndarray, radius: np.ndarray, box: Box, pair: np.ndarray, overlap: np.ndarray
) -> np.ndarray:
    """Correct positions so that each of the given pairs has its overlap and no other pair touches.

    Newton iteration; each step takes the least-squares smallest displacements that satisfy all linearised conditions.

    Parameters
    ----------
    position, radius : ndarray
        (N, 3) and (N,) [m].
    box : Box
        Boundary conditions.
    pair, overlap : ndarray
        (C, 2) and (C,) [m] of the contacts.

    Returns
    -------
    ndarray
        Positions (N, 3) [m].

    Raises
    ------
    BadInput
        If there are no such positions within 1e-3 of a radius.
    """
    unit = float(radius.mean())
    initial, size = position / unit, radius / unit
    x, known = initial, {tuple(sorted(p)) for p in pair.tolist()}
    spurious = np.zeros((0, 2), dtype=np.int64)  # pairs without a contact that overlap because of single precision
    scaled = scaled_box(box, unit)
    rounding = float(np.abs(initial).max())
    tolerance = 64.0 * np.finfo(float).eps * max(1.0, rounding)
    target = size[pair].sum(axis=1) - overlap / unit
    for _ in range(ITERATIONS):
        touching = [p for p in overlapping(x, size, scaled) if tuple(sorted(p)) not in known]
        known |= {tuple(sorted(p)) for p in touching}
        spurious = np.concatenate([spurious, np.array(touching, dtype=np.int64).reshape(-1, 2)])
        constrained = np.concatenate([pair, spurious])
        lacking, n = deficit(x, constrained, np.concatenate([target, size[spurious].sum(axis=1)]), scaled)
        free = np.arange(len(constrained)) >= len(pair)
        # pairs without a contact are separated only if they overlap, with a small gap
        lacking = np.where(free, np.where(lacking >= 0.0, lacking + max(APART, 4.0 * tolerance), 0.0), lacking)
        if not len(constrained) or np.abs(lacking).max() <= tolerance:
            break
        use = ~free | (lacking > 0.0)
        x = x + least_shift(constrained[use], n[use], lacking[use], len(x))
    else:
        i, j = constrained[int(np.abs(lacking).argmax())]
        raise BadInput(f"the overlap of grains {i} and {j} does not fit their positions; the frame is damaged")
    if np.abs(x - initial).max() > max(1e-3, 64.0 * SINGLE_PRECISION * rounding):
        raise BadInput("the overlaps of the frame do not fit its positions; it is damaged, or not from SAND")
    # positions that need no correction keep their bits
    return np.where(x == initial, position, x * unit)
