"""Pair forces that a cut-off ends where they still matter: |U(r_c)| is compared with the energy of motion.

Where the energy of a pair at the cut-off is above 0.1 k_B T, positions and motion of the grains depend on where the
cut-off lies.  T is that of a gas with Brownian motion or of the bath of contacts, the higher one, else that of the
translation of the grains at the start.  Grains at rest have no k_B T: they are moved by their forces alone, and gain
energies of the order of |U| of neighbours, which takes its place: |U| at the median distance of a grain to its nearest
neighbour.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..basics.box import Box
from ..basics.constants import BOLTZMANN
from ..basics.grains import Grains
from ..basics.temperature import kinetic_temperature
from ..basics.units import format_quantity, text_past
from ..contact.model import Contact
from ..forces.base import Force
from ..forces.gas import Gas
from ..forces.pair.cutoff import CutoffForce
from ..forces.pair.dipoles import Dipoles
from ..forces.pair.ewald_force import EwaldForce

SHARE = 0.1
"""Largest |U(r_c)| that gives no warning, in k_B T, or in |U| of nearest neighbours for grains at rest."""


def truncation_warnings(grains: Grains, forces: Sequence[Force], box: Box) -> list[str]:
    """One line for each force between pairs that is cut off where |U| > 0.1 k_B T.

    Not of an Ewald sum, a tree or all pairs of an open box, which leave nothing out, nor of dipoles whose automatic
    cut-off follows the clusters, which has its own limit and note.
    """
    found = []
    for force in forces:
        if isinstance(force, CutoffForce) and force.acts_on(grains):
            radius = _end(force, grains, box)
            if radius is not None:
                found.append(_warning(force, radius, grains, motion_temperature(grains, forces), box))
    return [text for text in found if text]


def motion_temperature(grains: Grains, forces: Sequence[Force]) -> float:
    """T [K] of a Brownian gas or of the bath of contacts, the higher one, else of the translation of the grains."""
    return given_temperature(forces) or kinetic_temperature(grains)


def given_temperature(forces: Sequence[Force]) -> float:
    """Temperature [K] of a Brownian gas or of the bath of contacts, the higher one; 0 without any."""
    given = [float(force.temperature) for force in forces if isinstance(force, Gas) and force.brownian]
    given += [float(force.bath_temperature or 0.0) for force in forces if isinstance(force, Contact)]
    return max(given, default=0.0)


def _end(force: CutoffForce, grains: Grains, box: Box) -> float | None:
    """Distance [m] beyond which the force leaves pairs out; None if it leaves out none."""
    if isinstance(force, EwaldForce) and force.uses_ewald(grains, box):
        return None
    if isinstance(force, Dipoles) and force.follows_clusters(box):
        return None
    radius = force.choose(grains, box).radius
    return 0.5 * box.shortest if radius is None and not box.is_open else radius


def _warning(force: CutoffForce, radius: float, grains: Grains, kelvin: float, box: Box) -> str:
    """The warning, "" if the interaction is weak at its end."""
    energy = force.largest_energy(grains, radius)
    unit, name = BOLTZMANN * kelvin, f"kT at {kelvin:.3g} K"
    if kelvin == 0.0:
        unit, name = force.largest_energy(grains, _nearest(grains, box)), "of that of nearest neighbours, all at rest,"
    if not energy > SHARE * unit:
        return ""
    where = "the cut-off" if force.cutoff is not None else "half the box"
    return (
        f"{force.name}: {where}, {format_quantity(radius, 'm')}, ends an interaction that is not small there: |U| of "
        f"two of the grains is up to {energy:.3g} J, {text_past(energy / unit, SHARE)} {name} (limit {SHARE:g}), and "
        f"what lies beyond is left out; {_remedy(force, box)}"
    )


def _nearest(grains: Grains, box: Box) -> float:
    """Median distance [m] of a grain to its nearest neighbour; of a single grain, its diameter."""
    if len(grains) < 2:
        return 2.0 * float(grains.radius[0])
    tree = box.tree(grains.position)
    return float(np.median(tree.query(tree.data, 2)[0][:, 1]))


def _remedy(force: CutoffForce, box: Box) -> str:
    """What to do."""
    if box.is_open:
        return "leave cutoff out, which sums all pairs in an open box, or give a longer one"
    longer = "give a longer cutoff in a larger box"
    if not isinstance(force, EwaldForce):
        return longer
    if all(side is not None for side in box.lengths):
        return f"use periodic = 'ewald' without cutoff and cut, or {longer}"
    return f"use a box that is periodic along x, y and z, with periodic = 'ewald', or {longer}"
