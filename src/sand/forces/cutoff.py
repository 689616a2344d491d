"""Where a long-range force ends: what the user may give, and what the kernels get."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..core.box import Box
from ..core.errors import BadInput
from ..core.units import si, spoken
from ..physics.dipole import Cutoff

CUTS = ("smooth", "sharp")
SHELL = 0.2
"""Part of the cut-off radius over which a smooth cut switches the interaction off."""
SHARP = 1e15
"""r_c² over the shell of a sharp cut: thinner than numbers can tell."""

UNCUT = Cutoff(1e300, 1e-200)
"""No cut: the weight is 1 and its slope 0 at any distance; infinities would make 0 × ∞."""
ROOM = 1.35
"""Half the box over the automatic cut-off: leaves room for a list's margin."""


class Choice(NamedTuple):
    """A cut-off [m] (None: none) and why."""

    radius: float | None
    reason: str


def cutoff_given(cutoff: Any, name: str) -> float | None:
    """A length [m], or None for None and "none" (how a case file says it).  Raises BadInput."""
    if cutoff is None or (isinstance(cutoff, str) and cutoff == "none"):
        return None
    return si(cutoff, "m", f"{name}: cutoff", above=0.0)


def spoken_cut(cutoff: float | None, cut: str, box: Box, name: str) -> Choice:
    """The user's own cut-off as a choice.  Raises BadInput if it reaches beyond half the box."""
    if cutoff is None:
        where = "all pairs, open box" if box.is_open else "nearest images, energy jumps at half the box"
        return Choice(None, f"no cut-off asked for: {where}")
    if cutoff > 0.5 * box.shortest:
        raise BadInput(
            f"{name}: cutoff = {spoken(cutoff, 'm')} reaches beyond half the box "
            f"({spoken(0.5 * box.shortest, 'm')}); take a larger box or a cutoff up to that"
        )
    return Choice(cutoff, f"{cut}, given by the user")


def cutoff_for(radius: float | None, cut: str) -> Cutoff:
    """The numbers of the weight S(r²)."""
    if radius is None:
        return UNCUT
    if cut == "sharp":
        return Cutoff(radius**2, SHARP / radius**2)
    inner = (1.0 - SHELL) * radius
    return Cutoff(radius**2, 1.0 / (radius**2 - inner**2))
