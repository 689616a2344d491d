"""Checks of bodies read from files: excessive overlaps and disconnected grains, reported with grain indices."""

from __future__ import annotations

import numpy as np

from ..box import Box
from ..errors import BadInput
from ..grains import Grains
from .population import grain_set_of, rest_distances

MOST_OVERLAP = (2.0, 1e-3)
"""Largest initial overlap: the larger of 2 δ0 and 1e-3 of the smaller radius."""
MOST_MESSAGES = 10
"""Number of errors that are listed."""


def most_overlap(rest: np.ndarray | float, smaller: np.ndarray | float) -> np.ndarray:
    """Largest allowed initial overlap [m] for an equilibrium overlap and a smaller radius of the pair [m]."""
    return np.maximum(MOST_OVERLAP[0] * np.asarray(rest), MOST_OVERLAP[1] * np.asarray(smaller))


def check_body(body: Grains, origin: str) -> None:
    """Check a body for excessive overlaps and for grains that are not connected to its largest cluster.

    Parameters
    ----------
    body : Grains
        The body.
    origin : str
        Source of the body, for the message.

    Raises
    ------
    BadInput
        One line for each of the first ten such grains or pairs.
    """
    pairs, overlap = body.touching(Box.open())
    problems = _overlaps(body, pairs, overlap) or _gaps(body, pairs)
    if problems:
        more = len(problems) - MOST_MESSAGES
        listed = problems if more <= 0 else [*problems[:MOST_MESSAGES], f"… and {more} more"]
        raise BadInput(f"{origin}: {problem}" for problem in listed)


def _overlaps(body: Grains, pairs: np.ndarray, overlap: np.ndarray) -> list[str]:
    grain_set = grain_set_of(body.radius, [body.materials[k] for k in body.material])
    touch = body.radius[pairs].sum(axis=1)
    rest = touch - rest_distances(grain_set, pairs[:, 0], pairs[:, 1])
    most = most_overlap(rest, body.radius[pairs].min(axis=1))
    return [
        f"grains {pairs[k, 0]} and {pairs[k, 1]} overlap by {overlap[k]:.3g} m, at most {most[k]:.3g} m is allowed: "
        "move them apart"
        for k in np.flatnonzero(overlap > most)
    ]


def _gaps(body: Grains, pairs: np.ndarray) -> list[str]:
    """Messages about grains outside the largest cluster, with their nearest neighbour in it."""
    from scipy.spatial import cKDTree  # slow to import, and used for bodies from files only

    main = np.zeros(len(body), dtype=bool)
    main[largest_cluster(pairs, len(body))] = True
    outside = np.flatnonzero(~main)
    if not len(outside):
        return []
    distance, nearest = cKDTree(body.position[main]).query(body.position[outside])
    neighbours = np.flatnonzero(main)[nearest]
    return [
        f"grain {i} has no contact with the rest of the body: a gap of about "
        f"{max(d - body.radius[i] - body.radius[j], 0.0):.3g} m to grain {j}; close it, or leave the grain out"
        for i, j, d in zip(outside, neighbours, distance, strict=True)
    ]


def largest_cluster(pairs: np.ndarray, count: int) -> np.ndarray:
    """Indices of the largest connected cluster among the first `count` grains."""
    from scipy.sparse import csr_array  # slow to import
    from scipy.sparse.csgraph import connected_components

    inside = pairs[(pairs < count).all(axis=1)]
    graph = csr_array((np.ones(len(inside)), (inside[:, 0], inside[:, 1])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    return np.flatnonzero(label == np.bincount(label).argmax())
