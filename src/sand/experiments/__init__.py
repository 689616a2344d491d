"""Numerical experiments: collisions, cross-sections, growth of ensembles, collision kernels, and sweeps of all these.

Submodules are imported on first use: `sand.experiments.scattering.cross_section(...)` needs no further import.
"""

from __future__ import annotations

from ..basics.lazy import lazily

MODULES = ("chain_impact", "collision", "kernel_table", "laboratory", "scattering", "sequential")
"""Public submodules; the others are used by these and by the command line."""

__getattr__, __dir__ = lazily(__name__, {**dict.fromkeys(MODULES, ""), "sweep": "sweep_job"})
