"""Initial conditions from files: bodies, and frames of trajectories."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..grains import Grains
from ..io.run_folder import TRAJECTORY
from ..material import Material
from ..paths import user_path
from ..schema import own_values
from .checks import check_body, largest_cluster
from .from_frame import Start, StrainedContacts, from_frame

TEXT_SUFFIXES = (".xyz", ".extxyz", ".txt", ".dat")
"""Suffixes of text files with a body; all other files are read as trajectories."""


def body_from_file(path: str | Path, material: Material | None = None, *others: Any, **named: Any) -> Grains:
    """Read a body that is in one piece; parameters as for `io.bodies.read_body`.

    Raises
    ------
    BadInput
        As `read_body`; also for grains that overlap by more than a simulation allows at its start, and for grains
        without a contact to the rest. The first ten are named.
    """
    from ..io.bodies import read_body  # loads gsd, which few simulations need

    body = read_body(path, material, *others, **named)
    check_body(body, str(path))
    return body


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
    frames = Frames(place)
    try:
        start = from_frame(frames[frame], materials)
    finally:
        frames.close()
    return start._replace(note=f"{place}, {start.note}")


def largest_body(start: Start) -> tuple[Grains, StrainedContacts | None]:
    """The largest cluster of a frame, in one piece across periodic boundaries, and its contacts."""
    from scipy.sparse import csr_array  # slow to import
    from scipy.sparse.csgraph import breadth_first_order

    grains, contacts = start.grains, start.contacts
    pair = np.zeros((0, 2), np.int64) if contacts is None else np.asarray(contacts.pair, dtype=np.int64)
    chosen = largest_cluster(pair, len(grains))
    index = np.full(len(grains), -1)
    index[chosen] = np.arange(len(chosen))
    inside = np.flatnonzero(index[pair[:, 0]] >= 0) if len(pair) else np.zeros(0, np.int64)
    links = index[pair[inside]]
    position = grains.position[chosen]
    graph = csr_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(len(chosen), len(chosen)))
    order, before = breadth_first_order(graph, 0, directed=False)
    for k in order[1:]:  # nearest image of each grain to its predecessor
        position[k] = position[before[k]] + start.box.nearest(position[k] - position[before[k]])
    mass = grains.mass[chosen]
    body = Grains(
        position - np.average(position, axis=0, weights=mass),
        grains.radius[chosen],
        [grains.materials[k] for k in grains.material[chosen]],
        moment=grains.moment[chosen],
        charge=grains.charge[chosen],
        own={name: values[chosen] for name, values in own_values(grains).items()},
        mass=mass,
    )
    if contacts is None or not len(links):
        return body, None
    return body, StrainedContacts(links, *(np.asarray(part)[inside] for part in contacts[1:]))
