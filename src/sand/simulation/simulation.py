"""The simulation object: composes forces, box and integrator, and runs them."""

from __future__ import annotations

import math
import time as wall
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import checked
from ..box import as_box
from ..errors import BadInput, FilesFailed, Interrupted, warn
from ..forces.base import Force
from ..forces.pair.dipoles import kinetic_temperature
from ..grains import Grains
from ..integrate.adaptive import Adaptive
from ..integrate.kernel_spec import Stop
from ..integrate.verlet import Verlet
from ..neighbours.settings import Neighbours
from ..setup.from_frame import Bonds
from ..state.state import State
from ..units import format_quantity, seed_given
from .assemble import build_engine
from .contact_table import ContactTable
from .displays import display
from .grain_table import at_grains
from .ledger import Ledger, kinetic_energies, log_row
from .observers import Observer, Schedule, tick_all
from .outcome import OF_STOP, Outcome, Result
from .pace import Pace
from .run_writer import RunWriter
from .settings import ReadOnlySettings, forces_given
from .signals import Signals
from .stop import SHORTEST_DURATION, stop_criteria

BURST = 0.1
"""Wall time [s] the compiled driver stays away from Python, about."""
GUARD_EVERY = 10_000
"""Steps between two looks at whether the energy runs away."""


@checked
class Simulation(ReadOnlySettings):
    """Grains, forces and a box, and the time they have lived; only `frame_every` and `observers` can be assigned later.

    Parameters
    ----------
    grains : Grains
        the start; copied.
    forces : Sequence[Force] or Force, optional
        a list such as `[sand.Contact(), sand.Dipoles()]`, each kind once; or a single one.
    box : optional
        a Box, or a length for a periodic cube; open by default.
    stepping : Verlet or Adaptive or None, optional
        the integrator, `sand.Verlet()` by default, or `sand.Adaptive()`.
    neighbours : Neighbours or None, optional
        how pairs within reach are found, `sand.Neighbours()` by default.
    seed : int or None, optional
        of random forces, 0 … 2⁶³ − 1; kept with the run.
    out : str or Path or None, optional
        folder for the run's files, made at the first `run`; None keeps everything in memory.
    overwrite : bool, optional
        allow `out` to hold an earlier run, whose files are then replaced.
    observers : Iterable[Observer], optional
        objects that look on (see `sand.Observer`); they never change the physics.
    frame_every : optional
        time between frames [s]; by default a two-hundredth of the first `run`.
    contacts : Bonds or None, optional
        present from the start, with their strains, as `sand.setup.from_frame` gives them.
    restart : tuple[dict[str, ndarray], dict[str, Any]] or None, optional
        arrays and meta of a checkpoint in `out` to go on from (`sand.resume` gives them).

    Raises
    ------
    BadInput
        everything that is wrong, one line each.
    """

    def __init__(
        self,
        grains: Grains,
        forces: Sequence[Force] | Force = (),
        *,
        box: Any = None,
        stepping: Verlet | Adaptive | None = None,
        neighbours: Neighbours | None = None,
        seed: int | None = None,
        out: str | Path | None = None,
        overwrite: bool = False,
        observers: Iterable[Observer] = (),
        frame_every: Any = None,
        contacts: Bonds | None = None,
        restart: tuple[dict[str, np.ndarray], dict[str, Any]] | None = None,
    ):
        self.forces = forces_given(forces)
        self.box, self.neighbours = as_box(box), neighbours or Neighbours()
        self.seed = None if seed is None else seed_given(seed, bits=63)
        self.observers, self.frame_every = observers, frame_every
        self._chosen: dict[str, str] = {}  # what the start of a resumed run decided
        self.recipe: dict[str, Any] | None = None  # how a case file made the grains
        self.origin = ""  # what is to be said of where the grains came from
        self.planned = (math.inf, math.inf)  # time [s] and step that a resumed run was to reach
        self.start = grains.copy()
        parts = (grains, self.forces, self.box, stepping or Verlet(), self.neighbours, int(self.seed or 0))
        self._engine = build_engine(*parts, fresh=restart is None, contacts=contacts)
        self.stepping, self.neighbours = self._engine.stepping, self._engine.neighbours
        self.temperature = kinetic_temperature(grains)
        self.ledger = Ledger(
            [*(f.column for f, _, _ in self._engine.long_range), *(f.name for f in self._engine.external)]
        )
        self.writer = RunWriter(out, overwrite, resumed=restart is not None) if out is not None else None
        self.wall_seconds, self._begun = 0.0, restart is not None
        self._broken = ""  # why it cannot be run any further
        if restart is not None:
            arrays, meta = restart
            self._engine.load_state(arrays)
            self.temperature, self.wall_seconds = meta["temperature"], meta["wall_seconds"]
            self._chosen = meta["choices"]
            self.ledger.from_array(arrays["ledger"], meta["ledger"])
        for text in self._engine.warnings:
            warn(text)
        self._built = True

    @property
    def state(self) -> State:
        """The state."""
        return self._engine.state

    @property
    def time(self) -> float:
        """[s]"""
        return self._engine.time

    @property
    def steps(self) -> int:
        """Taken so far."""
        return self._engine.steps

    @property
    def is_sound(self) -> bool:
        """False if numbers are no longer finite, or most of the energy came from nowhere."""
        return not self.ledger.runs_away(self._log_row())

    @property
    def grains(self) -> Grains:
        """The grains as they are now; their arrays are read only."""
        return self.state.grains

    @property
    def contacts(self) -> ContactTable:
        """The contacts as they are now: displacements, shares of their limits, loads, energies, what each lost."""
        self._start()
        return ContactTable(self.state, self._engine.parameters.contact.follow)

    @property
    def choices(self) -> dict[str, str]:
        """What was decided for the user, and why: boundary, cut-offs, how neighbours are found."""
        if self._chosen:
            return self._chosen
        told = {"start": self.origin} if self.origin else {}
        told["boundary"] = self.box.describe()
        for force in self.forces:
            choose = getattr(force, "choose", None)
            if choose is not None:
                radius, reason = choose(self.start, self.box)
                told[f"{force.name} cut-off"] = (
                    f"{'none' if radius is None else format_quantity(radius, 'm')} ({reason})"
                )
        return told | {"neighbours": self._engine.search}

    def loads(self) -> dict[str, Any]:
        """Force (N, 3) [N], torque (N, 3) [N m], field (N, 3) [T], energies by name [J]; no step is taken."""
        self._start()
        row = self._log_row()
        names = dict.fromkeys(("normal", "sliding", "rolling", "twisting", "magnetic", *self._engine.force_energies()))
        return {
            "force": self.grains.force.copy(),
            "torque": self.grains.torque.copy(),
            "field": self.grains.field.copy(),
            "energy": {name: row[name] for name in names},
        }

    def at_grains(self) -> dict[str, np.ndarray]:
        """Flux density (N, 3) [T] and energies (N,) [J] at each grain, by name; energies sum to the ledger's columns.

        `kinetic`, `contacts`, and one for each force: half of each pair's energy goes to each of its grains.
        """
        self._start()
        return at_grains(self._engine)

    @checked
    def run(self, until: Any = None, *, steps: Any = None) -> Result:
        """Go on until a time, or for a number of steps, whichever comes first.

        Parameters
        ----------
        until : optional
            absolute time [s]; the run ends at the first step at or after it. Resumed runs know theirs.
        steps : optional
            number of steps from now, ≥ 1; the last cycle of long-range forces (`Verlet.far`) is finished.

        Raises
        ------
        BadInput
            neither is given, or one is out of range, or the run's folder cannot be used.
        FilesFailed
            the disk is full, the folder has vanished, …; what was written before stays whole.
        Interrupted
            Ctrl-C or SIGTERM; the checkpoint is written before.
        """
        if self._broken:
            raise BadInput(f"this simulation cannot go on: {self._broken}")
        end, last = stop_criteria(until, steps, self.time, self.steps, self.planned)
        if self.frame_every is None and 0.0 < end - self.time < math.inf:
            self.frame_every = max((end - self.time) / 200.0, SHORTEST_DURATION)
        try:
            self._start()
            if self.writer:
                self.writer.open(self, end, last)
            begun = wall.monotonic()
            with Signals() as signals:
                try:
                    outcome = self._loop(end, last, signals)
                finally:
                    self.wall_seconds += wall.monotonic() - begun
                    self._engine.restore_user_order()
            return self._close(outcome)
        except FilesFailed as error:
            if self.writer:
                self.writer.rescue()
            self._broken = f"its files could not be written ({error}); go on with sand.resume, or start again"
            raise
        finally:
            if self.writer:
                self.writer.release()

    @checked
    def view(self, path: str | Path | None = None) -> Any:
        """The grains in motion: a widget in a notebook with anywidget, else a page, opened if there is a browser.

        Parameters
        ----------
        path : str or Path or None, optional
            of the page; view.html in the run's folder by default, or in a temporary one.

        Returns the widget, or the path of the page; the figure, with a warning, where the installation lacks the page.
        """
        self._start()
        return display("view", self, path)

    def figure(self) -> Any:
        """The figure of the run so far: S(t), energies and losses, the aggregates in 3-D (matplotlib)."""
        self._start()
        return display("figure", self)

    def _start(self) -> None:
        if not self._begun:
            self._engine.begin()
            self._begun = True
            self._record_output()

    def _log_row(self) -> dict[str, float]:
        return log_row(self.state, self._engine.parameters, self._engine.force_energies())

    def _record_output(self) -> None:
        """A row of the ledger, a frame and everyone who looks on."""
        row = self._log_row()
        if not self.ledger.add(row):
            return
        if self.writer:
            self.writer.write(self, row)
        for observer in self.observers:
            observer.see(self, row)

    def _loop(self, end: float, last: float, signals: Signals) -> Outcome:
        frames = Schedule(self.frame_every or math.inf, self.time)
        burst, guarded, pace = 64, self.steps, Pace(end, last)
        while True:
            began = wall.monotonic()
            left = max(min(burst, last - self.steps, guarded + GUARD_EVERY - self.steps), 0)
            stop = self._engine.advance(min(end, frames.due), left)
            spent = wall.monotonic() - began
            if left == burst:
                burst = max(64, min(int(burst * min(BURST / max(spent, 1e-9), 2.0)), 10**7))
            if stop in OF_STOP:
                return OF_STOP[stop]
            pace.look(self.time, self.steps, spent)
            if self.steps - guarded >= GUARD_EVERY:
                guarded = self.steps
                if not self.is_sound:
                    return Outcome.RUNAWAY
            done = self.time >= end or self.steps >= last
            output = stop is Stop.TIME_REACHED or done
            if output:
                self._record_output()
                frames.pass_by(self.time)
            if done:
                return Outcome.FINISHED if self.is_sound else Outcome.RUNAWAY
            if self.writer:
                self.writer.tick(self, output)
            tick_all(self.observers, self)
            if signals.received:
                return Outcome.INTERRUPTED

    def _close(self, outcome: Outcome) -> Result:
        named = self._engine.limiting_grains() if outcome.is_physics else ()
        if outcome is Outcome.RUNAWAY:
            named = tuple(sorted(np.argsort(kinetic_energies(self.grains))[-2:].tolist()))
        if outcome.is_physics:
            self._record_output()
        result = Result(outcome, self.steps, self.time, self.ledger.drift, named)
        if self.writer:
            self.writer.close(self, result)
        for observer in self.observers:
            observer.close(self, result)
        if outcome is Outcome.INTERRUPTED:
            raise Interrupted(result)
        return result
