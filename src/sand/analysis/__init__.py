"""Analysis of clusters: size, shape, contact network, fractal dimension, magnetic moment and growth laws.

Submodules are imported on first use: `sand.analysis.fits.power_law(...)` needs no further import.
"""

from __future__ import annotations

from ..basics.lazy import lazily

MODULES = (
    "body_motion", "clusters", "collision_model", "fits", "fractal", "frame_statistics", "ledger_columns",
    "network", "quantities", "shape", "tracking",
)  # fmt: skip
"""Public submodules."""

__getattr__, __dir__ = lazily(__name__, dict.fromkeys(MODULES, ""))
