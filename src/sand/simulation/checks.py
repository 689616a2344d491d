"""Grains, forces and box together at a new start: what cannot be is refused, what is unusual is warned of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..box import Box
from ..contact.model import Contact
from ..forces.base import Force, LongRangeForce
from ..grains import Grains
from ..units import format_quantity, is_word

OUTSIDE = 1e-3
"""How far a centre may lie outside a periodic box, in sides of it: frames in single precision are mended by that."""
LARGEST = 1e-2
"""Radius [m] beyond which grains are hardly dust."""
NEAREST = 8
"""Neighbours of a grain, itself among them, that are looked at for overlaps."""
SUNK = 1e-3
"""Overlap, in radii of the smaller grain, that without a contact law is more than rounding."""


def impossible(grains: Grains, forces: Sequence[Force], box: Box) -> list[str]:
    """Complaints about grains outside a periodic box, and cut-offs that end inside a grain."""
    return [*_outside(grains, box), *_short_cutoffs(grains, forces, box)]


def unusual(grains: Grains, forces: Sequence[Force], box: Box) -> list[str]:
    """Warnings of very large grains, and of overlaps that no contact law acts on."""
    warnings = []
    sticky = any(isinstance(force, Contact) for force in forces)
    largest = int(np.argmax(grains.radius))
    if sticky and grains.radius[largest] > LARGEST:
        size = format_quantity(float(grains.radius[largest]), "m")
        warnings.append(
            f"grain {largest} has a radius of {size}: contacts are made for dust, far below {format_quantity(LARGEST, 'm')}; "
            "is the unit right?"
        )
    alone = bool(forces) and not any(isinstance(force, LongRangeForce) for force in forces)
    if not sticky and not alone:
        warnings += _overlaps(grains, box)  # grains that feel only what surrounds them may be in one place
    return warnings


def _outside(grains: Grains, box: Box) -> list[str]:
    lengths = np.array([np.inf if v is None else v for v in box.lengths])
    wrong = np.flatnonzero((np.abs(grains.position) > (0.5 + OUTSIDE) * lengths).any(axis=1))
    if not len(wrong):
        return []
    first = int(wrong[0])
    place = ", ".join(f"{x:.4g}" for x in grains.position[first])
    others = f" and {len(wrong) - 1} more" if len(wrong) > 1 else ""
    return [
        f"grain {first}{others} lies outside the box: it is at ({place}) m, and the box, {box.describe()}, reaches "
        "from −L/2 to L/2 on each periodic axis; move the grains, or take box.wrap(position)"
    ]


def _short_cutoffs(grains: Grains, forces: Sequence[Force], box: Box) -> list[str]:
    diameter = 2.0 * float(grains.radius.max())
    problems = []
    for force in forces:
        cutoff = getattr(force, "cutoff", None)
        if (
            isinstance(force, LongRangeForce)
            and cutoff is not None
            and not is_word(cutoff, "auto")
            and cutoff < diameter
        ):
            problems.append(
                f"{force.name}: cutoff = {format_quantity(cutoff, 'm')} ends within a grain, whose diameter is "
                f"{format_quantity(diameter, 'm')}; take a longer one, or 'auto'"
            )
    return problems


def _overlaps(grains: Grains, box: Box) -> list[str]:
    pair = _nearest(grains, box)
    overlap = grains.overlaps(pair, box)
    deep = np.flatnonzero(overlap > SUNK * grains.radius[pair].min(axis=1))
    if not len(deep):
        return []
    i, j = pair[deep[0]]
    return [
        f"grains {i} and {j} overlap by {format_quantity(float(overlap[deep[0]]), 'm')}, and there is no sand.Contact() among "
        "the forces: grains pass through each other"
    ]


def _nearest(grains: Grains, box: Box) -> np.ndarray:
    """Pairs (P, 2) of each grain with its few nearest neighbours; all pairs might be too many."""
    from scipy.spatial import cKDTree  # slow to load

    count = len(grains)
    if count == 1:
        return np.zeros((0, 2), np.int64)
    lengths = np.array([0.0 if v is None else v for v in box.lengths])
    folded = np.where(lengths > 0.0, np.mod(grains.position, np.where(lengths > 0.0, lengths, 1.0)), grains.position)
    folded = np.where((lengths > 0.0) & (folded >= lengths), 0.0, folded)
    _, others = cKDTree(folded, boxsize=lengths).query(folded, min(count, NEAREST))
    pairs = np.stack([np.repeat(np.arange(count), others.shape[1]), others.ravel()], axis=1)
    return np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
