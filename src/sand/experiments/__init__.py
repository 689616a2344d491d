"""Published figures and common measurements, each as one function.

Modules are loaded when first used: `sand.experiments.scattering.cross_section(...)` needs no import of its own.
"""

from __future__ import annotations

import importlib
from typing import Any

from ..errors import NoSuchAttribute, did_you_mean

MODULES = ("chain_impact", "collision", "kernel_table", "scattering")
"""What there is to be used; the other modules serve these and the command line."""


def __getattr__(name: str) -> Any:
    if name in MODULES:
        return importlib.import_module(f".{name}", __name__)
    raise NoSuchAttribute(f"module 'sand.experiments' has no '{name}'; {did_you_mean(name, MODULES)}")
