"""Every aggregate of a frame, counted and measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arguments import checked
from ..errors import refuse_other
from .clusters import aggregate_moments, cluster_labels, unwrapped
from .network import network
from .shape import elongation, filling_factor, gyration_radius

COLUMNS = {
    "grains": ("1", "number of grains N"),
    "mass": ("kg", "mass"),
    "gyration_radius": ("m", "radius of gyration, centres only"),
    "elongation": ("1", "longest over shortest principal length, extent of grains included"),
    "filling_factor": ("1", "volume of grains over that of the sphere with this radius of gyration"),
    "moment": ("A m^2", "size of the sum of all moments"),
    "alignment": ("1", "that over the sum of their sizes"),
    "coordination": ("1", "mean number of contacts of a grain"),
    "ends": ("1", "grains with one contact"),
    "junctions": ("1", "grains with three or more"),
    "rings": ("1", "independent closed loops"),
    "longest": ("1", "grains on the longest way along contacts"),
}
"""Name, unit and meaning of every column of a census."""


@checked
def aggregate_statistics(frame: Any, least: int = 2) -> dict[str, np.ndarray]:
    """The aggregates of a frame, the largest first: columns (K,) as in COLUMNS.

    Parameters
    ----------
    frame
        of a trajectory, or anything with position, radius, mass, moment, pair (C, 2) and box.
    least : int, optional
        aggregates of fewer grains are left out.
    """
    refuse_other(frame, "position", "pair", "moment", "box")
    labels = cluster_labels(len(frame.position), frame.pair)
    sizes = np.bincount(labels)
    whole = unwrapped(frame.position, frame.pair, frame.box)
    moments, aligned = aggregate_moments(frame.moment, labels)
    order = np.argsort(-sizes, kind="stable")
    members = np.split(np.argsort(labels, kind="stable"), np.cumsum(sizes)[:-1])
    of_pair = labels[frame.pair[:, 0]] if len(frame.pair) else np.zeros(0, int)
    rows = []
    for k in order[sizes[order] >= least]:
        who = members[k]
        held = np.searchsorted(who, frame.pair[of_pair == k])
        place, mass, radius = whole[who], np.asarray(frame.mass, float)[who], frame.radius[who]
        net = network(len(who), held)
        rows.append(
            (
                len(who),
                mass.sum(),
                gyration_radius(place, mass),
                elongation(place, mass, radius),
                filling_factor(place, radius),
                np.linalg.norm(moments[k]),
                aligned[k],
                net.coordination,
                net.ends,
                net.junctions,
                net.rings,
                net.longest,
            )
        )
    table = np.array(rows, dtype=float).reshape(-1, len(COLUMNS))
    return {name: table[:, c] for c, name in enumerate(COLUMNS)}


@checked
def size_distribution(labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sizes s (K,) that occur and how many clusters n_s (K,) have each."""
    sizes, numbers = np.unique(np.bincount(labels), return_counts=True)
    return sizes, numbers
