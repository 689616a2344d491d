"""The engine of a simulation: its state, the compiled driver, and the parameters that the driver takes."""

from __future__ import annotations

import contextlib
import copy
import math
import operator
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Self

import numpy as np

from ..analysis.body_motion import BodyMotion
from ..basics.arrays import OVER_ALLOCATION, cluster_arrays
from ..basics.spare_copy import SpareCopy
from ..basics.state import (
    BROKEN,
    CHECKED,
    COMPARED,
    CONTACT_STEP,
    CONTACT_STEPS,
    CONTACTS,
    CUT_RADIUS,
    CUTOFF_CHANGED,
    CYCLE,
    GRAIN1,
    GRAIN2,
    LEFT,
    LISTED,
    LONG_RANGE_SUMS,
    MADE,
    ORDERED,
    OUTSIDE,
    PAIRS,
    REBUILT,
    REJECTED,
    SLIPPED,
    STAGE,
    STEP,
    STEP_INCREASES,
    STEPS,
    SUBSTEPS,
    TIME,
    State,
)
from ..basics.threads import cores, threads
from ..compiler.ahead import compile_ahead
from ..compiler.program import Program
from ..compiler.stage import PythonStage, Stage
from ..compiler.table import Table
from ..contact.constants_table import with_derived
from ..contact.damping import THERMAL
from ..contact.events import InitialContacts, forming_loops
from ..contact.gather import resort_contacts_by_grain
from ..contact.law import ContactLaw
from ..contact.measure import BODY_ROWS, ENERGIES, contacts_stage, energies_stage, measure_bodies
from ..contact.model import Contact
from ..contact.renewal import renewal_stage
from ..forces.base import ExternalForce, LongRangeForce
from ..forces.external_loops import external_energies_for
from ..forces.pair.long_range_loops import LongRangeSums, long_range_energies_for
from ..integrate.driver import advance
from ..integrate.force_stages import SUM, WHOLE, pair_force_stages, run_rounds
from ..integrate.integrator import Integrator
from ..integrate.parts import HEAVY, PARTS, SCRATCH, StepParameters, Stop
from ..integrate.respa import clear_long_range_loads
from ..integrate.stage_list import ProgramContent, build_program, variant_of
from ..integrate.stages import NO_STEP, StageNumber, bath_work
from ..integrate.step_control import INCREASE_INTERVAL, is_past
from ..integrate.task_queue import (
    SHARED,
    TaskQueue,
    benefits_from_workers,
    new_task_queue,
    release_workers,
    take_blocks,
    uses_task_queue,
)
from ..integrate.worker_threads import WorkerThreads
from ..neighbours.cell_list import FULL, rebuild_verlet_list
from ..neighbours.search import Neighbours
from ..neighbours.spatial_sort import SORT_INTERVAL, inverse, reorder_grains, sort_contacts_and_pairs, spatial_order
from .cluster_cutoff import ClusterCutoff
from .ramped import RampedForces

CONTACT = Contact.name
"""Name of the contact model among the forces."""
ALONE = 2000
"""Grains from which on several threads take the shorter step to a time of output."""


def _arrays(state: State) -> tuple:
    """The arrays of a state that stages take."""
    return *state.in_groups(), state.clock, state.count, state.lost


def _names(state: State) -> tuple[str, ...]:
    """The parts of a table that these are."""
    return *state.group_names(), "clock", "count", "lost"


def _set_arrays(table: Table, state: State, present: tuple) -> None:
    """Give a table the arrays of a state."""
    for name, value in zip(_names(state), present, strict=True):
        table.set(name, value)


