"""Magnetic dipole forces between all grains."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from ...basics.arguments import checked
from ...basics.box import Box
from ...basics.constants import BOLTZMANN, MAGNETIC
from ...basics.grains import Grains
from ...basics.ramps import rampable
from ...basics.settings import Word
from ...basics.temperature import kinetic_temperature, sums_of_clusters
from ...basics.units import format_quantity
from .cutoff import HALF_BOX_RATIO, Cut, CutoffChoice, CutoffRadius, cutoff_for
from .dipole_formulas import capture_radius, contact_energy
from .dipole_loops import ALL_PAIRS, ALL_PAIRS_CUT, LISTED_PAIRS, DipoleParameters
from .ewald import degree_for, ewald_parameters
from .ewald_fit import DIPOLES, Sources
from .ewald_force import DEFAULT_ACCURACY, PERIODIC, Accuracy, Boundary, EwaldForce, Reciprocal
from .ewald_loops import EwaldParameters, MeshEwaldParameters, ewald_sums
from .long_range_loops import LongRangeSums
from .tree import TREE_FROM, TreeChoice, choose_tree, tree_parameters
from .tree_loops import TREE, TreeParameters

CAPTURE_RADII = 1.5
"""Automatic cut-off in a large box, in units of the capture radius b_max at thermal speed."""


class CapturingPair(NamedTuple):
    """The two bodies with the largest moments, and how far from each other they capture."""

    capture: float  # b_max [m] at thermal speed; 0 with fewer than two moments, infinite at rest
    first: int  # grains of each; 0 with fewer than two moments
    second: int

    def __str__(self) -> str:
        if max(self.first, self.second) == 1:
            return "single grains"
        if min(self.first, self.second) == 1:
            return f"a cluster of {max(self.first, self.second)} grains and a single grain"
        return f"clusters of {self.first} and {self.second} grains"


@checked
@rampable
@dataclass(frozen=True)
class Dipoles(EwaldForce):
    """Forces and torques between magnetic moments.

    Parameters
    ----------
    cutoff : float, str or None, optional
        "auto", None (no cut-off: all pairs in an open box, nearest images in a periodic one), or a length [m]. "auto"
        is None in an open box. In a periodic one it is 1.5 b_max of the two clusters with the largest moments, at
        thermal speed, but at least two diameters of the largest grain and at most (L/2)/1.35. A cluster is a group of
        grains connected by contacts, or a single grain. The cut-off grows during a run: it is chosen anew when b_max
        has grown by 10 %. Clusters are compared after each step in which a contact formed or broke. The temperature is
        that of the clusters' translation at the start. The change of the energy is logged as `lost_cutoff_changed`. A
        cut-off that is given as a length stays the same.
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
        Of the Ewald sum, 1e-8 … 0.1, or of the tree, 1e-6 … 0.1, a number without unit: largest rms error of the forces
        (in N) as a fraction of √6 k μ²/a⁴, and of the torques (in N m) as a fraction of √2 k μ²/a³; k = μ₀/4π, μ the
        rms moment, and a = (3V/4πn)^(1/3) for n moments in the volume V, at most 0.4 of the shortest side. These are
        the rms force and torque in a gas of such moments. The parameters of the sum are the cheapest with this
        accuracy.
    boundary : str, optional
        What surrounds the images of the Ewald sum, at infinity: "tin-foil" (a medium of infinite permeability: no
        demagnetising field) or "vacuum" (a sphere of images in vacuum: demagnetising field −μ₀M/3 of the total
        moment, M per volume).
    reciprocal : str, optional
        How the reciprocal part of the Ewald sum is computed: "direct", summed over wave vectors; "mesh", by Fourier
        transforms on a mesh; "auto", the cheaper of both (the mesh from one or two thousand grains on).

    Raises
    ------
    BadInput
        If a parameter is invalid; later, if the cut-off exceeds half the box, a box of an Ewald sum is open along an
        axis, `open` or `cut` have no effect in the box, or an Ewald sum would need too many wave vectors and nodes.
    """

    cutoff: CutoffRadius = "auto"
    cut: Cut = "smooth"
    periodic: Annotated[str, Word(*PERIODIC)] = "nearest image"
    open: Annotated[str, Word("auto", "pairs", "tree")] = "auto"
    accuracy: Accuracy = DEFAULT_ACCURACY
    boundary: Boundary = "tin-foil"
    reciprocal: Reciprocal = "auto"

    name: ClassVar[str] = "dipoles"
    no_effect: ClassVar[str] = "dipoles are switched on but no grain has a magnetic moment"
    column: ClassVar[str] = "magnetic"
    references: ClassVar[str] = (
        "Dominik & Nübold 2002, Eqs. 6, 34–41; Jackson 1975; Ewald sum: de Leeuw, Perram & Smith 1980; Wang & Holm 2001"
        "; Essmann et al. 1995; tree: Dehnen 2002"
    )
    sources: ClassVar[Sources] = DIPOLES

    def carriers(self, grains: Grains) -> int:
        """Number of grains with a moment."""
        return int(grains.body_moment.any(axis=1).sum())

    def resolved(self, grains: Grains, box: Box) -> dict[str, Any]:
        """Settings; a cut-off in an open box as "none".

        An Ewald sum follows from grains and box, and a cut-off that follows the clusters from the state.
        """
        own = self.periodic == "ewald" or self.follows_clusters(box)
        return self.parameters() if own else super().resolved(grains, box)

    def follows_clusters(self, box: Box) -> bool:
        """Whether the cut-off is chosen anew during a run."""
        return self.cutoff == "auto" and self.periodic != "ewald" and not box.is_open

    def choose(self, grains: Grains, box: Box) -> CutoffChoice:
        """The cut-off radius, or that of the real part of the Ewald sum, or none with a tree, with the reason."""
        if not self.uses_tree(grains, box):
            return super().choose(grains, box)
        tree = self.tree(grains)
        return CutoffChoice(
            None,
            f"open box: all grains, by a tree of multipoles, degree {tree.degree}, opening angle {tree.opening:g}, "
            f"accuracy {self.accuracy:g}; predicted errors of force {tree.force_error:.1e}, "
            f"of torque {tree.torque_error:.1e}",
        )

    def uses_tree(self, grains: Grains, box: Box) -> bool:
        """Whether all pairs are summed with a tree."""
        if not box.is_open or self.periodic == "ewald" or self.cutoff not in (None, "auto"):
            return False
        return self.open == "tree" or (self.open == "auto" and len(grains) >= TREE_FROM)

    def tree(self, grains: Grains) -> TreeChoice:
        """The parameters of the tree."""
        return choose_tree(len(grains), self.accuracy)

    def automatic(self, grains: Grains, largest: float) -> CutoffChoice:
        """The cut-off for single grains; none in an open box."""
        if math.isinf(largest):
            return super().automatic(grains, largest)
        return self.for_pair(capturing_pair(grains, None, kinetic_temperature(grains)), grains, largest)

    def for_pair(self, pair: CapturingPair, grains: Grains, largest: float) -> CutoffChoice:
        """1.5 capture radii of a pair of clusters, at least two diameters of the largest grain, at most `largest`."""
        capture = CAPTURE_RADII * pair.capture
        shortest = 4.0 * float(grains.radius.max())
        full = f"{CAPTURE_RADII} b_max = {format_quantity(capture, 'm')}"
        half = f"{self.cut}, half the box / {HALF_BOX_RATIO}"
        if capture == 0.0:
            few = "only one cluster has" if self.acts_on(grains) else "no grain has"
            return CutoffChoice(largest, f"{half}, {few} a magnetic moment")
        if capture >= largest:
            limit = f"{half}, limited by the box: less than {full}, so captures from farther away are missed"
            return CutoffChoice(largest, f"{limit}; use a larger box, or periodic = 'ewald'")
        if shortest >= largest:
            return CutoffChoice(largest, f"{half}, less than two grain diameters")
        if capture < shortest:
            return CutoffChoice(shortest, f"{self.cut}, two grain diameters, more than {full}")
        return CutoffChoice(capture, f"{self.cut}, {CAPTURE_RADII} b_max of {pair} at thermal speed")

    def sums(self, box: Box, listed: bool, grains: Grains | None = None) -> LongRangeSums:
        """The loops over the pairs of the Verlet list if `listed`, else over all pairs, or the tree of these grains."""
        if grains is not None and self.uses_tree(grains, box):
            return TREE
        if self.periodic == "ewald":
            order = 0 if grains is None or box.is_open else self.ewald(grains, box).order
            return ewald_sums(degree_for(self.accuracy), listed, order)
        if listed:
            return LISTED_PAIRS
        return ALL_PAIRS if box.is_open and self.cutoff in (None, "auto") else ALL_PAIRS_CUT

    def numbers(
        self, grains: Grains, box: Box
    ) -> DipoleParameters | EwaldParameters | MeshEwaldParameters | TreeParameters:
        """Parameters of the loops."""
        if self.uses_tree(grains, box):
            tree = self.tree(grains)
            return tree_parameters(len(grains), tree.degree, tree.opening)
        if self.periodic == "ewald":
            choice, moves = self.ewald(grains, box), self.chosen is not None
            return ewald_parameters(choice, box, len(grains), self.boundary == "vacuum", follows_box=moves)
        return self.numbers_at(self.choose(grains, box).radius)

    def numbers_at(self, radius: float | None) -> DipoleParameters:
        """Parameters of the loops for a cut-off radius [m], without an Ewald sum."""
        return DipoleParameters(MAGNETIC, cutoff_for(radius, self.cut))

    def acts_on(self, grains: Grains) -> bool:
        """Whether any grain has a moment."""
        return bool(grains.body_moment.any())

    def largest_energy(self, grains: Grains, distance: float) -> float:
        """|U| [J] of the two largest moments, parallel and in line, at a distance [m]."""
        if len(grains) < 2:
            return 0.0
        size = np.linalg.norm(grains.body_moment, axis=1)
        a, b = np.argpartition(-size, 1)[:2]
        return float(contact_energy(size[a], size[b], distance, MAGNETIC))

    def energy_scale(self, grains: Grains) -> float:
        """|U_min| [J] of two grains in contact with the largest moment (Eq. 7)."""
        size = np.linalg.norm(grains.body_moment, axis=1)
        strongest = int(np.argmax(size))
        if size[strongest] == 0.0:
            return 0.0
        return contact_energy(size[strongest], size[strongest], 2.0 * grains.radius[strongest], MAGNETIC)


def capturing_pair(grains: Grains, labels: np.ndarray | None, temperature: float) -> CapturingPair:
    """The two clusters with the largest moments |Σμ|, and b_max (Eq. 13) at their thermal speed.

    Parameters
    ----------
    grains : Grains
        The grains.
    labels : ndarray or None
        Cluster of each grain (N,), 0…K−1; None: grains without contacts.
    temperature : float
        T [K] of the translation of clusters. The speed √(kT/2m̄), m̄ the reduced mass, is √(kT/m) for equal masses m.
    """
    mass, moment, number = sums_of_clusters(grains, labels, grains.moment)
    size = np.linalg.norm(moment, axis=1)
    if np.count_nonzero(size) < 2:
        return CapturingPair(0.0, 0, 0)
    a, b = np.argsort(-size, kind="stable")[:2]
    first, second = int(number[a]), int(number[b])
    if temperature == 0.0:
        return CapturingPair(math.inf, first, second)
    reduced = mass[a] * mass[b] / (mass[a] + mass[b])
    speed = math.sqrt(BOLTZMANN * temperature / (2.0 * reduced))
    return CapturingPair(float(capture_radius(size[a], size[b], reduced, speed, MAGNETIC)), first, second)
