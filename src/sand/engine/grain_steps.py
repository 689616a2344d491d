"""Steps of all grains by the compiled driver."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..basics.state import State
from ..compiler.stage import PythonStage, Stage
from ..compiler.table import Table
from ..integrate.driver import advance
from ..integrate.parts import Stop


class GrainSteps:
    """Steps of all grains by the compiled driver; base class of other ways to take steps (`rigid.body_steps`).

    Methods take the engine, an `engine.Engine`.

    Attributes
    ----------
    seconds : float
        Processor time [s] of steps within the steps that are counted.
    """

    seconds: float = 0.0

    def for_part(self) -> GrainSteps:
        """Such steps for an engine of some of the grains."""
        return self

    def stages(self, engine: Any, table: Table) -> list[tuple[Table, Stage | PythonStage, Any]]:
        """Stages that a run calls besides those of the program, each with a table of parts and its parameters."""
        return [(table, advance, ())]

    def call(self, engine: Any, until: float, last: float, shorten: bool) -> Stop:
        """Take steps up to a time [s] or a step; returns why no more were taken."""
        return engine.run_driver(advance, until, last, shorten)

    def summary(self, state: State) -> dict[str, Any]:
        """What the summary of a run says of bodies; nothing without any."""
        return {}

    def with_missing(self, engine: Any, saved: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The arrays of a saved state; arrays that it lacks are those of the present state."""
        return saved

    def loaded(self, engine: Any) -> None:
        """Called after a state was loaded."""

    def begin(self, engine: Any) -> None:
        """Called when the loads were summed at a start, or after a change by the user."""
