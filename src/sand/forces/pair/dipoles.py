"""Magnetic dipoles: every grain feels every other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...arguments import checked
from ...box import Box
from ...constants import BOLTZMANN, MAGNETIC
from ...grains import Grains
from ...units import format_quantity
from .cutoff import ROOM, Choice, WithCutoff, cutoff_for
from .dipole_formulas import capture_radius, contact_energy
from .dipole_loops import ALL_PAIRS, ALL_PAIRS_CUT, LISTED_PAIRS, DipoleParameters
from .loops import LongRangeSums

CAPTURE = 1.5
"""Automatic cut-off over b_max at thermal speed, in a large box."""


@checked
@dataclass(frozen=True)
class Dipoles(WithCutoff):
    """Forces and torques between magnetic moments.

    Parameters
    ----------
    cutoff
        "auto", None (no cut: all pairs in an open box, nearest images in a periodic one), or a length
        [m]. "auto" is None in an open box. In a periodic one it is 1.5 b_max(v_th), but at least two diameters of
        the largest grain, where that is less than (L/2)/1.35, and (L/2)/1.35 otherwise.
    cut
        "smooth", over the outer fifth of the radius, so that it costs no energy; or "sharp", the literal SAND,
        where the energy jumps each time a pair crosses the radius.

    Raises
    ------
    BadInput
        a cut-off that is neither; later, one beyond half the box.
    """

    name: ClassVar[str] = "dipoles"
    idle: ClassVar[str] = "dipoles are switched on but no grain has a magnetic moment"
    column: ClassVar[str] = "magnetic"
    references: ClassVar[str] = "Dominik & Nübold 2002, Eqs. 6, 34–41; Jackson 1975"

    def automatic(self, grains: Grains, half: float) -> Choice:
        """The reach of a thermal capture, at least two grain diameters, where it fits into the box."""
        capture = CAPTURE * thermal_capture(grains)
        shortest = 4.0 * float(grains.radius.max())
        if 0.0 < capture < shortest < half:
            would = f"{CAPTURE} b_max which would be {format_quantity(capture, 'm')}"
            return Choice(shortest, f"{self.cut}, two grain diameters, beyond {would}")
        if 0.0 < capture < half:
            return Choice(capture, f"{self.cut}, {CAPTURE} b_max at the grains' thermal speed")
        return Choice(
            half,
            f"{self.cut}, half the box / {ROOM}, inside {CAPTURE} b_max which would be {format_quantity(capture, 'm')}",
        )

    def sums(self, box: Box, listed: bool) -> LongRangeSums:
        """The loops that sum it: over listed pairs, or over all."""
        if listed:
            return LISTED_PAIRS
        return ALL_PAIRS if box.is_open and self.cutoff in (None, "auto") else ALL_PAIRS_CUT

    def numbers(self, grains: Grains, box: Box) -> DipoleParameters:
        """What the loops get."""
        return DipoleParameters(MAGNETIC, cutoff_for(self.choose(grains, box).radius, self.cut))

    def acts_on(self, grains: Grains) -> bool:
        """False if no grain feels it."""
        return bool(grains.body_moment.any())

    def energy_scale(self, grains: Grains) -> float:
        """|U_min| [J] of the two strongest moments at touch (Eq. 7)."""
        size = np.linalg.norm(grains.body_moment, axis=1)
        strongest = int(np.argmax(size))
        if size[strongest] == 0.0:
            return 0.0
        return contact_energy(size[strongest], size[strongest], 2.0 * grains.radius[strongest], MAGNETIC)


def thermal_capture(grains: Grains) -> float:
    """b_max [m] (Eq. 13) of the mean moment at the grains' own thermal speed √(kT/m); infinite if cold."""
    temperature = kinetic_temperature(grains)
    mass = float(grains.mass.mean())
    moment = float(np.linalg.norm(grains.moment, axis=1).mean())
    if temperature == 0.0:
        return math.inf
    speed = math.sqrt(BOLTZMANN * temperature / mass)
    return float(capture_radius(moment, moment, 0.5 * mass, speed, MAGNETIC))


def kinetic_temperature(grains: Grains) -> float:
    """T [K] from the mean translational energy (3/2) k_B T in the frame of the centre of mass."""
    mass = grains.mass
    drift = (mass[:, None] * grains.velocity).sum(axis=0) / mass.sum()
    energy = 0.5 * (mass * ((grains.velocity - drift) ** 2).sum(axis=1)).sum()
    return float(2.0 * energy / (3.0 * len(grains) * BOLTZMANN))
