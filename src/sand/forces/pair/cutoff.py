"""Where a long-range force ends: what the user may give, and what the kernels get."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from ...box import Box
from ...errors import FORBID_EXTRA, BadInput, did_you_mean
from ...grains import Grains
from ...units import format_quantity, is_word, si
from .dipole_formulas import Cutoff

CUTS = ("smooth", "sharp")
SHELL = 0.2
"""Part of the cut-off radius over which a smooth cut switches the interaction off."""
SHARP = 1e15
"""r_c² over the shell of a sharp cut: thinner than numbers can tell."""

UNCUT = Cutoff(1e300, 1e-200)
"""No cut: the weight is 1 and its slope 0 at any distance; infinities would make 0 × ∞."""
ROOM = 1.35
"""Half the box over the automatic cut-off: so much farther the paper's list reached."""


class Choice(NamedTuple):
    """A cut-off [m] (None: none) and why."""

    radius: float | None
    reason: str


def cutoff_given(cutoff: Any, name: str) -> float | None:
    """A length [m], or None for None and "none" (how a case file says it).  Raises BadInput."""
    if cutoff is None or is_word(cutoff, "none"):
        return None
    return si(cutoff, "m", f"{name}: cutoff", above=0.0)


def describe_cutoff(cutoff: float | None, cut: str, box: Box, name: str) -> Choice:
    """The user's own cut-off as a choice.  Raises BadInput if it reaches beyond half the box."""
    if cutoff is None:
        where = "all pairs, open box" if box.is_open else "nearest images, energy jumps at half the box"
        return Choice(None, f"no cut-off asked for: {where}")
    if cutoff > 0.5 * box.shortest:
        raise BadInput(
            f"{name}: cutoff = {format_quantity(cutoff, 'm')} reaches beyond half the box "
            f"({format_quantity(0.5 * box.shortest, 'm')}); take a larger box or a cutoff up to that"
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


@dataclass(frozen=True)
class WithCutoff:
    """What all long-range forces have: an end, and something to warn of. `cutoff` and `cut` as the force says."""

    cutoff: Any = "auto"
    cut: str = "smooth"

    __pydantic_config__ = FORBID_EXTRA
    name: ClassVar[str]
    idle: ClassVar[str]  # what is said where no grain feels it

    def __post_init__(self) -> None:
        problems = []
        if self.cut not in CUTS:
            problems.append(f"{self.name}: cut = {self.cut!r}; {did_you_mean(str(self.cut), CUTS)}")
        if not is_word(self.cutoff, "auto"):
            try:
                object.__setattr__(self, "cutoff", cutoff_given(self.cutoff, self.name))
            except BadInput as error:
                problems += error.problems
        if problems:
            raise BadInput(problems)

    def parameters(self) -> dict[str, Any]:
        return {"cutoff": "none" if self.cutoff is None else self.cutoff, "cut": self.cut}

    def choose(self, grains: Grains, box: Box) -> Choice:
        """The cut-off in force, with its reason.  Raises BadInput if it does not fit into the box."""
        if self.cutoff != "auto":
            return describe_cutoff(self.cutoff, self.cut, box, self.name)
        if box.is_open:
            return Choice(None, "open box: all pairs")
        return self.automatic(grains, 0.5 * box.shortest / ROOM)

    def automatic(self, grains: Grains, half: float) -> Choice:
        """The cut-off in a periodic box where the user gave none; at most `half` [m]."""
        return Choice(half, f"{self.cut}, half the box / {ROOM}")

    def acts_on(self, grains: Grains) -> bool:
        """False if no grain feels it."""
        raise NotImplementedError

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warns when no grain feels it, or when nearest images are summed without a cut."""
        choice = self.choose(grains, box)
        warnings = [] if self.acts_on(grains) else [self.idle]
        if choice.radius is None and not box.is_open:
            warnings.append(f"{self.name}: cutoff = none in a periodic box: energy jumps when images change")
        return warnings
