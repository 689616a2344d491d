"""Checks of grains read from files: excessive overlaps and disconnected grains, reported with grain indices."""

from __future__ import annotations

import numpy as np

from ..basics.box import Box
from ..basics.clusters import labels_of
from ..basics.errors import BadInput, first_problems
from ..basics.grains import ROUNDED, Grains
from ..basics.initial_pairs import MOST_MESSAGES, at_same_place, most_overlap
from .population import grain_set_of, rest_distances

ROUNDING = 64.0 * np.finfo(float).eps
"""Error of an overlap by the rounding of positions in double precision, relative to the largest coordinate."""


def pairs_in_contact(grains: Grains, box: Box) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs (C, 2) of grains of a file that are in contact, their overlaps, and those of equilibrium (C,) [m].

    Gaps up to `ROUNDED` of the smaller radius count as contacts.
    """
    pairs, overlap = grains.touching(box, ROUNDED)
    grain_set = grain_set_of(grains.radius, [grains.materials[k] for k in grains.material])
    rest = grains.radius[pairs].sum(axis=1) - rest_distances(grain_set, pairs[:, 0], pairs[:, 1])
    return pairs, overlap, rest


def refuse_excess(grains: Grains, pairs: np.ndarray, overlap: np.ndarray, rest: np.ndarray, origin: str) -> None:
    """Refuse pairs that overlap by more than a simulation allows at its start.

    Parameters
    ----------
    pairs, overlap, rest : ndarray
        As `pairs_in_contact` returns them.
    origin : str
        Source of the grains, for the message.

    Raises
    ------
    BadInput
        One line for each of the first ten such pairs.
    """
    if same := at_same_place(grains, Box.open()):
        raise BadInput(f"{origin}: {problem}" for problem in same)
    most = most_overlap(rest, grains.radius[pairs].min(axis=1))
    wrong = np.flatnonzero(overlap > most + ROUNDING * np.abs(grains.position).max(initial=0.0))
    problems = [
        f"{origin}: grains {pairs[k, 0]} and {pairs[k, 1]} overlap by {overlap[k]:.3g} m, at most {most[k]:.3g} m is "
        "allowed: move them apart"
        for k in wrong[:MOST_MESSAGES]
    ]
    if problems:
        raise BadInput(first_problems(problems, len(wrong), "overlapping pairs"))


def refuse_pieces(grains: Grains, pairs: np.ndarray, box: Box, origin: str) -> None:
    """Refuse grains that are not connected to the largest cluster.

    Raises
    ------
    BadInput
        One line for each of the first ten other clusters, with the gap between the two nearest grains.
    """
    label = labels_of(len(grains), pairs)
    sizes = np.bincount(label)
    others = [int(k) for k in dict.fromkeys(label.tolist()) if k != sizes.argmax()]
    problems = []
    for cluster in others[:MOST_MESSAGES]:
        i, j, gap = _nearest_outside(grains, np.flatnonzero(label == cluster), box)
        more = sizes[cluster] - 1
        of_cluster = f" (with {more} more that it touches)" if more else ""
        problems.append(
            f"{origin}: grain {i}{of_cluster} has no contact with the rest of the body: a gap of about {gap:.3g} m to "
            f"grain {j}; close it, or leave the grain out"
        )
    if problems:
        raise BadInput(first_problems(problems, len(others), "such grains"))


def _nearest_outside(grains: Grains, inside: np.ndarray, box: Box) -> tuple[int, int, float]:
    """Grain of a cluster, grain outside, and gap [m] of the two whose surfaces are nearest."""
    outside = np.setdiff1d(np.arange(len(grains)), inside)
    best = (0, 0, np.inf)
    for i in inside.tolist():
        apart = np.linalg.norm(box.nearest(grains.position[outside] - grains.position[i]), axis=1)
        gap = apart - grains.radius[outside] - grains.radius[i]
        k = int(gap.argmin())
        if gap[k] < best[2]:
            best = (i, int(outside[k]), float(gap[k]))
    return best


def largest_cluster(pairs: np.ndarray, count: int) -> np.ndarray:
    """Indices of the largest connected cluster among the first `count` grains."""
    label = labels_of(count, pairs[(pairs < count).all(axis=1)])
    return np.flatnonzero(label == np.bincount(label).argmax())
