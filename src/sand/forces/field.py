"""A uniform magnetic field."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..core.box import Box
from ..core.errors import FORBID_EXTRA, BadInput
from ..core.grains import Grains
from ..core.units import si
from ..physics.surroundings import UniformField, uniform_field


@dataclass(frozen=True)
class Field:
    """A flux density that is the same everywhere and always: torque μ×B, energy −μ·B (Eqs. 40, 41).

    Args:
        flux_density: three components [T], or one size along +z as in the paper: "1 mT".

    Raises:
        BadInput: not one or three finite numbers in T.
    """

    flux_density: Any

    __pydantic_config__ = FORBID_EXTRA
    name = "field"
    references = "Dominik & Nübold 2002, Eqs. 40, 41"
    formula = staticmethod(uniform_field)

    def __post_init__(self) -> None:
        given = self.flux_density
        parts = list(given) if hasattr(given, "__len__") and not isinstance(given, str) else [0.0, 0.0, given]
        if len(parts) != 3:
            raise BadInput(f"field: flux_density = {given!r} must be one size along z or three components, in T")
        names = (f"field: flux_density {axis}" for axis in "xyz")
        object.__setattr__(self, "flux_density", tuple(si(p, "T", n) for p, n in zip(parts, names, strict=True)))

    def parameters(self) -> dict[str, Any]:
        return {"flux_density": list(self.flux_density)}

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warns when no grain has a moment."""
        return [] if grains.moment.any() else ["a field is switched on but no grain has a magnetic moment"]

    def numbers(self) -> UniformField:
        return UniformField(*self.flux_density)

    def flux_density_size(self) -> float:
        return math.sqrt(sum(b * b for b in self.flux_density))
