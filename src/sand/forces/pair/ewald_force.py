"""Base class of the forces that can be summed over all periodic images: settings, and choice of the Ewald sum."""

from __future__ import annotations

import copy
from collections.abc import Set
from dataclasses import fields, replace
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from ...basics.box import Box
from ...basics.errors import BadInput, ErrorCollector, shown
from ...basics.grains import Grains
from ...basics.settings import Number, Word
from .cutoff import CutoffChoice, CutoffForce
from .ewald import EwaldChoice, choose_ewald, half_of_vectors, sides
from .ewald_fit import Sources
from .tree import ACCURACIES as TREE_ACCURACIES

PERIODIC = ("nearest image", "ewald")
Accuracy = Annotated[Any, Number(least=1e-8, most=0.1)]
"""Type of the accuracy of an Ewald sum."""
Boundary = Annotated[str, Word("tin-foil", "vacuum")]
"""Type of what surrounds the images of an Ewald sum."""
Reciprocal = Annotated[str, Word("auto", "direct", "mesh")]
"""Type of the way in which the reciprocal part of an Ewald sum is computed."""
DEFAULT_ACCURACY = 1e-3
SMALLEST_RADIUS = 6.0
"""Smallest radius of the real part of an Ewald sum, in radii of the largest grain, if the box allows it."""


MOST_STRAIN = 2e-3
"""Change of a side of a box after which the parameters of an Ewald sum are chosen anew: errors grow by up to 6 %."""


