"""Settings of the neighbour search, and the choice of a method for given grains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.box import Box
from ..basics.grains import Grains
from ..basics.settings import Number, Settings, Word
from ..basics.units import format_quantity
from .cell_list import Search

MARGIN = 0.1
"""Skin of the Verlet list relative to the cut-off, Δr/r_c; the paper uses 0.3–0.4."""
LONG_STEP_MARGIN = 0.35
"""The same for integrators with steps of their own without contacts, whose length the skin limits."""
LIST_FROM = 64
"""Fewest grains for which "auto" uses cells or a Verlet list."""
LIST_UP_TO = 0.4
"""Largest fraction of the other grains within reach for which "auto" uses a list, which contains each pair twice."""
SORT_FROM = 4000
"""Fewest grains for which "auto" sorts grains in memory.

The arrays of fewer grains fit into the caches in any order.  At 4000 grains sorting saves a tenth of the time, and each
worker thread finds the grains it needs in its own cache.
"""
SAMPLES = 64, 4096
"""Largest numbers of grains, and of other grains, in the sample that `share_within` examines."""


def share_within(position: np.ndarray, box: Box, reach: float) -> float:
    """Mean fraction of the other grains closer than `reach` [m] to a grain, estimated from a sample.

    Parameters
    ----------
    position : ndarray
        (N, 3) [m], N ≥ 2.
    box : Box
        The box.
    reach : float
        Distance [m].

    Returns
    -------
    float
        Fraction, 0 … 1.
    """
    sample, others = (np.unique(np.linspace(0, len(position) - 1, most).astype(int)) for most in SAMPLES)
    separation = box.nearest(position[sample][:, None] - position[others])
    distinct = sample[:, None] != others
    return float(((separation**2).sum(axis=-1) < reach**2)[distinct].mean())


class ChosenSearch(NamedTuple):
    """The search method, and the reason for the choice."""

    search: Search
    reason: str


@checked
@dataclass(frozen=True)
class Neighbours(Settings):
    """Settings of the neighbour search for contacts and long-range forces.

    Parameters
    ----------
    search : str, optional
        "cells": a cell list, and a Verlet list of the pairs closer than the cut-off plus a margin.  "all pairs": all
        pairs are examined, in every long-range sum and whenever the candidate pairs for contacts are listed.  "auto":
        cells from 64 grains on, if initially at most 0.4 of the other grains are within reach of a grain, on average.
    margin : float or str, optional
        Skin of the Verlet list Δr [m] > 0, or "auto": 0.1 of the cut-off, or 0.35 with an integrator of your own whose
        steps without contacts the skin limits.  The list is rebuilt when a grain has moved by more than Δr/2; a large
        margin makes lists longer, but rebuilds rarer.  If no force has a cut-off, "auto" builds no Verlet list:
        candidate pairs for contacts are found with the cells.  With such an integrator it builds one all the same; its
        skin is then half the largest gap of candidate pairs.
    order : str, optional
        Order of grains in memory while stepping.  "curve": Morton order, renewed every 2000 steps, so that neighbours
        in space are neighbours in memory; "as given": the user's order; "auto": "curve" from 4000 grains on.  Input and
        output always use the user's indices.

    Raises
    ------
    BadInput
        If a word is unknown, or the margin is not a length above 0.

    Notes
    -----
    No choice changes results by more than rounding errors.
    """

    search: Annotated[str, Word("auto", "cells", "all pairs")] = "auto"
    margin: Annotated[Any, Number("m", above=0.0, auto=True)] = "auto"
    order: Annotated[str, Word("auto", "curve", "as given")] = "auto"

    place: ClassVar[str] = "neighbours"

    def uses_spatial_sort(self, count: int) -> bool:
        """Whether `count` grains are sorted in memory."""
        return self.order == "curve" or (self.order == "auto" and count >= SORT_FROM)

    def settled(self, search: Search, count: int) -> Neighbours:
        """Settings without "auto", as chosen by `choose`, so that a resumed run uses the same."""
        order = "curve" if self.uses_spatial_sort(count) else "as given"
        method = "cells" if search.listed or search.celled else "all pairs"
        return Neighbours(method, search.margin or "auto", order)  # a margin would request a Verlet list

    def choose(
        self, grains: Grains, box: Box, pair_gap: float, cutoffs: Sequence[float], *, long_steps: bool = False
    ) -> ChosenSearch:
        """Choose the search method for these grains.

        Parameters
        ----------
        grains : Grains
            The grains.
        box : Box
            The box.
        pair_gap : float
            Gap [m] up to which pairs are candidates for contacts.
        cutoffs : Sequence[float]
            Cut-off radii [m] of the long-range forces that have one.
        long_steps : bool, optional
            Whether the skin of the list limits the length of steps.

        Returns
        -------
        ChosenSearch
            The method and the reason for it.
        """
        contact_reach = 2.0 * float(grains.radius.max()) + pair_gap
        widest = max(cutoffs, default=0.0)
        # candidate pairs are found with cells, or in the Verlet list; without a cut-off the skin is half their gap
        celled = widest == 0.0 and self.margin == "auto" and not long_steps
        margin = 0.0 if celled else self.margin
        if margin == "auto":
            margin = (LONG_STEP_MARGIN if long_steps else MARGIN) * widest if widest > 0.0 else 0.5 * pair_gap
        list_reach = max(widest, contact_reach) + margin
        all_pairs, distance = Search(False, list_reach, margin), format_quantity(list_reach, "m")
        if self.search == "all pairs":
            return ChosenSearch(all_pairs, "all pairs, as requested")
        if self.search == "auto":
            if len(grains) < LIST_FROM:
                return ChosenSearch(all_pairs, f"all pairs: fewer than {LIST_FROM} grains")
            share = share_within(grains.position, box, list_reach)
            if share > LIST_UP_TO:
                reason = (
                    f"all pairs, faster than a list here: {share:.0%} of the grains are within {distance} of a grain"
                )
                return ChosenSearch(all_pairs, reason)
        if celled:
            reason = f"cells, for pairs closer than {distance} (contacts)"
            return ChosenSearch(Search(False, list_reach, margin, True), reason)
        cause, length = ("cut-off", widest) if widest > contact_reach else ("contacts", contact_reach)
        parts = f"{cause} {format_quantity(length, 'm')}, margin {format_quantity(margin, 'm')}"
        reason = f"cells and a list of pairs closer than {distance} ({parts})"
        return ChosenSearch(Search(True, list_reach, margin), reason)
