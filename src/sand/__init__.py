"""SAND, Soft Aggregate Numerical Dynamics: dust aggregates simulated grain by grain.

Names are loaded when first used, so that `import sand` and `sand --help` cost nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOMES = {
    "Box": "core.box",
    "Grains": "core.grains",
    "Material": "core.material",
    "ICE": "core.material",
    "SILICA": "core.material",
    "GRAPHITE": "core.material",
    "FORSTERITE": "core.material",
    "IRON": "core.material",
    "MAGNETITE": "core.material",
    "SandError": "core.errors",
    "BadInput": "core.errors",
    "Interrupted": "core.errors",
    "Contact": "forces.contact",
    "Dipoles": "forces.dipoles",
    "Field": "forces.field",
    "Verlet": "stepping.verlet",
    "Simulation": "run.simulation",
    "Observer": "run.observers",
    "Outcome": "run.outcome",
    "Result": "run.outcome",
}
_ROOMS = ("setup", "theory", "analysis", "files")

__all__ = ["__version__", *_HOMES, *_ROOMS]

if TYPE_CHECKING:
    from . import analysis, files, setup
    from .core.box import Box
    from .core.errors import BadInput, Interrupted, SandError
    from .core.grains import Grains
    from .core.material import FORSTERITE, GRAPHITE, ICE, IRON, MAGNETITE, SILICA, Material
    from .forces.contact import Contact
    from .forces.dipoles import Dipoles
    from .forces.field import Field
    from .run.observers import Observer
    from .run.outcome import Outcome, Result
    from .run.simulation import Simulation
    from .stepping.verlet import Verlet


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        found = getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
        globals()[name] = found
        return found
    if name in _ROOMS:
        return importlib.import_module(f".{name}", __name__)
    raise AttributeError(f"module 'sand' has no '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
