"""Registers the displays of a simulation; the packages that draw are imported when a display is first used."""

from __future__ import annotations

from .simulation.displays import DISPLAYS

TYPE_CHECKING = False  # typing takes as long to load as the whole of `import sand`
if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any


def _figure(simulation: Any) -> Any:
    from .plotting.run_figure import run_figure, show

    return show(run_figure(simulation))


def _save_figure(simulation: Any, path: Path) -> None:
    from .compiler.progress import announce

    announce("drawing the figure")
    from .plotting.run_figure import run_figure, save

    save(run_figure(simulation), path)


def _view(simulation: Any, path: Any) -> Any:
    from .viewer.show import view_simulation

    return view_simulation(simulation, path)


def register() -> None:
    """Register all displays."""
    DISPLAYS.update({"figure": _figure, "save figure": _save_figure, "view": _view})