class GrainSteps:
    """Steps of all grains by the compiled driver; base class of other ways to take steps (`rigid.body_steps`).

    Attributes
    ----------
    seconds : float
        Processor time [s] of steps within the steps that are counted.
    """

    seconds: float = 0.0

    def for_part(self) -> GrainSteps:
        """Such steps for an engine of some of the grains."""
        return self

    def drivers(self) -> list[tuple[Stage, Any]]:
        """Stages that are called during a run besides those of the program, with their parameters."""
        return [(advance, ())]

    def stages_within(self, engine: Engine, table: Table) -> list[tuple[Table, Stage | PythonStage, Any]]:
        """Further stages that a run may call, each with a table of parts and its parameters."""
        return []

    def call(self, engine: Engine, until: float, last: float, shorten: bool) -> Stop:
        """Take steps up to a time [s] or a step; returns why no more were taken."""
        return engine.run_driver(advance, until, last, shorten)

    def summary(self, state: State) -> dict[str, Any]:
        """What the summary of a run says of bodies; nothing without any."""
        return {}

    def with_missing(self, engine: Engine, saved: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The arrays of a saved state; arrays that it lacks are those of the present state."""
        return saved

    def loaded(self, engine: Engine) -> None:
        """Called after a state was loaded."""

    def begin(self, engine: Engine) -> None:
        """Called when the loads were summed at a start, or after a change by the user."""


@dataclass
class Engine:
    """The state of a simulation and the compiled driver that advances it.

    Attributes
    ----------
    state : State
        The state, with grains in the user's order.
    parameters : StepParameters
        Settings of the run, as the stages take them.
    warnings : list[str]
        Warnings of the forces about these grains.
    external : Sequence[ExternalForce]
        Per-grain forces.
    long_range : Sequence[tuple[LongRangeForce, Any, Any]]
        Long-range forces that act on at least one grain, with their loops and numbers.
    search : str
        Description of the neighbour search and the reason for its choice.
    stepping : Integrator
        The integrator, with all automatic settings resolved.
    neighbours : Neighbours
        Settings of the neighbour search, with all automatic settings resolved; a resumed run keeps those of its start.
    cutoff : ClusterCutoff or None
        The cut-off that follows the clusters, if there is one.
    ramped : RampedForces or None
        The forces, if any of them has ramps.
    stepper : GrainSteps
        How steps are taken.
    """

    _state: State
    parameters: StepParameters
    warnings: list[str]
    external: Sequence[ExternalForce]
    long_range: Sequence[tuple[LongRangeForce, Any, Any]]
    search: str
    stepping: Integrator
    neighbours: Neighbours
    content: ProgramContent
    cutoff: ClusterCutoff | None = None
    ramped: RampedForces | None = None
    stepper: GrainSteps = field(default_factory=GrainSteps)
    _intervals: Sequence[tuple[int, int]] = ()  # of the ramps, for which the parameters are set
    _is_sorted: bool = field(init=False, default=False)  # are the arrays in Morton order now?
    _table: Table = field(init=False)
    _program: Program | None = field(init=False, default=None)  # None: it is made before the next step
    _workers: WorkerThreads | None = field(init=False, default=None)
    _compiles_ahead: bool = field(init=False, default=True)  # before the first step; not in engines of parts
    _present: tuple = field(init=False, default=(None,))  # arrays of the state that the table has
    _copy_table: Table = field(init=False)  # the table of the copy that is stepped to times of output
    _copy_present: tuple = field(init=False, default=(None,))  # arrays of the state that it has
    _of_contacts: tuple = field(init=False, default_factory=lambda: (np.zeros(len(ENERGIES)),))  # results of a stage
    _shares: dict[str, np.ndarray] = field(init=False, default_factory=dict)  # results of stages: energies of grains
    _of_bodies: tuple | None = field(init=False, default=None)  # results and memory of a stage
    _spare: SpareCopy = field(init=False, default_factory=SpareCopy)  # memory of the copy
    _queue: TaskQueue | None = field(init=False, default=None)  # of the last call of the driver
    _queue_size: tuple[int, int] = field(init=False, default=(0, 0))  # grains and contacts that it is for
    _output_time: float | None = field(init=False, default=None)  # time of `state`; None: that of the regular state
    _output_state: State | None = field(init=False, default=None)  # made from the regular state when first needed

    def __post_init__(self) -> None:
        names = *PARTS, *self._state.of_components
        self._table, self._copy_table = Table(names), Table(names)
        for name, value in self.parameters._asdict().items():
            self._table.set(name, value)
        self._table.set("scratch", np.zeros(SCRATCH))
        if uses_task_queue(len(self._state.grains)):
            self._workers = WorkerThreads(take_blocks)

    def __deepcopy__(self, memo: dict[int, Any]) -> Engine:
        """A copy with a table of its own."""
        names = [each.name for each in fields(self) if each.init]
        other = type(self)(*(copy.deepcopy(getattr(self, name), memo) for name in names))
        other._is_sorted, other._output_time = self._is_sorted, self._output_time
        return other

    def for_state(self, state: State) -> Self:
        """An engine with the settings of this one, for another state, with a table of its own and no other threads."""
        made = self.changed(_state=state, stepper=self.stepper.for_part())
        made._workers, made._compiles_ahead = None, False
        return made

    def share_threads(self, other: Engine) -> None:
        """Use the threads of another engine, which does not step at the same time."""
        self._workers = other._workers

    def changed(self, **changes: Any) -> Self:
        """An engine with the settings of this one but for these, and a table of its own.

        What does not change, such as the list of warnings, is shared.
        """
        return type(self)(**{each.name: getattr(self, each.name) for each in fields(self) if each.init} | changes)

    @property
    def state(self) -> State:
        """The state at the last time of `go_to`, otherwise the regular state; grains in the user's order."""
        if self._output_time is not None and self._output_state is None and self._output_time != self._state.time:
            self.go_to(self._output_time)  # of a checkpoint
        return self.regular_state if self._output_state is None else self._output_state

    @property
    def regular_state(self) -> State:
        """The state after the last regular step, from which the run continues; grains in the user's order."""
        self.restore_user_order()
        return self._state

    @regular_state.setter
    def regular_state(self, other: State) -> None:
        """Continue from another state, in the user's order."""
        self._state, self._is_sorted = other, False
        self._output_state = self._output_time = None

    def restore_user_order(self) -> None:
        """Undo the spatial sorting of the arrays, until the next step."""
        if self._is_sorted:
            reorder_grains(self._state, inverse(self._state.order))
            self._is_sorted = False

    def go_to(self, time: float, last: float = math.inf) -> Stop:
        """Make `state` the state at exactly this time [s], after `advance` up to it; returns why no such state exists.

        `Stop.NONE`: the regular state has arrived at step `last` before this time.

        A copy of the regular state takes one shorter step or cycle. Regular steps do not depend on it, and so not on
        the times of output. If an event, such as a first contact, ends the shorter step before this time, the regular
        step, which may end there too, is tried first.
        """
        while True:
            stop = self._shorten_copy(time, self._state, 1)
            if stop is Stop.TIME_REACHED:
                return stop
            before, is_sorted = self._state.copy(), self._is_sorted
            compared, self._state.count[COMPARED] = self._state.count[COMPARED], -1
            regular = self._advance(math.inf, 1)
            # the cut-off that follows the clusters, and ramps, are brought up to date by the next `advance`, if the
            # step is kept
            self._state.count[COMPARED] = compared
            if regular is not Stop.NONE:
                return regular
            if is_past(self._state.time, time):  # only the shorter step ended before: go on with shorter steps
                self._state, self._is_sorted = before, is_sorted
                return self._shorten_copy(time, before, math.inf)
            stop = self.advance(time, max(last - self.steps, 0))
            if stop is not Stop.TIME_REACHED:
                return stop

    def _shorten_copy(self, time: float, regular: State, most_steps: float) -> Stop:
        """Make `state` a copy of the regular state after steps or cycles that end at `time`, at most so many."""
        is_sorted, self._output_state = self._is_sorted, None
        table, (self._state, is_same) = self.table_of(regular), self._spare.of(regular)
        self._copy_table.follow(table, _names(self._state) if is_same else ())
        self._copy_present = _arrays(self._state)
        _set_arrays(self._copy_table, self._state, self._copy_present)
        self._state.count[COMPARED] = -1  # a cut-off that follows the clusters changes between regular steps only
        try:
            stop = self.drive(time, regular.steps + most_steps, shorten=True)
            reached = self.regular_state
        finally:
            self._state, self._is_sorted = regular, is_sorted
        if stop is Stop.TIME_REACHED:
            reached.clock[TIME] = time
            for index in (STEPS, LONG_RANGE_SUMS, REBUILT, LISTED, REJECTED):
                reached.count[index] = regular.count[index]
            self._output_state, self._output_time = reached, time
        self._spare.keep(reached)
        return stop

    @property
    def law(self) -> ContactLaw:
        """The contact law."""
        return self.content.law

    @property
    def time(self) -> float:
        """Time of `state` [s]."""
        return self._state.time if self._output_time is None else self._output_time

    @property
    def regular_time(self) -> float:
        """Time of the regular state [s]."""
        return self._state.time

    @property
    def steps(self) -> int:
        """Number of steps taken so far."""
        return self._state.steps

    @property
    def clock(self) -> np.ndarray:
        """Times and extremes of the regular state, `State.clock`."""
        return self._state.clock

    @property
    def awake_work(self) -> tuple[int, int, float]:
        """Contact steps and substeps within steps of bodies, and the processor time [s] of all work on these."""
        count = self._state.count
        return int(count[CONTACT_STEPS]), int(count[SUBSTEPS]), self.stepper.seconds

    def _sort_in_space(self) -> None:
        """Bring the arrays into Morton order; the order is recomputed every `SORT_INTERVAL` steps."""
        if not self._state.order.size or self.steps >= self._state.count[ORDERED] + SORT_INTERVAL:
            state = self.regular_state
            state.order, state.count[ORDERED] = spatial_order(state), state.steps
            reorder_grains(state, state.order)
            sort_contacts_and_pairs(state)
            self._rebuild_list()
        elif not self._is_sorted:
            reorder_grains(self._state, self._state.order)
        self._is_sorted = True

    def advance(self, until: float, most_steps: float) -> Stop:
        """Take steps not beyond `until` [s] or at least `most_steps` steps; a started r-RESPA cycle is completed.

        Parameters with ramps are brought up to date after the first step or cycle that ends in a new interval.
        """
        if self.ramped is None:
            return self._advance(until, most_steps)
        last = self.steps + most_steps
        while True:
            self._follow_ramps()
            change = self.ramped.next_change(self._state.time)
            stop = self._advance(min(until, change), last - self.steps)
            if stop is Stop.TIME_REACHED and self._state.time < change < until:  # the step or cycle that passes it
                stop = self._advance(until, min(1, last - self.steps))
            if stop is Stop.TIME_REACHED and change <= self._state.time < until:
                stop = Stop.NONE
            if stop is not Stop.NONE or self.steps >= last:
                if stop in (Stop.NONE, Stop.TIME_REACHED):
                    self._follow_ramps()
                return stop

    def _advance(self, until: float, most_steps: float) -> Stop:
        """As `advance`, with the present parameters of the forces."""
        self._output_state = self._output_time = None
        last = self.steps + most_steps
        if not self.neighbours.uses_spatial_sort(len(self._state.grains)):
            return self.drive(until, last)
        while True:
            if self._state.time < until and self.steps < last:
                self._sort_in_space()
            renewed = self._state.count[ORDERED] + SORT_INTERVAL
            stop = self.drive(until, min(last, renewed))
            if not (stop is Stop.NONE and renewed <= self.steps < last):
                return stop

    def drive(self, until: float, last: float, shorten: bool = False) -> Stop:
        """Take steps up to a time [s] or a step, in the present order of the arrays."""
        last = min(last, 2**62)
        while True:
            stop = self.stepper.call(self, until, last, shorten)
            if stop is not Stop.CLUSTERS_CHANGED:
                return stop
            self._compare_clusters()

    def _compare_clusters(self) -> None:
        """After a contact formed or broke: choose the cut-off that follows the clusters anew, if they have grown."""
        assert self.cutoff is not None
        state, before = self._state, float(self._state.cutoff[CUT_RADIUS])
        state.count[COMPARED] = state.count[MADE] + state.count[BROKEN]
        radius = self.cutoff.update(state)
        if radius is not None:
            self._change_cutoff(self.cutoff.index, radius)
            self.warnings.append(self.cutoff.message(state, before))

    def _change_cutoff(self, k: int, radius: float) -> None:
        """Use another cut-off [m] for the dipoles, long-range force k: their loops, the reach of lists, loads, energy.

        Loads change by the difference of two sums, so that the next step starts with the present ones; grains in
        contact are within both cut-offs, and their share of the loads (r-RESPA) stays. Lists keep their skin.
        """
        state, search = self._state, self.parameters.search
        energy, loads = self._pair_energy(k), self._pair_loads(k)
        changed: list[tuple[Any, Any, Any]] = list(self.long_range)
        force, sums, _ = changed[k]
        changed[k] = force, sums, force.numbers_at(radius)
        self.long_range = changed
        self.content = self.content._replace(pair_forces=[own[1:] for own in self.long_range])
        search = search._replace(reach=max(search.reach, radius + search.margin))
        self.parameters = self.parameters._replace(search=search)
        self._table.set("search", search)
        self._program = None
        self._rebuild_list()
        force_change, torque_change = self._pair_loads(k) - loads
        for arrays in (state.grains.arrays, state.long_range):
            arrays.force[...] += force_change
            arrays.torque[...] += torque_change
        state.lost[CUTOFF_CHANGED] += energy - self._pair_energy(k)

    def set_ramped_parameters(self) -> None:
        """Give ramped parameters their values at the time of the regular state; loads and contacts stay as they are."""
        assert self.ramped is not None
        time, self._program = self._state.time, None
        self._intervals = self.ramped.intervals(time)
        forces = self.ramped.at(time)
        now: dict[str, Any] = {force.name: force for force in forces if force.name in self.ramped.names}
        self.parameters = self.parameters._replace(**self.ramped.parameters(forces, self._state.grains))
        for name in ("settings", "gas", "criteria"):
            self._table.set(name, getattr(self.parameters, name))
        self.external = [now.get(force.name, force) for force in self.external]
        self.long_range = [
            (force, sums, numbers._replace(own=now[force.name].constants()) if force.name in now else numbers)
            for force, sums, numbers in self.long_range
        ]
        self.content = self.content._replace(
            pair_forces=[own[1:] for own in self.long_range],
            external_forces=[(force.formula, force.numbers()) for force in self.external],
        )

    def _follow_ramps(self) -> None:
        """Change ramped parameters if the regular state is in new intervals of the ramps, and compute loads anew.

        The change of the energy at fixed positions is work of the user. Contacts keep their displacements; a
        contact beyond its new limits slips or breaks when the loads are computed.
        """
        assert self.ramped is not None
        state = self._state
        if self._intervals == self.ramped.intervals(state.time):
            return
        before = self._ramped_energy()
        self.set_ramped_parameters()
        if CONTACT in self.ramped.names:
            with self._held():
                renewal_stage(self.law).run(self.table_of(state))
        state.lost[OUTSIDE] += before - self._ramped_energy()
        state.count[CHECKED] = state.steps - INCREASE_INTERVAL  # the next step is chosen for the new parameters
        if self.neighbours.uses_spatial_sort(len(state.grains)):
            self._sort_in_space()
        if CONTACT in self.ramped.names:
            state.pair_list.anchor[0, 0] = math.inf  # the list has constants of possible contacts: build it anew
        self._refresh_loads()

    def _ramped_energy(self) -> float:
        """Energy [J] of the forces with ramps."""
        assert self.ramped is not None
        energies = [share.sum() for share in self._energies_at_grains(self.ramped.names).values()]
        return math.fsum([*energies, *(self.contact_energies() if CONTACT in self.ramped.names else ())])

    def _pair_loads(self, k: int) -> np.ndarray:
        """Forces and torques (2, 3, N) of long-range force k; the loads of the state stay as they are."""
        (_, sums, numbers), own = self.long_range[k], self._state.long_range
        kept = own.force.copy(), own.torque.copy()
        clear_long_range_loads(own)
        stage = pair_force_stages(sums, self.content.wide)[SUM]
        stage.run(self.table_of(self._state), numbers, WHOLE)
        found = np.array([own.force, own.torque])
        own.force[...], own.torque[...] = kept
        return found

    def _pair_energy(self, k: int) -> float:
        """Energy [J] of long-range force k."""
        _, sums, numbers = self.long_range[k]
        shares = np.zeros(len(self._state.grains))
        self._add_energies(self.table_of(self._state), sums, numbers, shares)
        return math.fsum(shares)

    def _add_energies(self, table: Table, sums: LongRangeSums, numbers: Any, shares: np.ndarray) -> None:
        """Add the energies [J] of a long-range force to those of the grains."""
        if sums.energies_need_rounds:
            run_rounds(sums, self.content.wide, table, numbers)
        long_range_energies_for(sums).run(table, (numbers, shares))

    def table_of(self, state: State) -> Table:
        """The table with the present arrays of the state."""
        present = _arrays(state)
        if all(map(operator.is_, present, self._copy_present)):
            return self._copy_table
        if not all(map(operator.is_, present, self._present)):
            _set_arrays(self._table, state, present)
            self._present = present
        return self._table

    def _call_table(self, until: float, last: float, shorten: bool) -> tuple[Table, Any]:
        """The table for one call of the driver, and its task queue."""
        state, table = self._state, self.table_of(self._state)
        queue = self._task_queue(len(state.grains), state.contacts.flag.size)
        for name, value in (("queue", queue), ("until", float(until)), ("last", int(last)), ("shorten", shorten)):
            table.set(name, value)
        return table, queue

    def _task_queue(self, grains: int, contacts: int) -> TaskQueue:
        """An empty task queue for one call of the driver: the last one, if no other thread has seen it.

        A thread that starts late could otherwise take blocks of the next call.
        """
        alone = self._workers is None or not self._workers.have_started
        if self._queue is not None and self._queue_size == (grains, contacts) and alone:
            self._queue.words[:] = 0
            self._queue.words[SHARED] = uses_task_queue(grains)
        else:
            self._queue, self._queue_size = new_task_queue(grains, contacts), (grains, contacts)
        return self._queue

    def uncompiled(self) -> list[str]:
        """What the stages compute that a run would compile, if it calls them; nothing is compiled."""
        stages = self.stages(self.first_table())
        missing = [
            each.purpose for table, each, own in stages if isinstance(each, Stage) and not each.is_compiled(table, own)
        ]
        return list(dict.fromkeys(missing))

    def first_table(self) -> Table:
        """The table as for a call of the driver, with all parts that stages take."""
        return self._call_table(math.inf, 1, False)[0]

    def stages(self, table: Table) -> list[tuple[Table, Stage | PythonStage, Any]]:
        """All stages that a run may call, each with a table of parts, by default this one, and its parameters."""
        shares = np.zeros(len(self._state.grains))
        stages: list[tuple[Any, Any]] = [*self.stepper.drivers(), *self._program_for(table).stages.values()]
        if self.parameters.settings.on:
            stages.append((energies_stage(self.law), (np.zeros(len(ENERGIES)),)))
            stages.append((contacts_stage(self.law), (np.zeros((1, 1)),)))
        stages.append((measure_bodies, (np.zeros((BODY_ROWS, 1)), cluster_arrays(1))))
        stages += [(long_range_energies_for(sums), (numbers, shares)) for _, sums, numbers in self.long_range]
        stages += [
            (external_energies_for(outer.formula), (outer.numbers(), self.time, shares)) for outer in self.external
        ]
        return [*((table, *each) for each in stages), *self.stepper.stages_within(self, table)]

    def _program_for(self, table: Table) -> Program:
        """The program, made for the present parameters if there is none."""
        if self._program is None:
            self._program = build_program(self.content, self.parameters, table)
        for each in (self._table, table):
            each.set("program", self._program)
        return self._program

    def run_driver(self, driver: Stage, until: float, last: float, shorten: bool = False) -> Stop:
        """Run a driver with the stages of the simulation, in the present order of the arrays.

        Arrays that overflow are enlarged; returns why it stops otherwise.
        """
        state = self._state
        while True:
            stop = self._call_driver(driver, until, last, shorten)
            if stop is Stop.CONTACTS_FULL:
                state.grow("contacts")
            elif stop is Stop.TABLES_FULL:
                state.grow_of_components()
            elif stop is Stop.PAIRS_FULL:
                found, state.count[PAIRS] = int(state.count[PAIRS]), 0  # the list is incomplete
                state.grow("pair_list", int(OVER_ALLOCATION * found))
            elif stop is Stop.LIST_FULL:
                state.grow_rows()
            else:
                return stop

    def _call_driver(self, driver: Stage, until: float, last: float, shorten: bool) -> Stop:
        """One call of a driver."""
        state = self._state
        table, queue = self._call_table(until, last, shorten)
        try:
            if self._compiles_ahead:
                self._compiles_ahead = False
                compile_ahead(self.stages(table), min(cores(), threads()))
            alone = shorten and len(state.grains) < ALONE  # threads start later than one step ends
            if (
                not alone
                and self._workers is not None
                and benefits_from_workers(len(self.content.pair_forces), int(state.count[CONTACTS]))
            ):
                self._workers.start(table)
            return Stop(self._program_for(table).run(driver, table))
        except BaseException:  # Ctrl-C while it compiles, an error in a user's formula
            release_workers(queue)
            raise

    def add_contacts(self, pair: np.ndarray, slide: np.ndarray, roll: np.ndarray, twist: np.ndarray) -> int:
        """Add contacts before the first step; array shapes (C, …).

        Returns
        -------
        int
            Index of the first contact that is stretched beyond its breaking point, or −1.
        """
        state = self.state
        if state.contacts.pair.shape[1] < len(pair):
            state.grow("contacts", len(pair))
        vectors = (np.ascontiguousarray(array.T, dtype=np.float64) for array in (slide, roll, twist))
        initial = InitialContacts(np.ascontiguousarray(pair.T, dtype=np.uint32), *vectors)
        arrays, settings = (state.grains.arrays, state.contacts, state.count), self.parameters.settings
        with self._held():
            return forming_loops(self.law).add_initial(*arrays, state.box.span, settings, initial)

    def losses(self) -> np.ndarray:
        """Losses [J] up to the time of `state`, in the order of `basics.state.LOST`.

        With a bath they include the work in the half kick at the end of the last step (`contact.bath_work`).
        """
        state = self.state
        if variant_of(self.parameters.settings) != THERMAL:
            return state.lost
        arrays = state.sums()
        kept = [array.copy() for array in arrays]
        self._record_bath_work(state)
        found = state.lost.copy()
        for array, values in zip(arrays, kept, strict=True):
            array[...] = values
        return found

    def _record_bath_work(self, state: State) -> None:
        """Record the work of the bath in the half kick at the end of the last step, if no step follows it."""
        with self._held(state):
            bath_work.run(self.table_of(state), (), NO_STEP)
            if (added := self.content.of_components.get(StageNumber.COMPONENT_BATH_WORK)) is not None:
                stage, numbers = added
                stage.run(self.table_of(state), numbers, NO_STEP)

    @contextlib.contextmanager
    def _held(self, state: State | None = None) -> Iterator[None]:
        """While constants of contacts are computed, some grains have a mass that counts as infinite."""
        index, arrays = self.content.heavy, (state or self._state).grains.arrays
        for quantity in (arrays.mass, arrays.inertia):
            quantity[index] *= HEAVY
        try:
            yield
        finally:
            for quantity in (arrays.mass, arrays.inertia):
                quantity[index] /= HEAVY

    def begin(self) -> None:
        """Form contacts between grains that touch at the start, with no energy booked, and compute the first loads."""
        state = self.state
        state.count[STAGE] = 1
        state.count[CHECKED] = state.count[STEP_INCREASES] = -INCREASE_INTERVAL
        state.clock[CONTACT_STEP] = math.inf
        self.drive(-math.inf, 1)
        state.count[STEPS] = state.count[MADE] = state.count[SLIPPED] = state.count[LONG_RANGE_SUMS] = 0
        state.count[COMPARED] = min(state.count[COMPARED], 0)
        state.forget_sums()
        self.stepper.begin(self)

    def refresh_loads(self) -> None:
        """Sum the loads anew by the second half of a step of 0 s, after the user has changed grains or forces."""
        self.restore_user_order()
        self._refresh_loads()
        self.stepper.begin(self)

    def _refresh_loads(self) -> None:
        """As `refresh_loads`, in the present order of the arrays."""
        state = self._state
        steps, sums = state.steps, int(state.count[LONG_RANGE_SUMS])
        if variant_of(self.parameters.settings) == THERMAL:
            self._record_bath_work(state)  # the loads that follow have no noise
        state.count[STAGE] = 1
        state.clock[STEP] = state.clock[CYCLE] = state.clock[LEFT] = 0.0
        self.drive(-math.inf, steps + 1)
        state.count[STEPS], state.count[LONG_RANGE_SUMS] = steps, sums

    def load_state(self, saved: dict[str, np.ndarray], output_time: float | None = None) -> None:
        """Restore the regular state of a checkpoint, with `state` at a time of output [s]; sum loads, rebuild lists."""
        state, self._output_time = self.regular_state, output_time
        state.from_arrays(with_derived(self.law, self.stepper.with_missing(self, saved)))
        if self.cutoff is None:
            state.count[COMPARED] = -1
        if state.order.size:  # the order of the lists depends on it
            reorder_grains(state, state.order)
            self._is_sorted = True
        elif state.contacts.gather_order.size:
            resort_contacts_by_grain(state.grains.arrays, state.contacts, state.count)
        if self.ramped is not None:
            self.set_ramped_parameters()
        if self.parameters.search.listed and not self._list_lasts():
            state.long_range.anchor[...] = state.grains.arrays.position
        self._rebuild_list()
        self.stepper.loaded(self)

    def _rebuild_list(self) -> None:
        """Rebuild the Verlet list, if there is one, from its reference positions for the present order of grains."""
        state, search = self._state, self.parameters.search
        while search.listed and rebuild_verlet_list(state.long_range, state.box.span, search.reach) == FULL:
            state.grow_rows()

    def _list_lasts(self) -> bool:
        """Whether no grain is more than half the margin of the Verlet list from its reference position."""
        state = self._state
        if not np.isfinite(state.long_range.anchor).all():
            return False
        moved = state.box.nearest((state.grains.arrays.position - state.long_range.anchor).T)
        return bool((moved**2).sum(axis=1).max() <= (0.5 * self.parameters.search.margin) ** 2)

    def energies_at_grains(self, names: Collection[str] | None = None) -> dict[str, np.ndarray]:
        """Energy [J] of each grain (N,) by force: half of each pair energy, and the energies of per-grain forces.

        Of all forces, or of those with these names.
        """
        return {name: share.copy() for name, share in self._energies_at_grains(names).items()}

    def _energies_at_grains(self, names: Collection[str] | None = None) -> dict[str, np.ndarray]:
        """As `energies_at_grains`, in arrays that the next call uses again."""
        state, columns = self.state, dict.fromkeys(self.columns())
        table, count = self.table_of(state), len(state.grains)
        if self._shares.keys() != columns.keys() or any(len(share) != count for share in self._shares.values()):
            self._shares = {name: np.zeros(count) for name in columns}
        shares = self._shares
        for share in shares.values():
            share[:] = 0.0
        for force, sums, numbers in self.long_range:
            if names is None or force.name in names:
                self._add_energies(table, sums, numbers, shares[force.column])
        for outer in self.external:
            if names is not None and outer.name not in names:
                continue
            external_energies_for(outer.formula).run(table, (outer.numbers(), state.time, shares[outer.name]))
        return shares

    def external_energy(self, outer: ExternalForce, time: float) -> float:
        """Energy [J] of a per-grain force on the grains of the regular state, at a time [s]."""
        shares = np.zeros(len(self._state.grains))
        external_energies_for(outer.formula).run(self.table_of(self._state), (outer.numbers(), time, shares))
        return math.fsum(shares)

    def columns(self) -> list[str]:
        """Columns of the forces in the ledger."""
        return [*(force.column for force, _, _ in self.long_range), *(force.name for force in self.external)]

    def contact_energies(self) -> list[float]:
        """Energies [J] stored by the contacts, see `contact.measure.ENERGIES`."""
        found, state = self._of_contacts[0], self.state
        found[:] = 0.0
        if state.count[CONTACTS]:
            energies_stage(self.law).run(self.table_of(state), self._of_contacts)
        if (added := self.content.of_components.get(StageNumber.COMPONENT_ENERGIES)) is not None:
            added[0].run(self.table_of(state), self._of_contacts)
        return found.tolist()

    def body_motion(self) -> BodyMotion:
        """Motion of each body, as `analysis.body_motion` has it."""
        state, count = self.state, len(self._state.grains)
        if self._of_bodies is None or self._of_bodies[0].shape[1] != count:
            self._of_bodies = np.zeros((BODY_ROWS, count)), cluster_arrays(count)
        bodies = measure_bodies.run(self.table_of(state), self._of_bodies)
        found = self._of_bodies[0][:, :bodies].copy()
        return BodyMotion(found[0].astype(np.int64), *found[1:])

    def force_energies(self) -> dict[str, float]:
        """Total energy [J] of each long-range and per-grain force, by ledger column."""
        return {name: math.fsum(share.tolist()) for name, share in self._energies_at_grains().items()}

    def limiting_grains(self) -> tuple[int, ...]:
        """Indices of the grains that caused the last stop."""
        return tuple(sorted({int(self.state.count[g]) for g in (GRAIN1, GRAIN2)} - {-1}))
