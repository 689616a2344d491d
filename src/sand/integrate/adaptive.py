"""Adaptive steps of an embedded Runge–Kutta pair, the integrator for free flight and scattering."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ..arguments import checked
from ..errors import FORBID_EXTRA, BadInput, shown
from ..grains import Grains
from ..units import is_word, si
from .step_control import StepCriteria
from .verlet import Verlet

ERRORS = {"position_error": "m", "velocity_error": "m/s", "turn_error": "rad", "spin_error": "rad/s"}
"""The prescribed errors and their units."""


class ErrorLimits(NamedTuple):
    """What a Runge–Kutta step must keep to."""

    position: float  # allowed error of a step [m]
    velocity: float  # [m/s]
    turn: float  # [rad]
    spin: float  # [rad/s]
    stride: float  # longest way of a grain in one step [m]


@checked
@dataclass(frozen=True)
class Adaptive:
    """Dormand and Prince's Runge–Kutta pair 5(4) with prescribed errors while nothing touches, Verlet in between.

    A step is taken again, shorter, if the error of any quantity of any grain exceeds what is prescribed, and ends
    where two grains come to touch.  Momentum is kept to rounding, energy and angular momentum to the errors.

    Parameters
    ----------
    tolerance : optional
        the errors that are "auto" are this part, below 1, of the problem's own scales.
    position_error : optional
        largest error of a position in one step [m], or "auto": of the smallest radius.
    velocity_error : optional
        of a velocity [m/s], or "auto": of the fastest start, or of √(U/m) if that is more, U the
        far energy of two grains at touch, m the largest mass; at least a radius in the longest step.
    turn_error : optional
        of an orientation [rad], or "auto": of 1 rad.
    spin_error : optional
        of a spin [rad/s], or "auto": of the fastest spin at the start, or of √(U/I) if that is more, U
        the larger of the far energy at touch and of μB, I the largest moment of inertia; at least 1 rad in the
        longest step.
    touching : Verlet, optional
        the `sand.Verlet` that takes over while grains touch; a table of its keys in a case file.

    Raises
    ------
    BadInput
        out of range.
    """

    tolerance: Any = 1e-9
    position_error: Any = "auto"
    velocity_error: Any = "auto"
    turn_error: Any = "auto"
    spin_error: Any = "auto"
    touching: Verlet = field(default_factory=Verlet)

    __pydantic_config__ = FORBID_EXTRA
    name = "adaptive"

    def __post_init__(self) -> None:
        problems: list[str] = []
        for key, unit in {"tolerance": "1", **ERRORS}.items():
            if key != "tolerance" and is_word(getattr(self, key), "auto"):
                continue
            bounds = {"below": 1.0 if key == "tolerance" else math.inf}
            try:
                object.__setattr__(self, key, si(getattr(self, key), unit, f"stepping: {key}", above=0.0, **bounds))
            except BadInput as error:
                problems.extend(error.problems)
        if not isinstance(self.touching, Verlet):
            problems.append(f"stepping: touching = {shown(self.touching)}; give sand.Verlet(…)")
        if problems:
            raise BadInput(problems)

    def parameters(self) -> dict[str, Any]:
        """Its settings in SI."""
        touching = {k: v for k, v in self.touching.parameters().items() if k != "method"}
        own = {key: getattr(self, key) for key in ("tolerance", *ERRORS)}
        return {"method": self.name, **own, "touching": touching}

    def resolved(self, grains: Grains, criteria: StepCriteria) -> Adaptive:
        """The same with a number for every "auto", from the grains at the start."""
        scales = dict(zip(ERRORS, natural_scales(grains, criteria), strict=True))
        auto = {key: self.tolerance * scale for key, scale in scales.items() if getattr(self, key) == "auto"}
        return replace(self, **auto)

    def error_limits(self, stride: float) -> ErrorLimits:
        """What the driver takes, once settled."""
        return ErrorLimits(self.position_error, self.velocity_error, self.turn_error, self.spin_error, stride)


def natural_scales(grains: Grains, criteria: StepCriteria) -> tuple[float, float, float, float]:
    """A length [m], a speed [m/s], an angle [rad] and a spin [rad/s] that are typical of the motion; never 0."""
    moment = float(np.linalg.norm(grains.body_moment, axis=1).max())
    length = float(grains.radius.min())
    speed = float(np.linalg.norm(grains.velocity, axis=1).max())
    spin = float(np.linalg.norm(grains.spin, axis=1).max())
    swing = max(criteria.energy_scale, moment * criteria.outer_field)
    return (
        length,
        max(speed, math.sqrt(criteria.energy_scale / float(grains.mass.max())), length / criteria.longest),
        1.0,
        max(spin, math.sqrt(swing / float(grains.inertia.max())), 1.0 / criteria.longest),
    )
