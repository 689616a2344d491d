"""Drag and Brownian motion of grains in a rarefied gas, `sand.Gas` among the forces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

from ..basics.box import Box
from ..basics.grains import Grains
from ..basics.state import CONTACT_STEPS, CYCLE, GAS, KICKED, STEP, STEPS, TIME
from ..compiler.jit import loop
from ..compiler.stage import stage
from ..contact.law import ContactLaw
from ..engine.component import Component, Setup
from ..forces.base import Force
from ..forces.gas import Gas
from ..forces.gas_loops import gas_kick
from ..integrate.hooks import Hook, HookStages
from ..integrate.parts import ContactParameters


@loop
def _kick(grains, clock, count, lost, gas):
    """Drag and Brownian kicks for the time since the last; their numbers are those of steps, also of awake clusters."""
    # the steps of grains of awake clusters are counted from 0 in each step of the bodies, CONTACT_STEPS before it
    number, elapsed = count[STEPS] + count[CONTACT_STEPS], clock[TIME] - clock[KICKED]
    lost[GAS] += gas_kick(grains, gas.seed, number, elapsed, gas.gas)
    clock[KICKED] = clock[TIME]


@stage("the drag and noise of the gas")
def kick_by_gas(grains, clock, count, lost, gas):
    """Drag and Brownian kicks for the time since the last; at ends of steps or cycles, about once per gas period."""
    if clock[TIME] - clock[KICKED] + 0.5 * max(clock[STEP], clock[CYCLE]) >= gas.period:
        _kick(grains, clock, count, lost, gas)
    return 0


@stage("the drag and noise of the gas on awake clusters")
def finish_gas(grains, clock, count, lost, gas):
    """As `kick_by_gas`, for any time since the last, at the end of a step of the bodies."""
    if clock[TIME] > clock[KICKED]:
        _kick(grains, clock, count, lost, gas)
    return 0


class GasKicks(Component):
    """Drag and Brownian kicks, whose work is `lost_gas`.  Rigid bodies have friction and noise of their own."""

    name = "gas"
    in_parts = True
    last_action = KICKED

    @classmethod
    def of(cls, forces: Sequence[Force], grains: Grains, box: Box) -> Self:
        """The gas among these forces."""
        return cls([force for force in forces if isinstance(force, Gas)])

    def stages(self, setup: Setup, law: ContactLaw, settings: ContactParameters) -> HookStages:
        """Kicks at intervals of the stopping time, and at the end of each step of rigid bodies."""
        return {Hook.BETWEEN_CYCLES: [(kick_by_gas, ())], Hook.END_OF_BODIES: [(finish_gas, ())]}
