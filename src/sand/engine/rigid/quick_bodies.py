"""The engine of rigid clusters whose bodies take steps of two lengths, see `integrate.substeps`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...basics.arrays import SAVED_BODIES, body_arrays
from ...basics.state import (
    BROKEN,
    COMPARED,
    CONTACT_STEPS,
    CORRECTED,
    GRAIN1,
    GRAIN2,
    GRAINS_AWAKE,
    KICKED,
    LARGEST_LOAD,
    LATE,
    MADE,
    OUTSIDE,
    RESTED,
    SETTLED,
    SLIPPED,
    SOME_AWAKE,
    STAGE,
    STEP,
    STEPS,
    SUBSTEPS,
    TIME,
    WOKEN,
)
from ...compiler.stage import Stage
from ...contact.gather import resort_contacts_by_grain
from ...integrate.parts import Stop
from ...integrate.rigid.substeps import AFTER_SUBSTEPS, find_slow_rate, kick_by_slow_loads, place_all_velocities
from ..changed_state import subset
from ..new_state import new_state
from ..part import copy_contacts, copy_grains, store_contacts, store_grains
from .rigid_engine import RigidEngine, external_energy, keep, timed

COPIED_BODIES = (*SAVED_BODIES, "decay", "mode")
LOADS = ("force", "torque", "field")
COUNTED = (MADE, BROKEN, SLIPPED, WOKEN, RESTED, LATE)
LEAST_RATE = 1e-30
"""Slowest rate of change of a load [1/s]."""


@dataclass
class SubstepEngine(RigidEngine):
    """An engine of rigid clusters in which quick bodies and awake clusters may take substeps within a step of all.

    For their substeps their grains are copied to a smaller state, which another engine advances.  A step begins and
    ends with all grains in the state of this engine, which alone is saved.

    Attributes
    ----------
    part : RigidEngine
        The engine from which those of the substeps are made, with forces between nearest images of all pairs.
    """

    part: RigidEngine | None = None
    _parts: dict[int, RigidEngine] = field(init=False, default_factory=dict)  # engines by number of grains
    _had_substeps: bool = field(init=False, default=False)  # of the present step

    def _drivers(self) -> list[tuple[Stage, Any]]:
        """As `RigidEngine._drivers`, with the stages of substeps."""
        vectors = np.zeros((3, 1))
        plain = [(each, ()) for each in (kick_by_slow_loads, place_all_velocities)]
        return [*super()._drivers(), *plain, (find_slow_rate, (vectors, vectors, np.zeros(1)))]

    def _call_driver(self, until: float, last: float, shorten: bool) -> Stop:
        """As `RigidEngine._call_driver`, with substeps."""
        while True:
            stop = super()._call_driver(until, last, shorten)
            if stop is not Stop.SUBSTEPS:
                return stop
            failed = self._take_substeps()
            if failed is not Stop.NONE:
                return failed

    def _take_contact_steps(self) -> Stop:
        """As `RigidEngine._take_contact_steps`: the present step has no substeps."""
        self._had_substeps = False
        return super()._take_contact_steps()

    def _finish_step(self) -> None:
        """As `RigidEngine._finish_step`; awake clusters that had substeps only get their kick."""
        if not self._had_substeps:
            return super()._finish_step()
        grains, bodies = self._state.grains.arrays, self._state.bodies
        slow = grains.force - bodies.excluded_force, grains.torque - bodies.excluded_torque
        return self.kick_awake(*slow, float(self._state.clock[STEP]))

    @timed
    def _take_substeps(self) -> Stop:
        """The first half of a step of all bodies, and the substeps of the quick ones to its end.

        Returns
        -------
        Stop
            `NONE`, or why the substeps failed; the state then is that before the step.
        """
        state, bodies = self._state, self._state.bodies
        is_quick = bodies.quick[bodies.first] == 1
        index, contacts = np.flatnonzero(is_quick), self._contacts_of(is_quick)
        part = self._copy(index, contacts)
        own, before = part._state, (bodies.momentum.copy(), bodies.angular_momentum.copy())
        self._exclude_loads(part, index)
        step, stop = float(state.clock[STEP]), Stop.NONE
        try:
            kick_by_slow_loads.run(self._current_table(state))
            for name in ("momentum", "angular_momentum"):
                getattr(bodies, name).take(index, axis=1, out=getattr(own.bodies, name))
            # a body may wake before its first substep: then the velocities of its grains are all that remains
            place_all_velocities.run(part._current_table(own))
            part.kick_awake(own.bodies.excluded_force, own.bodies.excluded_torque, step)
            stop = part._drive(state.time + step, math.inf, shorten=True)
        finally:
            if stop is not Stop.TIME_REACHED:
                bodies.momentum[...], bodies.angular_momentum[...] = before
                bodies.quick[:] = 0
        if stop is not Stop.TIME_REACHED:
            for grain in (GRAIN1, GRAIN2):
                number = int(own.count[grain])
                state.count[grain] = index[number] if 0 <= number < len(index) else -1
            return stop
        self._store(part, index, contacts)
        return Stop.NONE

    def _copy(self, index: np.ndarray, contacts: np.ndarray) -> RigidEngine:
        """An engine with these grains and their bodies, and the loads that they and external forces have on them."""
        state = self._state
        part = self._parts.get(len(index)) or self._new_part(index)
        own = part._state
        own.count[:], own.clock[:], own.lost[:] = 0, 0.0, 0.0
        copy_grains(state, own, index)
        copy_contacts(state, own, index, contacts)
        for name in COPIED_BODIES:
            if getattr(state.bodies, name).size:
                getattr(state.bodies, name).take(index, axis=-1, out=getattr(own.bodies, name))
        own.bodies.first[:] = np.searchsorted(index, own.bodies.first)
        own.bodies.excluded_force[...] = own.bodies.excluded_torque[...] = 0.0
        own.pair_list.anchor[...] = math.inf
        own.count[COMPARED], own.count[CONTACT_STEPS] = -1, state.count[CONTACT_STEPS]
        # the random numbers of a gas are counted with steps and substeps
        own.count[SUBSTEPS] = state.count[STEPS] + state.count[SUBSTEPS]
        own.clock[TIME] = own.clock[KICKED] = state.time
        own.clock[SETTLED] = state.clock[SETTLED]
        part._sort_members()
        if len(contacts):
            resort_contacts_by_grain.run(part._current_table(own))
        part._sum_outer_loads()
        return part

    def _new_part(self, index: np.ndarray) -> RigidEngine:
        """An engine for these grains, which is kept for others of the same number."""
        given = self.part
        assert given is not None and given.inner is not None
        grains, components = subset(self._state.grains, index), given._components
        state = new_state(grains, self._state.box, given.parameters, components, 0, over_all_pairs=True)
        state.uniform_contacts = self._state.uniform_contacts
        state.bodies = body_arrays(len(index), in_gas=bool(self._state.bodies.decay.size))
        part = given.for_state(state)
        part.inner, part.warnings = given.inner.for_state(given.inner._state), self.warnings
        return keep(self._parts, len(index), part)

    def _exclude_loads(self, part: RigidEngine, index: np.ndarray) -> None:
        """Divide the loads on the quick bodies into those of substeps and others, which may shorten the step."""
        state, own = self._state, part._state
        slow = [getattr(state.grains.arrays, name).take(index, axis=1) for name in LOADS]
        for loads, name in zip(slow, LOADS, strict=True):
            loads -= getattr(own.grains.arrays, name)
        rate = np.zeros(1)
        find_slow_rate.run(part._current_table(own), (slow[0], slow[2], rate))
        longest = self._limits.step_fraction / max(float(rate[0]), LEAST_RATE)
        state.clock[STEP] = min(state.clock[STEP], longest)
        for name, held in (("force", slow[0]), ("torque", slow[1])):
            acting, excluded = getattr(own.grains.arrays, name), f"excluded_{name}"
            getattr(state.bodies, excluded)[:, index] = acting
            getattr(own.bodies, excluded)[...] = held
            acting += held

    def _store(self, part: RigidEngine, index: np.ndarray, contacts: np.ndarray) -> None:
        """Copy grains, contacts and bodies back, the loads that acted in the last substep, and what was counted."""
        state, own, bodies = self._state, part._state, self._state.bodies
        store_grains(state, own, index)
        changed = bool(own.count[MADE] + own.count[BROKEN])
        store_contacts(state, own, index, contacts, changed=changed)
        own.bodies.first[:] = index[own.bodies.first]
        for name in COPIED_BODIES:
            if getattr(bodies, name).size:
                getattr(bodies, name)[..., index] = getattr(own.bodies, name)
        bodies.quick[index] = 1
        bodies.excluded_force[:, index] = own.grains.arrays.force - own.bodies.excluded_force
        bodies.excluded_torque[:, index] = own.grains.arrays.torque - own.bodies.excluded_torque
        if changed or own.count[WOKEN] + own.count[RESTED]:
            self._sort_members()
        if self.parameters.external_work.time_dependent:
            # the drift of all other bodies will book the change of these energies once more
            end = state.time + float(state.clock[STEP])
            for outer in self.external:
                state.lost[OUTSIDE] += external_energy(part, outer, end) - external_energy(part, outer, state.time)
        state.lost += own.lost
        for number in COUNTED:
            state.count[number] += own.count[number]
        state.count[CONTACT_STEPS] = own.count[CONTACT_STEPS]
        state.count[SUBSTEPS] += own.count[STEPS]
        state.clock[SOME_AWAKE] += own.clock[SOME_AWAKE]
        state.clock[GRAINS_AWAKE] += own.clock[GRAINS_AWAKE] * len(index) / len(state.grains)
        state.clock[CORRECTED] += own.clock[CORRECTED]
        state.clock[SETTLED] = own.clock[SETTLED]
        state.take_extremes(own)
        state.clock[LARGEST_LOAD] = max(state.clock[LARGEST_LOAD], own.clock[LARGEST_LOAD])
        state.count[STAGE], self._had_substeps = AFTER_SUBSTEPS, True
