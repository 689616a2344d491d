"""Scattering of two bodies: trajectories, capture cross-sections and maps of the hit probability.

Functions are imported on first use: `sand.experiments.scattering.cross_section(...)` needs no further import.
"""

from __future__ import annotations

from ...basics.lazy import lazily

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

__getattr__, __dir__ = lazily(__name__, _MODULES)
