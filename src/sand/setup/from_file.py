"""Initial conditions from files: bodies, gases of other programs, and frames of trajectories."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..basics.box import Box
from ..basics.clusters import closes_through_boundary, in_one_piece
from ..basics.errors import BadInput, warn
from ..basics.grains import Grains
from ..basics.initial_pairs import StrainedContacts
from ..basics.material import Material
from ..basics.paths import user_path
from ..basics.units import format_quantity
from ..io.run_folder import TRAJECTORY
from .checks import ROUNDING, largest_cluster, pairs_in_contact, refuse_excess, refuse_pieces
from .from_frame import Start, from_frame, restore_overlaps
from .overlap_fit import fit_overlaps

if TYPE_CHECKING:
    from ..io.bodies import ReadGrains

EXACT = 1e-6
"""Largest difference of an overlap from that of equilibrium, relative to it, that is left as it is."""


def is_own_trajectory(path: str | Path) -> bool:
    """Whether this is the folder of a run, or a trajectory of SAND, whose contacts and box are known.

    Raises
    ------
    BadInput
        If it is a damaged trajectory.
    """
    from ..io.grain_files import is_gsd  # loads gsd, which few simulations need
    from ..io.trajectory import Frames

    file = Path(path)
    if file.is_dir() or not is_gsd(file):
        return file.is_dir() or file.suffix == ".gsd"  # a damaged one is refused when it is read
    with contextlib.closing(Frames(file)) as frames:
        return frames.written_by_sand or not len(frames)


def body_from_file(path: str | Path, *arguments: Any, **named: Any) -> Grains:
    """Read a body that is in one piece; parameters as for `io.bodies.read_grains`.

    A body that the periodic box of its file cuts is made whole. Contacts of rounded coordinates are put at rest, with a
    note. The centre of mass is at the origin and at rest; velocities relative to it, and spins, are those of the file.

    Raises
    ------
    BadInput
        As `read_grains`; also for grains that overlap by more than a simulation allows at its start, and for grains
        without a contact to the rest. The first ten are named.
    """
    from ..io.bodies import centred, read_grains

    found = read_grains(path, *arguments, **named)
    _tell(found.notes)  # they tell how the file is understood, also if it is refused
    grains, pairs, notes = _at_rest(found, str(path))
    refuse_pieces(grains, pairs, found.box, str(path))
    if not found.box.is_open:
        make_whole(grains, pairs, found.box, str(path))
    mean = np.average(grains.velocity, axis=0, weights=grains.mass)
    if np.linalg.norm(mean) > EXACT * float(np.linalg.norm(grains.velocity, axis=1).max()):
        speed = format_quantity(float(np.linalg.norm(mean)), "m/s")
        notes.append(
            f"{path}: velocities are used relative to that of the centre of mass, which is {speed} in the file"
        )
    grains.arrays.velocity[...] -= mean[:, None]
    _tell(notes)
    return centred(grains)


def start_from_file(path: str | Path, box: Box | None, *arguments: Any, **named: Any) -> Start:
    """Grains of a file that is no trajectory of SAND as a new start: free grains, bodies, or both.

    Contacts of rounded coordinates are put at rest, with a note.

    Parameters
    ----------
    box : Box or None
        The box of the simulation; None for the one that the file states. In another box, clusters that the faces of the
        file's box cut are made whole.
    arguments, named
        Further parameters of `io.bodies.read_grains`.

    Returns
    -------
    Start
        Grains relative to the centre of the box that the file states, or to their centre of mass.

    Raises
    ------
    BadInput
        As `read_grains`; also for grains that overlap by more than a simulation allows at its start.
    """
    from ..io.bodies import centred, read_grains

    found = read_grains(path, *arguments, **named)
    _tell(found.notes)  # they tell how the file is understood, also if it is refused
    used = found.box if box is None else box
    if found.box.is_open:  # grains may touch across the faces of the case's box
        found = found._replace(box=used)
    grains, pairs, notes = _at_rest(found, str(path))
    if not found.box.is_open and used != found.box:
        if make_whole(grains, pairs, found.box, str(path)):
            notes.append(f"{path}: clusters that the faces of its box cut are made whole")
        notes.append(f"{path}: its box is {found.box.describe()}; the box of the case is used")
    _tell(notes)
    if found.centre is None:
        return Start(centred(grains), None, used, f"{path}, centred on the centre of mass")
    grains.arrays.position[...] -= found.centre[:, None]
    return Start(grains, None, used, f"{path}, relative to the centre of its box")


def _tell(notes: Iterable[str]) -> None:
    for note in notes:
        warn(note)


def _at_rest(found: ReadGrains, origin: str) -> tuple[Grains, np.ndarray, list[str]]:
    """Grains with their contacts (C, 2) at the equilibrium overlap, or at that of their frame, and notes.

    Raises
    ------
    BadInput
        If grains overlap by too much.
    """
    grains, box, notes = found.grains, found.box, list[str]()
    if found.contacts is not None:
        pairs, overlap = found.contacts
        grains.arrays.position[...] = restore_overlaps(grains.position, grains.radius, box, pairs, overlap).T
        touching, overlap, rest = pairs_in_contact(grains, box)
        refuse_excess(grains, touching, overlap, rest, origin)
        return grains, pairs, notes
    pairs, overlap, rest = pairs_in_contact(grains, box)
    refuse_excess(grains, pairs, overlap, rest, origin)
    rounding = ROUNDING * float(np.abs(grains.position).max())
    if (np.abs(overlap - rest) <= EXACT * rest + rounding).all():
        return grains, pairs, notes
    fit = fit_overlaps(grains.position, grains.radius, box, pairs, rest)
    grains.arrays.position[...] = fit.position.T
    moved = format_quantity(fit.moved, "m")
    contacts = "1 contact is" if len(pairs) == 1 else f"{len(pairs)} contacts are"
    text = f"{origin}: coordinates are rounded; {contacts} put at rest, grains move by at most {moved}"
    if fit.residue > EXACT * float(rest.max()) + rounding:
        gaps = int((grains.overlaps(pairs, box) < 0.0).sum())
        text += f"; rings do not fit: overlaps differ from those of equilibrium by at most {fit.residue:.2g} m"
        text += f", and {gaps} pairs keep a gap and start without a contact" * bool(gaps)
    pairs = pairs[grains.overlaps(pairs, box) >= -rounding]
    return grains, pairs, [text]


def make_whole(grains: Grains, pairs: np.ndarray, box: Box, origin: str) -> bool:
    """Move grains by lengths of the box so that no cluster is cut by its faces; returns whether any was.

    Raises
    ------
    BadInput
        If a cluster touches its own periodic image: it has no end.
    """
    position = in_one_piece(grains.position.copy(), pairs, box)
    if (closing := pairs[closes_through_boundary(position, pairs, box)]).size:
        i, j = closing[0]
        raise BadInput(
            f"{origin}: the cluster of grains {i} and {j} touches its own image across the box, {box.describe()}, and "
            "has no end; start it in this box, with the key [box]"
        )
    is_cut = bool((position != grains.position).any())
    if is_cut:
        grains.arrays.position[...] = position.T
    return is_cut


def from_trajectory(path: str | Path, frame: int, materials: Mapping[str, Material]) -> Start:
    """Read one frame of a trajectory, or of the run in a folder, as a new start; see `setup.from_frame`.

    Raises
    ------
    BadInput
        If there is no such file or frame, or the frame cannot be a start.
    """
    from ..io.trajectory import Frames

    place = user_path(path)
    place = place / TRAJECTORY if place.is_dir() else place
    with contextlib.closing(Frames(place)) as frames:
        start = from_frame(frames[frame], materials)
    return start._replace(note=f"{place}, {start.note}")


def largest_body(start: Start) -> tuple[Grains, StrainedContacts | None]:
    """The largest cluster of a frame, in one piece across periodic boundaries, and its contacts."""
    grains, contacts = start.grains, start.contacts
    pair = np.zeros((0, 2), np.int64) if contacts is None else np.asarray(contacts.pair, dtype=np.int64)
    chosen = largest_cluster(pair, len(grains))
    index = np.full(len(grains), -1)
    index[chosen] = np.arange(len(chosen))
    inside = np.flatnonzero(index[pair[:, 0]] >= 0) if len(pair) else np.zeros(0, np.int64)
    links = index[pair[inside]]
    body = Grains(
        grains.position[chosen],
        grains.radius[chosen],
        [grains.materials[k] for k in grains.material[chosen]],
        moment=grains.moment[chosen],
        charge=grains.charge[chosen],
        own=grains.own.taken(chosen),
        mass=grains.mass[chosen],
    )
    make_whole(body, links, start.box, "the largest cluster")
    body.arrays.position[...] -= np.average(body.position, axis=0, weights=body.mass)[:, None]
    if contacts is None or not len(links):
        return body, None
    return body, StrainedContacts(links, *(np.asarray(part)[inside] for part in contacts[1:]))
