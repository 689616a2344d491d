"""Steps of rigid clusters: bodies take long steps, grains of awake clusters contact steps, quick bodies substeps."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

import numpy as np

from ...basics.arrays import SAVED_BODIES
from ...basics.state import (
    BODIES,
    CONTACT_STEPS,
    CONTACTS,
    GRAINS_AWAKE,
    LARGEST_LOAD,
    LATE,
    LONG_RANGE_SUMS,
    PHASE,
    RESTED,
    SOME_AWAKE,
    STEP,
    SUBSTEPS,
    TIME,
    WOKEN,
    State,
)
from ...compiler.stage import PythonStage, Stage
from ...compiler.table import Table
from ...contact.gather import resort_contacts_by_grain
from ...forces.base import Force
from ...integrate.hooks import Hook
from ...integrate.part_copies import NO_COPIES, add_sums_of_part, begin_part, copy_columns
from ...integrate.parts import Stop
from ...integrate.rigid.awake_clusters import (
    cluster_measures,
    find_resting_clusters,
    kick_clusters,
    measure_clusters_stage,
    no_loads,
    place_awake_grains,
    store_rest,
)
from ...integrate.rigid.body_touches import LOADED
from ...integrate.rigid.rigid_driver import advance_bodies, mark_near_bodies
from ..engine import Engine, GrainSteps
from ..part import MOVING
from .awake_steps import AwakeSteps
from .cluster_bodies import describe_body, form_bodies, members, set_friction
from .quick_bodies import QuickBodies
from .rigid_loads import may_stay_at_rest, virial_at_rest

OF_GRAINS, OF_BODIES = attrgetter(*MOVING), attrgetter("centre", "orientation", "momentum", "angular_momentum")
"""Arrays of grains and bodies that change in a step."""


@dataclass
class BodySteps(GrainSteps):
    """Steps of clusters at rest as rigid bodies.

    The state of the engine is that of all grains.

    Attributes
    ----------
    awake : AwakeSteps
        Steps of the grains of awake clusters.
    quick : QuickBodies or None
        Substeps of quick bodies; None: no body takes any.
    made : callable or None
        `(engine, forces)` → such steps for other numbers of the forces.
    """

    awake: AwakeSteps
    quick: QuickBodies | None = None
    made: Callable[[Engine, Sequence[Force]], BodySteps] | None = None
    _had_substeps: bool = field(init=False, default=False)  # of the present step
    _before: list[np.ndarray] = field(init=False, default_factory=list)  # arrays at the start of the present step
    _changed_forces: Sequence[Force] | None = field(init=False, default=None)  # which the parts do not have yet

    def __deepcopy__(self, memo: dict[int, Any]) -> BodySteps:
        """A copy whose parts have tables of their own."""
        copied = BodySteps(AwakeSteps(copy.deepcopy(self.awake.part, memo)), copy.deepcopy(self.quick, memo), self.made)
        copied._changed_forces = self._changed_forces
        return copied

    def for_part(self) -> BodySteps:
        """As `GrainSteps.for_part`, without substeps."""
        return BodySteps(AwakeSteps(self.awake.part.anew()))

    def stages(self, engine: Engine, table: Table) -> list[tuple[Table, Stage | PythonStage, Any]]:
        """Stages of bodies and of awake clusters; those are the ones of all grains with other loops over pairs."""
        inner, quick = self.awake.part.engine, [] if self.quick is None else self.quick.stages()
        own, measures = inner.regular_state, cluster_measures(1)
        plain = advance_bodies, mark_near_bodies, store_rest, resort_contacts_by_grain
        of_bodies = [
            *((each, ()) for each in plain),
            *quick,
            (add_sums_of_part, (own.clock, own.count, own.lost, np.zeros(2))),
            (place_awake_grains, (*np.zeros((3, 3, 1)), np.zeros(1))),
            (find_resting_clusters, measures),
        ]
        of_awake: list[tuple[Stage, Any]] = [
            (measure_clusters_stage(inner.law), measures),
            (kick_clusters, no_loads(1)),
            (begin_part, (np.zeros(1),)),
            (copy_columns, NO_COPIES),
        ]
        of_inner = inner.table_for_call()
        found = [*super().stages(engine, table), *((table, *each) for each in of_bodies)]
        return [*found, *inner.stages(of_inner), *((of_inner, *each) for each in of_awake)]

    def begin(self, engine: Engine) -> None:
        """Make a body of each grain without contacts; clusters are awake."""
        state, awake = engine.regular_state, self.awake
        self._update_parts(engine)
        form_bodies(state, np.union1d(engine.content.heavy, state.held_grains()))
        awake.list(state)
        if awake.grains.size:  # the search for touches needs mass and inertia of awake clusters
            awake.take(engine, state)
            awake.measure()
            for _, own, offset in awake.clusters(np.ones(len(awake.grains), bool)):
                describe_body(state, awake.grains[own], offset)
        self.sum_loads(engine)

    def loads(self, engine: Engine) -> tuple[np.ndarray, np.ndarray]:
        """As `GrainSteps.loads`, with those of the contacts of awake clusters."""
        state, awake = engine.state.copy(), self.awake
        grains = state.grains.arrays
        awake.list(state)
        if awake.grains.size:
            self._update_parts(engine)
            # after a step of no length, which begins without marks of r-RESPA, these are the loads of contacts alone
            own = awake.take_with_loads(engine, state)
            contacts, used = own.contacts, int(own.count[CONTACTS])
            for side, sign, torque in ((0, 1.0, contacts.torque1), (1, -1.0, contacts.torque2)):
                index = awake.grains[contacts.pair[side, :used]]
                np.add.at(grains.force.T, index, sign * contacts.force.T[:used])
                np.add.at(grains.torque.T, index, torque.T[:used])
        for stage, numbers in engine.content.of_components.get(Hook.LOADS, ()):
            stage.run(engine.table_of(state), numbers)
        return state.grains.force, state.grains.torque

    def virial_at_rest(self, engine: Engine) -> np.ndarray:
        """As `GrainSteps.virial_at_rest`."""
        return virial_at_rest(engine.state, *self.loads(engine))

    def summary(self, state: State) -> dict[str, Any]:
        """Time awake, steps of each level, and the largest load at rest."""
        count, clock, time = state.count, state.clock, max(state.time, np.finfo(float).tiny)
        return {
            "time_awake": float(clock[SOME_AWAKE]) / time,
            "grains_awake": float(clock[GRAINS_AWAKE]) / time,
            "steps_of_bodies": state.steps,
            "substeps_of_bodies": int(count[SUBSTEPS]),
            "contact_steps": int(count[CONTACT_STEPS]),
            "woken": int(count[WOKEN]),
            "came_to_rest": int(count[RESTED]),
            "touches_seen_late": int(count[LATE]),
            "largest_load_at_rest": float(clock[LARGEST_LOAD]),
        }

    def with_missing(self, engine: Engine, saved: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """As `GrainSteps.with_missing`: a state without bodies, after a change, gets them with its loads."""
        return {f"bodies/{name}": getattr(engine.regular_state.bodies, name) for name in SAVED_BODIES} | saved

    def loaded(self, engine: Engine) -> None:
        """As `GrainSteps.loaded`."""
        self.awake.sort_members(engine.regular_state)
        self._set_frictions(engine)

    def follow(self, engine: Engine, forces: Sequence[Force]) -> None:
        """As `GrainSteps.follow`: the parts are made anew before they are used."""
        self._changed_forces = forces
        self._set_frictions(engine)

    def _update_parts(self, engine: Engine) -> None:
        """Make the parts anew if numbers of the forces have changed; they begin anew in each step anyway."""
        if self._changed_forces is not None and self.made is not None:
            workers, steps = self.awake.part.prototype.workers, self.made(engine, self._changed_forces)
            self.awake.part, self.quick, self._changed_forces = steps.awake.part, steps.quick, None
            self.awake.part.prototype.workers = workers  # instead of more and more threads

    def _set_frictions(self, engine: Engine) -> None:
        """The modes of friction of all clusters at rest."""
        state, gas = engine.regular_state, engine.parameters.gas.gas
        if gas.on:
            firsts, sizes = np.unique(state.bodies.first, return_counts=True)
            for first in firsts[(sizes > 1) & (state.bodies.asleep[firsts] == 1)].tolist():
                set_friction(state, gas, members(state, first))

    def sum_loads(self, engine: Engine) -> None:
        """As `GrainSteps.sum_loads`, of all bodies; clusters at rest stay at rest."""
        state = engine.regular_state
        sums = int(state.count[LONG_RANGE_SUMS])
        state.count[PHASE], state.clock[STEP] = 1, 0.0
        before = state.time
        engine.run_driver(advance_bodies, -math.inf, state.steps + 1)
        state.clock[TIME], state.count[LONG_RANGE_SUMS] = before, sums

    def call(self, engine: Engine, until: float, last: float, shorten: bool) -> Stop:
        """Steps of all grains before the first step, else of bodies, quick bodies and awake clusters.

        The driver of bodies returns in a step for what it cannot do:

        * `HAS_TO_WAKE`: bodies may touch, or the loads of their contacts are near a limit.  They wake, unless a closer
          look shows that contacts stay at rest; the same step is chosen again, with awake clusters not longer than
          `RigidLimits.longest_awake`.
        * `SUBSTEPS`: quick bodies take substeps to the end of the step.
        * `AWAKE_STEPS`: bodies have arrived; the grains of awake clusters take contact steps to the same time.
        * `AWAKE_LOADS`: loads at the end of the step are summed; awake clusters get their kick, or come to rest.

        docs/physics/rigid-clusters.md, "The life of a cluster", tells the same in words.
        """
        state = engine.regular_state
        if state.count[BODIES] == 0 or (state.count[PHASE] == 1 and state.clock[STEP] == 0.0):
            return super().call(engine, until, last, shorten)
        self.awake.list(state)  # of a copy of the state, or a loaded one
        while True:
            if self.awake.grains.size and state.count[PHASE] == 0:
                self._keep(state)
            stop = engine.run_driver(advance_bodies, until, last, shorten)
            began, failed = time.thread_time(), Stop.NONE
            if stop is Stop.HAS_TO_WAKE:
                self._wake(engine)
            elif stop is Stop.AWAKE_STEPS:
                self._had_substeps = False
                self._update_parts(engine)
                failed = self.awake.take_contact_steps(engine)
                if failed is not Stop.NONE:
                    self._return(state)
            elif stop is Stop.AWAKE_LOADS:
                if self._had_substeps:
                    assert self.quick is not None
                    self.awake.kick(engine, state, self.quick.slow_loads(state), float(state.clock[STEP]))
                else:
                    self.awake.finish(engine)
            elif stop is Stop.SUBSTEPS:
                failed = self._take_substeps(engine)
                self.awake.list(state)
            else:
                return stop
            self.seconds += time.thread_time() - began
            if failed is not Stop.NONE:
                return failed

    def _take_substeps(self, engine: Engine) -> Stop:
        """The first half of a step of all bodies, and the substeps of the quick ones; returns why they failed."""
        self._update_parts(engine)
        assert self.quick is not None
        failed = self.quick.take(engine)
        self._had_substeps = failed is Stop.NONE
        return failed

    def _wake(self, engine: Engine) -> None:
        """Wake all bodies that may touch, or the loads of whose contacts are near a limit.

        Their grains have the velocities of the rigid motion already, from the end of the last step.
        """
        state, woken = engine.regular_state, False
        bodies = state.bodies
        for first in np.flatnonzero((bodies.near >= LOADED) & (bodies.asleep == 1)).tolist():
            if bodies.near[first] == LOADED and may_stay_at_rest(state, engine.law, engine.table_of(state), first):
                continue
            bodies.asleep[members(state, first)] = 0
            bodies.event[first] = bodies.vibration[first] = state.time
            state.count[WOKEN] += 1
            woken = True
        if woken:
            self.awake.sort_members(state)

    def _keep(self, state: State) -> None:
        """Keep what a step of bodies changes, but for forces and lists, before awake grains are copied back."""
        moving = _moving_arrays(state)
        if [array.shape for array in moving] != [array.shape for array in self._before]:
            self._before = [array.copy() for array in moving]
        for before, array in zip(self._before, moving, strict=True):
            before[...] = array

    def _return(self, state: State) -> None:
        """Return to the state at the start of a step, in whose contact steps something failed, and name the grains."""
        for before, array in zip(self._before, _moving_arrays(state), strict=True):
            array[...] = before
        self.awake.sort_members(state)
        self.awake.part.name_limiting(state)


def _moving_arrays(state: State) -> list[np.ndarray]:
    """Arrays that change in a step of bodies."""
    own = *OF_GRAINS(state.grains.arrays), *OF_BODIES(state.bodies), *(state.cell or ())
    return [*own, state.clock, state.count, state.lost]
