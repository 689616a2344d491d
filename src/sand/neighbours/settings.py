"""How neighbours are looked for: the user's choice and what becomes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..arguments import checked
from ..box import Box
from ..errors import FORBID_EXTRA, BadInput, did_you_mean
from ..grains import Grains
from ..units import format_quantity, is_word, si
from .cell_list import Search

SEARCHES = ("auto", "cells", "all pairs")
ORDERS = ("auto", "curve", "as given")
MARGIN = 0.1
"""Margin of the list over the cut-off, Δr/r_c; the paper has 0.3–0.4."""
MARGIN_OF_FLIGHTS = 0.35
"""The same where steps are as long as the margin lets them be."""
LIST_FROM = 64
"""Fewest grains for which "auto" makes a list."""
LIST_UP_TO = 0.4
"""Largest part of the other grains within the list's reach for which "auto" makes one: each pair is in two rows."""
CURVE_FROM = 4000
"""Fewest grains for which "auto" keeps an order of its own: fewer fit into the caches, however they are numbered.

Of 4000 it saves a tenth of a step, and from there on helpers find in their caches what they need.
"""
SAMPLES = 64, 4096
"""Grains, and others, that are looked at for it."""


def share_within(position: np.ndarray, box: Box, reach: float) -> float:
    """Which part of the other grains is closer than `reach` [m] to a grain, on average; from a sample of them.

    Parameters
    ----------
    position : ndarray
        (N, 3) [m], N ≥ 2.
    """
    some, others = (np.unique(np.linspace(0, len(position) - 1, most).astype(int)) for most in SAMPLES)
    apart = box.nearest(position[some][:, None] - position[others])
    another = some[:, None] != others
    return float(((apart**2).sum(axis=-1) < reach**2)[another].mean())


class ChosenSearch(NamedTuple):
    """The search in force, and why."""

    search: Search
    reason: str


@checked
@dataclass(frozen=True)
class Neighbours:
    """How pairs within reach are found, for contacts and for long-range forces alike.

    Parameters
    ----------
    search : str, optional
        "cells" sorts the grains into cells and lists the pairs closer than the cut-off plus a margin;
        "all pairs" looks at every pair in every step; "auto" takes cells from 64 grains on, if at the start no
        more than 0.4 of the others are within reach of a grain, on average.
    margin : optional
        how much farther than the cut-off the list reaches, Δr [m], or "auto": 0.1 of the cut-off, 0.35 where
        the list limits the steps (Runge–Kutta). The list is made anew when a grain is more than Δr/2 from where
        it was; a wide margin makes long but lasting lists. Where no force has a cut-off, "auto" makes none but
        that of the pairs that may touch soon, straight from the cells.
    order : str, optional
        where grains stand in memory while steps are taken; "curve": along one that fills space, made anew every
        2000 steps, so that neighbours are close; "as given": by their numbers; "auto": along a curve from
        4000 grains on. All that is looked at or written has the numbers of the start.

    No choice changes a result by more than rounding.

    Raises
    ------
    BadInput
        an unknown word, or a margin that is not a length above 0.
    """

    search: str = "auto"
    margin: Any = "auto"
    order: str = "auto"

    __pydantic_config__ = FORBID_EXTRA

    def __post_init__(self) -> None:
        problems = []
        for name, allowed in (("search", SEARCHES), ("order", ORDERS)):
            said = getattr(self, name)
            if said not in allowed:
                problems.append(f"neighbours: {name} = {said!r}; {did_you_mean(str(said), allowed)}")
        if not is_word(self.margin, "auto"):
            try:
                object.__setattr__(self, "margin", si(self.margin, "m", "neighbours: margin", above=0.0))
            except BadInput as error:
                problems += error.problems
        if problems:
            raise BadInput(problems)

    def parameters(self) -> dict[str, Any]:
        """Its settings in SI."""
        return {"search": self.search, "margin": self.margin, "order": self.order}

    def uses_spatial_sort(self, count: int) -> bool:
        """True if so many grains are kept in an order of their own."""
        return self.order == "curve" or (self.order == "auto" and count >= CURVE_FROM)

    def settled(self, search: Search, count: int) -> Neighbours:
        """What was chosen, so that a run that goes on from elsewhere chooses the same."""
        order = "curve" if self.uses_spatial_sort(count) else "as given"
        how = "cells" if search.listed or search.celled else "all pairs"
        return Neighbours(how, search.margin or "auto", order)  # any margin would ask for a list

    def choose(
        self, grains: Grains, box: Box, reach: float, cutoffs: Sequence[float], *, adaptive_steps: bool = False
    ) -> ChosenSearch:
        """The search for these grains.

        Parameters
        ----------
        reach : float
            gap [m] up to which pairs count as near a contact.
        cutoffs : Sequence[float]
            radii [m] of the long-range forces that have one.
        adaptive_steps : bool, optional
            whether steps may be as long as the list lasts.
        """
        touch = 2.0 * float(grains.radius.max()) + reach
        widest = max(cutoffs, default=0.0)
        # near pairs come straight from cells, or out of a list; their own margin is half their reach
        celled = widest == 0.0 and self.margin == "auto" and not adaptive_steps
        margin = 0.0 if celled else self.margin
        if margin == "auto":
            margin = (MARGIN_OF_FLIGHTS if adaptive_steps else MARGIN) * widest if widest > 0.0 else 0.5 * reach
        whole = max(widest, touch) + margin
        nothing = Search(False, whole, margin)
        if self.search == "all pairs":
            return ChosenSearch(nothing, "all pairs, asked for")
        if self.search == "auto":
            if len(grains) < LIST_FROM:
                return ChosenSearch(nothing, f"all pairs: fewer than {LIST_FROM} grains")
            share = share_within(grains.position, box, whole)
            if share > LIST_UP_TO:
                held = f"a grain has {share:.2g} of the others within {format_quantity(whole, 'm')}, more than {LIST_UP_TO}"
                return ChosenSearch(nothing, f"all pairs: {held}")
        if celled:
            near = format_quantity(whole, "m")
            return ChosenSearch(Search(False, whole, margin, True), f"cells, for pairs closer than {near} (contacts)")
        purpose = (
            f"cut-off {format_quantity(widest, 'm')}" if widest > touch else f"contacts {format_quantity(touch, 'm')}"
        )
        return ChosenSearch(
            Search(True, whole, margin),
            f"cells and a list of pairs closer than {format_quantity(whole, 'm')} ({purpose}, margin {format_quantity(margin, 'm')})",
        )
