"""Adaptive integrator: an embedded Runge–Kutta pair for free flight, velocity Verlet during contacts."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.grains import Grains
from ..compiler.stage import Stage
from ..errors import FORBID_EXTRA
from .adaptive_driver import free_flight
from .flight import FlightSettings
from .integrator import register
from .step_control import StepCriteria
from .verlet import Verlet

ERRORS = {"position_error": "m", "velocity_error": "m/s", "turn_error": "rad", "spin_error": "rad/s"}
"""Error limits and their units."""


class ErrorLimits(NamedTuple):
    """Limits of a Runge–Kutta step."""

    position: float  # allowed error of a step [m]
    velocity: float  # [m/s]
    turn: float  # [rad]
    spin: float  # [rad/s]
    stride: float  # largest displacement of a grain in one step [m]


@register
@checked
@dataclass(frozen=True)
class Adaptive(FlightSettings):
    """Dormand–Prince Runge–Kutta pair 5(4) with error control while there are no contacts, velocity Verlet otherwise.

    A step is repeated with a shorter length if the error of any quantity of any grain exceeds its limit, and ends at
    the first contact of two grains. Momentum is conserved to rounding, energy and angular momentum to the errors.

    Parameters
    ----------
    tolerance : float, optional
        Relative error: limits that are "auto" are `tolerance` times the natural scales below; above 0, below 1.
    position_error : float or str, optional
        Largest error of a position in one step [m]. Scale of "auto": the smallest radius.
    velocity_error : float or str, optional
        Largest error of a velocity [m/s]. Scale: the largest initial speed or √(U/m), whichever is larger, U the
        long-range energy of two grains in contact, m the largest mass; at least a radius per longest step.
    turn_error : float or str, optional
        Largest error of an orientation [rad]. Scale: 1 rad.
    spin_error : float or str, optional
        Largest error of a spin [rad/s]. Scale: the largest initial spin or √(U/I), whichever is larger, U the larger
        of the long-range energy in contact and μB, I the largest moment of inertia; at least 1 rad per longest step.
    contact_stepping : Verlet, optional
        Integrator while grains are in contact; in a case file a table of its keys.

    Raises
    ------
    BadInput
        If a parameter is out of range.
    """

    tolerance: Any = 1e-9
    position_error: Any = "auto"
    velocity_error: Any = "auto"
    turn_error: Any = "auto"
    spin_error: Any = "auto"
    contact_stepping: Verlet = field(default_factory=Verlet)

    __pydantic_config__ = FORBID_EXTRA
    name: ClassVar[str] = "adaptive"
    UNITS: ClassVar[dict[str, str]] = {"tolerance": "1", **ERRORS}
    flight: ClassVar[Stage | None] = free_flight

    def resolved(self, grains: Grains, criteria: StepCriteria) -> Adaptive:
        """A copy in which every "auto" is replaced by a number, from the initial grains."""
        scales = dict(zip(ERRORS, natural_scales(grains, criteria), strict=True))
        auto = {key: self.tolerance * scale for key, scale in scales.items() if getattr(self, key) == "auto"}
        return replace(self, **auto)

    def flight_limits(self, longest_displacement: float) -> ErrorLimits:
        """Limits for the driver, after `resolved`, with the largest displacement in one step [m]."""
        return ErrorLimits(
            self.position_error, self.velocity_error, self.turn_error, self.spin_error, longest_displacement
        )


def natural_scales(grains: Grains, criteria: StepCriteria) -> tuple[float, float, float, float]:
    """Typical length [m], speed [m/s], angle [rad] and spin [rad/s] of the motion; never 0."""
    moment = float(np.linalg.norm(grains.body_moment, axis=1).max())
    length = float(grains.radius.min())
    speed = float(np.linalg.norm(grains.velocity, axis=1).max())
    spin = float(np.linalg.norm(grains.spin, axis=1).max())
    rotational_energy = max(criteria.energy_scale, moment * criteria.outer_field)
    return (
        length,
        max(speed, math.sqrt(criteria.energy_scale / float(grains.mass.max())), length / criteria.longest),
        1.0,
        max(spin, math.sqrt(rotational_energy / float(grains.inertia.max())), 1.0 / criteria.longest),
    )
