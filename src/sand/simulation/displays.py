"""Displays of a simulation, which packages above this one provide.

`sand/__init__.py` registers them, so that `Simulation.figure`, `Simulation.view` and the figure at the end of a run need
no import of the packages that draw.
"""

from __future__ import annotations

TYPE_CHECKING = False  # typing takes as long to load as the whole of `import sand`
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

_DISPLAYS: dict[str, Callable[..., Any]] = {}


def register_display(name: str, function: Callable[..., Any]) -> None:
    """Register a display; it replaces an earlier one of the same name.

    Parameters
    ----------
    name : str
        "figure" (simulation) → figure, "save figure" (simulation, path), or "view" (simulation, path).
    function : Callable[..., Any]
        called with the simulation first.
    """
    _DISPLAYS[name] = function


def display(name: str, *arguments: Any) -> Any:
    """Call a registered display."""
    return _DISPLAYS[name](*arguments)
