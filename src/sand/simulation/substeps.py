"""Substeps of the bodies whose loads change fast: a smaller state, and an engine that moves them."""

from __future__ import annotations

import copy
import math
from dataclasses import fields
from typing import Any

import numpy as np

from ..integrate.parts import Stop
from ..integrate.substeps import AFTER_SUBSTEPS, kick_by_slow_loads, place_all_velocities, split_loads
from ..state.arrays import SAVED_BODIES, body_arrays
from ..state.state import COMPARED, GRAIN1, GRAIN2, LARGEST_LOAD, LATE, STAGE, STEP, STEPS, SUBSTEPS, TIME, State
from .bodies import sort_members
from .body_engine import BodyEngine
from .changed_state import subset
from .new_state import new_state

MOVED = ("position", "velocity", "orientation", "spin", "moment")
MOVED_BODIES = ("centre", "orientation", "momentum", "angular_momentum")
COPIED_BODIES = (*SAVED_BODIES, "decay", "mode")
LOADS = ("force", "torque", "field")
LEAST_RATE = 1e-30
"""Slowest rate of change of a load [1/s]."""
MOST_STEPS = 2**62
MOST_ENGINES = 64
"""Engines of different numbers of grains that are kept for further use."""


class Substeps:
    """Steps of the bodies that are marked as quick, within one step of all bodies.

    Parameters
    ----------
    engine : BodyEngine
        An engine without awake clusters, whose forces act between the nearest images of all pairs of grains.
    """

    def __init__(self, engine: BodyEngine):
        self.engine, self._engines = engine, dict[int, BodyEngine]()

    def __deepcopy__(self, memo: dict[int, Any]) -> Substeps:
        return Substeps(copy.deepcopy(self.engine, memo))

    def take(self, state: State, table: Any) -> Stop:
        """Take the first half of a step of all bodies, and the substeps of the quick ones in it.

        Returns
        -------
        Stop
            NONE if they have arrived at the end of the step, which is shorter if a touch is ahead.  Otherwise no step
            was begun: TOUCH_AHEAD, with the bodies marked that have to wake, or why the substeps failed.
        """
        bodies, step = state.bodies, float(state.clock[STEP])
        index = np.flatnonzero(bodies.quick[bodies.first])
        before = bodies.momentum.copy(), bodies.angular_momentum.copy()
        stop = Stop.NONE
        while stop is not Stop.TIME_REACHED:
            engine = self._copy(state, index)
            own = engine._state
            step = min(step, self._longest_step(state, engine, index))
            try:
                bodies.quick_force[:, index], bodies.quick_torque[:, index] = (
                    own.grains.arrays.force,
                    own.grains.arrays.torque,
                )
                state.clock[STEP] = step
                kick_by_slow_loads.run(table)
                stop = self._run(state, engine, index, state.time + step)
            finally:
                if stop is not Stop.TIME_REACHED:
                    bodies.momentum[...], bodies.angular_momentum[...] = before
            step = own.time - state.time
            if stop not in (Stop.TIME_REACHED, Stop.TOUCH_AHEAD) or step <= 0.0:
                self._tell(state, own, index)
                return stop
        self._store(state, own, index)
        return Stop.NONE

    def _copy(self, state: State, index: np.ndarray) -> BodyEngine:
        """An engine with these grains and their bodies, with the loads that they and external forces have on them."""
        engine = self._engines.get(len(index)) or self._new_engine(state, index)
        own = engine._state
        for name, array in own.grains.arrays._asdict().items():
            getattr(state.grains.arrays, name).take(index, axis=-1, out=array)
        for name in COPIED_BODIES:
            if getattr(state.bodies, name).size:
                getattr(state.bodies, name).take(index, axis=-1, out=getattr(own.bodies, name))
        own.bodies.first[:] = np.searchsorted(index, own.bodies.first)
        own.count[:], own.clock[:], own.lost[:] = 0, 0.0, 0.0
        sort_members(own)
        own.clock[TIME], own.count[STAGE], own.count[COMPARED] = state.time, 1, -1
        own.count[SUBSTEPS] = state.count[STEPS] + state.count[SUBSTEPS]
        own.pair_list.anchor[...] = math.inf
        engine._bodies_driver(-math.inf, 1)
        return engine

    def _new_engine(self, state: State, index: np.ndarray) -> BodyEngine:
        """An engine for so many grains, which is kept: a table of other arrays is slow to fill."""
        given = self.engine
        own = new_state(
            subset(state.grains, index), state.box, given.parameters, given._components, 0, over_all_pairs=True
        )
        own.uniform_contacts = state.uniform_contacts
        own.bodies = body_arrays(len(index), in_gas=bool(state.bodies.decay.size))
        names = [each.name for each in fields(given) if each.init]
        engine = type(given)(own, *(getattr(given, name) for name in names[1:]))
        engine._workers = None  # few grains share no work between threads
        if len(self._engines) == MOST_ENGINES:
            self._engines.clear()
        self._engines[len(index)] = engine
        return engine

    def _longest_step(self, state: State, engine: BodyEngine, index: np.ndarray) -> float:
        """Longest step [s] of all bodies that the loads on the quick ones allow which do not act in substeps."""
        split = [getattr(state.grains.arrays, name).take(index, axis=1) for name in LOADS]
        for loads, name in zip(split, LOADS, strict=True):
            loads -= getattr(engine._state.grains.arrays, name)
        square = np.zeros(1)
        split_loads.run(engine._current_table(engine._state), (*split, square))
        return float(engine.parameters.flight_limits.step_fraction) / max(math.sqrt(square[0]), LEAST_RATE)

    def _run(self, state: State, engine: BodyEngine, index: np.ndarray, until: float) -> Stop:
        """Take substeps until a time [s]."""
        for name in ("momentum", "angular_momentum"):
            getattr(state.bodies, name).take(index, axis=1, out=getattr(engine._state.bodies, name))
        place_all_velocities.run(engine._current_table(engine._state))
        return engine._bodies_driver(until, MOST_STEPS, shorten=True)

    def _store(self, state: State, own: State, index: np.ndarray) -> None:
        """Copy bodies and grains back, with the loads that have acted in the last substep."""
        for name in MOVED:
            getattr(state.grains.arrays, name)[:, index] = getattr(own.grains.arrays, name)
        for name in MOVED_BODIES:
            getattr(state.bodies, name)[:, index] = getattr(own.bodies, name)
        state.bodies.quick_force[:, index] = own.grains.arrays.force
        state.bodies.quick_torque[:, index] = own.grains.arrays.torque
        state.lost += own.lost
        state.count[SUBSTEPS] += own.count[STEPS]
        state.count[LATE] += own.count[LATE]
        state.clock[LARGEST_LOAD] = max(state.clock[LARGEST_LOAD], own.clock[LARGEST_LOAD])
        state.count[STAGE] = AFTER_SUBSTEPS

    @staticmethod
    def _tell(state: State, own: State, index: np.ndarray) -> None:
        """Mark the bodies that have to wake, or name the grains that caused the failure."""
        state.bodies.quick[:] = 0
        state.bodies.near[index] = own.bodies.near
        for grain in (GRAIN1, GRAIN2):
            number = int(own.count[grain])
            state.count[grain] = index[number] if 0 <= number < len(index) else -1
