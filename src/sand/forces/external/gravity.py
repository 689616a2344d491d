"""Uniform gravity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ...basics.arguments import checked
from ...basics.box import Box
from ...basics.grains import Grains
from ...basics.ramps import rampable
from ...errors import FORBID_EXTRA, BadInput
from ..vectors import along_z, components
from .formulas import UniformGravity, uniform_gravity


@checked
@rampable("acceleration")
@dataclass(frozen=True)
class Gravity:
    """A uniform acceleration: force m g, energy −m g·x.

    Parameters
    ----------
    acceleration : float, str or sequence
        g, three components [m/s^2], or one magnitude ≥ 0 along −z: "9.81 m/s^2"; or a `Ramp`.

    Raises
    ------
    BadInput
        If `acceleration` is not one or three finite numbers in m/s^2, or one number below 0; one line each.
    """

    acceleration: Any

    __pydantic_config__ = FORBID_EXTRA
    name = "gravity"
    references = "Newton 1687"
    formula = staticmethod(uniform_gravity)
    position_dependent = True

    def __post_init__(self) -> None:
        given = self.acceleration
        g = along_z(given, "m/s^2", "gravity: acceleration", direction=-1.0)
        if components(given) is None and g[2] > 0.0:
            raise BadInput(
                f"gravity: acceleration = {given!r} is a magnitude along −z and must be at least 0 m/s^2; "
                "for another direction give three components"
            )
        object.__setattr__(self, "acceleration", g)

    def parameters(self) -> dict[str, Any]:
        """Settings in SI units, as in a case file."""
        return {"acceleration": list(self.acceleration)}

    def check(self, grains: Grains, box: Box) -> list[str]:
        """No warnings: every grain has a mass."""
        return []

    def numbers(self) -> UniformGravity:
        """Parameters of the formula."""
        return UniformGravity(*self.acceleration)

    def flux_density_size(self) -> float:
        """0: there is no magnetic field."""
        return 0.0
