"""Damping of the motion of grains relative to their cluster, `settling_time` of `sand.Contact`."""

from __future__ import annotations

import math
from typing import ClassVar

from ..basics.arrays import cluster_arrays
from ..basics.state import CYCLE, SETTLED, SETTLING, STEP, TIME, State
from ..compiler.stage import stage
from ..contact.law import ContactLaw
from ..contact.model import Contact
from ..contact.settling import PERIOD_FRACTION, settle_clusters
from ..engine.component import Component
from ..forces.base import Force
from ..integrate.hooks import Hook, HookStages
from ..integrate.parts import ContactParameters


@stage("the settling of clusters")
def settle(grains, contacts, clusters, clock, lost, span, settings):
    """Settling of clusters for the time since the last; at ends of steps or cycles, about every τ/20."""
    elapsed = clock[TIME] - clock[SETTLED]
    if elapsed + 0.5 * max(clock[STEP], clock[CYCLE]) >= PERIOD_FRACTION * settings.settling_time:
        part = -math.expm1(-elapsed / settings.settling_time)
        lost[SETTLING] += settle_clusters(grains, contacts, clusters, span, clock[SETTLED], part)
        clock[SETTLED] = clock[TIME]
    return 0


class Settling(Component):
    """Settling of clusters; its item is the contact model, and what it removes is `lost_settling`.

    With driven grains in a cluster, it leads to the rigid motion of these.
    """

    name = "settling"
    in_parts = True
    own_stages: ClassVar[HookStages] = {Hook.BETWEEN_CYCLES: [(settle, ())]}

    @staticmethod
    def follows_from(force: Force) -> bool:
        """Whether this is a contact model with a settling time."""
        return isinstance(force, Contact) and force.settling_time is not None

    def add_arrays(self, state: State, law: ContactLaw, settings: ContactParameters) -> None:
        """Give a new state the memory for one cluster at a time."""
        state.clusters = cluster_arrays(len(state.grains))
