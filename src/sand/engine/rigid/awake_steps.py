"""Awake clusters within a step of bodies: their grains take contact steps in a part of the state, or come to rest.

One step of bodies with awake clusters:

    `take_contact_steps`    grains are copied to the part and take contact steps to the end of the step
    `finish`                far loads at the end of the step kick the clusters; those at rest become bodies (`resting`)

The part begins anew in each step of the bodies, so that the state of all grains and the bodies determine what follows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ...basics.arrays import CellArrays
from ...basics.state import CONTACTS, OUTSIDE, SLIPPED, STEP, STEPS, State
from ...compiler.table import Table
from ...integrate.hooks import Hook
from ...integrate.parts import DT, Stop
from ...integrate.rigid.awake_clusters import (
    ClusterMeasures,
    cluster_measures,
    find_resting_clusters,
    measure_clusters_stage,
    place_awake_grains,
)
from ...integrate.rigid.body_touches import NEAR
from ...integrate.rigid.rigid_clusters import SAMPLES, RigidLimits
from ...integrate.rigid.rigid_driver import mark_near_bodies
from ..engine import Engine
from ..measures import external_energy
from ..part import Part
from .cluster_bodies import contacts_of, describe_body, rest_grain, sort_members
from .far_loads import FarLoads
from .resting import fits_in_box, rename_clusters, rest_as_body

SLIP_LOSSES = slice(1, 4)
"""Rows of `ContactArrays.lost` that change when a contact slides, rolls or twists beyond a limit."""


def limits_of(engine: Engine) -> RigidLimits:
    """Run-time numbers of rigid clusters."""
    limits: RigidLimits = engine.parameters.flight_limits
    return limits


@dataclass
class AwakeSteps:
    """Grains of awake clusters, and their steps within a step of bodies.

    Attributes
    ----------
    part : Part
        The grains.
    grains, columns : ndarray
        Their indices, ascending, and the columns of their contacts, in the state of all grains.
    measures : ClusterMeasures
        What was last measured of their clusters.
    far : FarLoads
        Loads of other grains on them.
    """

    part: Part
    grains: np.ndarray = field(init=False, default_factory=lambda: np.zeros(0, np.int64))
    columns: np.ndarray = field(init=False, default_factory=lambda: np.zeros(0, np.int64))
    measures: ClusterMeasures = field(init=False, default_factory=lambda: cluster_measures(0))
    far: FarLoads = field(init=False, default_factory=FarLoads)
    _have_changed: bool = field(init=False, default=False)  # contacts, in the last contact steps

    def list(self, state: State) -> None:
        """List the grains of awake clusters, and their contacts."""
        awake = state.bodies.asleep == 0
        grains, columns = np.flatnonzero(awake), contacts_of(state, awake)
        # what was made for these grains and contacts is used again
        self.grains = self.grains if np.array_equal(grains, self.grains) else grains
        self.columns = self.columns if np.array_equal(columns, self.columns) else columns

    def sort_members(self, state: State) -> None:
        """Lists of the grains of each body, and of awake grains."""
        sort_members(state)
        self.list(state)

    def take(self, engine: Engine, state: State) -> State:
        """The state of the awake grains, with contacts as they are and everything else as at a start."""
        are_others = self.part.index is not self.grains
        taken = self.part.take(state, self.grains, self.columns)
        if are_others:
            self.measures = self.part.engine.memory_for("awake clusters", cluster_measures)
            self.measures.grain[:] = self.grains
            self.measures.limits[:] = limits_of(engine).vibration, engine.parameters.gas.gas.temperature_energy
        self.measures.vibrated[:] = 0.0
        self.far.prepare(self.part)
        return taken

    def take_with_loads(self, engine: Engine, state: State) -> State:
        """The state of the awake grains, with all loads that their engine sums."""
        own = self.take(engine, state)
        self._sum_loads(own)
        return own

    def _sum_loads(self, own: State) -> None:
        own.begin_empty_step()
        self.part.engine.drive(-math.inf, 1)
        own.count[STEPS] = 0

    def take_contact_steps(self, engine: Engine) -> Stop:
        """Contact steps of the awake grains for one step of the bodies; returns why they failed."""
        state = engine.regular_state
        own, inner = self.take(engine, state), self.part.engine
        if own.cell is not None:
            _begin_in_box(own.cell)
        self._sum_loads(own)
        far_before = None if own.cell is None else own.cell.far_virial.copy()
        before, end = state.time, state.time + float(state.clock[STEP])
        if engine.parameters.external_work.time_dependent:
            # the driver of bodies has booked the change of their energies at rest; the inner engine books it as well
            for force in engine.external:
                state.lost[OUTSIDE] += external_energy(inner, force, end) - external_energy(inner, force, before)
        self.far.begin(state, self.part)
        pieces = max(math.ceil(SAMPLES * float(state.clock[STEP]) / limits_of(engine).longest_awake), 1)
        for k in range(1, pieces + 1):
            # vibrations at the end of the last piece are measured after the kick by the far loads, in `finish`
            stop = inner.drive(before + (end - before) * k / pieces if k < pieces else end, math.inf, shorten=True)
            if stop is not Stop.TIME_REACHED:
                return stop
            if k < pieces:
                self.measure()
        if own.cell is not None:
            inner.table["scratch"][DT] = 0.0  # the work up to now is added up
        for stage, numbers in inner.content.of_components.get(Hook.END_OF_BODIES, ()):
            stage.run(inner.table, numbers, Hook.END_OF_BODIES)
        if own.cell is not None and state.cell is not None:
            # that of the pairs of the part is not counted again with that of all pairs
            state.cell.work[:] = own.cell.work
            state.cell.work[:3] += 0.5 * state.cell.strain[:3] * (far_before + own.cell.far_virial)
        self.measures.slipped[:] = self._slips(state, own) if own.count[SLIPPED] else 0.0
        self._have_changed = self.part.give_back(engine)
        self.columns = self.part.columns
        return Stop.NONE

    def measure(self) -> None:
        """Measure the clusters, and note the grains of those that vibrate too much to come to rest."""
        inner = self.part.engine
        measure_clusters_stage(inner.law).run(inner.table, self.measures)

    def clusters(self, chosen: np.ndarray) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """First grain and grains, as indices of awake grains, of clusters, and vectors from their centres of mass [m].

        Of the clusters that were measured those with a `chosen` (n,) first grain.
        """
        numbers, offset = self.measures.first, self.part.state.clusters.offset
        for first in np.flatnonzero(chosen & (numbers == np.arange(len(numbers)))).tolist():
            own = np.flatnonzero(numbers == first)
            yield first, own, offset[:, own]

    def kick(self, engine: Engine, state: State, loads: tuple[np.ndarray, np.ndarray], step: float) -> None:
        """Half a kick of the awake clusters between steps.

        Parameters
        ----------
        loads : tuple of ndarray
            (3, N) forces [N] and torques [N m] on the grains of the state.
        step : float
            Length of the step [s].
        """
        self.list(state)
        if not self.grains.size:
            return
        own = self.take(engine, state)
        self.far.kick(self.part, loads, step)
        for name in ("velocity", "spin"):
            getattr(state.grains.arrays, name)[..., self.grains] = getattr(own.grains.arrays, name)

    def finish(self, engine: Engine) -> None:
        """The second half kick of awake clusters; those that are at rest become bodies."""
        state, own, measures = engine.regular_state, self.part.state, self.measures
        self.far.end(state, self.part)
        self.measure()
        if self._have_changed:
            changed = rename_clusters(state, self.grains, self.grains[measures.first.astype(np.int64)])
            self.sort_members(state)
            for _, cluster, offset in self.clusters(changed):
                describe_body(state, self.grains[cluster], offset)
        table = engine.table_of(state)
        grains = own.grains.arrays
        place_awake_grains.run(table, (grains.velocity, grains.spin, own.clusters.offset, measures.grain))
        mark_near(engine, table)
        if find_resting_clusters.run(table, measures):
            self._rest(engine)

    def _rest(self, engine: Engine) -> None:
        """Make bodies of the clusters that may come to rest, if they fit into the box."""
        state, measures, rested = engine.regular_state, self.measures, False
        for first, cluster, offset in self.clusters(measures.rests == 1.0):
            index = self.grains[cluster]
            if len(cluster) == 1:
                rest_grain(state, int(index[0]))
            elif fits_in_box(engine, offset):
                rest_as_body(engine, index, offset, float(measures.strain[first]), measures.strength[:, first])
            else:
                continue
            rested = True
        if rested:
            self.sort_members(state)

    def _slips(self, state: State, own: State) -> np.ndarray:
        """Which awake grains have contacts that slipped in this step of bodies: losses of these have grown."""
        slipped = np.zeros(len(self.grains), bool)
        contacts, columns, used = state.contacts, self.columns, int(own.count[CONTACTS])
        lost = [each.tobytes() for each in contacts.lost[SLIP_LOSSES, columns].T]
        before = dict(zip(map(frozenset, contacts.pair[:, columns].T.tolist()), lost, strict=True))
        pairs = own.contacts.pair[:, :used].T
        for pair, now in zip(pairs, own.contacts.lost[SLIP_LOSSES, :used].T, strict=True):
            if before.get(frozenset(self.grains[pair].tolist())) != now.tobytes():
                slipped[pair] = True
        return slipped


def _begin_in_box(cell: CellArrays) -> None:
    """Let a box change linearly from that at the start of a step of bodies to that at its end."""
    cell.span[:], cell.start[:], cell.rate[:3] = cell.begun, cell.begun[:3], cell.begun[6:9]
    cell.strain[:] = 0.0


def mark_near(engine: Engine, table: Table) -> None:
    """Mark bodies near others or walls, and those with driven grains, which do not come to rest."""
    bodies, heavy = engine.regular_state.bodies, engine.content.heavy
    mark_near_bodies.run(table)
    for stage, numbers in engine.content.of_components.get(Hook.NEAR_BODIES, ()):
        stage.run(table, numbers, Hook.NEAR_BODIES)
    if heavy.size:
        firsts = bodies.first[heavy]
        bodies.near[firsts] = np.maximum(bodies.near[firsts], NEAR)
