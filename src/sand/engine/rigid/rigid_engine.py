"""The engine of rigid clusters: bodies take long steps, grains of awake clusters contact steps by an inner engine."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import wraps
from typing import Any, TypeVar

import numpy as np

from ...basics.arrays import SAVED_BODIES, SAVED_LONG_RANGE, cluster_arrays
from ...basics.box import Box
from ...basics.grains import Grains
from ...basics.state import (
    BODIES,
    BROKEN,
    CHECKED,
    COMPARED,
    CONTACT_STEP,
    CONTACT_STEPS,
    CONTACTS,
    CORRECTED,
    CYCLE,
    GRAIN1,
    GRAIN2,
    KICKED,
    LEFT,
    LONG_RANGE_SUMS,
    MADE,
    OUTSIDE,
    PAIRS,
    QUIETING,
    RESTED,
    SETTLED,
    SLIPPED,
    STAGE,
    STEP,
    STEP_INCREASES,
    STEPS,
    SUBSTEPS,
    TIME,
    WOKEN,
    State,
)
from ...compiler.stage import PythonStage, Stage
from ...compiler.table import Table
from ...contact.gather import resort_contacts_by_grain
from ...contact.law import ContactLaw, Pairing, contact_constants
from ...forces.external.external_loops import external_energies_for
from ...integrate.parts import DT, ContactParameters, Stop
from ...integrate.rigid.awake_clusters import (
    ClusterMeasures,
    cluster_measures,
    kick_clusters,
    measure_clusters_stage,
    store_rest,
)
from ...integrate.rigid.rigid_clusters import SAMPLES, RigidLimits
from ...integrate.rigid.rigid_driver import CLEAR, LOADED, advance_bodies, mark_near_bodies
from ...integrate.stages import finish_gas
from ...integrate.step_control import INCREASE_INTERVAL
from ...integrate.task_queue import uses_task_queue
from ...integrate.worker_threads import WorkerThreads
from ..changed_state import subset
from ..engine import Engine
from ..new_state import new_state
from ..part import MOVING, MOVING_BODIES, copy_contacts, copy_grains, store_contacts, store_grains
from .cluster_bodies import (
    body_number,
    describe_body,
    form_bodies,
    members,
    rest_cluster,
    rest_grain,
    set_friction,
    sort_members,
)
from .rigid_loads import may_stay_at_rest, rest_with_loads

PERIODS = 10.0
"""Time for which the vibration of a cluster must have been low, in longest periods of its contacts; for clusters of n
more than ten grains n²/10 of these, about half the period of the slowest bending of a straight chain."""
LIST_GAP, SHARE_OF_SPACING = 3.0, 0.3
"""Largest gap of pairs that the driver of bodies looks at, in smallest radii, and, in thin gases, in mean distances of
neighbours: steps of bodies are long, and no body flies farther in a step than a tenth of it."""
MOST_ENGINES = 64
"""Engines of different numbers of grains that are kept: the table of an engine is slow to fill with other arrays."""
SLIP_LOSSES = slice(1, 4)
"""Rows of `ContactArrays.lost` that change when a contact slides, rolls or twists beyond a limit."""
SPANS = (
    "a cluster spans half of the box or more, and acts on itself through the images of the box: it is not moved as a "
    "rigid body, and takes contact steps all the time; use a larger box"
)

Kind = TypeVar("Kind", bound=Engine)


def timed(method: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Count the processor time of a method as work on awake clusters."""

    @wraps(method)
    def call(self: Any) -> Any:
        began = time.thread_time()
        try:
            return method(self)
        finally:
            self._awake_seconds += time.thread_time() - began

    return call


