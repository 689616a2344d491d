"""Numerical experiments: collisions, cross-sections, growth of ensembles, collision kernels, and sweeps of all these.

Submodules are imported on first use: `sand.experiments.scattering.cross_section(...)` needs no further import.
"""

from __future__ import annotations

import importlib
from typing import Any

from ..basics.errors import NoSuchAttribute, did_you_mean

MODULES = ("chain_impact", "collision", "kernel_table", "laboratory", "scattering", "sequential")
"""Public submodules; the others are used by these and by the command line."""


def __getattr__(name: str) -> Any:
    if name == "sweep":
        return importlib.import_module(".sweep_job", __name__).sweep
    if name in MODULES:
        return importlib.import_module(f".{name}", __name__)
    raise NoSuchAttribute(f"module 'sand.experiments' has no '{name}'; {did_you_mean(name, (*MODULES, 'sweep'))}")
