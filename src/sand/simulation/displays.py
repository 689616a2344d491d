"""Registry of displays: functions of upper packages that draw or show a simulation.

`entry_points.register` fills it, so that `Simulation.figure`, `Simulation.view` and the figure at the end of a run need
no import of the packages that draw.
"""

from __future__ import annotations

TYPE_CHECKING = False  # typing takes as long to load as the whole of `import sand`
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

_DISPLAYS: dict[str, Callable[..., Any]] = {}


def register_display(name: str, function: Callable[..., Any]) -> None:
    """Register a display, replacing an earlier one of the same name.

    Parameters
    ----------
    name : str
        One of "figure" (simulation) → figure, "save figure" (simulation, path) and "view" (simulation, path).
    function : Callable[..., Any]
        Called with the simulation as first argument.
    """
    _DISPLAYS[name] = function


def display(name: str, *arguments: Any) -> Any:
    """Call a registered display."""
    return _DISPLAYS[name](*arguments)