@dataclass
class RigidEngine(Engine):
    """An engine whose clusters at rest move as rigid bodies.

    The state is that of all grains.  While clusters are awake, their grains are copied to a smaller state, on which
    the inner engine takes contact steps; it begins anew in each step of the bodies, so that the state of all grains
    and the bodies determine all that follows.

    Attributes
    ----------
    inner : Engine
        The engine of awake grains; it is replaced as clusters wake and come to rest.
    """

    inner: Engine | None = None
    _inners: dict[int, Engine] = field(init=False, default_factory=dict)  # engines of awake grains by their number
    _inner_workers: WorkerThreads | None = field(init=False, default=None)
    _awake: np.ndarray = field(init=False, default_factory=lambda: np.zeros(0, np.int64))  # grains that are awake
    _columns: np.ndarray = field(init=False, default_factory=lambda: np.zeros(0, np.int64))  # contacts between them
    _vibrated: np.ndarray = field(init=False, default_factory=lambda: np.zeros(0, bool))  # awake grains, in this step
    _slipped: np.ndarray = field(init=False, default_factory=lambda: np.zeros(0, bool))  # awake grains, in this step
    _measures: ClusterMeasures = field(init=False, default_factory=lambda: cluster_measures(0))
    _remainder: np.ndarray = field(init=False, default_factory=lambda: np.zeros((2, 3, 0)))
    _awake_seconds: float = field(init=False, default=0.0)  # processor time of the work on awake clusters [s]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.inner is not None:
            self._inner_workers = self.inner._workers

    @property
    def awake_work(self) -> tuple[int, int, float]:
        """As `Engine.awake_work`."""
        count = self._state.count
        return int(count[CONTACT_STEPS]), int(count[SUBSTEPS]), self._awake_seconds

    def _drivers(self) -> list[tuple[Stage, Any]]:
        """Stages of bodies; those of the inner engine are the ones of this engine with other loops over pairs."""
        return [*super()._drivers(), (advance_bodies, ()), (mark_near_bodies, ())]

    def stages(self, table: Table) -> list[tuple[Table, Stage | PythonStage, Any]]:
        """As `Engine.stages`, with those of awake clusters."""
        assert self.inner is not None
        inner, measures = self.inner._call_table(math.inf, 1, False)[0], cluster_measures(1)
        own: list[tuple[Stage, Any]] = [
            (measure_clusters_stage(self.law), measures),
            (kick_clusters, (self._remainder,)),
        ]
        own += [(resort_contacts_by_grain, ())] + ([(finish_gas, ())] if self.parameters.gas.gas.on else [])
        of_inner = [*self.inner.stages(inner), *((inner, *each) for each in own)]
        return [*super().stages(table), (table, store_rest, ()), *of_inner]

    def begin(self) -> None:
        """As `Engine.begin`; clusters start awake, single grains as bodies."""
        super().begin()
        self._form_bodies()

    def refresh_loads(self) -> None:
        """As `Engine.refresh_loads`; all clusters wake."""
        super().refresh_loads()
        self._form_bodies()

    def load_state(self, saved: dict[str, np.ndarray], output_time: float | None = None) -> None:
        """As `Engine.load_state`; a state without bodies, after a change, gets them with its loads."""
        saved = {f"bodies/{name}": getattr(self._state.bodies, name) for name in SAVED_BODIES} | saved
        super().load_state(saved, output_time)
        self._sort_members()
        if self.parameters.gas.gas.on:
            bodies = self._state.bodies
            firsts, sizes = np.unique(bodies.first, return_counts=True)
            for first in firsts[(sizes > 1) & (bodies.asleep[firsts] == 1)].tolist():
                set_friction(self._state, self.parameters.gas.gas, members(self._state, first))

    def _form_bodies(self) -> None:
        """Make a body of each grain without contacts; clusters are awake."""
        state = self._state
        form_bodies(state)
        self._list_awake()
        if self._awake.size:  # the search for touches needs mass and inertia of awake clusters
            present, self._vibrated = self._inner_state(), np.zeros(len(self._awake), bool)
            self._measure_vibrations(present)
            for _, own in self._awake_clusters():
                describe_body(state, self._awake[own], present.clusters.offset[:, own])
        self._sum_outer_loads()

    def _sort_members(self) -> None:
        """Lists of the grains of each body, and of awake grains."""
        sort_members(self._state)
        self._list_awake()

    def _list_awake(self) -> None:
        """Lists of the grains of awake clusters, and of their contacts."""
        awake = self._state.bodies.asleep == 0
        self._awake, self._columns = np.flatnonzero(awake), self._contacts_of(awake)

    def _contacts_of(self, chosen: np.ndarray) -> np.ndarray:
        """Columns of the contacts of some clusters; `chosen` says (N,) which grains are theirs."""
        return np.flatnonzero(chosen[self._state.contacts.pair[0, : self._state.count[CONTACTS]]])

    def _sum_outer_loads(self) -> None:
        """Sum the loads of all bodies on each other."""
        state = self._state
        sums = int(state.count[LONG_RANGE_SUMS])
        state.count[STAGE], state.clock[STEP] = 1, 0.0
        before = state.time
        self._bodies_driver(-math.inf, state.steps + 1)
        state.clock[TIME], state.count[LONG_RANGE_SUMS] = before, sums

    def _bodies_driver(self, until: float, last: float, shorten: bool = False) -> Stop:
        """Call the driver of bodies; enlarges arrays that overflow."""
        while True:
            stop = self._run_program(advance_bodies, until, last, shorten)
            if stop is Stop.PAIRS_FULL:
                found, self._state.count[PAIRS] = int(self._state.count[PAIRS]), 0
                self._state.grow_pairs(int(1.1 * found))
            elif stop is Stop.LIST_FULL:
                self._state.grow_rows()
            else:
                return stop

    def _call_driver(self, until: float, last: float, shorten: bool) -> Stop:
        """One call of the driver: of all grains before the first step, else of bodies and awake clusters."""
        state = self._state
        if state.count[BODIES] == 0 or (state.count[STAGE] == 1 and state.clock[STEP] == 0.0):
            return super()._call_driver(until, last, shorten)
        self._list_awake()  # of a copy of the state, or a loaded one
        before: dict[str, np.ndarray] = {}
        while True:
            if self._awake.size and state.count[STAGE] == 0:
                before = {name: array.copy() for name, array in _moving_arrays(state).items()}
            stop = self._bodies_driver(until, last, shorten)
            if stop is Stop.TOUCH_AHEAD:
                self._wake()
            elif stop is Stop.AWAKE_STEPS:
                failed = self._take_contact_steps()
                if failed is not Stop.NONE:
                    self._return_to(before)
                    return failed
            elif stop is Stop.AWAKE_LOADS:
                self._finish_step()
            else:
                return stop

    def _wake(self) -> None:
        """Wake all bodies that may touch, or the loads of whose contacts are near a limit."""
        bodies, state, woken = self._state.bodies, self._state, False
        for first in np.flatnonzero((bodies.near >= LOADED) & (bodies.asleep == 1)).tolist():
            if bodies.near[first] == LOADED and may_stay_at_rest(state, self.law, self._current_table(state), first):
                continue
            bodies.asleep[members(state, first)] = 0
            bodies.event[first] = bodies.vibration[first] = state.time
            state.count[WOKEN] += 1
            woken = True
        if woken:
            self._sort_members()

    def _inner_state(self) -> State:
        """The state of the awake grains, with contacts as they are and everything else as at a start."""
        assert self.inner is not None
        state, index = self._state, self._awake
        if self._measures.size.size != len(index):
            self.inner = self._inners.get(len(index)) or self._new_inner(index)
            self._measures = cluster_measures(len(index))
            self._remainder = np.zeros((2, 3, len(index)))
        present = self.inner._state
        present.count[:] = 0
        copy_grains(state, present, index)
        copy_contacts(state, present, index, self._columns)
        present.clock[:] = 0.0
        present.lost[:] = 0.0
        present.count[COMPARED] = -1
        present.count[CHECKED] = present.count[STEP_INCREASES] = -INCREASE_INTERVAL
        # the kicks of the gas are counted with the steps of grains, so that no random number is used twice
        present.count[CONTACT_STEPS] = state.count[CONTACT_STEPS]
        present.clock[TIME], present.clock[SETTLED] = state.clock[TIME], state.clock[SETTLED]
        present.clock[KICKED] = state.clock[TIME]
        present.clock[CONTACT_STEP] = math.inf
        for name in SAVED_LONG_RANGE:
            getattr(present.long_range, name)[...] = math.inf if name == "anchor" else 0.0
        present.pair_list.anchor[...] = math.inf
        resort_contacts_by_grain.run(self._inner_table(present))
        return present

    def _new_inner(self, index: np.ndarray) -> Engine:
        """An engine for these awake grains, which is kept for others of the same number."""
        given = self.inner
        assert given is not None
        grains, capacity = subset(self._state.grains, index), len(self._columns)
        made = new_state(grains, self._state.box, given.parameters, given._components, capacity, over_all_pairs=True)
        made.uniform_contacts = self._state.uniform_contacts
        made.clusters = cluster_arrays(len(index))
        inner = given.for_state(made)
        # few grains share no work between threads
        inner._workers = self._inner_workers if uses_task_queue(len(index)) else None
        return keep(self._inners, len(index), inner)

    @timed
    def _take_contact_steps(self) -> Stop:
        """Contact steps of the awake grains for one step of the bodies."""
        state, present = self._state, self._inner_state()
        before, end = state.time, state.time + float(state.clock[STEP])
        inner = self.inner
        assert inner is not None
        if self.parameters.external_work.time_dependent:
            # the driver of bodies has booked the change of their energies at rest; the inner engine books it as well
            for outer in self.external:
                state.lost[OUTSIDE] += external_energy(inner, outer, end) - external_energy(inner, outer, before)
        present.count[STAGE] = 1
        present.clock[STEP] = present.clock[CYCLE] = present.clock[LEFT] = 0.0
        inner._drive(-math.inf, 1)
        present.count[STEPS] = 0
        self._kick_awake(present)
        self._vibrated = np.zeros(len(self._awake), bool)
        pieces = math.ceil(SAMPLES * float(state.clock[STEP]) / self._limits.longest_awake)
        for k in range(1, pieces):
            stop = inner._drive(before + (end - before) * k / pieces, math.inf, shorten=True)
            if stop is not Stop.TIME_REACHED:
                break
            self._measure_vibrations(present)
        else:
            stop = inner._drive(end, math.inf, shorten=True)
        if stop is not Stop.TIME_REACHED:
            return stop
        self._finish_gas(present)
        self._copy_back(present)
        return Stop.NONE

    def _return_to(self, before: dict[str, np.ndarray]) -> None:
        """Return to the state at the start of a step, in whose contact steps something failed, and name the grains."""
        assert self.inner is not None
        state, awake, count = self._state, self._awake, self.inner._state.count
        limiting = [int(count[grain]) for grain in (GRAIN1, GRAIN2)]
        for name, array in _moving_arrays(state).items():
            array[...] = before[name]
        self._sort_members()
        for grain, own in zip((GRAIN1, GRAIN2), limiting, strict=True):
            state.count[grain] = awake[own] if 0 <= own < len(awake) else -1

    def _measure_vibrations(self, present: State) -> None:
        """Measure awake clusters; notes the grains of those that vibrate too much to come to rest."""
        measures = self._measures
        measure_clusters_stage(self.law).run(self._inner_table(present), measures)
        allowed = self._vibration_at_rest(measures.size, measures.limit)
        self._vibrated |= (measures.vibration > allowed)[measures.first.astype(np.int64)]

    def _awake_clusters(self) -> list[tuple[int, np.ndarray]]:
        """First grain and all grains of each awake cluster that was measured, as indices of awake grains."""
        numbers = self._measures.first.astype(np.int64)
        order = np.argsort(numbers, kind="stable")
        starts = np.flatnonzero(np.diff(numbers[order], prepend=-1))
        return list(zip(numbers[order][starts].tolist(), np.split(order, starts[1:]), strict=True))

    def _finish_gas(self, present: State) -> None:
        """Drag and noise of the gas on awake grains since their last kick, so that none is left for the next step."""
        assert self.inner is not None
        if self.parameters.gas.gas.on:
            finish_gas.run(self._inner_table(present))

    def _kick_awake(self, present: State) -> None:
        """Half a kick of the awake clusters by the loads of all grains that the inner engine does not sum."""
        full = self._state.long_range
        if not full.force.size:
            return
        self._remainder[0] = full.force[:, self._awake] - present.long_range.force
        self._remainder[1] = full.torque[:, self._awake] - present.long_range.torque
        self._kick(present, float(self._state.clock[STEP]))

    def _kick(self, present: State, step: float) -> None:
        """Half a kick of the awake clusters by the loads `_remainder`, for a step [s]."""
        table = self._inner_table(present)
        table["scratch"][DT] = 0.5 * step
        kick_clusters.run(table, (self._remainder,))

    def kick_awake(self, force: np.ndarray, torque: np.ndarray, step: float) -> None:
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
        self._list_awake()
        if not self._awake.size:
            return
        present = self._inner_state()
        self._remainder[0], self._remainder[1] = force[:, self._awake], torque[:, self._awake]
        self._kick(present, step)
        self._store_velocities(present)

    def _store_velocities(self, present: State) -> None:
        """Copy velocities and spins of awake grains to the state of all grains."""
        for name in ("velocity", "spin"):
            getattr(self._state.grains.arrays, name)[..., self._awake] = getattr(present.grains.arrays, name)

    def _inner_table(self, present: State) -> Table:
        """The table of the inner engine with the present arrays."""
        assert self.inner is not None
        return self.inner._current_table(present)

    def _copy_back(self, present: State) -> None:
        """Copy awake grains and their contacts to the state of all grains, with counts and losses."""
        state, index = self._state, self._awake
        store_grains(state, present, index)
        changed = present.count[MADE] + present.count[BROKEN] > 0
        self._note_slips(present, int(present.count[CONTACTS]))
        self._columns = store_contacts(state, present, index, self._columns, changed=bool(changed))
        for number in (MADE, BROKEN, SLIPPED):
            state.count[number] += present.count[number]
        state.count[CONTACT_STEPS] += present.count[STEPS]
        state.lost += present.lost
        present.lost[:] = 0.0
        state.clock[SETTLED] = present.clock[SETTLED]
        state.clock[CORRECTED] += present.clock[CORRECTED]
        state.take_extremes(present)
        present.count[MADE] = present.count[BROKEN] = present.count[SLIPPED] = 0

    def _note_slips(self, present: State, used: int) -> None:
        """Note the grains whose contacts have slipped in this step of bodies: losses of these contacts have grown."""
        self._slipped = np.zeros(len(self._awake), bool)
        if not present.count[SLIPPED]:
            return
        contacts, columns = self._state.contacts, self._columns
        lost = [each.tobytes() for each in contacts.lost[SLIP_LOSSES, columns].T]
        before = dict(zip(map(frozenset, contacts.pair[:, columns].T.tolist()), lost, strict=True))
        pairs = present.contacts.pair[:, :used].T
        for pair, now in zip(pairs, present.contacts.lost[SLIP_LOSSES, :used].T, strict=True):
            if before.get(frozenset(self._awake[pair].tolist())) != now.tobytes():
                self._slipped[pair] = True

    @timed
    def _finish_step(self) -> None:
        """The second half kick of awake clusters; clusters that are at rest become bodies."""
        assert self.inner is not None
        state, inner, bodies = self._state, self.inner, self._state.bodies
        present = inner._state
        self._kick_awake(present)
        self._store_velocities(present)
        measures = self._measures
        self._measure_vibrations(present)
        clusters, firsts = self._awake_clusters(), self._awake[measures.first.astype(np.int64)]
        if not np.array_equal(firsts, bodies.first[self._awake]):
            changed = self._rename(firsts)
            for k, own in clusters:
                if changed[k]:
                    describe_body(state, self._awake[own], present.clusters.offset[:, own])
        # vectors from the centres of mass now, as those of grains of bodies that are not turned
        bodies.offset[:, self._awake] = present.clusters.offset
        bodies.orientation[:, self._awake] = np.array([[0.0], [0.0], [0.0], [1.0]])
        bodies.inner_field[:, self._awake] = 0.0
        mark_near_bodies.run(self._current_table(state))
        rested = False
        for k, own in clusters:
            first = int(self._awake[k])
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
            if quiet and bodies.near[first] == CLEAR and self._fits(own, present):
                self._rest(self._awake[own], present.clusters.offset[:, own])
                rested = True
        if rested:
            self._sort_members()

    def _fits(self, own: np.ndarray, present: State) -> bool:
        """Whether a cluster extends over less than half of the box along each periodic axis.

        Larger ones stay awake, with a warning: their grains may act on each other through the images of the box.
        """
        s = present.clusters.offset[:, own]
        extent = s.max(axis=1) - s.min(axis=1)
        lengths = self._state.box.lengths
        fits = all(side is None or size < 0.5 * side for size, side in zip(extent, lengths, strict=True))
        if not fits and SPANS not in self.warnings:
            self.warnings.append(SPANS)
        return fits

    def _vibration_at_rest(self, size: np.ndarray, limit: np.ndarray) -> np.ndarray:
        """Vibrational energy [J] below which clusters of `size` grains may come to rest; `limit` is their ½ k q_c².

        In a thermal gas this is at least 3 (n − 1) k_B T, the mean kinetic energy of the 6 n − 6 modes of a cluster in
        equilibrium with the gas, but no more than ½ k q_c², with which one contact would slip. Dashpots without noise
        keep the modes colder: measured in chains of two and eight 10 nm iron grains that were kept awake, ζ = 0.2, were
        0.07 and 0.7 k_B T with a stopping time of 20 ns, 0.3 and 3.6 k_B T (at most 1.3 and 10) with 1 ns. So chains
        come to rest as fast as without gas, and few would in a dense or hot gas with ε ½ k q_c² alone.
        """
        thermal = 3.0 * (size - 1) * self.parameters.gas.gas.temperature_energy
        return np.maximum(self._limits.vibration * limit, np.minimum(thermal, limit))

    @property
    def _limits(self) -> RigidLimits:
        limits: RigidLimits = self.parameters.flight_limits
        return limits

    def _rename(self, firsts: np.ndarray) -> np.ndarray:
        """New first grains of the clusters of the awake grains, after contacts formed or broke.

        Returns whether the cluster of each awake grain has other grains than before.
        """
        bodies, n = self._state.bodies, len(self._state.grains)
        before = bodies.first[self._awake]
        # a cluster is the same if all of its grains had its first grain, and no other grain had
        other = np.bincount(firsts, before != firsts, n) + np.bincount(before, before != firsts, n)
        changed = other[firsts] > 0
        bodies.event[firsts[changed]] = bodies.vibration[firsts[changed]] = self._state.time
        bodies.first[self._awake] = firsts
        self._sort_members()
        return changed

    def _rest(self, index: np.ndarray, offset: np.ndarray) -> None:
        """Make a body of the grains of a cluster, at vectors `offset` from its centre of mass."""
        state, measures, first = self._state, self._measures, int(index[0])
        describe_body(state, index, offset)
        state.lost[QUIETING] += rest_cluster(state, index)
        at = np.searchsorted(self._awake, first)
        rest_with_loads(state, first, float(measures.strain[at]))
        state.bodies.strength[:, first] = measures.strength[:, at]
        store_rest.run(self._current_table(state), (), body_number(state, first))
        if self.parameters.gas.gas.on:
            set_friction(state, self.parameters.gas.gas, index)
        state.count[RESTED] += 1


