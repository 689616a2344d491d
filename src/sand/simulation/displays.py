"""Registry of displays: functions of upper packages that draw or show a simulation.

`entry_points.register` fills it, so that `Simulation.figure`, `Simulation.view` and the figure at the end of a run need
no import of the packages that draw.
"""

from __future__ import annotations

TYPE_CHECKING = False  # typing takes as long to load as the whole of `import sand`
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

DISPLAYS: dict[str, Callable[..., Any]] = {}
"""Displays by name: "figure" (simulation) → figure, "save figure" (simulation, path) and "view" (simulation, path)."""
