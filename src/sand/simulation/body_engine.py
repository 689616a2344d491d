"""An engine of bodies that move as rigid bodies."""

from __future__ import annotations

from dataclasses import dataclass

from ..integrate.parts import Stop
from ..integrate.rigid_driver import advance_bodies
from ..state.state import PAIRS
from .engine import Engine


@dataclass
class BodyEngine(Engine):
    """An engine whose state consists of bodies; see `integrate.rigid_driver` for their steps."""

    def _bodies_driver(self, until: float, last: float, shorten: bool = False) -> Stop:
        """Call the driver of bodies; enlarges arrays that overflow."""
        while True:
            stop = self._run_program(advance_bodies, until, last, shorten)
            if stop is Stop.PAIRS_FULL:
                found, self._state.count[PAIRS] = int(self._state.count[PAIRS]), 0
                self._state.grow_pairs(int(1.1 * found))
            elif stop is Stop.LIST_FULL:
                self._state.grow_rows()
            else:
                return stop
