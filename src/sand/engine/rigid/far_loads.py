"""Loads on awake clusters of the pairs that their part does not sum: kicks between steps, or held loads.

The part of the awake grains sums pairs among these.  The far loads are those of all pairs less these sums, and change
little in a step of the bodies.  As a rule each cluster, as a rigid body, gets half a kick by them at either end of the
step.  Where components hold grains (`Component.holds`), such kicks would make a cluster vibrate that cannot follow
them: there the far loads act on its grains during all contact steps (`HeldLoads`), and at the end of the step the
grains get half a kick by the change of the loads.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...basics.state import OUTSIDE, STEP, State
from ...integrate.hooks import Hook
from ...integrate.parts import DT
from ...integrate.rigid.awake_clusters import HeldLoads, add_held_loads, kick_clusters
from ..part import Part


@dataclass
class FarLoads:
    """The far loads on the grains of a part.

    Attributes
    ----------
    values : ndarray
        (2, 3, n) forces [N] and torques [N m].
    """

    values: np.ndarray = field(default_factory=lambda: np.zeros((2, 3, 0)))

    def prepare(self, part: Part) -> None:
        """Memory for the grains that the part has taken, which no held loads act on yet."""
        if self.values.shape[-1] != len(part.index):
            self.values = np.zeros((2, 3, len(part.index)))
        for loads in _held(part) or ():
            loads[...] = 0.0

    def begin(self, state: State, part: Part) -> None:
        """Hold the far loads for the step, or kick the awake clusters by half of them."""
        if self._apply(state, part) and (held := _held(part)) is not None:
            grains = part.state.grains.arrays
            for far, own, loads in zip(self.values, held, (grains.force, grains.torque), strict=True):
                own[...] = far
                loads[...] += far

    def end(self, state: State, part: Part) -> None:
        """Kick the awake clusters by half of the far loads, or the grains by half of the change of held loads."""
        if self._apply(state, part) and (held := _held(part)) is not None:
            state.lost[OUTSIDE] += self._kick_by_change(part, held, 0.5 * float(state.clock[STEP]))

    def kick(self, part: Part, loads: tuple[np.ndarray, np.ndarray], step: float) -> None:
        """Half a kick of the clusters of a part by forces (3, N) and torques on all grains, for a step [s]."""
        for own, given in zip(self.values, loads, strict=True):
            own[...] = given[:, part.index]
        self._kick(part, step)

    def _apply(self, state: State, part: Part) -> bool:
        """Set the far loads, and kick by half of them unless they are held; returns whether there are any."""
        full, near = state.long_range, part.state.long_range
        if full.force.size:
            self.values[0] = full.force[:, part.index] - near.force
            self.values[1] = full.torque[:, part.index] - near.torque
            if _held(part) is None:
                self._kick(part, float(state.clock[STEP]))
        return full.force.size > 0

    def _kick(self, part: Part, step: float) -> None:
        """Half a kick of the clusters, as rigid bodies, for a step [s]."""
        table = part.engine.table_of(part.state)
        table["scratch"][DT] = 0.5 * step
        kick_clusters.run(table, (self.values,))

    def _kick_by_change(self, part: Part, held: HeldLoads, half: float) -> float:
        """Kick the grains by the change of the held loads for a time [s]; returns the work [J] of a drive."""
        grains, heavy, work = part.state.grains.arrays, part.engine.content.heavy, 0.0
        motions = ((grains.velocity, grains.mass), (grains.spin, grains.inertia))
        for far, before, (motion, inertia) in zip(self.values, held, motions, strict=True):
            loads = far - before
            work += float((loads[:, heavy] * motion[:, heavy]).sum())
            loads[:, heavy] = 0.0
            motion += half * loads / inertia
        return half * work


def _held(part: Part) -> HeldLoads | None:
    """The held loads of a part; None where far loads are kicks."""
    stages = part.engine.content.of_components.get(Hook.LOADS, ())
    return next((numbers for stage, numbers in stages if stage is add_held_loads), None)
