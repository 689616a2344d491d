"""The automatic cut-off of dipoles in a periodic box, which follows the two clusters with the largest moments."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..analysis.clusters import cluster_labels
from ..basics.box import Box
from ..basics.errors import BadInput
from ..basics.grains import Grains
from ..basics.initial_pairs import StrainedContacts
from ..basics.state import (
    CONTACTS,
    CUT_CAPTURE,
    CUT_FIRST,
    CUT_LIMITED,
    CUT_RADIUS,
    CUT_SECOND,
    CUT_TEMPERATURE,
    CUT_TIME,
    CUTOFF,
    State,
)
from ..basics.temperature import kinetic_temperature
from ..basics.units import format_quantity
from ..forces.base import LongRangeForce
from ..forces.pair.cutoff import HALF_BOX_RATIO, CutoffChoice
from ..forces.pair.dipoles import CAPTURE_RADII, CapturingPair, Dipoles, capturing_pair

GROWTH = 1.1
"""Growth of b_max since the last choice from which the cut-off is chosen anew; it is thus 1.36 to 1.5 b_max."""


@dataclass(frozen=True)
class ClusterCutoff:
    """The cut-off that follows the clusters.

    A choice depends only on contacts, moments and the temperature at the start, so that it is the same for any output,
    interruption or number of threads. The cut-off never becomes shorter: a cut-off that is too long costs time only.

    Attributes
    ----------
    force : Dipoles
        The force.
    index : int
        Its index among the long-range forces.
    largest : float
        Upper limit of the cut-off [m].
    at_start : CutoffChoice
        The cut-off at the start, with the reason.
    values : ndarray
        `State.cutoff` at the start, or of the checkpoint from which a run continues.
    """

    force: Dipoles
    index: int
    largest: float
    at_start: CutoffChoice
    values: np.ndarray

    def update(self, state: State) -> float | None:
        """Compare the largest clusters with the last choice; a new cut-off radius [m], or None.

        The choice is stored in `state.cutoff`, also where half the box leaves the radius as it is.
        """
        labels = cluster_labels(len(state.grains), state.contacts.pair[:, : state.count[CONTACTS]].T)
        pair = capturing_pair(state.grains, labels, state.cutoff[CUT_TEMPERATURE])
        before, _, temperature, time, _, _, limited = state.cutoff.tolist()
        if pair.capture <= GROWTH * state.cutoff[CUT_CAPTURE]:
            return None
        # the first two moments that exist need a shorter cut-off than half the box, which is used without them
        radius = max(self.force.for_pair(pair, state.grains, self.largest).radius or 0.0, before)
        time = state.time if radius > before else time
        if CAPTURE_RADII * pair.capture > self.largest:
            limited = min(limited, state.time)  # stays 0 if the first choice was limited, which the start says
        state.cutoff[:] = _values(radius, pair, temperature, time, limited)
        return radius if radius > before else None

    def note(self, state: State) -> str:
        """Note of a run in which clusters outgrew the box; "" if none did."""
        if math.isinf(state.cutoff[CUT_LIMITED]) or state.cutoff[CUT_LIMITED] == 0.0:
            return ""
        since, now = format_quantity(state.cutoff[CUT_LIMITED], "s"), format_quantity(state.cutoff[CUT_RADIUS], "m")
        full = format_quantity(CAPTURE_RADII * state.cutoff[CUT_CAPTURE], "m")
        return (
            f"dipoles: from {since} on half the box / {HALF_BOX_RATIO} limits the cut-off to {now}, less than "
            f"{CAPTURE_RADII} b_max = {full} of {_pair_of(state)}; captures from farther away are missed: use a larger "
            "box, or periodic = 'ewald'"
        )

    def present(self, state: State) -> str:
        """The present cut-off, if it was chosen during the run, else ""."""
        if state.cutoff[CUT_TIME] == 0.0:
            return ""
        radius, time = (format_quantity(state.cutoff[k], unit) for k, unit in ((CUT_RADIUS, "m"), (CUT_TIME, "s")))
        return f"{radius} since {time}; the largest moments are those of {_pair_of(state)}"

    def message(self, state: State, before: float) -> str:
        """Text for the log after a change from `before` [m]."""
        if state.cutoff[CUT_LIMITED] == state.time:
            return self.note(state)
        now, old = format_quantity(state.cutoff[CUT_RADIUS], "m"), format_quantity(before, "m")
        return f"dipoles: cut-off now {now}, {CAPTURE_RADII} b_max of {_pair_of(state)}; it was {old}"


def follow_clusters(
    forces: Sequence[LongRangeForce],
    grains: Grains,
    box: Box,
    overlapping: np.ndarray,
    contacts: StrainedContacts | None,
    saved: np.ndarray | None,
) -> ClusterCutoff | None:
    """The cut-off that follows the clusters, if a force has one.

    Parameters
    ----------
    forces : Sequence[LongRangeForce]
        Long-range forces that act on at least one grain.
    overlapping : ndarray
        Pairs of grains (P, 2) that overlap at the start.
    contacts : StrainedContacts or None
        Further contacts at the start.
    saved : ndarray or None
        `State.cutoff` of the checkpoint from which a run continues.

    Raises
    ------
    BadInput
        If the cut-off of the checkpoint does not fit the box.
    """
    found: list[tuple[int, Any]] = [
        (k, force) for k, force in enumerate(forces) if isinstance(force, Dipoles) and force.follows_clusters(box)
    ]
    if not found:
        return None
    index, force = found[0]
    largest = 0.5 * box.shortest / HALF_BOX_RATIO
    given = np.zeros((0, 2), np.int64) if contacts is None else np.asarray(contacts.pair)
    if given.ndim != 2 or given.shape[1] != 2 or (given >= len(grains)).any() or (given < 0).any():
        given = overlapping[:0]  # refused when they are added
    labels = cluster_labels(len(grains), np.concatenate([overlapping, given]))
    temperature = kinetic_temperature(grains, labels)
    pair = capturing_pair(grains, labels, temperature)
    choice = force.for_pair(pair, grains, largest)
    limited = 0.0 if CAPTURE_RADII * pair.capture > largest else math.inf
    values = _values(float(choice.radius or 0.0), pair, temperature, 0.0, limited) if saved is None else saved
    if not 0.0 < values[CUT_RADIUS] <= largest:
        wrong, most = format_quantity(float(values[CUT_RADIUS]), "m"), format_quantity(largest, "m")
        raise BadInput(f"the cut-off of the dipoles in the checkpoint is {wrong}, but must be above 0, at most {most}")
    return ClusterCutoff(force, index, largest, choice, values)


def _values(radius: float, pair: CapturingPair, temperature: float, time: float, limited: float) -> np.ndarray:
    """Content of `State.cutoff`."""
    values = np.zeros(len(CUTOFF))
    values[CUT_RADIUS], values[CUT_CAPTURE], values[CUT_TEMPERATURE] = radius, pair.capture, temperature
    values[CUT_TIME], values[CUT_FIRST], values[CUT_SECOND], values[CUT_LIMITED] = time, *pair[1:], limited
    return values


def _pair_of(state: State) -> CapturingPair:
    """The clusters of the last choice."""
    return CapturingPair(state.cutoff[CUT_CAPTURE], int(state.cutoff[CUT_FIRST]), int(state.cutoff[CUT_SECOND]))
