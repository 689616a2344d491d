"""Scattering of two bodies: trajectories, capture cross-sections and maps of the hit probability.

Functions are imported on first use: `sand.experiments.scattering.cross_section(...)` needs no further import.
"""

from __future__ import annotations

import importlib
from typing import Any

from ...basics.errors import NoSuchAttribute, did_you_mean

_MODULES = {
    "CrossSection": "cross_sections",
    "Flight": "encounters",
    "Trajectory": "flights",
    "cross_section": "cross_sections",
    "flight": "problem",
    "grains_at_contact": "flights",
    "run_flights": "cross_sections",
    "measure": "cross_sections",
    "probability_map": "maps",
    "seed_of": "cross_sections",
    "trajectory": "flights",
}
"""Public names and the modules that define them."""


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return getattr(importlib.import_module(f".{_MODULES[name]}", __name__), name)
    raise NoSuchAttribute(f"module 'sand.experiments.scattering' has no '{name}'; {did_you_mean(name, list(_MODULES))}")
