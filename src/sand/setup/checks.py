"""Checks of grains read from files: excessive overlaps and disconnected grains, reported with grain indices."""

from __future__ import annotations

import numpy as np

from ..analysis.clusters import labels_of
from ..basics.box import Box
from ..basics.errors import BadInput, first_problems
from ..basics.grains import ROUNDED, Grains
from .population import grain_set_of, rest_distances

MOST_OVERLAP = (2.0, 1e-3)
"""Largest initial overlap: the larger of 2 δ0 and 1e-3 of the smaller radius."""
ROUNDING = 64.0 * np.finfo(float).eps
"""Error of an overlap by the rounding of positions in double precision, relative to the largest coordinate."""
SAME_PLACE = 1e-6
"""Distance of centres, in radii of the smallest grain, up to which two grains are at the same place."""
MOST_MESSAGES = 10
"""Number of errors that are listed."""


def most_overlap(rest: np.ndarray | float, smaller: np.ndarray | float) -> np.ndarray:
    """Largest allowed initial overlap [m] for an equilibrium overlap and a smaller radius of the pair [m]."""
    return np.maximum(MOST_OVERLAP[0] * np.asarray(rest), MOST_OVERLAP[1] * np.asarray(smaller))


def at_same_place(grains: Grains, box: Box) -> list[str]:
    """Messages about the first ten pairs of grains at the same place, between which no force has a direction."""
    pairs = box.close_pairs(grains.position, SAME_PLACE * float(grains.radius.min()))
    problems = [
        f"grains {i} and {j} are at the same place; leave one of them out, or move it" for i, j in pairs[:MOST_MESSAGES]
    ]
    return first_problems(problems, len(pairs), "such pairs")


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
