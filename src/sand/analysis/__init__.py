"""Analysis of clusters: size, shape, contact network, fractal dimension, magnetic moment and growth laws.

Submodules are imported on first use: `sand.analysis.fits.power_law(...)` needs no further import.
"""

from __future__ import annotations

import importlib
from typing import Any

from ..basics.errors import NoSuchAttribute, did_you_mean

MODULES = (
    "body_motion", "clusters", "collision_model", "fits", "fractal", "frame_statistics", "internal_motion",
    "ledger_columns", "network", "quantities", "shape", "tracking",
)  # fmt: skip
"""Public submodules."""


def __getattr__(name: str) -> Any:
    if name in MODULES:
        return importlib.import_module(f".{name}", __name__)
    raise NoSuchAttribute(f"module 'sand.analysis' has no '{name}'; {did_you_mean(name, MODULES)}")
