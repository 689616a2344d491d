"""The automatic cut-off of dipoles in a periodic box, which follows the two clusters with the largest moments."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np

from ..basics.box import Box
from ..basics.clusters import labels_of
from ..basics.errors import BadInput
from ..basics.grains import Grains
from ..basics.state import (
    BROKEN,
    COMPARED,
    CONTACTS,
    CUT_CAPTURE,
    CUT_FIRST,
    CUT_LIMITED,
    CUT_RADIUS,
    CUT_SECOND,
    CUT_TEMPERATURE,
    CUT_TIME,
    CUTOFF,
    CUTOFF_CHANGED,
    MADE,
    State,
)
from ..basics.temperature import kinetic_temperature
from ..basics.units import format_quantity
from ..contact.law import ContactLaw
from ..engine.component import Component, Setup
from ..engine.engine import Engine
from ..engine.measures import pair_energy, pair_loads
from ..engine.step_parameters import ForcesByType
from ..forces.base import Force
from ..forces.pair.cutoff import HALF_BOX_RATIO
from ..forces.pair.dipoles import CAPTURE_RADII, CapturingPair, Dipoles, capturing_pair
from ..integrate.parts import ContactParameters

GROWTH = 1.1
"""Growth of b_max since the last choice from which the cut-off is chosen anew; it is thus 1.36 to 1.5 b_max."""


class ClusterCutoff(Component):
    """The cut-off that follows the clusters; its only item is the force.

    A choice depends only on contacts, moments and the temperature at the start, so that it is the same for any output,
    interruption or number of threads. The cut-off never becomes shorter: a cut-off that is too long costs time only.

    Attributes
    ----------
    largest : float
        Upper limit of the cut-off [m].
    first : CutoffChoice
        The cut-off for clusters at the start, with the reason.
    values : ndarray
        `State.cutoff` at the start, or of the checkpoint from which a run continues.
    """

    name = "cluster_cutoff"
    watches_contacts: ClassVar[bool] = True

    @classmethod
    def of(cls, forces: Sequence[Force], grains: Grains, box: Box) -> Self:
        """The cut-off of the dipoles, if it follows the clusters of these grains in this box."""
        return cls([f for f in forces if isinstance(f, Dipoles) and f.follows_clusters(box) and f.acts_on(grains)])

    def at_start(self, forces: ForcesByType, setup: Setup) -> ForcesByType:
        """The dipoles with the cut-off for the clusters at the start, or that of the checkpoint.

        Raises
        ------
        BadInput
            If the cut-off of the checkpoint does not fit the box.
        """
        (force,), grains = self.items, setup.grains
        self.largest = 0.5 * setup.box.shortest / HALF_BOX_RATIO
        labels = labels_of(len(grains), setup.touching)
        temperature = kinetic_temperature(grains, labels)
        pair = capturing_pair(grains, labels, temperature)
        self.first = force.for_pair(pair, grains, self.largest)
        self._is_new = "cutoff" not in setup.saved
        limited = 0.0 if CAPTURE_RADII * pair.capture > self.largest else math.inf
        chosen = _values(float(self.first.radius or 0.0), pair, temperature, 0.0, limited)
        self.values = chosen if self._is_new else setup.saved["cutoff"]
        radius = float(self.values[CUT_RADIUS])
        if not 0.0 < radius <= self.largest:
            wrong, most = format_quantity(radius, "m"), format_quantity(self.largest, "m")
            raise BadInput(
                f"the cut-off of the dipoles in the checkpoint is {wrong}, but must be above 0, at most {most}"
            )
        fixed = dataclasses.replace(force, cutoff=radius)
        return forces._replace(long_range=[fixed if each.name == force.name else each for each in forces.long_range])

    def add_arrays(self, state: State, law: ContactLaw, settings: ContactParameters) -> None:
        """Give a new state the cut-off."""
        state.cutoff[:] = self.values

    def contacts_changed(self, engine: Engine) -> None:
        """Choose the cut-off anew, if clusters have grown."""
        state = engine.stored_state
        before = float(state.cutoff[CUT_RADIUS])
        radius = self.choose_anew(state)
        if radius is not None:
            self._use(engine, radius)
            engine.warnings.append(self.message(state, before))

    def _use(self, engine: Engine, radius: float) -> None:
        """Use another cut-off [m]: in the loops of the dipoles, the reach of lists, loads and energy.

        Loads change by the difference of two sums, so that the next step starts with the present ones; grains in
        contact are within both cut-offs, and their share of the loads (r-RESPA) stays. Lists keep their skin.
        """
        state, search, long_range = engine.stored_state, engine.parameters.search, list(engine.long_range)
        k = next(k for k, (force, _, _) in enumerate(long_range) if force.name == Dipoles.name)
        energy, loads = pair_energy(engine, k), pair_loads(engine, k)
        force, sums, _ = long_range[k]
        long_range[k] = force, sums, self.items[0].numbers_at(radius)
        engine.set_forces(long_range, engine.external)
        engine.set_parameters(search=search._replace(reach=max(search.reach, radius + search.margin)))
        engine.rebuild_list()
        force_change, torque_change = pair_loads(engine, k) - loads
        for arrays in (state.grains.arrays, state.long_range):
            arrays.force[...] += force_change
            arrays.torque[...] += torque_change
        state.lost[CUTOFF_CHANGED] += energy - pair_energy(engine, k)

    def choose_anew(self, state: State) -> float | None:
        """Compare the largest clusters with the last choice; a new cut-off radius [m], or None.

        The choice is stored in `state.cutoff`, also where half the box leaves the radius as it is.
        """
        labels = labels_of(len(state.grains), state.contacts.pair[:, : state.count[CONTACTS]].T)
        pair = capturing_pair(state.grains, labels, state.cutoff[CUT_TEMPERATURE])
        before, _, temperature, time, _, _, limited = state.cutoff.tolist()
        if pair.capture <= GROWTH * state.cutoff[CUT_CAPTURE]:
            return None
        # the first two moments that exist need a shorter cut-off than half the box, which is used without them
        radius = max(self.items[0].for_pair(pair, state.grains, self.largest).radius or 0.0, before)
        time = state.time if radius > before else time
        if CAPTURE_RADII * pair.capture > self.largest:
            limited = min(limited, state.time)  # stays 0 if the first choice was limited, which the start says
        state.cutoff[:] = _values(radius, pair, temperature, time, limited)
        return radius if radius > before else None

    def choices(self) -> dict[str, str]:
        """The cut-off at the start."""
        return {"dipoles cut-off": str(self.first)}

    def present_choices(self, state: State) -> dict[str, str]:
        """The present cut-off, if it was chosen during the run."""
        if state.cutoff[CUT_TIME] == 0.0:
            return {}
        radius, time = (format_quantity(state.cutoff[k], unit) for k, unit in ((CUT_RADIUS, "m"), (CUT_TIME, "s")))
        return {"dipoles cut-off now": f"{radius} since {time}; the largest moments are those of {_pair_of(state)}"}

    def notes(self, state: State) -> list[str]:
        """Note of a run in which clusters outgrew the box."""
        if math.isinf(state.cutoff[CUT_LIMITED]) or state.cutoff[CUT_LIMITED] == 0.0:
            return []
        since, now = format_quantity(state.cutoff[CUT_LIMITED], "s"), format_quantity(state.cutoff[CUT_RADIUS], "m")
        full = format_quantity(CAPTURE_RADII * state.cutoff[CUT_CAPTURE], "m")
        return [
            f"dipoles: from {since} on half the box / {HALF_BOX_RATIO} limits the cut-off to {now}, less than "
            f"{CAPTURE_RADII} b_max = {full} of {_pair_of(state)}; captures from farther away are missed: use a larger "
            "box, or periodic = 'ewald'"
        ]

    def message(self, state: State, before: float) -> str:
        """Text for the log after a change from `before` [m]."""
        if state.cutoff[CUT_LIMITED] == state.time:
            return self.notes(state)[0]
        now, old = format_quantity(state.cutoff[CUT_RADIUS], "m"), format_quantity(before, "m")
        return f"dipoles: cut-off now {now}, {CAPTURE_RADII} b_max of {_pair_of(state)}; it was {old}"

    def saved_for_change(self, state: State, box: Box) -> dict[str, np.ndarray]:
        """The present cut-off, in the same box."""
        return {} if box != state.box or state.cutoff[CUT_RADIUS] == 0.0 else {"cutoff": state.cutoff.copy()}

    def changed(self, arrays: dict[str, np.ndarray], *, regroups: bool) -> None:
        """Compare other grains, and clusters in another box, with the cut-off before the next step."""
        temperature = arrays["cutoff"][CUT_TEMPERATURE]
        if self._is_new:
            arrays["cutoff"] = self.values.copy()
            if temperature > 0.0:
                arrays["cutoff"][CUT_TEMPERATURE] = temperature
        if regroups or self._is_new:
            count = arrays["count"]
            arrays["cutoff"][CUT_CAPTURE], count[COMPARED] = 0.0, count[MADE] + count[BROKEN] + 1


def _values(radius: float, pair: CapturingPair, temperature: float, time: float, limited: float) -> np.ndarray:
    """Content of `State.cutoff`."""
    values = np.zeros(len(CUTOFF))
    values[CUT_RADIUS], values[CUT_CAPTURE], values[CUT_TEMPERATURE] = radius, pair.capture, temperature
    values[CUT_TIME], values[CUT_FIRST], values[CUT_SECOND], values[CUT_LIMITED] = time, *pair[1:], limited
    return values


def _pair_of(state: State) -> CapturingPair:
    """The clusters of the last choice."""
    return CapturingPair(state.cutoff[CUT_CAPTURE], int(state.cutoff[CUT_FIRST]), int(state.cutoff[CUT_SECOND]))
