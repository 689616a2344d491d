"""Rigid clusters: aggregates at rest move as rigid bodies, and take contact steps only while something happens."""

from __future__ import annotations

import math
from collections.abc import Iterator, Set
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, NamedTuple

from ...basics.arguments import checked
from ...basics.grains import Grains
from ...basics.settings import Number, Table
from ...compiler.stage import Stage
from ..integrator import IntegratorSettings, register
from ..step_control import StepCriteria
from ..verlet import Verlet

SAMPLES = 4
"""Vibrations of awake clusters are measured this often in the shortest time after which a cluster may be at rest."""


class RigidLimits(NamedTuple):
    """Run-time numbers of rigid clusters."""

    vibration: float  # vibrational energy below which a cluster may be at rest, in units of ½ k q_c²
    step_fraction: float  # longest step times the rate of change of a body's loads
    longest_step: float  # [s]
    longest_awake: float  # [s], while a cluster is awake: the shortest time after which one may be at rest
    smallest_radius: float  # [m]
    friction_rate: float  # fastest decay of a velocity or spin by friction in a gas [1/s]; 0 without gas
    substeps: bool  # whether bodies may take several steps within a step of all bodies
    excludes_loads: (
        bool  # whether these are substeps, in which `BodyArrays.excluded_force` and torque do not kick bodies
    )


@register
@checked
@dataclass(frozen=True)
class RigidClusters(IntegratorSettings):
    """Clusters at rest move as rigid bodies with long steps; grains of awake clusters take contact steps within these.

    A cluster comes to rest when its vibrational energy has been low for half of its slowest period and no touch is
    ahead; it wakes before it may touch another grain, and before a load may move a contact. Single grains are bodies
    as well. Bodies whose loads change fast take several steps within one of all bodies where this saves time. Needs
    damped contacts (`sand.Contact(damping="critical", settling_time=…)`), without which no cluster comes
    to rest. In a gas (`sand.Gas`) bodies have the friction and noise of their grains. See
    docs/physics/rigid-clusters.md.

    Parameters
    ----------
    vibration : float, optional
        ε, vibrational energy below which a cluster may come to rest, in units of ½ k q_c², the smallest elastic energy
        at which one of its contacts slips; 0 … 0.1, 0 not included. In a thermal gas at least 3 (n − 1) k_B T for n
        grains, and at most ½ k q_c². This energy is removed; the ledger has it as `lost_quieting`.
    step_fraction : float, optional
        η, longest step in units of the time in which the loads of a body change, and of the shortest stopping time in
        a gas; 0 … 0.2, 0 not included. Errors of position, energy and diffusion are proportional to η².
    longest_step : float or str, optional
        Longest step of bodies [s]; with "auto" the loads, spins and flights of the bodies, and a gas, alone limit it.
    contact_stepping : Verlet, optional
        Integrator of the grains of awake clusters; in a case file a table of its keys.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """

    # above the largest values clusters would come to rest while they swing, and steps would not be accurate
    vibration: Annotated[Any, Number(above=0.0, most=0.1)] = 0.01
    step_fraction: Annotated[Any, Number(above=0.0, most=0.2)] = 0.1
    longest_step: Annotated[Any, Number("s", above=0.0, auto=True)] = "auto"
    contact_stepping: Annotated[Verlet, Table(Verlet)] = field(default_factory=Verlet)

    name: ClassVar[str] = "rigid-clusters"
    clusters: ClassVar[str] = "rigid"
    moves_bodies: ClassVar[bool] = True
    flight: ClassVar[Stage | None] = None

    def contradictions(self, wrong: Set[str]) -> Iterator[str]:
        """Taylor series of long-range forces, which need steps of all grains."""
        if "contact_stepping" not in wrong and self.contact_stepping.far.startswith("taylor"):
            far = self.contact_stepping.far
            yield f"far = {far!r} is not possible with rigid clusters; use 'impulse' or 'every step'"

    def resolved(self, grains: Grains, criteria: StepCriteria) -> RigidClusters:
        """These settings: the driver chooses the automatic step."""
        return self

    def flight_limits(self, grains: Grains, longest_displacement: float) -> RigidLimits:
        """Run-time numbers; the engine, which knows contacts, gas and grains, sets all but the first three."""
        longest = math.inf if self.longest_step == "auto" else self.longest_step
        return RigidLimits(
            self.vibration, self.step_fraction, longest, longest, 0.0, 0.0, substeps=False, excludes_loads=False
        )
