"""Velocity Verlet, the default integrator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from ..basics.arguments import checked
from ..basics.grains import Grains
from ..basics.settings import Number, Whole, Word
from ..compiler.stage import Stage
from .integrator import IntegratorSettings, register

IMPULSE_PERIODS = 0.48
"""Longest r-RESPA cycle in fastest contact periods; the first resonance of the impulses is at half a period."""
TAYLOR_STEPS = 70
"""k_max of the paper."""
MAX_FAR_STEPS = 1_000_000
"""Largest `far_steps` accepted."""


@register
@checked
@dataclass(frozen=True)
class Verlet(IntegratorSettings):
    """Velocity Verlet for translation, spin and rotation parameters; second order, conserves momenta to rounding.

    Parameters
    ----------
    steps_per_period : float, optional
        Steps per fastest period of any contact, ≥ 10. With 25, frequencies are 0.26 % too high.
    step : float or str, optional
        A fixed step [s], or "auto": a fraction of the contact period while there are contacts; of magnetic and
        collision times otherwise.
    accuracy : float, optional
        Allowed energy error of a step without contacts, in units of the largest energy of a long-range pair
        (|U_min| for dipoles); above 0, below 1.
    far : str, optional
        Integration of long-range forces while there are contacts. "impulse": r-RESPA; the forces are summed once per
        cycle of steps, their constant part acts in every step and the difference as impulses at both ends of the cycle;
        forces between grains in contact act in every step. "taylor": extrapolated within the cycle by their
        first-order Taylor series, with the mean motion of grains in contact. "taylor-literal": as in the paper, with
        the instantaneous velocity and spin of all grains, contact oscillations included. "every step": summed in
        every step.
    far_steps : int or str, optional
        Largest number of steps in a cycle, k_max ≥ 1, counted in the steps that contacts allow if a fixed `step` is
        longer; or
        "auto": for "impulse" the largest cycle below half the fastest contact period, 12 steps of 25; for Taylor
        series 70, as in the paper. Impulses of longer cycles are resonant with contact oscillations and slowly heat
        them. Cycles are shorter where the long-range loads, spins or moments of free grains require it, and have one
        step without contacts.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """

    steps_per_period: Annotated[Any, Number(least=10.0)] = 25.0
    step: Annotated[Any, Number("s", above=0.0, auto=True)] = "auto"
    accuracy: Annotated[Any, Number(above=0.0, below=1.0)] = 1e-8
    far: Annotated[str, Word("every step", "impulse", "taylor", "taylor-literal")] = "impulse"
    far_steps: Annotated[Any, Whole(1, MAX_FAR_STEPS, auto=True)] = "auto"

    name: ClassVar[str] = "verlet"
    clusters: ClassVar[str] = "grains"
    flight: ClassVar[Stage | None] = None

    @property
    def contact_stepping(self) -> Verlet:
        """Settings while grains are in contact: these."""
        return self

    def resolved(self, grains: Grains, criteria: Any) -> Verlet:
        """These settings: the driver chooses the automatic step."""
        return self

    def flight_limits(self, grains: Grains, longest_displacement: float) -> tuple[()]:
        """None: grains without contacts are moved in the same way."""
        return ()

    @property
    def max_cycle_steps(self) -> int:
        """k_max, the largest number of steps between two sums of the long-range forces."""
        if self.far == "every step":
            return 1
        if self.far_steps != "auto":
            return int(self.far_steps)
        return max(1, int(IMPULSE_PERIODS * self.steps_per_period)) if self.far == "impulse" else TAYLOR_STEPS
