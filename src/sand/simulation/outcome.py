"""Outcomes of a run."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ..basics.descriptions import described
from ..integrate.parts import Stop


class Outcome(Enum):
    """Why a run ended; the values are sentences for the user."""

    FINISHED = "the requested end is reached"
    CONDITION_MET = "the condition that ends the run is met"
    INTERRUPTED = "interrupted by a signal or the wall time allowed; a checkpoint lets the run continue"
    WALL_TIME = "the wall time of the condition is used up; a checkpoint lets the run continue"
    NOT_FINITE = "a speed or spin is no longer a finite number"
    RUNAWAY = "the energy runs away: its error exceeds half of all energy in the system; the step is too long"
    NO_STEP = "no step can be taken: the forces require one too short for the resolution of the time"
    TOO_FAST = "a grain would move by more than half the smallest radius in one step: the step is too long"
    SPINS_TOO_FAST = "a grain would rotate by more than half a radian in one step: the step is too long"
    BOX_TOO_SMALL = "the box is too small for its grains: a side must hold two of the largest and their gap twice"
    STRAINED_TOO_FAST = "a fixed step would strain the box too much: use a shorter one, or step = 'auto'"
    OVERCOMPRESSED = "two grains, or a grain and a wall, overlap by more than a radius: too fast, or the step too long"

    @property
    def is_physics(self) -> bool:
        """Whether the physics or the numerics stopped the run (exit code 3)."""
        return self not in (Outcome.FINISHED, Outcome.CONDITION_MET, *UNFINISHED)


UNFINISHED = (Outcome.INTERRUPTED, Outcome.WALL_TIME)
"""Outcomes of runs that wait to be continued."""
OUTCOME_OF_STOP = {stop: Outcome[stop.name] for stop in Stop if stop.name in Outcome.__members__}


@dataclass(frozen=True, repr=False)
class Result:
    """Result of `Simulation.run`.

    Attributes
    ----------
    outcome : Outcome
        Why the run ended.
    steps : int
        Number of steps since the start of the simulation.
    time : float
        Simulation time [s].
    drift : float
        Relative energy error: |change of the ledger's total| / (energy dissipated + largest kinetic energy).
    grains : tuple[int, ...]
        Indices of the grains that caused the outcome; empty if the run finished.
    condition : str
        The condition that was met, with `Outcome.CONDITION_MET`; "given" for a function.
    """

    outcome: Outcome
    steps: int
    time: float
    drift: float
    grains: tuple[int, ...] = ()
    condition: str = ""

    __repr__ = described

    def __str__(self) -> str:
        named = f" (grains {', '.join(map(str, self.grains))})" if self.grains else ""
        named += f" ({self.condition})" if self.condition else ""
        return f"{self.outcome.value}{named}: {self.time:.6g} s after {self.steps} steps, energy drift {self.drift:.2g}"
