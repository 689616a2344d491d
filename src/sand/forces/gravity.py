"""Uniform gravity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from ..basics.arguments import checked
from ..basics.box import Box
from ..basics.errors import BadInput, shown
from ..basics.grains import Grains
from ..basics.ramps import rampable
from ..basics.settings import RAMP, Reading, Settings
from ..basics.vectors import along_z, components
from .external_formulas import UniformVector, uniform_gravity


def _downwards(value: Any, name: str) -> tuple[float, float, float]:
    """Three components, or one magnitude along −z.  Raises BadInput."""
    g = along_z(value, "m/s^2", name, direction=-1.0)
    if components(value) is None and g[2] > 0.0:
        raise BadInput(
            f"{name} = {shown(value)} is a magnitude along −z and must be at least 0 m/s^2; "
            "for another direction give three components"
        )
    return g


@checked
@rampable
@dataclass(frozen=True)
class Gravity(Settings):
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

    acceleration: Annotated[Any, Reading(_downwards, unit="m/s^2"), RAMP]

    name = "gravity"
    references = "Newton 1687"
    formula = staticmethod(uniform_gravity)
    position_dependent = True

    def check(self, grains: Grains, box: Box) -> list[str]:
        """No warnings: every grain has a mass."""
        return []

    def numbers(self) -> UniformVector:
        """Parameters of the formula."""
        return UniformVector(*self.acceleration)

    def flux_density_size(self) -> float:
        """0: there is no magnetic field."""
        return 0.0
