"""SAND, Soft Aggregate Numerical Dynamics: grain-by-grain simulation of dust aggregates.

Public names are imported on first use, so that `import sand` and `sand --help` are fast.
"""

from __future__ import annotations

import importlib

from .basics.version import __version__
from .entry_points import register
from .forces import BUILT_IN as FORCES
from .integrate import BUILT_IN as INTEGRATORS

register()

TYPE_CHECKING = False  # typing takes as long to load as all the rest here


_MODULES = {
    "Box": "basics.box",
    "Grains": "basics.grains",
    "Material": "basics.material",
    "ICE": "basics.material",
    "SILICA": "basics.material",
    "GRAPHITE": "basics.material",
    "FORSTERITE": "basics.material",
    "IRON": "basics.material",
    "MAGNETITE": "basics.material",
    "SandError": "basics.errors",
    "BadInput": "basics.errors",
    "FilesFailed": "basics.errors",
    "Interrupted": "basics.errors",
    **FORCES,
    "external_force": "forces.own",
    "pair_force": "forces.own",
    "Ramp": "basics.ramps",
    **INTEGRATORS,
    "Neighbours": "neighbours.search",
    "Simulation": "simulation.simulation",
    "Wall": "components.walls",
    "resume": "config.build",
    "open": "results",
    "Driven": "components.driven",
    "Deformation": "components.deformation",
    "Observer": "simulation.observers",
    "Updater": "simulation.updater",
    "set_threads": "basics.threads",
    "Outcome": "simulation.outcome",
    "Result": "simulation.outcome",
}
_PACKAGES = ("setup", "theory", "analysis", "experiments", "io")

__all__ = ["__version__", *_MODULES, *_PACKAGES]

if TYPE_CHECKING:
    from typing import Any

    from . import analysis as analysis
    from . import experiments as experiments
    from . import io as io
    from . import setup as setup
    from . import theory as theory
    from .basics.box import Box as Box
    from .basics.errors import BadInput as BadInput
    from .basics.errors import FilesFailed as FilesFailed
    from .basics.errors import Interrupted as Interrupted
    from .basics.errors import SandError as SandError
    from .basics.grains import Grains as Grains
    from .basics.material import FORSTERITE as FORSTERITE
    from .basics.material import GRAPHITE as GRAPHITE
    from .basics.material import ICE as ICE
    from .basics.material import IRON as IRON
    from .basics.material import MAGNETITE as MAGNETITE
    from .basics.material import SILICA as SILICA
    from .basics.material import Material as Material
    from .basics.ramps import Ramp as Ramp
    from .basics.threads import set_threads as set_threads
    from .components.deformation import Deformation as Deformation
    from .components.driven import Driven as Driven
    from .components.walls import Wall as Wall
    from .config.build import resume as resume
    from .contact.model import Contact as Contact
    from .forces.electric_field import ElectricField as ElectricField
    from .forces.gas import Gas as Gas
    from .forces.gravity import Gravity as Gravity
    from .forces.magnetic_field import Field as Field
    from .forces.own import external_force as external_force
    from .forces.own import pair_force as pair_force
    from .forces.pair.dipoles import Dipoles as Dipoles
    from .forces.pair.inverse_square import Attraction as Attraction
    from .forces.pair.inverse_square import Charges as Charges
    from .forces.pair.screened_charges import ScreenedCharges as ScreenedCharges
    from .integrate.rigid.rigid_clusters import RigidClusters as RigidClusters
    from .integrate.verlet import Verlet as Verlet
    from .neighbours.search import Neighbours as Neighbours
    from .results import open as open
    from .simulation.observers import Observer as Observer
    from .simulation.outcome import Outcome as Outcome
    from .simulation.outcome import Result as Result
    from .simulation.simulation import Simulation as Simulation
    from .simulation.updater import Updater as Updater


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        value = getattr(importlib.import_module(f".{_MODULES[name]}", __name__), name)
        globals()[name] = value
        return value
    if name in _PACKAGES:
        return importlib.import_module(f".{name}", __name__)
    from .basics.errors import NoSuchAttribute, did_you_mean

    raise NoSuchAttribute(f"module 'sand' has no '{name}'; {did_you_mean(name, __all__)}")


def __dir__() -> list[str]:
    return sorted(__all__)
