"""Forces with ramps: when their parameters change, and to what."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Self

from ..basics.box import Box
from ..basics.grains import Grains
from ..basics.ramps import Ramp, force_at, ramps_of
from ..basics.state import CHECKED, OUTSIDE
from ..contact.model import Contact
from ..contact.renewal import renewal_stage
from ..engine.component import Component
from ..engine.engine import Engine
from ..engine.measures import contact_energies, energies_at_grains
from ..forces.base import Force
from ..integrate.step_control import INCREASE_INTERVAL


class Ramps(Component):
    """Ramps of parameters of forces; its items are all forces of the simulation, if any of them has ramps."""

    name = "ramps"

    def __init__(self, items: Sequence[Any]):
        super().__init__(items)
        self._intervals: list[tuple[int, int]] = []  # of the ramps, for which the parameters are set
        self._ramps: list[Ramp] = [ramp for force in items for ramp in ramps_of(force).values()]
        self._names = {force.name for force in items if ramps_of(force)}

    @classmethod
    def of(cls, forces: Sequence[Force], grains: Grains, box: Box) -> Self:
        """The ramps of these forces."""
        return cls(forces if any(map(ramps_of, forces)) else ())

    def _present_intervals(self, time: float) -> list[tuple[int, int]]:
        """Interval of each ramp at a time [s]; parameters change where these do."""
        return [ramp.interval(time) for ramp in self._ramps]

    def next_time(self, engine: Engine) -> float:
        """Next time [s] at which a parameter changes, or infinity."""
        return min(ramp.next_change(engine.stored_state.time) for ramp in self._ramps)

    def begin(self, engine: Engine) -> None:
        """Give parameters their values at the time of the regular state; loads and contacts stay as they are."""
        state = engine.stored_state
        self._intervals = self._present_intervals(state.time)
        forces = [force_at(force, state.time) for force in self.items]
        now: dict[str, Any] = {force.name: force for force in forces if force.name in self._names}
        engine.set_parameters(**engine.force_dependent(forces, state.grains)._asdict())
        long_range = [
            (force, sums, numbers._replace(own=now[force.name].constants()) if force.name in now else numbers)
            for force, sums, numbers in engine.long_range
        ]
        engine.set_forces(long_range, [now.get(force.name, force) for force in engine.external])

    def update(self, engine: Engine) -> None:
        """Change parameters if the regular state is in new intervals of the ramps, and compute loads anew.

        The change of the energy at fixed positions is work of the user. Contacts keep their displacements; a
        contact beyond its new limits slips or breaks when the loads are computed.
        """
        state, of_contacts = engine.stored_state, Contact.name in self._names
        if self._intervals == self._present_intervals(state.time):
            return
        before = self._energy(engine)
        self.begin(engine)
        if of_contacts:
            with engine.heavy_grains(state):
                renewal_stage(engine.law).run(engine.table_of(state))
        state.lost[OUTSIDE] += before - self._energy(engine)
        state.count[CHECKED] = state.steps - INCREASE_INTERVAL  # the next step is chosen for the new parameters
        engine.sort_in_space()
        if of_contacts:
            state.pair_list.anchor[0, 0] = math.inf  # the list has constants of possible contacts: build it anew
        engine.sum_loads()

    def _energy(self, engine: Engine) -> float:
        """Energy [J] of the forces with ramps."""
        energies = [share.sum() for share in energies_at_grains(engine, self._names).values()]
        return math.fsum([*energies, *(contact_energies(engine) if Contact.name in self._names else ())])
