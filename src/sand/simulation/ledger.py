"""The energy table of a run: energies, losses per mechanism, momenta, and counts of contacts and clusters."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..analysis.body_motion import temperatures_of
from ..analysis.clusters import mean_size
from ..analysis.ledger_columns import AWAKE, LOSSES, LedgerColumns
from ..basics.clusters import labels_of
from ..basics.constants import BOLTZMANN
from ..basics.errors import BadInput
from ..basics.grains import Grains
from ..basics.state import BROKEN, CONTACTS, CORRECTED, MADE, SLIPPED, State
from ..contact.measure import ENERGIES
from ..engine.component import Component
from ..engine.engine import Engine
from ..engine.measures import body_motion, contact_energies, force_energies, losses
from ..io.ledger_table import TEMPERATURES
from .stress import PRESSURES, stress_of

KINETIC = "translation", "rotation"
"""Columns of kinetic energies."""
MAGNETIC = "magnetic"
"""A column that every ledger has, with or without dipoles."""
RUNAWAY = 0.5
"""Change of the total energy at which a run is stopped, relative to the sum of the magnitudes of all energies at the
start and now and of the energy that was put in."""
MOMENTA = tuple(f"{kind}_{axis}" for kind in ("momentum", "angular_momentum") for axis in "xyz")
INTERNAL = "internal"
"""Column of the kinetic energy of clusters beyond their rigid motion; a part of the kinetic energies."""
CORRECTION = "angular_momentum_corrected"
"""Column of the corrections that keep the angular momentum constant over r-RESPA cycles, their magnitudes summed."""
OF_MOTION = (*MOMENTA, CORRECTION, INTERNAL, *TEMPERATURES)
"""Columns of the motion that are not part of the total energy."""
NUMBERS = ("contacts", "made", "moved", "broken", "clusters", "mean_cluster_size", "largest_cluster")
COUNTED = {"step", "time", *NUMBERS, AWAKE}
"""Columns that need no energies, see `Ledger.counts_of`."""
WHOLE = {"step", *NUMBERS, AWAKE} - {"mean_cluster_size"}
"""Columns of whole numbers."""


def cluster_numbers(state: State) -> dict[str, float]:
    """Number of clusters, their mean size and the largest size."""
    pairs = state.contacts.pair[:, : state.count[CONTACTS]].T.astype(np.int64)
    sizes = np.bincount(labels_of(len(state.grains), pairs))
    return {"clusters": len(sizes), "mean_cluster_size": mean_size(sizes), "largest_cluster": int(sizes.max())}


def kinetic_energies(grains: Grains) -> tuple[np.ndarray, np.ndarray]:
    """Kinetic energies of translation ½mv² and rotation ½Iω² of each grain, (N,) each [J]."""
    arrays = grains.arrays
    v, w = arrays.velocity, arrays.spin
    squares = v[0] * v[0] + v[1] * v[1] + v[2] * v[2], w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    return 0.5 * arrays.mass * squares[0], 0.5 * arrays.inertia * squares[1]


def momenta(grains: Grains) -> list[float]:
    """Momentum [kg m/s] and angular momentum about the origin [J s], spins included: six numbers."""
    arrays, x = grains.arrays, grains.arrays.position
    p, spin = arrays.mass * arrays.velocity, arrays.inertia * arrays.spin
    orbital = np.array([x[1] * p[2] - x[2] * p[1], x[2] * p[0] - x[0] * p[2], x[0] * p[1] - x[1] * p[0]])
    # pairwise sums of momenta, sums grain by grain of angular momenta: the last digits of earlier ledgers
    return [*p.sum(axis=1).tolist(), *(orbital + spin).T.copy().sum(axis=0).tolist()]


class Ledger(LedgerColumns):
    """The ledger of a simulation: all rows so far, oldest first, and the times [s] of those that have a frame.

    Parameters
    ----------
    forces : Sequence[str], optional
        Names of the energy columns of long-range and per-grain forces.
    extra : Sequence[Component], optional
        Components, such as walls, which may have columns of their own.
    awake : bool, optional
        Whether clusters may be at rest: with the column `awake`.
    stress : bool, optional
        Whether rows have the columns PRESSURES.
    """

    def __init__(
        self,
        forces: Sequence[str] = (),
        extra: Sequence[Component] = (),
        *,
        awake: bool = False,
        stress: bool = False,
    ):
        self.stress = stress
        others = [name for name in forces if name != MAGNETIC]
        self._extra, numbers = tuple(extra), (*NUMBERS, AWAKE) if awake else NUMBERS
        self._further = [name for each in extra for name in each.losses()]
        own = {"step", "time", *KINETIC, *ENERGIES, *LOSSES, "total", *OF_MOTION, *NUMBERS, AWAKE, *PRESSURES}
        if taken := [name for name in others if name in own]:
            raise BadInput(f"forces: '{taken[0]}' is a column of the ledger; give this force another name")
        for each in extra:
            if taken := [name for name in each.columns() if name in {*own, *forces, *self._further, MAGNETIC}]:
                advice = f"give one of the {each.noun} another name"
                raise BadInput(f"{each.name}: '{taken[0]}' is a column of the ledger; {advice}")
        self._more = [*(PRESSURES if stress else ()), *(name for each in extra for name in each.columns())]
        of_state = (*LOSSES, *self._further, "total", *OF_MOTION, *numbers, *self._more)
        super().__init__(("step", "time", *KINETIC, *ENERGIES, MAGNETIC, *others, *of_state))
        self.frame_times: list[float] = []
        # engine, counts of contacts, and numbers of clusters for these
        self._clusters: tuple[Any, Any, dict[str, float]] = (None, None, {})

    @property
    def last_time(self) -> float:
        """Time of the last row [s]; −∞ without one."""
        return self.rows[-1]["time"] if self.rows else -math.inf

    def add(self, row: dict[str, float], with_frame: bool = False) -> bool:
        """Append a row; returns False if the ledger already has a row of this time."""
        if not row["time"] > self.last_time:
            return False
        self.rows.append(row)
        if with_frame:
            self.frame_times.append(row["time"])
        return True

    def row_of(self, engine: Engine) -> dict[str, float]:
        """The row of the present state of an engine: energies, losses [J], momenta (SI), temperatures [K], counts."""
        lost, bodies, state = losses(engine).tolist(), body_motion(engine), engine.state
        energies = [*(math.fsum(each.tolist()) for each in kinetic_energies(state.grains)), *contact_energies(engine)]
        forces, own = force_energies(engine), {name: v for each in self._extra for name, v in each.row(state).items()}
        further = [own[name] for name in self._further]
        row = dict.fromkeys(self.columns, 0.0)  # 0 for forces that a change left out
        row |= self.counts_of(engine) | dict(zip((*KINETIC, *ENERGIES, *LOSSES), (*energies, *lost), strict=True))
        row |= forces | {"total": math.fsum([*energies, *forces.values(), *lost, *further])}
        row |= dict(zip(MOMENTA, momenta(state.grains), strict=True))
        row |= {CORRECTION: float(state.clock[CORRECTED]), INTERNAL: math.fsum(bodies.internal.tolist())}
        row |= dict(zip(TEMPERATURES, temperatures_of(bodies.translation, bodies.rotation), strict=True))
        row |= (stress_of(engine).row() if self.stress else {}) | own
        before = self.rows[-1] if self.rows else None
        return row | {name: mean for each in self._extra for name, mean in each.means(state, before, row).items()}

    def counts_of(self, engine: Engine) -> dict[str, float]:
        """The part of the row of the present state that needs no energies: step, time [s], contacts and clusters."""
        state, at_rest = engine.state, engine.state.at_rest
        numbers = {"contacts": CONTACTS, "made": MADE, "moved": SLIPPED, "broken": BROKEN}
        row: dict[str, float] = {"step": state.steps, "time": state.time}
        row |= {name: int(state.count[k]) for name, k in numbers.items()} | self._cluster_numbers(engine)
        return row | ({} if at_rest is None else {AWAKE: int(np.count_nonzero(~at_rest))})

    def _cluster_numbers(self, engine: Engine) -> dict[str, float]:
        """Numbers of clusters, found anew after contacts have formed or broken."""
        state = engine.state
        key = (len(state.grains), *(int(state.count[k]) for k in (CONTACTS, MADE, BROKEN)))
        if self._clusters[:2] != (engine, key):
            self._clusters = engine, key, cluster_numbers(state)
        return self._clusters[2]

    def with_row(self, row: dict[str, float]) -> Ledger:
        """The ledger with one more row; the rows themselves if this time is the last one logged.

        Used for the summary of an interrupted run: the ledger of the run itself must not depend on interruptions.
        """
        more = copy.copy(self)
        more.rows = list(self.rows)
        more.add(row)
        return more

    def to_array(self) -> np.ndarray:
        """All rows as an array (K, columns) for a checkpoint; integers below 2⁵³ are exact in it."""
        return np.array([[row[name] for name in self.columns] for row in self.rows], dtype=np.float64)

    def from_array(self, table: np.ndarray, columns: Sequence[str], frame_times: np.ndarray | None = None) -> None:
        """Restore the rows from the array of `to_array`; raises BadInput if it lacks a column of this ledger.

        Without `frame_times` every row has a frame.

        Further columns are those of forces that a change left out. Without the column `awake` or the temperatures of
        bodies, as in checkpoints of versions that did not have them, the ledger goes on without them.
        """
        if not set(columns) >= set(self.columns) - {AWAKE, *TEMPERATURES}:
            raise BadInput(
                f"the ledger in the checkpoint has columns {', '.join(columns)}, not {', '.join(self.columns)}"
            )
        whole = WHOLE.union(*(each.whole() for each in self._extra))
        types = [int if name in whole else float for name in columns]
        self.columns = tuple(columns)
        self.rows = [
            {name: kind(v) for name, kind, v in zip(columns, types, row, strict=True)} for row in table.tolist()
        ]
        self.frame_times = [row["time"] for row in self.rows] if frame_times is None else frame_times.tolist()

    def runs_away(self, row: dict[str, float]) -> bool:
        """Whether the energy error exceeds `RUNAWAY` times the energies in this row, the first one, and those put in.

        Dissipated energy is not part of this sum: it was one of these before, unless it is an error.  Only
        this row and the first one are used, so that the result does not depend on how often rows are written.
        """
        if not self.rows:
            return False
        lost = *LOSSES, *self._further
        others = {"total", "step", "time", *lost, *OF_MOTION, *NUMBERS, AWAKE, *self._more}
        energies = [abs(each[name]) for each in (row, self.rows[0]) for name in self.columns if name not in others]
        change = abs(row["total"] - self.rows[0]["total"])
        # this form is also true for NaN
        return not change <= RUNAWAY * math.fsum([*energies, *(max(-row[name], 0.0) for name in lost)])

    def drift_per_kT(self, temperature: float, grains: int) -> float:  # noqa: N802, a name that scripts count on
        """Change of the total energy over N k_B T; NaN for T = 0."""
        return self._change() / (grains * BOLTZMANN * temperature) if temperature > 0.0 else math.nan
