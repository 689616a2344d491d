"""Drag and Brownian motion of grains in a rarefied gas, `sand.Gas` among the forces."""

from __future__ import annotations

from typing import ClassVar

from ..basics.state import CONTACT_STEPS, CYCLE, GAS, KICKED, STEP, STEPS, TIME
from ..compiler.stage import stage
from ..engine.component import Component
from ..forces.base import Force
from ..forces.gas import Gas
from ..forces.gas_loops import gas_kick
from ..integrate.hooks import Hook, HookStages


@stage("the drag and noise of the gas")
def kick_by_gas(grains, clock, count, lost, gas, block):
    """Drag and Brownian kicks for the time since the last; about once per gas period, and at END_OF_BODIES."""
    elapsed = clock[TIME] - clock[KICKED]
    due = elapsed + 0.5 * max(clock[STEP], clock[CYCLE]) >= gas.period or block == Hook.END_OF_BODIES.value
    if due and elapsed > 0.0:
        # the steps of grains of awake clusters are counted from 0 in each step of the bodies, CONTACT_STEPS before it
        number = count[STEPS] + count[CONTACT_STEPS]
        lost[GAS] += gas_kick(grains, gas.seed, number, elapsed, gas.gas)
        clock[KICKED] = clock[TIME]
    return 0


KICKS = [(kick_by_gas, ())]


class GasKicks(Component):
    """Drag and Brownian kicks, whose work is `lost_gas`.  Rigid bodies have friction and noise of their own."""

    name = "gas"
    in_parts = True
    last_action = KICKED
    own_stages: ClassVar[HookStages] = dict.fromkeys((Hook.BETWEEN_CYCLES, Hook.END_OF_BODIES), KICKS)

    @staticmethod
    def follows_from(force: Force) -> bool:
        """Whether this is a gas."""
        return isinstance(force, Gas)