def keep(engines: dict[int, Kind], number: int, made: Kind) -> Kind:
    """Keep an engine for so many grains for further use; there are at most `MOST_ENGINES`."""
    if len(engines) == MOST_ENGINES:
        engines.clear()
    engines[number] = made
    return made


def external_energy(engine: Engine, outer: Any, time: float) -> float:
    """Energy [J] of an external force on the grains of the state of an engine, at a time [s]."""
    shares = np.zeros(len(engine._state.grains))
    external_energies_for(outer.formula).run(engine._current_table(engine._state), (outer.numbers(), time, shares))
    return math.fsum(shares)


def _moving_arrays(state: State) -> dict[str, np.ndarray]:
    """Arrays that change in a step of bodies, but for forces and lists, before awake grains are copied back."""
    found = {name: getattr(state.grains.arrays, name) for name in MOVING}
    found |= {f"bodies/{name}": getattr(state.bodies, name) for name in MOVING_BODIES}
    return found | {"clock": state.clock, "count": state.count, "lost": state.lost}


def list_gap(grains: Grains, box: Box) -> float:
    """Largest gap [m] of pairs that the driver of bodies looks at."""
    gap = LIST_GAP * float(grains.radius.min())
    sides = [side for side in box.lengths if side is not None]
    if len(sides) < 3:
        return gap
    return max(gap, SHARE_OF_SPACING * (math.prod(sides) / len(grains)) ** (1.0 / 3.0))


def longest_step_awake(law: ContactLaw, settings: ContactParameters, grains: Grains) -> float:
    """Longest step [s] of bodies while clusters are awake: the shortest time after which a cluster may be at rest.

    That is PERIODS of the slowest mode of the contact of two of the smallest grains of each material.
    """
    found, of_pair = math.inf, contact_constants(law)
    members = [np.flatnonzero(grains.arrays.material == k) for k in range(len(grains.materials))]
    smallest = [int(own[np.argmin(grains.radius[own])]) for own in members]
    for i in smallest:
        for j in smallest:
            pairing = Pairing(*settings.pairings[:, grains.arrays.material[i], grains.arrays.material[j]])
            c = of_pair(pairing, grains.radius[i], grains.radius[j], grains.mass[i], grains.mass[j])
            inertia = 1.0 / grains.inertia[i] + 1.0 / grains.inertia[j]
            slowest = min(
                3.5 * c.slide_stiffness * (1.0 / grains.mass[i] + 1.0 / grains.mass[j]),
                c.roll_stiffness * c.reduced_radius**2 * inertia,
                c.twist_stiffness * inertia,
            )
            if slowest > 0.0:
                found = min(found, 2.0 * math.pi / math.sqrt(slowest))
    return PERIODS * found
