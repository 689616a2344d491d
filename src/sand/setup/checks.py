"""Whether grains that are given can be the start of anything: overlaps and gaps, named grain by grain."""

from __future__ import annotations

import numpy as np

from ..box import Box
from ..errors import BadInput
from ..grains import ROUNDING, Grains
from .population import grain_set_of, rest_distances

MOST_OVERLAP = (2.0, 1e-3)
"""Overlaps at the start may reach 2 δ0 or 1e-3 radii, whichever is more."""
TOLD = 10


def most_overlap(rest: np.ndarray | float, smaller: np.ndarray | float) -> np.ndarray:
    """Largest overlap at the start [m] of grains with this overlap at rest [m], the smaller of this radius [m]."""
    return np.maximum(MOST_OVERLAP[0] * np.asarray(rest), MOST_OVERLAP[1] * np.asarray(smaller))


def check_body(body: Grains, origin: str) -> None:
    """Raises BadInput naming grains (the first ten) that overlap by too much, or touch none of the largest cluster.

    Parameters
    ----------
    origin : str
        where the body comes from, for the message.
    """
    problems = _overlaps(body) or _gaps(body)
    if problems:
        more = len(problems) - TOLD
        told = problems if more <= 0 else [*problems[:TOLD], f"… and {more} more"]
        raise BadInput(f"{origin}: {problem}" for problem in told)


def _pairs(body: Grains) -> tuple[np.ndarray, np.ndarray]:
    """Pairs that touch (P, 2), and their overlaps [m]."""
    pairs = Box.open().close_pairs(body.position, 2.0 * float(body.radius.max()) * (1.0 + ROUNDING))
    overlap = body.overlaps(pairs, Box.open())
    near = overlap >= -ROUNDING * body.radius[pairs].sum(axis=1)
    return pairs[near], overlap[near]


def _overlaps(body: Grains) -> list[str]:
    pairs, overlap = _pairs(body)
    grain_set = grain_set_of(body.radius, [body.materials[k] for k in body.material])
    touch = body.radius[pairs].sum(axis=1)
    rest = touch - rest_distances(grain_set, pairs[:, 0], pairs[:, 1])
    most = most_overlap(rest, body.radius[pairs].min(axis=1))
    return [
        f"grains {pairs[k, 0]} and {pairs[k, 1]} overlap by {overlap[k]:.3g} m; at most {most[k]:.3g} m may be: "
        "move them apart"
        for k in np.flatnonzero(overlap > most)
    ]


def _gaps(body: Grains) -> list[str]:
    """Grains outside the largest cluster, with their nearest neighbour."""
    from scipy.sparse import csr_array  # slow to load, and only bodies from files are looked at
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs, _ = _pairs(body)
    count = len(body)
    graph = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    main = label == np.bincount(label).argmax()
    outside = np.flatnonzero(~main)
    if not len(outside):
        return []
    distance, nearest = cKDTree(body.position[main]).query(body.position[outside])
    mates = np.flatnonzero(main)[nearest]
    return [
        f"grain {i} has no contact with the rest of the body: a gap of about "
        f"{max(d - body.radius[i] - body.radius[j], 0.0):.3g} m to grain {j}; close it, or leave the grain out"
        for i, j, d in zip(outside, mates, distance, strict=True)
    ]
