"""Rigid clusters: aggregates at rest move as rigid bodies, and take contact steps only while something happens."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

from ...basics.arguments import checked
from ...basics.grains import Grains
from ...basics.units import is_word, si
from ...compiler.stage import Stage
from ...errors import FORBID_EXTRA, BadInput, shown
from ..integrator import register
from ..step_control import StepCriteria
from ..verlet import Verlet

MOST_VIBRATION, MOST_STEP_FRACTION = 0.1, 0.2
"""Largest values accepted: above, clusters would come to rest while they swing, and steps would not be accurate."""
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
    holds_loads: bool  # whether these are substeps, in which other loads on the grains are known but do not act


@register
@checked
@dataclass(frozen=True)
class RigidClusters:
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

    vibration: Any = 0.01
    step_fraction: Any = 0.1
    longest_step: Any = "auto"
    contact_stepping: Verlet = field(default_factory=Verlet)

    __pydantic_config__ = FORBID_EXTRA
    name: ClassVar[str] = "rigid-clusters"
    flight: ClassVar[Stage | None] = None

    def __post_init__(self) -> None:
        problems: list[str] = []
        bounds = {"vibration": MOST_VIBRATION, "step_fraction": MOST_STEP_FRACTION, "longest_step": math.inf}
        for key, most in bounds.items():
            value = getattr(self, key)
            if key == "longest_step" and is_word(value, "auto"):
                continue
            try:
                unit = "s" if key == "longest_step" else "1"
                object.__setattr__(self, key, si(value, unit, f"stepping: {key}", above=0.0))
                if getattr(self, key) > most:
                    problems.append(f"stepping: {key} = {getattr(self, key):g} must be above 0 and at most {most:g}")
            except BadInput as error:
                problems.extend(error.problems)
        if not isinstance(self.contact_stepping, Verlet):
            problems.append(f"stepping: contact_stepping = {shown(self.contact_stepping)}; give sand.Verlet(…)")
        elif self.contact_stepping.far.startswith("taylor"):
            problems.append(
                f"stepping: far = {self.contact_stepping.far!r} is not possible with rigid clusters; use 'impulse' or "
                "'every step'"
            )
        if problems:
            raise BadInput(problems)

    def parameters(self) -> dict[str, Any]:
        """Settings in SI units, as in a case file."""
        contact_stepping = {k: v for k, v in self.contact_stepping.parameters().items() if k != "method"}
        own = {key: getattr(self, key) for key in ("vibration", "step_fraction", "longest_step")}
        return {"method": self.name, **own, "contact_stepping": contact_stepping}

    def resolved(self, grains: Grains, criteria: StepCriteria) -> RigidClusters:
        """These settings: the driver chooses the automatic step."""
        return self

    def flight_limits(self, longest_displacement: float) -> RigidLimits:
        """Run-time numbers; the engine, which knows contacts, gas and grains, sets all but the first three."""
        longest = math.inf if self.longest_step == "auto" else self.longest_step
        return RigidLimits(
            self.vibration, self.step_fraction, longest, longest, 0.0, 0.0, substeps=False, holds_loads=False
        )
