"""Measuring what has grown.

Modules are loaded when first used: `sand.analysis.fits.power_law(...)` needs no import of its own.
"""

from __future__ import annotations

import importlib
from typing import Any

from ..errors import NoSuchAttribute, did_you_mean

MODULES = (
    "clusters", "fits", "fractal", "frame_statistics", "ledger_columns", "network", "quantities", "shape",
    "tracking",
)  # fmt: skip
"""What there is to be used."""


def __getattr__(name: str) -> Any:
    if name in MODULES:
        return importlib.import_module(f".{name}", __name__)
    raise NoSuchAttribute(f"module 'sand.analysis' has no '{name}'; {did_you_mean(name, MODULES)}")
