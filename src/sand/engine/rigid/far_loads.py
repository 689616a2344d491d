"""Loads on awake clusters of the pairs that their part does not sum: kicks between steps, or held loads.

The part of the awake grains sums pairs among these.  The far loads are those of all pairs less these sums, and change
little in a step of the bodies.  As a rule each cluster, as a rigid body, gets half a kick by them at either end of the
step.  Where components hold grains (`Component.holds`), such kicks would make a cluster vibrate that cannot follow
them: there the far loads are held, they act on its grains during all contact steps (`add_held_loads`), and at the end
of the step the grains get half a kick by the change of the loads.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...basics.state import OUTSIDE, STEP, State
from ...integrate.hooks import Hook
from ...integrate.parts import DT
from ...integrate.rigid.awake_clusters import GrainLoads, add_held_loads, kick_clusters, no_loads
from ..part import Part

AS_GIVEN, LESS_OWN = 0, 1
"""Blocks of `kick_clusters`: the loads themselves, or less those of the grains on each other."""


@dataclass
class FarLoads:
    """The far loads on the grains of a part.

    Attributes
    ----------
    values : GrainLoads
        Forces [N] and torques [N m].
    held : GrainLoads or None
        Those that act in the contact steps of the part; None where far loads are kicks.
    """

    values: GrainLoads = field(default_factory=lambda: no_loads(0))
    held: GrainLoads | None = None

    def prepare(self, part: Part) -> None:
        """Memory for the grains that the part has taken, which no held loads act on yet."""
        self.values = part.engine.memory_for("far loads", no_loads)
        stages = part.engine.content.of_components.get(Hook.LOADS, ())
        self.held = next((numbers for stage, numbers in stages if stage is add_held_loads), None)
        for loads in self.held or ():
            loads[...] = 0.0

    def begin(self, state: State, part: Part) -> None:
        """Hold the far loads for the step, or kick the awake clusters by half of them."""
        if self._apply(state, part) and self.held is not None:
            grains = part.state.grains.arrays
            for far, own, loads in zip(self.values, self.held, (grains.force, grains.torque), strict=True):
                own[...] = far
                loads[...] += far

    def end(self, state: State, part: Part) -> None:
        """Kick the awake clusters by half of the far loads, or the grains by half of the change of held loads."""
        if self._apply(state, part) and self.held is not None:
            state.lost[OUTSIDE] += self._kick_by_change(part, self.held, 0.5 * float(state.clock[STEP]))

    def kick(self, part: Part, loads: tuple[np.ndarray, np.ndarray], step: float) -> None:
        """Half a kick of the clusters of a part by forces (3, N) and torques on all grains, for a step [s]."""
        self._take(part, loads)
        self._kick(part, step, AS_GIVEN)

    def _apply(self, state: State, part: Part) -> bool:
        """Set the far loads, and kick by half of them unless they are held; returns whether there are any."""
        full, own = state.long_range, part.state.long_range
        if not full.force.size:
            return False
        self._take(part, (full.force, full.torque))
        if self.held is None:
            self._kick(part, float(state.clock[STEP]), LESS_OWN)
        else:
            self.values.force[...] -= own.force
            self.values.torque[...] -= own.torque
        return True

    def _take(self, part: Part, loads: tuple[np.ndarray, np.ndarray]) -> None:
        """Copy the loads on the grains of the part out of those of all grains."""
        for own, given in zip(self.values, loads, strict=True):
            given.take(part.index, axis=1, out=own, mode="clip")

    def _kick(self, part: Part, step: float, block: int) -> None:
        """Half a kick of the clusters, as rigid bodies, for a step [s]."""
        table = part.engine.table
        table["scratch"][DT] = 0.5 * step
        kick_clusters.run(table, self.values, block)

    def _kick_by_change(self, part: Part, held: GrainLoads, half: float) -> float:
        """Kick the grains by the change of the held loads for a time [s]; returns the work [J] of a drive."""
        grains, heavy, work = part.state.grains.arrays, part.engine.content.heavy, 0.0
        motions = ((grains.velocity, grains.mass), (grains.spin, grains.inertia))
        for far, before, (motion, inertia) in zip(self.values, held, motions, strict=True):
            loads = far - before
            work += float((loads[:, heavy] * motion[:, heavy]).sum())
            loads[:, heavy] = 0.0
            motion += half * loads / inertia
        return half * work
