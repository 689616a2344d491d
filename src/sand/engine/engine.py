"""The engine of a simulation: its state, which it advances to a time, with the parameters that the stages take."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np

from ..basics.box import Box, box_of
from ..basics.grains import Grains
from ..basics.spare_copy import SpareCopy
from ..basics.state import (
    BROKEN,
    CHECKED,
    COMPARED,
    CONTACT_LIMIT,
    CONTACT_STEPS,
    LISTED,
    LONG_RANGE_SUMS,
    MADE,
    ORDERED,
    REBUILT,
    REJECTED,
    SLIPPED,
    STEP_INCREASES,
    STEPS,
    SUBSTEPS,
    TIME,
    State,
)
from ..compiler.ahead import expected_seconds
from ..compiler.jit import COMPILE_TIMES
from ..compiler.progress import compile_times
from ..compiler.stage import PythonStage, Stage
from ..compiler.table import Table
from ..contact.constants_table import with_derived
from ..contact.gather import resort_contacts_by_grain
from ..forces.base import Force
from ..integrate.driver import advance
from ..integrate.integrator import Integrator
from ..integrate.parts import Stop
from ..integrate.step_control import INCREASE_INTERVAL, is_past
from ..neighbours.cell_list import FULL, rebuild_verlet_list
from ..neighbours.search import Neighbours
from ..neighbours.spatial_sort import SORT_INTERVAL, reorder_grains, sort_contacts_and_pairs, spatial_order
from .compiled_state import CompiledState
from .measures import measuring_stages, record_bath_work


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

    def stages(self, engine: Engine, table: Table) -> list[tuple[Table, Stage | PythonStage, Any]]:
        """Stages that a run calls besides those of the program, each with a table of parts and its parameters."""
        return [(table, advance, ())]

    def call(self, engine: Engine, until: float, last: float, shorten: bool) -> Stop:
        """Take steps up to a time [s] or a step; returns why no more were taken."""
        return engine.run_driver(advance, until, last, shorten)

    def follow(self, engine: Engine, forces: Sequence[Force]) -> None:
        """Called when numbers of the forces have changed, to these, with those of the engine."""

    def sum_loads(self, engine: Engine) -> None:
        """Sum the loads after such a change."""
        engine.sum_loads()

    def loads(self, engine: Engine) -> tuple[np.ndarray, np.ndarray]:
        """Forces [N] and torques [N m] on the grains, (N, 3)."""
        grains = engine.state.grains
        return grains.force.copy(), grains.torque.copy()

    def virial_at_rest(self, engine: Engine) -> np.ndarray:
        """Virial (3, 3) [J] of the contacts in clusters at rest, whose loads contact steps do not compute."""
        return np.zeros((3, 3))

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
class Engine(CompiledState):
    """The state of a simulation and the compiled driver that advances it.

    Attributes
    ----------
    state : State
        The state, with grains in the user's order.
    warnings : list[str]
        Warnings of the forces about these grains.
    search : str
        Description of the neighbour search and the reason for its choice.
    stepping : Integrator
        The integrator, with all automatic settings resolved.
    neighbours : Neighbours
        Settings of the neighbour search, with all automatic settings resolved; a resumed run keeps those of its start.
    force_dependent : callable
        `(forces, grains)` → `step_parameters.ForceDependent`: what follows from numbers of the forces.
    components : Sequence
        Components (`component.Component`); the engine calls their methods for Python at fixed places.
    stepper : GrainSteps
        How steps are taken.
    """

    warnings: list[str]
    search: str
    stepping: Integrator
    neighbours: Neighbours
    force_dependent: Callable[[Sequence[Force], Grains], Any]
    components: Sequence[Any] = ()
    stepper: GrainSteps = field(default_factory=GrainSteps)
    _spare: SpareCopy = field(init=False, default_factory=SpareCopy)  # memory of the copy
    _output_time: float | None = field(init=False, default=None)  # time of `state`; None: that of the regular state
    _output_state: State | None = field(init=False, default=None)  # made from the regular state when first needed

    def __deepcopy__(self, memo: dict[int, Any]) -> Engine:
        """A copy with a table of its own."""
        other = type(self)(**{f.name: copy.deepcopy(getattr(self, f.name), memo) for f in fields(self) if f.init})
        other._is_sorted, other._output_time = self._is_sorted, self._output_time
        return other

    def for_state(self, state: State, *, with_threads: bool) -> Self:
        """An engine with the settings of this one, for another state, with a table of its own.

        `with_threads`: it uses the threads of this one, as the two never step at once; otherwise no others.
        """
        made = replace(self, stored_state=state, stepper=self.stepper.for_part())
        made.workers, made.compiles_ahead = self.workers if with_threads else None, False
        return made

    @property
    def state(self) -> State:
        """The state at the last time of `go_to`, otherwise the regular state; grains in the user's order."""
        if self._output_time is not None and self._output_state is None and self._output_time != self.stored_state.time:
            self.go_to(self._output_time)  # of a checkpoint
        return self.regular_state if self._output_state is None else self._output_state

    def go_to(self, time: float, last: float = math.inf) -> Stop:
        """Make `state` the state at exactly this time [s], after `advance` up to it; returns why no such state exists.

        `Stop.NONE`: the regular state has arrived at step `last` before this time.

        A copy of the regular state takes one shorter step or cycle. Regular steps do not depend on it, and so not on
        the times of output. If an event, such as a first contact, ends the shorter step before this time, the regular
        step, which may end there too, is tried first.
        """
        while True:
            stop = self._shorten_copy(time, self.stored_state, 1)
            if stop is Stop.TIME_REACHED:
                return stop
            before, is_sorted = self.stored_state.copy(), self._is_sorted
            compared, self.stored_state.count[COMPARED] = self.stored_state.count[COMPARED], -1
            regular = self._advance(math.inf, 1)
            self.stored_state.count[COMPARED] = compared  # if the step is kept, components act in the next `advance`
            if regular is not Stop.NONE:
                return regular
            if is_past(self.stored_state.time, time):  # only the shorter step ended before: go on with shorter steps
                self.stored_state, self._is_sorted = before, is_sorted
                return self._shorten_copy(time, before, math.inf)
            stop = self.advance(time, max(last - self.steps, 0))
            if stop is not Stop.TIME_REACHED:
                return stop

    def _shorten_copy(self, time: float, regular: State, most_steps: float) -> Stop:
        """Make `state` a copy of the regular state after steps or cycles that end at `time`, at most so many."""
        is_sorted, self._output_state = self._is_sorted, None
        self.stored_state, is_same = self._spare.of(regular)
        self.take_copy(regular, self.stored_state, is_same)
        self.stored_state.count[COMPARED] = -1  # components act between regular steps only
        try:
            stop = self.drive(time, regular.steps + most_steps, shorten=True)
            reached = self.regular_state
        finally:
            self.stored_state, self._is_sorted = regular, is_sorted
        if stop is Stop.TIME_REACHED:
            reached.clock[TIME] = time
            for index in (STEPS, LONG_RANGE_SUMS, REBUILT, LISTED, REJECTED, COMPARED):
                reached.count[index] = regular.count[index]
            self._output_state, self._output_time = reached, time
        self._spare.keep(reached)
        return stop

    @property
    def box(self) -> Box:
        """Box at the time of `state`."""
        return (self.stored_state if self.stored_state.cell is None else self.state).box

    @property
    def time(self) -> float:
        """Time of `state` [s]."""
        return self.stored_state.time if self._output_time is None else self._output_time

    @property
    def steps(self) -> int:
        """Number of steps taken so far."""
        return self.stored_state.steps

    @property
    def awake_work(self) -> tuple[int, int, float]:
        """Contact steps and substeps within steps of bodies, and the processor time [s] of all work on these."""
        count = self.stored_state.count
        return int(count[CONTACT_STEPS]), int(count[SUBSTEPS]), self.stepper.seconds

    def sort_in_space(self) -> None:
        """Bring the arrays into Morton order, if they are sorted; it is renewed every `SORT_INTERVAL` steps."""
        if not self.neighbours.uses_spatial_sort(len(self.stored_state.grains)):
            return
        if not self.stored_state.order.size or self.steps >= self.stored_state.count[ORDERED] + SORT_INTERVAL:
            state = self.regular_state
            state.order, state.count[ORDERED] = spatial_order(state), state.steps
            reorder_grains(state, state.order)
            sort_contacts_and_pairs(state)
            self.rebuild_list()
        elif not self._is_sorted:
            reorder_grains(self.stored_state, self.stored_state.order)
        self._is_sorted = True

    def advance(self, until: float, most_steps: float) -> Stop:
        """Take steps until `until` [s], or `most_steps` steps; an r-RESPA cycle is taken to its end.

        Components are brought up to date (`update`) before the first step, after the last one, and after the first step
        or cycle that ends at or after their `next_time`.
        """
        last = self.steps + most_steps
        while True:
            self._update_components()
            change = min((each.next_time(self) for each in self.components), default=math.inf)
            stop = self._advance(min(until, change), last - self.steps)
            reached = stop is Stop.TIME_REACHED and change < until
            if reached and self.stored_state.time < change:  # the step or cycle that passes it
                stop = self._advance(until, min(1, last - self.steps))
            if reached and stop is Stop.TIME_REACHED and change <= self.stored_state.time < until:
                stop = Stop.NONE
            if stop is not Stop.NONE or self.steps >= last:
                if stop in (Stop.NONE, Stop.TIME_REACHED):
                    self._update_components()
                return stop

    def _update_components(self) -> None:
        for each in self.components:
            each.update(self)

    def _advance(self, until: float, most_steps: float) -> Stop:
        """As `advance`, without an update of components."""
        self._output_state = self._output_time = None
        last = self.steps + most_steps
        if not self.neighbours.uses_spatial_sort(len(self.stored_state.grains)):
            return self.drive(until, last)
        while True:
            if self.stored_state.time < until and self.steps < last:
                self.sort_in_space()
            renewed = self.stored_state.count[ORDERED] + SORT_INTERVAL
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
            count = self.stored_state.count
            count[COMPARED] = count[MADE] + count[BROKEN]
            for each in self.components:
                each.contacts_changed(self)

    def uncompiled(self) -> dict[str, float]:
        """What the stages compute that a run would compile, if it calls them, with the expected times [s].

        Nothing is compiled; the times are those of one process.
        """
        known, found = compile_times(COMPILE_TIMES), dict[str, float]()
        for table, each, own in self.stages(self.table_for_call()):
            if isinstance(each, Stage) and not each.is_compiled(table, own):
                found[each.purpose] = found.get(each.purpose, 0.0) + expected_seconds(each, known)
        return found

    def stages(self, table: Table) -> list[tuple[Table, Stage | PythonStage, Any]]:
        """As `CompiledState.stages`, with those of steps and of measurements."""
        of_measures = ((table, *each) for each in measuring_stages(self))
        return [*self.stepper.stages(self, table), *super().stages(table), *of_measures]

    def begin(self) -> None:
        """Form contacts between grains that touch at the start, with no energy booked, and compute the first loads."""
        state = self.state
        state.begin_empty_step()
        state.count[CHECKED] = state.count[STEP_INCREASES] = -INCREASE_INTERVAL
        state.clock[CONTACT_LIMIT] = math.inf
        self.drive(-math.inf, 1)
        state.count[STEPS] = state.count[MADE] = state.count[SLIPPED] = state.count[LONG_RANGE_SUMS] = 0
        state.count[COMPARED] = min(state.count[COMPARED], 0)
        state.forget_sums()
        self.stepper.begin(self)

    def refresh_loads(self) -> None:
        """Sum the loads anew after the user has changed grains or forces."""
        self.restore_user_order()
        self.sum_loads()
        self.stepper.begin(self)

    def sum_loads(self) -> None:
        """Sum the loads anew by the second half of a step of 0 s, in the present order of the arrays."""
        state = self.stored_state
        steps, sums = state.steps, int(state.count[LONG_RANGE_SUMS])
        record_bath_work(self, state)  # the loads that follow have no noise
        state.begin_empty_step()
        self.drive(-math.inf, steps + 1)
        state.count[STEPS], state.count[LONG_RANGE_SUMS] = steps, sums

    def load_state(self, saved: dict[str, np.ndarray], output_time: float | None = None) -> None:
        """Restore the regular state of a checkpoint, with `state` at a time of output [s]; sum loads, rebuild lists."""
        state, self._output_time = self.regular_state, output_time
        state.from_arrays(with_derived(self.law, self.stepper.with_missing(self, saved)))
        if not any(each.watches_contacts for each in self.components):
            state.count[COMPARED] = -1
        if state.order.size:  # the order of the lists depends on it
            reorder_grains(state, state.order)
            self._is_sorted = True
        elif state.contacts.gather_order.size:
            resort_contacts_by_grain(state.grains.arrays, state.contacts, state.count)
        for each in self.components:
            each.begin(self)
        if self.parameters.search.listed and not self._list_lasts():
            state.long_range.anchor[...] = state.grains.arrays.position
            state.long_range.built[...] = [*state.box.span[:3], state.box.tilt]
        self.rebuild_list()
        self.stepper.loaded(self)

    def rebuild_list(self) -> None:
        """Rebuild the Verlet list, if there is one, from its reference positions for the present order of grains."""
        state, search = self.stored_state, self.parameters.search
        built = state.long_range.built
        span = state.box.span if state.cell is None else box_of(built, built[3]).span
        while search.listed and rebuild_verlet_list(state.long_range, span, search.reach) == FULL:
            state.grow_rows()

    def _list_lasts(self) -> bool:
        """Whether no grain is more than half the margin of the Verlet list from its reference position."""
        state = self.stored_state
        if not np.isfinite(state.long_range.anchor).all():
            return False
        if state.cell is not None and (state.box != box_of(built := state.long_range.built, built[3])):
            return True  # `neighbours.skin` looks at it before the next sum
        moved = state.box.nearest((state.grains.arrays.position - state.long_range.anchor).T)
        return bool((moved**2).sum(axis=1).max() <= (0.5 * self.parameters.search.margin) ** 2)
