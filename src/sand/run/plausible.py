"""Grains, forces and box together at a new start: what cannot be is refused, what is unusual is warned of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..core.box import Box
from ..core.grains import Grains
from ..core.units import is_word, spoken
from ..forces.base import FarForce, Force
from ..forces.contact import Contact
from .first_contacts import touching

OUTSIDE = 1e-3
"""How far a centre may lie outside a periodic box, in sides of it: frames in single precision are mended by that."""
LARGEST = 1e-2
"""Radius [m] beyond which grains are hardly dust."""
SUNK = 1e-3
"""Overlap, in radii of the smaller grain, that without a contact law is more than rounding."""


def impossible(grains: Grains, forces: Sequence[Force], box: Box) -> list[str]:
    """Complaints about grains outside a periodic box, and cut-offs that end inside a grain."""
    return [*_outside(grains, box), *_short_cutoffs(grains, forces, box)]


def unusual(grains: Grains, forces: Sequence[Force], box: Box) -> list[str]:
    """Warnings of very large grains, and of overlaps that no contact law acts on."""
    warnings = []
    largest = int(np.argmax(grains.radius))
    if grains.radius[largest] > LARGEST:
        size = spoken(float(grains.radius[largest]), "m")
        warnings.append(
            f"grain {largest} has a radius of {size}: contacts are made for dust, far below {spoken(LARGEST, 'm')}; "
            "is the unit right?"
        )
    if not any(isinstance(force, Contact) for force in forces):
        warnings += _overlaps(grains, box)
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
        if isinstance(force, FarForce) and cutoff is not None and not is_word(cutoff, "auto") and cutoff < diameter:
            problems.append(
                f"{force.name}: cutoff = {spoken(cutoff, 'm')} ends within a grain, whose diameter is "
                f"{spoken(diameter, 'm')}; take a longer one, or 'auto'"
            )
    return problems


def _overlaps(grains: Grains, box: Box) -> list[str]:
    found = touching(grains, box)
    smaller = grains.radius[found.pair].min(axis=1) if len(found.pair) else np.zeros(0)
    deep = np.flatnonzero(found.overlap > SUNK * smaller)
    if not len(deep):
        return []
    (i, j), overlap = found.pair[deep[0]], spoken(float(found.overlap[deep[0]]), "m")
    others = f", and {len(deep) - 1} more pairs do" if len(deep) > 1 else ""
    return [
        f"grains {i} and {j} overlap by {overlap}{others}, and there is no sand.Contact() among the forces: "
        "they pass through each other"
    ]
