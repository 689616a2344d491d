"""Steps of rigid clusters: bodies take long steps, grains of awake clusters contact steps, quick bodies substeps."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
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
    OUTSIDE,
    QUIETING,
    RESTED,
    SLIPPED,
    SOME_AWAKE,
    PHASE,
    STEP,
    STEPS,
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
from ...integrate.parts import Stop
from ...integrate.rigid.awake_clusters import (
    ClusterMeasures,
    cluster_measures,
    kick_clusters,
    measure_clusters_stage,
    store_rest,
)
from ...integrate.rigid.body_touches import CLEAR, LOADED, NEAR
from ...integrate.rigid.rigid_clusters import SAMPLES, RigidLimits
from ...integrate.rigid.rigid_driver import advance_bodies, mark_near_bodies
from ..engine import Engine, GrainSteps
from ..measures import external_energy
from ..part import MOVING, Part
from .cluster_bodies import (
    body_number,
    contacts_of,
    describe_body,
    form_bodies,
    members,
    rest_cluster,
    rest_grain,
    set_friction,
    sort_members,
)
from .far_loads import FarLoads
from .quick_bodies import QuickBodies
from .rigid_loads import may_stay_at_rest, rest_with_loads

PERIODS = 10.0
"""Time for which the vibration of a cluster must have been low, in longest periods of its contacts; for clusters of n
more than ten grains n²/10 of these, about half the period of the slowest bending of a straight chain."""
SLIP_LOSSES = slice(1, 4)
"""Rows of `ContactArrays.lost` that change when a contact slides, rolls or twists beyond a limit."""
SPANS = (
    "a cluster spans half of the box or more, and acts on itself through the images of the box: it is not moved as a "
    "rigid body, and takes contact steps all the time; use a larger box"
)
MOVING_BODIES = ("centre", "orientation", "momentum", "angular_momentum")
"""Arrays of bodies that change in a step."""


@dataclass
class BodySteps(GrainSteps):
    """Steps of clusters at rest as rigid bodies.

    The state of the engine is that of all grains.  While clusters are awake, their grains are copied to a part, which
    takes contact steps; it begins anew in each step of the bodies, so that the state of all grains and the bodies
    determine all that follows.

    Attributes
    ----------
    part : Part
        The grains of awake clusters.
    quick : QuickBodies or None
        Substeps of quick bodies; None: no body takes any.
    made : callable or None
        `(engine, forces)` → such steps for other numbers of the forces.
    """

    part: Part
    quick: QuickBodies | None = None
    made: Callable[[Engine, Sequence[Force]], BodySteps] | None = None
    _grains: np.ndarray = field(init=False, default_factory=lambda: np.zeros(0, np.int64))  # grains that are awake
    _columns: np.ndarray = field(init=False, default_factory=lambda: np.zeros(0, np.int64))  # contacts between them
    _vibrated: np.ndarray = field(init=False, default_factory=lambda: np.zeros(0, bool))  # awake grains, in this step
    _slipped: np.ndarray = field(init=False, default_factory=lambda: np.zeros(0, bool))  # awake grains, in this step
    _measures: ClusterMeasures = field(init=False, default_factory=lambda: cluster_measures(0))
    _far: FarLoads = field(init=False, default_factory=FarLoads)
    _had_substeps: bool = field(init=False, default=False)  # of the present step
    _changed_forces: Sequence[Force] | None = field(init=False, default=None)  # which the parts do not have yet

    def __deepcopy__(self, memo: dict[int, Any]) -> BodySteps:
        """A copy whose parts have tables of their own."""
        copied = BodySteps(copy.deepcopy(self.part, memo), copy.deepcopy(self.quick, memo), self.made)
        copied._changed_forces = self._changed_forces
        return copied

    def for_part(self) -> BodySteps:
        """As `GrainSteps.for_part`, without substeps."""
        return BodySteps(self.part.anew())

    def stages(self, engine: Engine, table: Table) -> list[tuple[Table, Stage | PythonStage, Any]]:
        """Stages of bodies and of awake clusters; those are the ones of all grains with other loops over pairs."""
        inner, quick = self.part.engine, [] if self.quick is None else self.quick.stages()
        of_bodies = (advance_bodies, ()), (mark_near_bodies, ()), (store_rest, ()), *quick
        own: list[tuple[Stage, Any]] = [
            (measure_clusters_stage(inner.law), cluster_measures(1)),
            (kick_clusters, (self._far.values,)),
            (resort_contacts_by_grain, ()),
        ]
        of_inner = inner.table_for_call()
        found = [*super().stages(engine, table), *((table, *each) for each in of_bodies)]
        return [*found, *inner.stages(of_inner), *((of_inner, *each) for each in own)]

    def begin(self, engine: Engine) -> None:
        """Make a body of each grain without contacts; clusters are awake."""
        state = engine.regular_state
        self._update_parts(engine)
        form_bodies(state, np.union1d(engine.content.heavy, state.held_grains()))
        self._list_awake(state)
        if self._grains.size:  # the search for touches needs mass and inertia of awake clusters
            present = self._take_awake(state)
            self._vibrated = np.zeros(len(self._grains), bool)
            self._measure_vibrations(engine)
            for _, own in self._awake_clusters():
                describe_body(state, self._grains[own], present.clusters.offset[:, own])
        self.sum_outer_loads(engine)

    def loads(self, engine: Engine) -> tuple[np.ndarray, np.ndarray]:
        """As `GrainSteps.loads`, with those of the contacts of awake clusters."""
        state = engine.state.copy()
        grains = state.grains.arrays
        self._list_awake(state)
        if self._grains.size:
            self._update_parts(engine)
            # after a step of no length, which begins without marks of r-RESPA, these are the loads of contacts alone
            present = self._sum_near_loads(state)
            contacts, used = present.contacts, int(present.count[CONTACTS])
            for side, sign, torque in ((0, 1.0, contacts.torque1), (1, -1.0, contacts.torque2)):
                index = self._grains[contacts.pair[side, :used]]
                np.add.at(grains.force.T, index, sign * contacts.force.T[:used])
                np.add.at(grains.torque.T, index, torque.T[:used])
        for stage, numbers in engine.content.of_components.get(Hook.LOADS, ()):
            stage.run(engine.table_of(state), numbers)
        return state.grains.force, state.grains.torque

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
        self.sort_members(engine.regular_state)
        self._set_frictions(engine)

    def follow(self, engine: Engine, forces: Sequence[Force]) -> None:
        """As `GrainSteps.follow`: the parts are made anew before they are used."""
        self._changed_forces = forces
        self._set_frictions(engine)

    def _update_parts(self, engine: Engine) -> None:
        """Make the parts anew if numbers of the forces have changed; they begin anew in each step anyway."""
        if self._changed_forces is not None and self.made is not None:
            workers, steps = self.part.prototype.workers, self.made(engine, self._changed_forces)
            self.part, self.quick, self._changed_forces = steps.part, steps.quick, None
            self.part.prototype.workers = workers  # instead of more and more threads

    def sum_loads(self, engine: Engine) -> None:
        """As `GrainSteps.sum_loads`: clusters at rest stay at rest."""
        self.sum_outer_loads(engine)

    def _set_frictions(self, engine: Engine) -> None:
        """The modes of friction of all clusters at rest."""
        state, gas = engine.regular_state, engine.parameters.gas.gas
        if gas.on:
            firsts, sizes = np.unique(state.bodies.first, return_counts=True)
            for first in firsts[(sizes > 1) & (state.bodies.asleep[firsts] == 1)].tolist():
                set_friction(state, gas, members(state, first))

    def sort_members(self, state: State) -> None:
        """Lists of the grains of each body, and of awake grains."""
        sort_members(state)
        self._list_awake(state)

    def _list_awake(self, state: State) -> None:
        """Lists of the grains of awake clusters, and of their contacts."""
        awake = state.bodies.asleep == 0
        self._grains, self._columns = np.flatnonzero(awake), contacts_of(state, awake)

    def sum_outer_loads(self, engine: Engine) -> None:
        """Sum the loads of all bodies on each other."""
        state = engine.regular_state
        sums = int(state.count[LONG_RANGE_SUMS])
        state.count[PHASE], state.clock[STEP] = 1, 0.0
        before = state.time
        engine.run_driver(advance_bodies, -math.inf, state.steps + 1)
        state.clock[TIME], state.count[LONG_RANGE_SUMS] = before, sums

    def call(self, engine: Engine, until: float, last: float, shorten: bool) -> Stop:
        """Steps of all grains before the first step, else of bodies, quick bodies and awake clusters.

        The driver of bodies returns in a step for what it cannot do:

        * `HAS_TO_WAKE`: bodies may touch, or the loads of their contacts are near a limit.  They wake; the same step is
          chosen again, now not longer than `RigidLimits.longest_awake`.
        * `SUBSTEPS`: quick bodies take substeps to the end of the step.
        * `AWAKE_STEPS`: bodies have arrived; the grains of awake clusters take contact steps to the same time.
        * `AWAKE_LOADS`: loads at the end of the step are summed; awake clusters get their kick, or come to rest.

        docs/physics/rigid-clusters.md, "The life of a cluster", tells the same in words.
        """
        state = engine.regular_state
        if state.count[BODIES] == 0 or (state.count[PHASE] == 1 and state.clock[STEP] == 0.0):
            return super().call(engine, until, last, shorten)
        self._list_awake(state)  # of a copy of the state, or a loaded one
        before: dict[str, np.ndarray] = {}
        while True:
            if self._grains.size and state.count[PHASE] == 0:
                before = {name: array.copy() for name, array in _moving_arrays(state).items()}
            stop = engine.run_driver(advance_bodies, until, last, shorten)
            began, failed = time.thread_time(), Stop.NONE
            if stop is Stop.HAS_TO_WAKE:
                self._wake(engine)
            elif stop is Stop.AWAKE_STEPS:
                failed = self._take_contact_steps(engine)
                if failed is not Stop.NONE:
                    self._return_to(before, state)
            elif stop is Stop.AWAKE_LOADS:
                self._finish_step(engine)
            elif stop is Stop.SUBSTEPS:
                failed = self._take_substeps(engine)
                self._list_awake(state)
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
            self.sort_members(state)

    def _take_awake(self, state: State) -> State:
        """The state of the awake grains, with contacts as they are and everything else as at a start."""
        if self._measures.size.size != len(self._grains):
            self._measures = cluster_measures(len(self._grains))
        taken = self.part.take(state, self._grains, self._columns)
        self._far.prepare(self.part)
        return taken

    def _sum_near_loads(self, state: State) -> State:
        """The state of the awake grains, with all loads that their engine sums."""
        present = self._take_awake(state)
        present.begin_empty_step()
        self.part.engine.drive(-math.inf, 1)
        present.count[STEPS] = 0
        return present

    def _take_contact_steps(self, engine: Engine) -> Stop:
        """Contact steps of the awake grains for one step of the bodies."""
        self._had_substeps = False
        self._update_parts(engine)
        state = engine.regular_state
        present = self._sum_near_loads(state)
        inner = self.part.engine
        before, end = state.time, state.time + float(state.clock[STEP])
        if engine.parameters.external_work.time_dependent:
            # the driver of bodies has booked the change of their energies at rest; the inner engine books it as well
            for outer in engine.external:
                state.lost[OUTSIDE] += external_energy(inner, outer, end) - external_energy(inner, outer, before)
        self._far.begin(state, self.part)
        self._vibrated = np.zeros(len(self._grains), bool)
        pieces = math.ceil(SAMPLES * float(state.clock[STEP]) / _limits(engine).longest_awake)
        for k in range(1, pieces):
            stop = inner.drive(before + (end - before) * k / pieces, math.inf, shorten=True)
            if stop is not Stop.TIME_REACHED:
                break
            self._measure_vibrations(engine)
        else:
            stop = inner.drive(end, math.inf, shorten=True)
        if stop is not Stop.TIME_REACHED:
            return stop
        for stage, numbers in inner.content.of_components.get(Hook.END_OF_BODIES, ()):
            stage.run(inner.table_of(present), numbers, Hook.END_OF_BODIES)
        self._slipped = self._slips(state, present)  # before `give_back`, which overwrites the losses compared
        self.part.give_back(engine)
        self._columns = self.part.columns
        return Stop.NONE

    def _return_to(self, before: dict[str, np.ndarray], state: State) -> None:
        """Return to the state at the start of a step, in whose contact steps something failed, and name the grains."""
        for name, array in _moving_arrays(state).items():
            array[...] = before[name]
        self.sort_members(state)
        self.part.name_limiting(state)

    def _measure_vibrations(self, engine: Engine) -> None:
        """Measure awake clusters; notes the grains of those that vibrate too much to come to rest."""
        measures, inner = self._measures, self.part.engine
        measure_clusters_stage(inner.law).run(inner.table_of(self.part.state), measures)
        allowed = _vibration_at_rest(engine, measures.size, measures.limit)
        self._vibrated |= (measures.vibration > allowed)[measures.first.astype(np.int64)]

    def _awake_clusters(self) -> list[tuple[int, np.ndarray]]:
        """First grain and all grains of each awake cluster that was measured, as indices of awake grains."""
        numbers = self._measures.first.astype(np.int64)
        order = np.argsort(numbers, kind="stable")
        starts = np.flatnonzero(np.diff(numbers[order], prepend=-1))
        return list(zip(numbers[order][starts].tolist(), np.split(order, starts[1:]), strict=True))

    def kick_awake(self, state: State, force: np.ndarray, torque: np.ndarray, step: float) -> None:
        """Half a kick of the awake clusters between steps.

        Parameters
        ----------
        force : ndarray
            (3, N) forces on the grains of the state [N].
        torque : ndarray
            (3, N) torques [N m].
        step : float
            Length of the step [s].
        """
        self._list_awake(state)
        if not self._grains.size:
            return
        self._take_awake(state)
        self._far.kick(self.part, (force, torque), step)
        self._store_velocities(state)

    def _store_velocities(self, state: State) -> None:
        """Copy velocities and spins of awake grains to the state of all grains."""
        for name in ("velocity", "spin"):
            getattr(state.grains.arrays, name)[..., self._grains] = getattr(self.part.state.grains.arrays, name)

    def _slips(self, state: State, present: State) -> np.ndarray:
        """Which awake grains have contacts that slipped in this step of bodies: losses of these have grown."""
        slipped = np.zeros(len(self._grains), bool)
        if not present.count[SLIPPED]:
            return slipped
        contacts, columns, used = state.contacts, self._columns, int(present.count[CONTACTS])
        lost = [each.tobytes() for each in contacts.lost[SLIP_LOSSES, columns].T]
        before = dict(zip(map(frozenset, contacts.pair[:, columns].T.tolist()), lost, strict=True))
        pairs = present.contacts.pair[:, :used].T
        for pair, now in zip(pairs, present.contacts.lost[SLIP_LOSSES, :used].T, strict=True):
            if before.get(frozenset(self._grains[pair].tolist())) != now.tobytes():
                slipped[pair] = True
        return slipped

    def _finish_step(self, engine: Engine) -> None:
        """The second half kick of awake clusters; those that had no substeps, and are at rest, become bodies."""
        state = engine.regular_state
        if self._had_substeps:
            assert self.quick is not None
            self.kick_awake(state, *self.quick.slow_loads(state), float(state.clock[STEP]))
            return
        present, bodies = self.part.state, state.bodies
        self._far.end(state, self.part)
        self._store_velocities(state)
        measures = self._measures
        self._measure_vibrations(engine)
        clusters, firsts = self._awake_clusters(), self._grains[measures.first.astype(np.int64)]
        if not np.array_equal(firsts, bodies.first[self._grains]):
            changed = self._rename(state, firsts)
            for k, own in clusters:
                if changed[k]:
                    describe_body(state, self._grains[own], present.clusters.offset[:, own])
        # vectors from the centres of mass now, as those of grains of bodies that are not turned
        bodies.offset[:, self._grains] = present.clusters.offset
        bodies.orientation[:, self._grains] = np.array([[0.0], [0.0], [0.0], [1.0]])
        bodies.inner_field[:, self._grains] = 0.0
        self._mark_near(engine)
        rested = False
        for k, own in clusters:
            first = int(self._grains[k])
            if len(own) == 1:
                if bodies.near[first] == CLEAR:
                    rest_grain(state, first)
                    rested = True
                continue
            if self._slipped[own].any():
                bodies.event[first] = state.time
            if self._vibrated[own].any():
                bodies.vibration[first] = state.time
            wait = measures.period[k] * max(PERIODS, len(own) ** 2 / 10.0)
            quiet = state.time - max(bodies.vibration[first], bodies.event[first]) > wait
            if quiet and bodies.near[first] == CLEAR and self._fits(engine, own):
                self._rest(engine, self._grains[own], present.clusters.offset[:, own])
                rested = True
        if rested:
            self.sort_members(state)

    def _mark_near(self, engine: Engine) -> None:
        """Mark bodies near others or walls, and those with driven grains, which do not come to rest."""
        state, table = engine.regular_state, engine.table_of(engine.regular_state)
        mark_near_bodies.run(table)
        for stage, numbers in engine.content.of_components.get(Hook.NEAR_BODIES, ()):
            stage.run(table, numbers, Hook.NEAR_BODIES)
        firsts = state.bodies.first[engine.content.heavy]
        state.bodies.near[firsts] = np.maximum(state.bodies.near[firsts], NEAR)

    def _fits(self, engine: Engine, own: np.ndarray) -> bool:
        """Whether a cluster extends over less than half of the box along each periodic axis.

        Larger ones stay awake, with a warning: their grains may act on each other through the images of the box.
        """
        s = self.part.state.clusters.offset[:, own]
        extent = s.max(axis=1) - s.min(axis=1)
        lengths = engine.regular_state.box.lengths
        fits = all(side is None or size < 0.5 * side for size, side in zip(extent, lengths, strict=True))
        if not fits and SPANS not in engine.warnings:
            engine.warnings.append(SPANS)
        return fits

    def _rename(self, state: State, firsts: np.ndarray) -> np.ndarray:
        """New first grains of the clusters of the awake grains, after contacts formed or broke.

        Returns whether the cluster of each awake grain has other grains than before.
        """
        bodies, n = state.bodies, len(state.grains)
        before = bodies.first[self._grains]
        # a cluster is the same if all of its grains had its first grain, and no other grain had
        other = np.bincount(firsts, before != firsts, n) + np.bincount(before, before != firsts, n)
        changed = other[firsts] > 0
        bodies.event[firsts[changed]] = bodies.vibration[firsts[changed]] = state.time
        bodies.first[self._grains] = firsts
        self.sort_members(state)
        return changed

    def _rest(self, engine: Engine, index: np.ndarray, offset: np.ndarray) -> None:
        """Make a body of the grains of a cluster, at vectors `offset` from its centre of mass."""
        state, measures, first = engine.regular_state, self._measures, int(index[0])
        describe_body(state, index, offset)
        state.lost[QUIETING] += rest_cluster(state, index)
        at = np.searchsorted(self._grains, first)
        rest_with_loads(state, first, float(measures.strain[at]))
        state.bodies.strength[:, first] = measures.strength[:, at]
        store_rest.run(engine.table_of(state), (), body_number(state, first))
        if engine.parameters.gas.gas.on:
            set_friction(state, engine.parameters.gas.gas, index)
        state.count[RESTED] += 1


def _vibration_at_rest(engine: Engine, size: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Vibrational energy [J] below which clusters of `size` grains may come to rest; `limit` is their ½ k q_c².

    In a thermal gas this is at least 3 (n − 1) k_B T, the mean kinetic energy of the 6 n − 6 modes of a cluster in
    equilibrium with the gas, but no more than ½ k q_c², with which one contact would slip. Dashpots without noise
    keep the modes colder: measured in chains of two and eight 10 nm iron grains that were kept awake, ζ = 0.2, were
    0.07 and 0.7 k_B T with a stopping time of 20 ns, 0.3 and 3.6 k_B T (at most 1.3 and 10) with 1 ns. So chains
    come to rest as fast as without gas, and few would in a dense or hot gas with ε ½ k q_c² alone.
    """
    thermal = 3.0 * (size - 1) * engine.parameters.gas.gas.temperature_energy
    return np.maximum(_limits(engine).vibration * limit, np.minimum(thermal, limit))


def _limits(engine: Engine) -> RigidLimits:
    limits: RigidLimits = engine.parameters.flight_limits
    return limits


def _moving_arrays(state: State) -> dict[str, np.ndarray]:
    """Arrays that change in a step of bodies, but for forces and lists, before awake grains are copied back."""
    found = {name: getattr(state.grains.arrays, name) for name in MOVING}
    found |= {f"bodies/{name}": getattr(state.bodies, name) for name in MOVING_BODIES}
    return found | {"clock": state.clock, "count": state.count, "lost": state.lost}
