"""Cut-offs of long-range forces: user input, automatic choice, parameters of the kernels."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, NamedTuple

from ...basics.box import Box
from ...basics.errors import BadInput
from ...basics.grains import Grains
from ...basics.settings import Number, Settings, Word
from ...basics.units import format_quantity, is_word
from .dipole_formulas import Cutoff

SHELL = 0.2
"""Width of the outer shell in which a smooth cut-off switches the interaction off, in units of the cut-off radius."""
SHARP = 1e15
"""r_c²/(r_c² − r_s²) of a sharp cut-off: the shell is thinner than the rounding of distances."""
UNCUT = Cutoff(1e300, 1e-200)
"""No cut-off: weight 1 and slope 0 at any distance; infinite parameters would give 0 × ∞."""
HALF_BOX_RATIO = 1.35
"""Ratio of half the box to the automatic cut-off, and of the radius of the paper's neighbour list to its cut-off."""


class CutoffChoice(NamedTuple):
    """A cut-off radius [m], None for no cut-off, and the reason for it."""

    radius: float | None
    reason: str

    def __str__(self) -> str:
        return f"{'none' if self.radius is None else format_quantity(self.radius, 'm')} ({self.reason})"


def cutoff_for(radius: float | None, cut: str) -> Cutoff:
    """Parameters of the weight S(r²) for a cut-off radius [m]."""
    if radius is None:
        return UNCUT
    if cut == "sharp":
        return Cutoff(radius**2, SHARP / radius**2)
    inner = (1.0 - SHELL) * radius
    return Cutoff(radius**2, 1.0 / (radius**2 - inner**2))


class _Radius(Number):
    """A radius [m], "auto", or None, in case files "none"."""

    def read(self, value: Any, name: str) -> Any:
        """The radius."""
        return None if value is None or is_word(value, "none") else super().read(value, name)

    def write(self, value: Any) -> Any:
        """The radius, as in a case file."""
        return "none" if value is None else value


CutoffRadius = Annotated[Any, _Radius("m", above=0.0, auto=True)]
"""Type of a cut-off radius."""
Cut = Annotated[str, Word("smooth", "sharp")]
"""Type of the way in which an interaction ends."""


class CutoffForce(Settings):
    """Base class of the long-range forces: their cut-off and its warnings.

    Subclasses are frozen dataclasses with the fields `cutoff: CutoffRadius = "auto"` and `cut: Cut = "smooth"`.
    """

    cutoff: CutoffRadius
    cut: Cut

    name: ClassVar[str]
    no_effect: ClassVar[str]  # warning if no grain is subject to the force

    def resolved(self, grains: Grains, box: Box) -> dict[str, Any]:
        """Settings in SI units with the cut-off as a number or "none", for a run that is resumed."""
        radius = self.choose(grains, box).radius
        return self.parameters() | {"cutoff": "none" if radius is None else radius}

    def choose(self, grains: Grains, box: Box) -> CutoffChoice:
        """The cut-off radius, with the reason.

        Raises
        ------
        BadInput
            If a cut-off given by the user exceeds half the box.
        """
        if self.cutoff is None:
            where = "all pairs, open box" if box.is_open else "nearest images, energy jumps at half the box"
            return CutoffChoice(None, f"no cut-off, given by the user: {where}")
        if self.cutoff != "auto":
            half = 0.5 * box.shortest
            if self.cutoff > half:
                raise BadInput(
                    f"{self.name}: cutoff = {format_quantity(self.cutoff, 'm')} exceeds half the box "
                    f"({format_quantity(half, 'm')}); use a larger box or a cutoff up to that"
                )
            return CutoffChoice(self.cutoff, f"{self.cut}, given by the user")
        return self.automatic(grains, math.inf if box.is_open else 0.5 * box.shortest / HALF_BOX_RATIO)

    def automatic(self, grains: Grains, largest: float) -> CutoffChoice:
        """The automatic cut-off; `largest` is its upper limit [m], infinite in an open box."""
        if math.isinf(largest):
            return CutoffChoice(None, "open box: all pairs")
        return CutoffChoice(largest, f"{self.cut}, half the box / {HALF_BOX_RATIO}")

    def acts_on(self, grains: Grains) -> bool:
        """Whether any grain is subject to the force."""
        raise NotImplementedError

    def largest_energy(self, grains: Grains, distance: float) -> float:
        """Largest |U| [J] of two grains at a distance [m], without the cut-off."""
        raise NotImplementedError

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warnings: no grain is subject to the force, or nearest images are summed without a cut-off.

        Raises
        ------
        BadInput
            If a setting is invalid or has no effect in this box.
        """
        choice = self.choose(grains, box)
        if choice.radius is None and self.cut != "smooth":
            raise BadInput(
                f"{self.name}: cut = {self.cut!r} has no effect without a cut-off ({choice.reason}); "
                "give cutoff, or leave cut out"
            )
        warnings = [] if self.acts_on(grains) else [self.no_effect]
        if choice.radius is None and not box.is_open:
            warnings.append(
                f"{self.name}: cutoff = none in a periodic box: the energy jumps when nearest images change"
            )
        return warnings
