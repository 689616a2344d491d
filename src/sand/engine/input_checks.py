"""Checks of grains, forces and box: impossible combinations are errors, unusual ones are warnings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..basics.box import Box, least_side
from ..basics.errors import ErrorCollector
from ..basics.grains import Grains
from ..basics.initial_pairs import at_same_place
from ..basics.units import format_quantity
from ..contact.model import Contact
from ..forces.base import Force, LongRangeForce
from ..forces.pair.inverse_square import Charges
from ..forces.pair.screened_charges import ScreenedCharges
from ..integrate.integrator import Integrator
from ..limits.model_limits import limit_warnings
from ..limits.solid_limits import fast_settling, grain_warnings
from ..limits.truncation import truncation_warnings
from .step_parameters import ForcesByType

POSITION_TOLERANCE = 1e-3
"""Distance beyond a periodic box, in box sides, at which positions are still wrapped (single-precision frames)."""
LARGEST_RADIUS = 1e-2
"""Radius [m] above which a warning asks whether the unit is right."""
NEAREST = 8
"""Nearest neighbours of a grain, itself included, that are checked for overlaps."""
OVERLAP_TOLERANCE = 1e-3
"""Overlap, in radii of the smaller grain, that counts as rounding where there is no contact law."""


def _of_a_start(grains: Grains, forces: Sequence[Force], box: Box) -> list[str]:
    """Errors of positions and cut-offs at a new start."""
    outside = outside_box(grains, box)
    interact = any(isinstance(force, (Contact, LongRangeForce)) for force in forces)
    together = at_same_place(grains, box) if interact and not outside else []
    return [*outside, *together, *_short_cutoffs(grains, forces, box)]


def check_system(grains: Grains, forces: Sequence[Force], box: Box, *, fresh: bool) -> list[str]:
    """Check that grains, forces and box fit together.

    Parameters
    ----------
    fresh : bool
        Whether this is a new start, of which more is checked.

    Returns
    -------
    list[str]
        Warnings.

    Raises
    ------
    BadInput
        With all problems.
    """
    errors, warnings = ErrorCollector(), list[str]()
    errors.problems += _of_a_start(grains, forces, box) if fresh else []
    names = {force.name for force in forces}
    if {Charges.name, ScreenedCharges.name} <= names:
        errors.problems.append(
            "forces: charges (sand.Charges) and screened_charges (sand.ScreenedCharges) both act between the charges "
            "of the grains, which would count twice; leave one of them out"
        )
    for force in forces:
        warnings += errors.take(force.check, grains, box, instead=[])
    least = least_side(grains.radius)
    if box.shortest < least:
        errors.problems.append(
            f"box = {box.describe()} is too small: its shortest side must be at least {least:.3g} m, "
            "so that a grain interacts with only one image of each neighbour"
        )
    errors.done()
    return warnings + (_start_warnings(grains, forces, box) if fresh else [])


def problems_of_tilt(forces: ForcesByType, stepping: Integrator) -> list[str]:
    """What cannot be used in a tilted box that keeps its shape."""
    others = [each.name for each in forces.long_range]
    others += [each.name for each in forces.external if getattr(each, "position_dependent", False)]
    found = [f"the force '{name}'" for name in others] + [f"stepping = '{stepping.name}'"] * (stepping.name != "verlet")
    return [f"box: {other} cannot be used in a tilted box; leave one of them out" for other in found]


def _start_warnings(grains: Grains, forces: Sequence[Force], box: Box) -> list[str]:
    """Warnings about limits of the model, very large grains, and overlaps without a contact law."""
    warnings = [*limit_warnings(grains, forces, box), *truncation_warnings(grains, forces, box)]
    warnings += grain_warnings(grains, forces).values()
    contact = any(isinstance(force, Contact) for force in forces)
    warnings += [text for force in forces if isinstance(force, Contact) for text in fast_settling(grains, force)]
    largest = int(np.argmax(grains.radius))
    if contact and grains.radius[largest] > LARGEST_RADIUS:
        size = format_quantity(float(grains.radius[largest]), "m")
        warnings.append(
            f"grain {largest} has a radius of {size}: the contact model is meant for dust, far below "
            f"{format_quantity(LARGEST_RADIUS, 'm')}; is the unit right?"
        )
    independent = bool(forces) and not any(isinstance(force, LongRangeForce) for force in forces)
    if not contact and not independent:  # grains that do not interact may overlap
        warnings += _overlaps(grains, box)
    return warnings


def outside_box(grains: Grains, box: Box) -> list[str]:
    """Message about grains outside a periodic box; none if there are none."""
    lengths = np.array([np.inf if v is None else v for v in box.lengths])
    wrong = np.flatnonzero((np.abs(grains.position) > (0.5 + POSITION_TOLERANCE) * lengths).any(axis=1))
    if not len(wrong):
        return []
    first = int(wrong[0])
    position = ", ".join(f"{x:.4g}" for x in grains.position[first])
    others = f" and {len(wrong) - 1} more" if len(wrong) > 1 else ""
    return [
        f"grain {first}{others} lies outside the box: it is at ({position}) m, and the box, {box.describe()}, extends "
        "from −L/2 to L/2 on each periodic axis; move the grains, or use box.wrap(position)"
    ]


def _short_cutoffs(grains: Grains, forces: Sequence[Force], box: Box) -> list[str]:
    diameter = 2.0 * float(grains.radius.max())
    problems = []
    for force in forces:
        cutoff = getattr(force, "cutoff", None)
        if isinstance(force, LongRangeForce) and isinstance(cutoff, float) and cutoff < diameter:
            problems.append(
                f"{force.name}: cutoff = {format_quantity(cutoff, 'm')} ends within a grain, whose diameter is "
                f"{format_quantity(diameter, 'm')}; give a longer one, or 'auto'"
            )
    return problems


def _overlaps(grains: Grains, box: Box) -> list[str]:
    pair = _nearest(grains, box)
    overlap = grains.overlaps(pair, box)
    deep = np.flatnonzero(overlap > OVERLAP_TOLERANCE * grains.radius[pair].min(axis=1))
    if not len(deep):
        return []
    i, j = pair[deep[0]]
    return [
        f"grains {i} and {j} overlap by {format_quantity(float(overlap[deep[0]]), 'm')}, and there is no "
        "sand.Contact() among the forces: grains pass through each other"
    ]


def _nearest(grains: Grains, box: Box) -> np.ndarray:
    """Pairs (P, 2) of each grain with its nearest neighbours only: all overlapping pairs might be too many."""
    count = len(grains)
    if count == 1:
        return np.zeros((0, 2), np.int64)
    if box.tilt:
        return box.close_pairs(grains.position, 2.0 * float(grains.radius.max()))
    tree = box.tree(grains.position)
    _, others = tree.query(tree.data, min(count, NEAREST))
    pairs = np.stack([np.repeat(np.arange(count), others.shape[1]), others.ravel()], axis=1)
    return np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
