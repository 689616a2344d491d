"""How a run can end."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ..integrate.kernel_spec import Stop


class Outcome(Enum):
    """The values are sentences for the user."""

    FINISHED = "the end that was asked for is reached"
    INTERRUPTED = "interrupted from outside; a checkpoint lets the run go on"
    NOT_FINITE = "a speed or spin is no longer a finite number"
    RUNAWAY = "the energy runs away: more than half of it came from nowhere; the step is too long"
    NO_STEP = "no step can be taken: the physics asks for one too short for the clock"
    TOO_FAST = "a grain would fly more than half the smallest radius in one step: the step is too long"
    SPINS_TOO_FAST = "a grain would turn by more than half a radian in one step: the step is too long"
    OVERCOMPRESSED = "two grains overlap by more than the smaller radius: too fast an impact, or too long a step"

    @property
    def is_physics(self) -> bool:
        """True if the physics stopped the run (exit code 3)."""
        return self not in (Outcome.FINISHED, Outcome.INTERRUPTED)


OF_STOP = {
    Stop.NOT_FINITE: Outcome.NOT_FINITE,
    Stop.NO_STEP: Outcome.NO_STEP,
    Stop.TOO_FAST: Outcome.TOO_FAST,
    Stop.SPINS_TOO_FAST: Outcome.SPINS_TOO_FAST,
    Stop.OVERCOMPRESSED: Outcome.OVERCOMPRESSED,
}


@dataclass(frozen=True)
class Result:
    """What `Simulation.run` returns.

    Attributes
    ----------
    outcome : Outcome
        why it ended.
    steps : int
        number of steps since the start of the simulation.
    time : float
        [s]
    drift : float
        |change of the ledger's total| / (energy dissipated + largest kinetic energy).
    grains : tuple[int, ...]
        the grains an outcome names; empty if all went well.
    """

    outcome: Outcome
    steps: int
    time: float
    drift: float
    grains: tuple[int, ...] = ()

    def __str__(self) -> str:
        named = f" (grains {', '.join(map(str, self.grains))})" if self.grains else ""
        return f"{self.outcome.value}{named}: {self.time:.6g} s after {self.steps} steps, energy drift {self.drift:.2g}"
