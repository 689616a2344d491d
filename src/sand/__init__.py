"""SAND, Soft Aggregate Numerical Dynamics: dust aggregates simulated grain by grain.

Names are loaded when first used, so that `import sand` and `sand --help` cost nothing.
"""

from __future__ import annotations

import importlib

TYPE_CHECKING = False  # typing takes as long to load as all the rest here

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
    "FilesFailed": "core.errors",
    "Interrupted": "core.errors",
    "Contact": "forces.contact",
    "Dipoles": "forces.dipoles",
    "Charges": "forces.central",
    "Attraction": "forces.central",
    "Gas": "forces.gas",
    "Field": "forces.field",
    "Gravity": "forces.gravity",
    "ElectricField": "forces.electric",
    "Verlet": "stepping.verlet",
    "Adaptive": "stepping.adaptive",
    "Neighbours": "stepping.neighbours",
    "Simulation": "run.simulation",
    "resume": "run.build",
    "open": "run.opened",
    "Observer": "run.observers",
    "set_threads": "core.threads",
    "Outcome": "run.outcome",
    "Result": "run.outcome",
}
_ROOMS = ("setup", "theory", "analysis", "experiments", "files")

__all__ = ["__version__", *_HOMES, *_ROOMS]

if TYPE_CHECKING:
    from typing import Any

    from . import analysis as analysis
    from . import experiments as experiments
    from . import files as files
    from . import setup as setup
    from . import theory as theory
    from .core.box import Box as Box
    from .core.errors import BadInput as BadInput
    from .core.errors import FilesFailed as FilesFailed
    from .core.errors import Interrupted as Interrupted
    from .core.errors import SandError as SandError
    from .core.grains import Grains as Grains
    from .core.material import FORSTERITE as FORSTERITE
    from .core.material import GRAPHITE as GRAPHITE
    from .core.material import ICE as ICE
    from .core.material import IRON as IRON
    from .core.material import MAGNETITE as MAGNETITE
    from .core.material import SILICA as SILICA
    from .core.material import Material as Material
    from .core.threads import set_threads as set_threads
    from .forces.central import Attraction as Attraction
    from .forces.central import Charges as Charges
    from .forces.contact import Contact as Contact
    from .forces.dipoles import Dipoles as Dipoles
    from .forces.electric import ElectricField as ElectricField
    from .forces.field import Field as Field
    from .forces.gas import Gas as Gas
    from .forces.gravity import Gravity as Gravity
    from .run.build import resume as resume
    from .run.observers import Observer as Observer
    from .run.opened import open as open
    from .run.outcome import Outcome as Outcome
    from .run.outcome import Result as Result
    from .run.simulation import Simulation as Simulation
    from .stepping.adaptive import Adaptive as Adaptive
    from .stepping.neighbours import Neighbours as Neighbours
    from .stepping.verlet import Verlet as Verlet


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        found = getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
        globals()[name] = found
        return found
    if name in _ROOMS:
        return importlib.import_module(f".{name}", __name__)
    from .core.errors import NoSuchAttribute, did_you_mean

    raise NoSuchAttribute(f"module 'sand' has no '{name}'; {did_you_mean(name, __all__)}")


def __dir__() -> list[str]:
    return sorted(__all__)