class EwaldForce(CutoffForce):
    """A long-range force with the fields `periodic`, `accuracy` and `boundary` beside those of `CutoffForce`.

    Subclasses are frozen dataclasses with `periodic`, by default "nearest image" or "auto", `accuracy: Accuracy =
    DEFAULT_ACCURACY`, `boundary: Boundary = "tin-foil"` and `reciprocal: Reciprocal = "auto"`; with `open`, "auto" by
    default, if there is a tree.

    periodic = "auto" is the Ewald sum in a box that is periodic along all axes if neither `cutoff` nor `cut` is given
    and the sum is possible, else nearest images, or all pairs in an open box.
    """

    periodic: str
    accuracy: Any
    boundary: str
    reciprocal: str
    open: str = "pairs"

    sources: ClassVar[Sources]
    chosen: ClassVar[EwaldChoice | None] = None  # of a force in a box that may be deformed, see `with_choice`

    def contradictions(self, wrong: Set[str]) -> list[str]:
        """Settings that cannot be given together, or are not used; a misspelt word is not judged."""
        problems: list[str] = []
        ewald = "periodic = 'ewald'"
        if not wrong & {"open", "accuracy"} and self.open == "tree" and self.accuracy < TREE_ACCURACIES[0]:
            problems.append(
                f"accuracy = {self.accuracy:g} must be at least {TREE_ACCURACIES[0]:g} with open = 'tree'; "
                "open = 'pairs' is exact"
            )
        if "periodic" in wrong:
            return problems
        if self.periodic == "ewald":
            for name in self._given("cutoff", "cut"):
                problems.append(
                    f"{name} = {shown(getattr(self, name))} cannot be given with {ewald}, "
                    "which sums all images and chooses the radius of its real part; leave one of them out"
                )
            if self._given("open"):
                problems.append(
                    f"open = {shown(self.open)} is for open boxes and {ewald} for periodic ones; leave one of them out"
                )
        else:
            uses = {"boundary": ewald, "reciprocal": ewald}
            if "open" in wrong or self.open != "tree":
                uses["accuracy"] = f"{ewald} or open = 'tree'" if type(self).open == "auto" else ewald
            for name in self._given(*uses) if self.periodic != "auto" else ():
                problems.append(f"{name} is used only with {uses[name]}; add that, or leave it out")
            for name in self._given(*uses) if self.periodic == "auto" and self._given("cutoff", "cut") else ():
                given = " and ".join(self._given("cutoff", "cut"))
                problems.append(f"{name} is used only by an Ewald sum, which has no {given}; leave it out")
            for name in self._given("cutoff", "cut") if self._given("open") and "open" not in wrong else ():
                if getattr(self, name) is not None:
                    problems.append(
                        f"{name} = {shown(getattr(self, name))} cannot be given with open = "
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

    def without_ewald(self, grains: Grains | None, box: Box) -> str:
        """Why there is no Ewald sum in this box; "" if there is one. Without grains it is taken as possible."""
        if self.periodic != "auto":
            return "" if self.periodic == "ewald" else "it is not asked for"
        if given := self._given("cutoff", "cut"):
            return f"{' and '.join(given)} {'are' if len(given) > 1 else 'is'} given"
        if any(side is None for side in box.lengths):
            return f"the box is {box.describe()}"
        try:
            if grains is not None:
                self.ewald(grains, box)
        except BadInput as error:
            return error.problems[0].removeprefix(f"{self.name}: ")
        return ""

    def uses_ewald(self, grains: Grains | None, box: Box) -> bool:
        """Whether all images are summed in this box."""
        return not self.without_ewald(grains, box)

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warnings, as for all cut-offs; raises BadInput also if `open` or `accuracy` has no effect in this box."""
        errors = ErrorCollector()
        if self.periodic == "auto" and (why := self.without_ewald(grains, box)):
            for name in self._given("accuracy", "reciprocal"):
                errors.problems.append(
                    f"{self.name}: {name} is used only by an Ewald sum, and there is none: {why}; leave it out"
                )
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
        if why := self.without_ewald(grains, box):
            choice = super().choose(grains, box)
            stated = self.periodic != "auto" or box.is_open or self._given("cutoff", "cut")
            return choice if stated else choice._replace(reason=f"{choice.reason}; no Ewald sum: {why}")
        chosen = self.ewald(grains, box)
        auto = "all images, as the box is periodic along x, y and z and no cut-off is given: "
        return CutoffChoice(
            chosen.radius,
            (auto if self.periodic == "auto" else "")
            + f"real part of an Ewald sum over all images: errors {chosen.force_error:.1e} of force, "
            f"{chosen.field_error:.1e} of {self.sources.field}, as accuracy = {self.accuracy:g} asks for; "
            f"{self.boundary}, alpha = {chosen.product:g}/radius, {chosen.reciprocal}",
        )

    def ewald(self, grains: Grains, box: Box) -> EwaldChoice:
        """The parameters of the Ewald sum.

        Raises
        ------
        BadInput
            If the box is open along an axis, or needs too many wave vectors and nodes.
        """
        if self.chosen is not None:
            return self.chosen
        if any(side is None for side in box.lengths):
            raise BadInput(
                f"{self.name}: periodic = 'ewald' needs a box that is periodic along x, y and z, and the box is "
                f"{box.describe()}; give three lengths, or leave periodic out"
            )
        return self._chosen_for(sides(box), grains, self.reciprocal)

    def _chosen_for(
        self, lengths: tuple[float, float, float], grains: Grains, reciprocal: str, like: EwaldChoice | None = None
    ) -> EwaldChoice:
        """The parameters for a box; see `choose_ewald`."""
        least, carriers = SMALLEST_RADIUS * float(grains.radius.max()), max(self.carriers(grains), 1)
        return choose_ewald(lengths, len(grains), carriers, self.accuracy, least, self.sources, reciprocal, like)

    def with_choice(self, choice: EwaldChoice) -> Self:
        """The same force, which keeps this choice in all boxes."""
        found = copy.copy(self)
        object.__setattr__(found, "chosen", choice)
        return found

    def for_moving_box(self, grains: Grains, lengths: np.ndarray) -> Self:
        """The same force with parameters that stay valid while the sides of a box [m] change by up to MOST_STRAIN.

        After the first choice, the loops stay the same: over wave vectors, or with splines of the same order.
        """
        x, y, z = (float(side) * (1.0 - MOST_STRAIN) for side in lengths)
        like, reciprocal = self.chosen, self.reciprocal
        if like is not None:
            reciprocal = "mesh" if like.order else "direct"
        choice = self._chosen_for((x, y, z), grains, reciprocal, like)
        if not choice.order:
            vectors = half_of_vectors((float(lengths[0]), float(lengths[1]), float(lengths[2])), choice.largest)
            choice = choice._replace(waves=len(vectors))
        return self.with_choice(choice)

    def resolved(self, grains: Grains, box: Box) -> dict[str, Any]:
        """Settings with the automatic cut-off as a number; those of an Ewald sum follow from grains and box.

        "auto" stays in all boxes if no cut-off is given, so that a change to a periodic one sums all images.
        """
        free = self.periodic == "auto" and not self._given("cutoff", "cut")
        as_given = free or self.uses_ewald(grains, box)
        return self.parameters() if as_given else super().resolved(grains, box)
