"""Pairs of grains at the start of a simulation: contacts with displacements, and pairs that are too near."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .box import Box
from .errors import first_problems
from .grains import Grains

MOST_OVERLAP = (2.0, 1e-3)
"""Largest initial overlap: the larger of 2 δ0 and 1e-3 of the smaller radius."""
SAME_PLACE = 1e-6
"""Distance of centres, in radii of the smallest grain, up to which two grains are at the same place."""
MOST_MESSAGES = 10
"""Number of errors that are listed."""


class StrainedContacts(NamedTuple):
    """Initial contacts with their displacements, in the laboratory frame.

    Overlapping grains are in contact anyway, without displacements; bonds add stretched and strained contacts.
    """

    pair: np.ndarray  # (C, 2) grains
    slide: np.ndarray  # (C, 3) sliding displacement ζ [m]
    roll: np.ndarray  # (C, 3) rolling displacement ξ [m]
    twist: np.ndarray  # (C,) twisting angle φ [rad]


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
