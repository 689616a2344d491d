"""Magnetic dipole forces between all grains."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...arguments import checked
from ...box import Box
from ...constants import BOLTZMANN, MAGNETIC
from ...errors import BadInput, ErrorCollector, did_you_mean, shown
from ...grains import Grains
from ...units import format_quantity, si
from .cutoff import HALF_BOX_RATIO, CutoffChoice, CutoffForce, cutoff_for
from .dipole_formulas import capture_radius, contact_energy
from .dipole_loops import ALL_PAIRS, ALL_PAIRS_CUT, LISTED_PAIRS, DipoleParameters
from .ewald import EwaldChoice, choose_ewald, degree_for, ewald_parameters, sides
from .ewald_loops import EwaldParameters, ewald_sums
from .loops import LongRangeSums
from .tree import ACCURACIES as TREE_ACCURACIES
from .tree import TREE_FROM, TreeChoice, choose_tree, tree_parameters
from .tree_loops import TREE, TreeParameters

OPEN = ("auto", "pairs", "tree")
PERIODIC = ("nearest image", "ewald")
BOUNDARIES = ("tin-foil", "vacuum")
ACCURACIES = 1e-8, 0.1
"""Smallest and largest accuracy of an Ewald sum."""
DEFAULT_ACCURACY = 1e-3
SMALLEST_RADIUS = 6.0
"""Smallest radius of the real part of an Ewald sum, in radii of the largest grain, if the box allows it."""
CAPTURE_RADII = 1.5
"""Automatic cut-off in a large box, in units of the capture radius b_max at thermal speed."""


@checked
@dataclass(frozen=True)
class Dipoles(CutoffForce):
    """Forces and torques between magnetic moments.

    Parameters
    ----------
    cutoff : float, str or None, optional
        "auto", None (no cut-off: all pairs in an open box, nearest images in a periodic one), or a length [m]. "auto"
        is None in an open box. In a periodic one it is 1.5 b_max(v_th), but at least two diameters of the largest
        grain and at most (L/2)/1.35.
    cut : str, optional
        "smooth": the interaction is switched off over the outer fifth of the cut-off radius, which conserves energy;
        or "sharp", as in the paper: the energy jumps each time a pair crosses the radius.
    periodic : str, optional
        What acts in a periodic box. "nearest image": the nearest image of each grain within the cut-off. "ewald": all
        images of all grains, by an Ewald sum, in a box that is periodic along all axes; without `cutoff` and `cut`.
    open : str, optional
        How all pairs in an open box are summed. "pairs": directly. "tree": near pairs directly, distant grains by
        multipole expansions of the cells of a tree, in a time proportional to the number of grains. "auto": a tree from
        5000 grains on.
    accuracy : float, optional
        Of the Ewald sum, 1e-8 … 0.1, or of the tree, 1e-6 … 0.1: largest rms error of force and torque, relative to
        their typical size in a gas of these grains. The parameters of the sum are the cheapest with this accuracy.
    boundary : str, optional
        What surrounds the images of the Ewald sum, at infinity: "tin-foil" (a medium of infinite permeability: no
        demagnetising field) or "vacuum" (a sphere of images in vacuum: demagnetising field −μ₀M/3 of the total
        moment, M per volume).

    Raises
    ------
    BadInput
        If a parameter is invalid; later, if the cut-off exceeds half the box, a box of an Ewald sum is open along an
        axis, or that of a tree is not open.
    """

    cutoff: Any = "auto"
    cut: str = "smooth"
    periodic: str = "nearest image"
    open: str = "auto"
    accuracy: Any = DEFAULT_ACCURACY
    boundary: str = "tin-foil"

    name: ClassVar[str] = "dipoles"
    no_effect: ClassVar[str] = "dipoles are switched on but no grain has a magnetic moment"
    column: ClassVar[str] = "magnetic"
    references: ClassVar[str] = (
        "Dominik & Nübold 2002, Eqs. 6, 34–41; Jackson 1975; Ewald sum: de Leeuw, Perram & Smith 1980; Wang & Holm 2001"
        "; tree: Dehnen 2002"
    )

    def __post_init__(self) -> None:
        errors = ErrorCollector()
        for name, allowed in (("periodic", PERIODIC), ("open", OPEN), ("boundary", BOUNDARIES)):
            value = getattr(self, name)
            if value not in allowed:
                errors.problems.append(f"{self.name}: {name} = {shown(value)}; {did_you_mean(str(value), allowed)}")
        accuracy = errors.take(si, self.accuracy, "1", f"{self.name}: accuracy", least=ACCURACIES[0])
        if accuracy is not None and accuracy > ACCURACIES[1]:
            errors.problems.append(f"{self.name}: accuracy = {accuracy:g} must be at most {ACCURACIES[1]:g}")
        errors.take(super().__post_init__)
        errors.done()
        object.__setattr__(self, "accuracy", accuracy)
        given = [name for name in ("cutoff", "cut") if getattr(self, name) != getattr(type(self), name)]
        if self.periodic == "ewald" and given:
            errors.problems.append(
                f"{self.name}: {given[0]} = {shown(getattr(self, given[0]))} cannot be given with periodic = 'ewald', "
                "which sums all images and chooses the radius of its real part; leave one of them out"
            )
        given = [name for name in ("accuracy", "boundary") if getattr(self, name) != getattr(type(self), name)]
        if self.open == "tree" and given == ["accuracy"]:
            given = []
        if self.periodic != "ewald" and given:
            other = " or open = 'tree'" if given[0] == "accuracy" else ""
            errors.problems.append(
                f"{self.name}: {given[0]} is used only with periodic = 'ewald'{other}; add that, or leave it out"
            )
        errors.problems += self._problems_of_tree()
        errors.done()

    def _problems_of_tree(self) -> list[str]:
        """What cannot be given with open = 'tree'."""
        if self.open != "tree":
            return []
        problems = []
        if self.periodic == "ewald":
            problems.append(f"{self.name}: open = 'tree' is for open boxes, periodic = 'ewald' for others; give one")
        if self.cutoff not in (None, "auto") or self.cut != type(self).cut:
            problems.append(f"{self.name}: open = 'tree' sums all pairs; leave cutoff and cut out")
        if self.accuracy < TREE_ACCURACIES[0]:
            least = f"{TREE_ACCURACIES[0]:g}"
            problems.append(
                f"{self.name}: accuracy = {self.accuracy:g} must be at least {least} with open = 'tree'; "
                "open = 'pairs' is exact"
            )
        return problems

    def choose(self, grains: Grains, box: Box) -> CutoffChoice:
        """The cut-off radius, or that of the real part of the Ewald sum, with the reason."""
        if self.open == "tree" and not box.is_open:
            raise BadInput(
                f"{self.name}: open = 'tree' needs an open box, and the box is {box.describe()}; "
                "use periodic = 'ewald', or leave open out"
            )
        if self.uses_tree(grains, box):
            tree = self.tree(grains)
            return CutoffChoice(
                None,
                f"open box: all grains, by a tree of multipoles, degree {tree.degree}, opening angle {tree.opening:g}, "
                f"accuracy {self.accuracy:g}; predicted errors of force {tree.force_error:.1e}, "
                f"of torque {tree.torque_error:.1e}",
            )
        if self.periodic != "ewald":
            return super().choose(grains, box)
        chosen = self.ewald(grains, box)
        return CutoffChoice(
            chosen.radius,
            f"radius of the real part of an Ewald sum, {self.boundary}, accuracy {self.accuracy:g}: "
            f"alpha = {chosen.product:g}/radius, {chosen.waves} wave vectors and their opposites; predicted errors "
            f"of force {chosen.force_error:.1e}, of torque {chosen.torque_error:.1e}",
        )

    def uses_tree(self, grains: Grains, box: Box) -> bool:
        """Whether all pairs are summed with a tree."""
        if not box.is_open or self.periodic == "ewald" or self.cutoff not in (None, "auto"):
            return False
        return self.open == "tree" or (self.open == "auto" and len(grains) >= TREE_FROM)

    def tree(self, grains: Grains) -> TreeChoice:
        """The parameters of the tree."""
        return choose_tree(len(grains), self.accuracy)

    def ewald(self, grains: Grains, box: Box) -> EwaldChoice:
        """The parameters of the Ewald sum.

        Raises
        ------
        BadInput
            If the box is open along an axis, or needs too many wave vectors.
        """
        if any(side is None for side in box.lengths):
            raise BadInput(
                f"{self.name}: periodic = 'ewald' needs a box that is periodic along x, y and z, and the box is "
                f"{box.describe()}; give three lengths, or leave periodic out"
            )
        dipoles = max(int(grains.body_moment.any(axis=1).sum()), 1)
        least = SMALLEST_RADIUS * float(grains.radius.max())
        return choose_ewald(sides(box), len(grains), dipoles, self.accuracy, least)

    def resolved(self, grains: Grains, box: Box) -> dict[str, Any]:
        """Settings with the automatic cut-off as a number; those of an Ewald sum follow from grains and box."""
        return self.parameters() if self.periodic == "ewald" else super().resolved(grains, box)

    def automatic(self, grains: Grains, largest: float) -> CutoffChoice:
        """The thermal capture radius, at least two grain diameters, at most `largest`; none in an open box."""
        if math.isinf(largest):
            return super().automatic(grains, largest)
        capture = CAPTURE_RADII * thermal_capture(grains)
        shortest = 4.0 * float(grains.radius.max())
        full = f"{CAPTURE_RADII} b_max = {format_quantity(capture, 'm')}"
        half = f"{self.cut}, half the box / {HALF_BOX_RATIO}"
        if capture == 0.0:
            return CutoffChoice(largest, f"{half}, no grain has a magnetic moment")
        if capture >= largest:
            limit = f"{half}, limited by the box: less than {full}, so captures from farther away are missed"
            return CutoffChoice(largest, f"{limit}; use a larger box, or periodic = 'ewald'")
        if shortest >= largest:
            return CutoffChoice(largest, f"{half}, less than two grain diameters")
        if capture < shortest:
            return CutoffChoice(shortest, f"{self.cut}, two grain diameters, more than {full}")
        return CutoffChoice(capture, f"{self.cut}, {CAPTURE_RADII} b_max at the grains' thermal speed")

    def sums(self, box: Box, listed: bool, grains: Grains | None = None) -> LongRangeSums:
        """The loops over the pairs of the Verlet list if `listed`, else over all pairs, or the tree of these grains."""
        if grains is not None and self.uses_tree(grains, box):
            return TREE
        if self.periodic == "ewald":
            return ewald_sums(degree_for(self.accuracy), listed)
        if listed:
            return LISTED_PAIRS
        return ALL_PAIRS if box.is_open and self.cutoff in (None, "auto") else ALL_PAIRS_CUT

    def numbers(self, grains: Grains, box: Box) -> DipoleParameters | EwaldParameters | TreeParameters:
        """Parameters of the loops."""
        if self.uses_tree(grains, box):
            tree = self.tree(grains)
            return tree_parameters(len(grains), tree.degree, tree.opening)
        if self.periodic == "ewald":
            return ewald_parameters(self.ewald(grains, box), box, len(grains), self.boundary == "vacuum")
        return DipoleParameters(MAGNETIC, cutoff_for(self.choose(grains, box).radius, self.cut))

    def acts_on(self, grains: Grains) -> bool:
        """Whether any grain has a moment."""
        return bool(grains.body_moment.any())

    def energy_scale(self, grains: Grains) -> float:
        """|U_min| [J] of two grains in contact with the largest moment (Eq. 7)."""
        size = np.linalg.norm(grains.body_moment, axis=1)
        strongest = int(np.argmax(size))
        if size[strongest] == 0.0:
            return 0.0
        return contact_energy(size[strongest], size[strongest], 2.0 * grains.radius[strongest], MAGNETIC)


def thermal_capture(grains: Grains) -> float:
    """Capture radius b_max [m] (Eq. 13) of the mean moment at the thermal speed √(kT/m); infinite at rest."""
    temperature = kinetic_temperature(grains)
    mass = float(grains.mass.mean())
    moment = float(np.linalg.norm(grains.moment, axis=1).mean())
    if temperature == 0.0:
        return math.inf
    speed = math.sqrt(BOLTZMANN * temperature / mass)
    return float(capture_radius(moment, moment, 0.5 * mass, speed, MAGNETIC))


def kinetic_temperature(grains: Grains) -> float:
    """T [K] from the translational energy (3/2) (N − 1) k_B T of N grains in the centre-of-mass frame; 0 for one grain.

    The momentum is zero in this frame, so that 3 (N − 1) degrees of freedom are left.
    """
    mass = grains.mass
    drift = (mass[:, None] * grains.velocity).sum(axis=0) / mass.sum()
    energy = 0.5 * (mass * ((grains.velocity - drift) ** 2).sum(axis=1)).sum()
    return float(2.0 * energy / (3.0 * max(len(grains) - 1, 1) * BOLTZMANN))
