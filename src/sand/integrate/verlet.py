"""Velocity Verlet, the integrator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..arguments import checked
from ..errors import FORBID_EXTRA, BadInput, did_you_mean
from ..units import is_word, si, whole_number
from .kernel_spec import RespaSettings

BELOW_RESONANCE = 0.48
"""Longest cycle of impulses in fastest periods: at half a period the first of them would push in step."""
LITERAL_STEPS = 70
"""k_max of the paper."""
MOST_FAR_STEPS = 1_000_000
"""Longest cycle that can be asked for."""
FAR = ("every step", "impulse", "taylor", "taylor-literal")


@checked
@dataclass(frozen=True)
class Verlet:
    """Velocity Verlet for translation, spin and rotation parameters; second order, keeps momenta exactly.

    Parameters
    ----------
    steps_per_period : optional
        steps per fastest period of any contact, ≥ 10 (25: frequencies come out 0.26 % high).
    step : optional
        a fixed step [s], or "auto": contact periods while anything touches, magnetic and closing times
        otherwise.
    accuracy : optional
        part, below 1, of the largest energy that a long-range force puts at stake, |U_min| for dipoles,
        that a step away from contacts may misplace.
    far : str, optional
        how long-range forces act while grains touch. "impulse" sums them once in a cycle of steps; what of them
        changes acts at the two ends of the cycle (r-RESPA), what lasts in every step, as does the force between
        two grains in contact. "taylor" foretells them inside the cycle by their Taylor series of first order,
        bound grains with their mean motion; "taylor-literal" is SAND's own, bound grains with the velocity and
        spin of the moment, ringing included; "every step" sums them in every step.
    far_steps : optional
        most steps in a cycle, k_max ≥ 1, counted in steps of the contacts' own where a fixed `step` is
        longer; or "auto": as many as stay below half the fastest period of a contact, 12 of 25, for "impulse";
        70, the paper's, for the Taylor series. Impulses at the ends of longer cycles meet the ringing in step
        and slowly heat it. A cycle is shorter where grains that touch nothing need it, by their long-range
        loads, spins and moments, and has one step where nothing touches.

    Raises
    ------
    BadInput
        out of range.
    """

    steps_per_period: Any = 25.0
    step: Any = "auto"
    accuracy: Any = 1e-8
    far: str = "impulse"
    far_steps: Any = "auto"

    __pydantic_config__ = FORBID_EXTRA
    name = "verlet"

    def __post_init__(self) -> None:
        problems: list[str] = []

        def take(key: str, unit: str, **bounds: float) -> None:
            try:
                object.__setattr__(self, key, si(getattr(self, key), unit, f"stepping: {key}", **bounds))
            except BadInput as error:
                problems.extend(error.problems)

        take("steps_per_period", "1", least=10.0)
        take("accuracy", "1", above=0.0, below=1.0)
        if not is_word(self.step, "auto"):
            take("step", "s", above=0.0)
        if self.far not in FAR:
            problems.append(f"stepping: far = {self.far!r}; {did_you_mean(str(self.far), FAR)}")
        if not is_word(self.far_steps, "auto"):
            try:
                whole_number(self.far_steps, "stepping: far_steps", 1, MOST_FAR_STEPS)
            except BadInput as error:
                problems += [f'{line}, or "auto"' for line in error.problems]
        if problems:
            raise BadInput(problems)

    def parameters(self) -> dict[str, Any]:
        """Its settings in SI."""
        return {
            "method": self.name,
            "steps_per_period": self.steps_per_period,
            "step": self.step,
            "accuracy": self.accuracy,
            "far": self.far,
            "far_steps": self.far_steps,
        }

    @property
    def most_steps(self) -> int:
        """k_max: the most steps between two sums of the long-range forces."""
        if self.far == "every step":
            return 1
        if self.far_steps != "auto":
            return int(self.far_steps)
        return max(1, int(BELOW_RESONANCE * self.steps_per_period)) if self.far == "impulse" else LITERAL_STEPS

    def respa_settings(self, distant: bool) -> RespaSettings:
        """How often far loads are summed, for the driver; every step if there are none."""
        return RespaSettings(self.max_steps if has_long_range else 1, self.far == "taylor-literal")
