"""Substeps of quick bodies and awake clusters within a step of all bodies, see `integrate.rigid.substeps`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...basics.state import BROKEN, MADE, OUTSIDE, PHASE, RESTED, STEP, STEPS, SUBSTEPS, WOKEN, State
from ...compiler.stage import Stage
from ...integrate.parts import Stop
from ...integrate.rigid.substeps import AFTER_SUBSTEPS, find_slow_rate, kick_by_slow_loads, place_all_velocities
from ..engine import Engine
from ..measures import external_energy
from ..part import Part
from .cluster_bodies import contacts_of, sort_members

LOADS = ("force", "torque", "field")
LEAST_RATE = 1e-30
"""Slowest rate of change of a load [1/s]."""


@dataclass
class QuickBodies:
    """Substeps of quick bodies and awake clusters.

    For their substeps their grains are copied to a part, which another engine of bodies advances.  A step begins and
    ends with all grains in the state of all, which alone is saved.

    Attributes
    ----------
    part : Part
        The grains of quick bodies.
    """

    part: Part

    def stages(self) -> list[tuple[Stage, Any]]:
        """Stages of substeps, with their parameters."""
        vectors = np.zeros((3, 1))
        plain = [(each, ()) for each in (kick_by_slow_loads, place_all_velocities)]
        return [*plain, (find_slow_rate, (vectors, vectors, np.zeros(1)))]

    def take(self, engine: Engine) -> Stop:
        """The first half of a step of all bodies, and the substeps of the quick ones to its end.

        Returns
        -------
        Stop
            `NONE`, or why the substeps failed; the state then is that before the step.
        """
        state = engine.regular_state
        bodies, steps = state.bodies, self._copy(state)
        part = self.part.engine
        own, before = part.regular_state, (bodies.momentum.copy(), bodies.angular_momentum.copy())
        self._exclude_loads(engine)
        step, stop = float(state.clock[STEP]), Stop.NONE
        try:
            kick_by_slow_loads.run(engine.table_of(state))
            for name in ("momentum", "angular_momentum"):
                getattr(bodies, name).take(self.part.index, axis=1, out=getattr(own.bodies, name))
            # a body may wake before its first substep: then the velocities of its grains are all that remains
            place_all_velocities.run(part.table_of(own))
            steps.awake.kick(part, own, (own.bodies.excluded_force, own.bodies.excluded_torque), step)
            stop = part.drive(state.time + step, math.inf, shorten=True)
        finally:
            if stop is not Stop.TIME_REACHED:
                bodies.momentum[...], bodies.angular_momentum[...] = before
                bodies.quick[:] = 0
        if stop is not Stop.TIME_REACHED:
            self.part.name_limiting(state)
            return stop
        self._store(engine)
        return Stop.NONE

    def slow_loads(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Forces and torques on all grains that did not act in the substeps."""
        grains, bodies = state.grains.arrays, state.bodies
        return grains.force - bodies.excluded_force, grains.torque - bodies.excluded_torque

    def _copy(self, state: State) -> Any:
        """Take the grains of quick bodies, and sum the loads that they and external forces have on them."""
        is_quick = state.bodies.quick[state.bodies.first] == 1
        own = self.part.take(state, np.flatnonzero(is_quick), contacts_of(state, is_quick))
        own.bodies.excluded_force[...] = own.bodies.excluded_torque[...] = 0.0
        # the random numbers of a gas are counted with steps and substeps
        own.count[SUBSTEPS] = state.count[STEPS] + state.count[SUBSTEPS]
        steps: Any = self.part.engine.stepper  # `body_steps.BodySteps`
        steps.awake.sort_members(own)
        steps.sum_loads(self.part.engine)
        return steps

    def _exclude_loads(self, engine: Engine) -> None:
        """Divide the loads on the quick bodies into those of substeps and others, which may shorten the step."""
        state, own, index = engine.regular_state, self.part.state, self.part.index
        slow = [getattr(state.grains.arrays, name).take(index, axis=1) for name in LOADS]
        for loads, name in zip(slow, LOADS, strict=True):
            loads -= getattr(own.grains.arrays, name)
        rate = np.zeros(1)
        find_slow_rate.run(self.part.engine.table_of(own), (slow[0], slow[2], rate))
        longest = engine.parameters.flight_limits.step_fraction / max(float(rate[0]), LEAST_RATE)
        state.clock[STEP] = min(state.clock[STEP], longest)
        for name, kept in (("force", slow[0]), ("torque", slow[1])):
            acting, excluded = getattr(own.grains.arrays, name), f"excluded_{name}"
            getattr(state.bodies, excluded)[:, index] = acting
            getattr(own.bodies, excluded)[...] = kept
            acting += kept

    def _store(self, engine: Engine) -> None:
        """Give grains, contacts and bodies back, and the loads that acted in the last substep."""
        state, own, index = engine.regular_state, self.part.state, self.part.index
        bodies, changed = state.bodies, bool(own.count[[BROKEN, MADE, WOKEN, RESTED]].any())
        if engine.parameters.external_work.time_dependent:
            # the drift of all other bodies will book the change of these energies once more
            part, end = self.part.engine, state.time + float(state.clock[STEP])
            for outer in engine.external:
                state.lost[OUTSIDE] += external_energy(part, outer, end) - external_energy(part, outer, state.time)
        self.part.give_back(engine)
        bodies.quick[index] = 1
        bodies.excluded_force[:, index] = own.grains.arrays.force - own.bodies.excluded_force
        bodies.excluded_torque[:, index] = own.grains.arrays.torque - own.bodies.excluded_torque
        if changed:
            sort_members(state)
        state.count[PHASE] = AFTER_SUBSTEPS
