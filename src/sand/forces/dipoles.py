"""Magnetic dipoles: every grain feels every other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..core.box import Box
from ..core.constants import BOLTZMANN, MAGNETIC
from ..core.errors import FORBID_EXTRA, BadInput
from ..core.grains import Grains
from ..core.units import si, spoken
from ..kernels.dipoles import BARE, CUT, OFF
from ..physics.dipole import Cutoff, capture_radius, contact_energy

SHELL = 0.2
"""Part of the cut-off radius over which the interaction is switched off."""
ROOM = 1.35
"""Half the box over the automatic cut-off: leaves room for a list's margin."""
CAPTURE = 1.5
"""Automatic cut-off over b_max at thermal speed, in a large box."""


class Choice(NamedTuple):
    """A cut-off [m] (None: none) and why."""

    radius: float | None
    reason: str


@dataclass(frozen=True)
class Dipoles:
    """Forces and torques between magnetic moments, all pairs.

    Args:
        cutoff: "auto", None (no cut: all pairs in an open box, nearest images in a periodic one), or a length
            [m]. The cut is smooth, over the outer fifth of the radius, so that it costs no energy. "auto" is
            None in an open box and min(1.5 b_max(v_th), (L/2)/1.35) in a periodic one.

    Raises:
        BadInput: a cut-off that is neither; later, one beyond half the box.
    """

    cutoff: Any = "auto"

    __pydantic_config__ = FORBID_EXTRA
    name = "dipoles"
    references = "Dominik & Nübold 2002, Eqs. 6, 34–41; Jackson 1975"

    def __post_init__(self) -> None:
        if self.cutoff == "none":  # how a case file says None
            object.__setattr__(self, "cutoff", None)
        if self.cutoff is not None and self.cutoff != "auto":
            object.__setattr__(self, "cutoff", si(self.cutoff, "m", "dipoles: cutoff", above=0.0))

    def parameters(self) -> dict[str, Any]:
        return {"cutoff": "none" if self.cutoff is None else self.cutoff}

    def choose(self, grains: Grains, box: Box) -> Choice:
        """The cut-off in force, with its reason.  Raises BadInput if it does not fit into the box."""
        if self.cutoff is None:
            where = "all pairs, open box" if box.is_open else "nearest images, energy jumps at half the box"
            return Choice(None, f"no cut-off asked for: {where}")
        if self.cutoff != "auto":
            if self.cutoff > 0.5 * box.shortest:
                raise BadInput(
                    f"dipoles: cutoff = {spoken(self.cutoff, 'm')} reaches beyond half the box "
                    f"({spoken(0.5 * box.shortest, 'm')}); take a larger box or a cutoff up to that"
                )
            return Choice(self.cutoff, "given by the user")
        if box.is_open:
            return Choice(None, "open box: all pairs")
        half = 0.5 * box.shortest / ROOM
        capture = CAPTURE * thermal_capture(grains)
        if 0.0 < capture < half:
            return Choice(capture, f"{CAPTURE} b_max at the grains' thermal speed")
        return Choice(half, f"half the box / {ROOM}; {CAPTURE} b_max would be {spoken(capture, 'm')}")

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warns when no grain has a moment, or when nearest images are summed without a cut."""
        choice = self.choose(grains, box)
        warnings = []
        if not grains.body_moment.any():
            warnings.append("dipoles are switched on but no grain has a magnetic moment")
        if choice.radius is None and not box.is_open:
            warnings.append("dipoles: cutoff = none in a periodic box: energy jumps when images change")
        return warnings

    def way(self, grains: Grains, box: Box) -> tuple[int, Cutoff]:
        """How the kernels are to sum (kernels/dipoles.py)."""
        if not grains.body_moment.any():
            return OFF, Cutoff(math.inf, 0.0)
        radius = self.choose(grains, box).radius
        if radius is None:
            # in a periodic box without a cut everything counts: the shell lies beyond any image
            far = 4.0 * sum(v or 0.0 for v in box.lengths) + 1.0
            return (BARE if box.is_open else CUT), Cutoff((2.0 * far) ** 2, 1.0 / (3.0 * far**2))
        inner = (1.0 - SHELL) * radius
        return CUT, Cutoff(radius**2, 1.0 / (radius**2 - inner**2))

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
