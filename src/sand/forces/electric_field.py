"""A uniform electric field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from ..basics.arguments import checked
from ..basics.box import Box
from ..basics.grains import Grains
from ..basics.ramps import rampable
from ..basics.settings import RAMP, AlongZ, Settings
from .external_formulas import UniformVector, uniform_electric


@checked
@rampable
@dataclass(frozen=True)
class ElectricField(Settings):
    """A uniform electric field: force q E, energy −q E·x.

    Parameters
    ----------
    strength : float, str or sequence
        E, three components [V/m], or one value along +z: "1 kV/m"; or a `Ramp`.

    Raises
    ------
    BadInput
        If `strength` is not one or three finite numbers in V/m; one line each.
    """

    strength: Annotated[Any, AlongZ("V/m"), RAMP]

    name = "electric"
    references = "Jackson 1975"
    formula = staticmethod(uniform_electric)
    position_dependent = True

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warnings: no grain has a charge."""
        return [] if grains.charge.any() else ["an electric field is switched on but no grain has a charge"]

    def numbers(self) -> UniformVector:
        """Parameters of the formula."""
        return UniformVector(*self.strength)

    def flux_density_size(self) -> float:
        """0: there is no magnetic field."""
        return 0.0
