"""Base class of the forces that can be summed over all periodic images: settings, and choice of the Ewald sum."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, ClassVar

from ...box import Box
from ...errors import BadInput, ErrorCollector, did_you_mean, shown
from ...grains import Grains
from ...units import si
from .cutoff import CutoffChoice, CutoffForce
from .ewald import EwaldChoice, choose_ewald, sides
from .ewald_fit import Sources
from .tree import ACCURACIES as TREE_ACCURACIES

PERIODIC = ("nearest image", "ewald")
BOUNDARIES = ("tin-foil", "vacuum")
RECIPROCALS = ("auto", "direct", "mesh")
OPEN = ("auto", "pairs", "tree")
ACCURACIES = 1e-8, 0.1
"""Smallest and largest accuracy of an Ewald sum."""
DEFAULT_ACCURACY = 1e-3
SMALLEST_RADIUS = 6.0
"""Smallest radius of the real part of an Ewald sum, in radii of the largest grain, if the box allows it."""


class EwaldForce(CutoffForce):
    """A long-range force with the fields `periodic`, `accuracy` and `boundary` beside those of `CutoffForce`.

    Subclasses are frozen dataclasses with `periodic: str = "nearest image"`, `accuracy: Any = DEFAULT_ACCURACY` and
    `boundary: str = "tin-foil"` and `reciprocal: str = "auto"`; with `open: str = "auto"` if there is a tree.
    """

    periodic: str
    accuracy: Any
    boundary: str
    reciprocal: str
    open: str = "pairs"

    sources: ClassVar[Sources]

    def __post_init__(self) -> None:
        errors = ErrorCollector()
        words = ("periodic", PERIODIC), ("boundary", BOUNDARIES), ("reciprocal", RECIPROCALS), ("open", OPEN)
        for name, allowed in words:
            value = getattr(self, name)
            if value not in allowed:
                errors.problems.append(f"{self.name}: {name} = {shown(value)}; {did_you_mean(str(value), allowed)}")
        accuracy = errors.take(si, self.accuracy, "1", f"{self.name}: accuracy", least=ACCURACIES[0])
        if accuracy is not None:
            object.__setattr__(self, "accuracy", accuracy)
            if accuracy > ACCURACIES[1]:
                errors.problems.append(f"{self.name}: accuracy = {accuracy:g} must be at most {ACCURACIES[1]:g}")
            elif self.open == "tree" and accuracy < TREE_ACCURACIES[0]:
                errors.problems.append(
                    f"{self.name}: accuracy = {accuracy:g} must be at least {TREE_ACCURACIES[0]:g} with open = 'tree'; "
                    "open = 'pairs' is exact"
                )
        errors.take(super().__post_init__)
        errors.problems += self._contradictions()
        errors.done()

    def _contradictions(self) -> list[str]:
        """Settings that cannot be given together, or are not used; a misspelt word is not judged."""
        problems, ewald = [], "periodic = 'ewald'"
        if self.periodic == "ewald":
            for name in self._given("cutoff", "cut"):
                problems.append(
                    f"{self.name}: {name} = {shown(getattr(self, name))} cannot be given with {ewald}, "
                    "which sums all images and chooses the radius of its real part; leave one of them out"
                )
            if self._given("open"):
                problems.append(
                    f"{self.name}: open = {shown(self.open)} is for open boxes and {ewald} for periodic ones; "
                    "leave one of them out"
                )
        elif self.periodic in PERIODIC:
            uses = {"boundary": ewald, "reciprocal": ewald}
            if self.open != "tree":
                uses["accuracy"] = f"{ewald} or open = 'tree'" if type(self).open == "auto" else ewald
            for name in self._given(*uses):
                problems.append(f"{self.name}: {name} is used only with {uses[name]}; add that, or leave it out")
            for name in self._given("cutoff", "cut") if self._given("open") and self.open in OPEN else ():
                if getattr(self, name) is not None:
                    problems.append(
                        f"{self.name}: {name} = {shown(getattr(self, name))} cannot be given with open = "
                        f"{shown(self.open)}, which sums all pairs; leave one of them out"
                    )
        return problems

    def _given(self, *names: str) -> list[str]:
        """Of these fields the ones that differ from their defaults."""
        return [name for name in names if shown(getattr(self, name)) != shown(getattr(type(self), name))]

    def of_nearest_images(self) -> EwaldForce:
        """The same force between nearest images, summed directly."""
        names = [name for name in ("accuracy", "boundary", "reciprocal") if hasattr(type(self), name)]
        plain = {name: getattr(type(self), name) for name in names} | {"periodic": "nearest image"}
        if "open" in {each.name for each in fields(self)}:  # type: ignore[arg-type]
            plain["open"] = type(self).open
        return replace(self, **plain)  # type: ignore[type-var]

    def carriers(self, grains: Grains) -> int:
        """Number of grains with a charge or moment."""
        raise NotImplementedError

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warnings, as for all cut-offs; raises BadInput also if `open` has no effect in this box."""
        errors = ErrorCollector()
        if self._given("open") and not box.is_open:
            errors.problems.append(
                f"{self.name}: open = {shown(self.open)} is for open boxes, and the box is {box.describe()}; "
                "leave it out, or use an open box"
            )
        warnings = errors.take(super().check, grains, box)
        errors.done()
        return warnings or []

    def choose(self, grains: Grains, box: Box) -> CutoffChoice:
        """The cut-off radius, or that of the real part of the Ewald sum, with the reason."""
        if self.periodic != "ewald":
            return super().choose(grains, box)
        chosen = self.ewald(grains, box)
        return CutoffChoice(
            chosen.radius,
            f"radius of the real part of an Ewald sum, {self.boundary}, accuracy {self.accuracy:g}: "
            f"alpha = {chosen.product:g}/radius, {chosen.reciprocal}; predicted errors "
            f"of force {chosen.force_error:.1e}, of {self.sources.field} {chosen.field_error:.1e}",
        )

    def ewald(self, grains: Grains, box: Box) -> EwaldChoice:
        """The parameters of the Ewald sum.

        Raises
        ------
        BadInput
            If the box is open along an axis, or needs too many wave vectors and nodes.
        """
        if any(side is None for side in box.lengths):
            raise BadInput(
                f"{self.name}: periodic = 'ewald' needs a box that is periodic along x, y and z, and the box is "
                f"{box.describe()}; give three lengths, or leave periodic out"
            )
        least = SMALLEST_RADIUS * float(grains.radius.max())
        carriers = max(self.carriers(grains), 1)
        return choose_ewald(sides(box), len(grains), carriers, self.accuracy, least, self.sources, self.reciprocal)

    def resolved(self, grains: Grains, box: Box) -> dict[str, Any]:
        """Settings with the automatic cut-off as a number; those of an Ewald sum follow from grains and box."""
        return self.parameters() if self.periodic == "ewald" else super().resolved(grains, box)
