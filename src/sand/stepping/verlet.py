"""Velocity Verlet, the integrator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..core.errors import FORBID_EXTRA, BadInput
from ..core.units import si


@dataclass(frozen=True)
class Verlet:
    """Velocity Verlet for translation, spin and rotation parameters; second order, keeps momenta exactly.

    Args:
        steps_per_period: steps per fastest period of any contact, ≥ 10 (25: frequencies come out 0.26 % high).
        step: a fixed step [s], or "auto": contact periods while anything touches, magnetic and closing times
            otherwise.
        accuracy: part of the magnetic contact energy |U_min| that a step away from contacts may misplace.

    Raises:
        BadInput: out of range.
    """

    steps_per_period: Any = 25.0
    step: Any = "auto"
    accuracy: Any = 1e-8

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
        take("accuracy", "1", above=0.0)
        if self.step != "auto":
            take("step", "s", above=0.0)
        if problems:
            raise BadInput(problems)

    def parameters(self) -> dict[str, Any]:
        """Its settings in SI."""
        return {
            "method": self.name,
            "steps_per_period": self.steps_per_period,
            "step": self.step,
            "accuracy": self.accuracy,
        }
