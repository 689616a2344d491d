"""A world and the compiled code that moves it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..contact.gather import resort_contacts_by_grain
from ..contact.initial import seed_contacts
from ..forces.base import GrainForce, LongRangeForce
from ..forces.external.loops import outside_shares_for
from ..forces.pair.loops import shares_for
from ..integrate.adaptive import Adaptive
from ..integrate.adaptive_driver import flight_driver_for
from ..integrate.driver import driver_for
from ..integrate.kernel_spec import KernelSpec, StepParameters, Stop
from ..integrate.step_control import GROW_EVERY
from ..integrate.task_queue import benefits_from_workers, new_task_queue, release_workers, worker_loops
from ..integrate.verlet import Verlet
from ..integrate.worker_threads import WorkerThreads
from ..neighbours.cell_list import FULL, rebuild_verlet_list
from ..neighbours.settings import Neighbours
from ..neighbours.spatial_sort import RENEWED_EVERY, inverse, rearrange, sort_columns, spatial_order
from ..state.arrays import SPARE
from ..state.state import (
    CHECKED,
    CONTACT_STEP,
    CONTACTS,
    GRAIN1,
    GRAIN2,
    LONG_RANGE_SUMS,
    MADE,
    ORDERED,
    PAIRS,
    SLIPPED,
    STAGE,
    STEP_INCREASES,
    STEPS,
    State,
)


@dataclass
class Engine:
    """A world and the compiled code that moves it.

    Attributes
    ----------
    world
        the state, its grains numbered as the user knows them.
    parameters : Rules
        everything that does not change, as the kernels take it.
    warnings : list[str]
        what the forces had to say about these grains.
    far : Sequence[tuple[LongRangeForce, Any, Any]]
        the long-range forces that some grain feels, with their loops and numbers.
    outside : Sequence[GrainForce]
        the per-grain forces.
    search : str
        how neighbours are found, in words.
    stepping : Verlet or Adaptive
        the integrator, with a number for everything that depends on the grains at the start.
    neighbours : Neighbours
        their settings, likewise, unless they are those of an earlier run.
    """

    _state: State
    parameters: StepParameters
    warnings: list[str]
    external: Sequence[GrainForce]
    long_range: Sequence[tuple[LongRangeForce, Any, Any]]
    search: str
    stepping: Verlet | Adaptive
    neighbours: Neighbours
    _kernel_spec: KernelSpec
    _is_sorted: bool = field(init=False, default=False)  # are grains at places of their own now?
    _advance: Callable = field(init=False)
    _workers: WorkerThreads | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self._advance = flight_driver_for(self._kernel_spec) if self._kernel_spec.adaptive else driver_for(self._kernel_spec)
        if self._kernel_spec.queue:
            self._workers = WorkerThreads(worker_loops(self._kernel_spec)[1])

    @property
    def state(self) -> State:
        """The state, its grains numbered as the user knows them."""
        self.restore_user_order()
        return self._state

    @state.setter
    def state(self, other: State) -> None:
        self._state, self._is_sorted = other, False

    def restore_user_order(self) -> None:
        """Give every grain the number back that the user knows it by, until the next step is taken."""
        if self._is_sorted:
            rearrange(self._state, inverse(self._state.order))
            self._is_sorted = False

    @property
    def time(self) -> float:
        """[s]"""
        return self._state.time

    @property
    def steps(self) -> int:
        """Taken so far."""
        return self._state.steps

    def _sort_in_space(self) -> None:
        """Grains where steps are fast, if that is not where they are."""
        if not self._state.order.size or self.steps >= self._state.count[ORDERED] + RENEWED_EVERY:
            state = self.state
            state.order, state.count[ORDERED] = spatial_order(state), state.steps
            rearrange(state, state.order)
            sort_columns(state)
            self._rebuild_list()
        elif not self._is_sorted:
            rearrange(self._state, self._state.order)
        self._is_sorted = True

    def advance(self, until: float, most_steps: float) -> Stop:
        """At least `most_steps` steps, or to `until` [s]; ends with a cycle of the long-range forces."""
        last = min(self.steps + most_steps, 2**62)
        if not self.neighbours.along_curve(len(self._state.grains)):
            return self._drive(until, last)
        while True:
            if self.time < until and self.steps < last:
                self._sort_in_space()
            renewed = self._state.count[ORDERED] + RENEWED_EVERY
            stop = self._drive(until, min(last, renewed))
            if not (stop is Stop.STEPS_DONE and renewed <= self.steps < last):
                return stop

    def _drive(self, until: float, last: float) -> Stop:
        """On to a time [s] or a step, as the grains stand now."""
        state = self._state
        while True:
            stages = (state.stages,) if self._kernel_spec.adaptive else ()
            arrays = (state.grains.arrays, state.contacts, state.pair_list, state.long_range, *stages, state.clock, state.count, state.lost)
            parameters = self._start_workers()
            try:
                stop = Stop(self._advance(*arrays, parameters, float(until), int(last)))
            except BaseException:  # Ctrl-C while it compiles, an error in a user's formula
                if self._workers is not None:
                    release_workers(parameters.queue)
                raise
            if stop is Stop.CONTACTS_FULL:
                state.grow_contacts()
            elif stop is Stop.PAIRS_FULL:
                found, state.count[PAIRS] = int(state.count[PAIRS]), 0  # none of the list holds
                state.grow_pairs(int(SPARE * found))
            elif stop is Stop.LIST_FULL:
                state.grow_rows()
            else:
                return stop

    def _start_workers(self) -> StepParameters:
        """The parameters for one call of the driver, with a crew at work if there is one."""
        if self._workers is None:
            return self.parameters
        state = self._state
        parameters = self.parameters._replace(queue=new_task_queue(len(state.grains), state.contacts.flag.size))
        if benefits_from_workers(self._kernel_spec, state.grains.arrays, int(state.count[CONTACTS])):
            self._workers.call((state.grains.arrays, state.contacts, state.long_range, state.count, parameters))
        return parameters

    def seed(self, pair: np.ndarray, slide: np.ndarray, roll: np.ndarray, twist: np.ndarray) -> int:
        """Contacts before the first step, arrays (C, …); the first that is stretched beyond its break, or −1."""
        state = self.state
        if state.contacts.pair.shape[1] < len(pair):
            state.grow_contacts(len(pair))
        given = [np.ascontiguousarray(vectors.T, dtype=np.float64) for vectors in (slide, roll, twist)]
        pairs = np.ascontiguousarray(pair.T, dtype=np.uint32)
        return int(seed_contacts(state.grains.arrays, state.contacts, state.count, state.box.span, self.parameters.contact, pairs, *given))

    def begin(self) -> None:
        """Contacts of grains that touch at the start, nothing booked, and the first loads."""
        state = self.state
        state.count[STAGE] = 1
        state.count[CHECKED] = state.count[STEP_INCREASES] = -GROW_EVERY
        state.clock[CONTACT_STEP] = math.inf
        self._drive(-math.inf, 1)
        state.count[STEPS] = state.count[MADE] = state.count[SLIPPED] = state.count[LONG_RANGE_SUMS] = 0
        state.lost[:] = 0.0
        state.contacts.lost[:] = 0.0

    def load_state(self, saved: dict[str, np.ndarray]) -> None:
        """Go on from a saved state; what a checkpoint leaves out is worked out from the rest."""
        state = self.state
        state.from_arrays(saved)
        if state.order.size:  # lists depend on it
            rearrange(state, state.order)
            self._is_sorted = True
        elif state.contacts.gather_order.size:
            resort_contacts_by_grain(state.contacts, state.count, len(state.grains))
        if self.parameters.search.listed and not self._list_lasts():
            state.long_range.anchor[...] = state.grains.arrays.position
        self._rebuild_list()

    def _rebuild_list(self) -> None:
        """The list of the anchors, if there is one, for the numbers that grains have now."""
        state, search = self._state, self.parameters.search
        while search.listed and rebuild_verlet_list(state.long_range, state.box.span, search.reach) == FULL:
            state.grow_rows()

    def _list_lasts(self) -> bool:
        """False if a run of an earlier version had no list, or a wider one, for which grains may have gone farther."""
        state = self._state
        if not np.isfinite(state.long_range.anchor).all():
            return False
        moved = state.box.nearest((state.grains.arrays.position - state.long_range.anchor).T)
        return bool((moved**2).sum(axis=1).max() <= (0.5 * self.parameters.search.margin) ** 2)

    def energies_at_grains(self) -> dict[str, np.ndarray]:
        """Energy [J] of each grain, (N,), by force: half of each pair's, and what per-grain forces give."""
        state = self.state
        shares = {force.column: np.zeros(len(state.grains)) for force, _, _ in self.long_range}
        for force, sums, numbers in self.long_range:
            shares_for(sums.energies)(state.grains.arrays, state.long_range, self.parameters.span, numbers, shares[force.column])
        for outer in self.external:
            shares[outer.name] = np.zeros(len(state.grains))
            fill = outside_shares_for(outer.formula)
            fill(state.grains.arrays, state.time, outer.numbers(), shares[outer.name])
        return shares

    def force_energies(self) -> dict[str, float]:
        """Energy [J] of all long-range and per-grain forces by column of the ledger."""
        return {name: math.fsum(share) for name, share in self.energies_at_grains().items()}

    def limiting_grains(self) -> tuple[int, ...]:
        """The grains that the last stop was about."""
        return tuple(sorted({int(self.state.count[g]) for g in (GRAIN1, GRAIN2)} - {-1}))
