"""The simulation object: composes forces, box and integrator, and runs them."""

from __future__ import annotations

import contextlib
import copy
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.box import as_box
from ..basics.grains import Grains
from ..basics.state import BROKEN, CONTACTS, LATE, MADE, OUTSIDE, State
from ..basics.units import format_quantity, seed_given
from ..contact.model import Contact
from ..engine.assemble import build_engine, fitting_forces
from ..engine.driven import read_driven
from ..engine.walls import Wall, WallState, read_walls, wall_columns, wall_states
from ..errors import BadInput, FilesFailed, Interrupted, warn
from ..forces.base import Force
from ..forces.pair.dipoles import kinetic_temperature
from ..integrate.integrator import Integrator
from ..integrate.registry import checked_integrator
from ..integrate.verlet import Verlet
from ..limits.solid_limits import extreme_warnings, grain_warnings
from ..limits.truncation import truncation_warnings
from ..neighbours.search import Neighbours
from ..setup.from_frame import StrainedContacts
from .cadence import Chosen, chosen_cadence
from .change import Change, as_chosen, changed_engine
from .condition import GIVEN, OwnCondition
from .contact_table import ContactTable
from .cost.cost import StepTimer
from .displays import DISPLAYS
from .exclusive import Exclusive, exclusive
from .ledger import Ledger, cluster_numbers, count_row, kinetic_energies, log_row
from .observers import Observer
from .outcome import Outcome, Result
from .run_loop import run_loop
from .run_writer import RunWriter, is_mostly_awake
from .settings import ReadOnlySettings, read_forces
from .signals import Signals
from .stop import StopCriteria, stop_criteria
from .updater import Updater, check_updaters
from .vibration import vibration_notes
from .wall_clock import WallClock

ELASTIC = ("energy_normal", "energy_sliding", "energy_rolling", "energy_twisting")
"""Columns of a contact's elastic energy."""


@checked
class Simulation(ReadOnlySettings):
    """A simulation: grains, forces, boundary conditions and an integrator.

    Only `observers`, `updaters`, `frame_every`, `row_every` and `checkpoint_every` can be assigned later.

    Parameters
    ----------
    grains : Grains
        Initial state of the grains; copied.
    forces : Sequence[Force] or Force, optional
        Forces such as `[sand.Contact(), sand.Dipoles()]`, each type at most once; or a single force.
    box : Box or float or str, optional
        A box, or the side length of a periodic cube; open by default.
    stepping : Integrator or None, optional
        Integrator: `sand.Verlet()`, the default, `sand.Adaptive()`, `sand.ForestRuth()` or `sand.RigidClusters()`.
    neighbours : Neighbours or None, optional
        Settings of the neighbour search, `sand.Neighbours()` by default.
    seed : int or None, optional
        Seed of random forces, 0 … 2⁶³ − 1; saved with the run.
    out : str or Path or None, optional
        Folder for the run's files, created at the first `run`; with None nothing is written.
    overwrite : bool, optional
        Whether files of an earlier run in `out` may be replaced.
    observers : Iterable[Observer], optional
        Objects that are called during the run (see `sand.Observer`); they must not change the simulation.
    updaters : Iterable[Updater], optional
        Objects that change the simulation or end its run at regular moments (see `sand.Updater`).
    frame_every : float or str, optional
        When frames are written: a time between them [s], "1000 steps", or "log(10 per decade, from 1 ns)"; by default
        1/200 of each `run` that ends at a time.
    row_every : float or str or None, optional
        When rows are added to the ledger, in the same forms; every frame has a row in any case.
    checkpoint_every : float or str or None, optional
        When checkpoints are written, in the same forms or by wall time, "30 s wall"; by default at least every minute
        of wall time. The end of each `run` and an interruption write one in any case.
    walls : Sequence[Wall] or Wall, optional
        Walls to which grains stick.
    contacts : StrainedContacts or None, optional
        Initial contacts with their displacements, from `sand.setup.from_frame`.
    driven : Driven or Sequence[Driven], optional
        Grains with prescribed velocity and spin, such as `sand.Driven([0])`, which holds one.
    restart : tuple[dict[str, ndarray], dict[str, Any]] or None, optional
        Arrays and metadata of a checkpoint in `out` from which to continue; used by `sand.resume`.

    Raises
    ------
    BadInput
        If arguments are invalid or do not fit together; all problems at once, one line each.
    """

    def __init__(
        self,
        grains: Grains,
        forces: Sequence[Force] | Force = (),
        *,
        box: Any = None,
        stepping: Integrator | None = None,
        neighbours: Neighbours | None = None,
        seed: int | None = None,
        out: str | Path | None = None,
        overwrite: bool = False,
        observers: Iterable[Observer] = (),
        updaters: Iterable[Updater] | None = None,
        frame_every: Any = None,
        row_every: Any = None,
        checkpoint_every: Any = None,
        walls: Sequence[Wall] | Wall = (),
        contacts: StrainedContacts | None = None,
        driven: Any = (),
        restart: tuple[dict[str, np.ndarray], dict[str, Any]] | None = None,
    ):
        self.forces, self._walls = read_forces(forces), read_walls(walls)
        self.driven = read_driven(driven)
        self.box, self.neighbours = as_box(box), neighbours or Neighbours()
        self.seed = None if seed is None else seed_given(seed, bits=63)
        self.observers, self.frame_every = observers, frame_every
        self.updaters = () if updaters is None else updaters
        self.row_every, self.checkpoint_every = row_every, checkpoint_every
        self._choices_at_start: dict[str, str] = {}  # of a resumed run, from its checkpoint
        self.recipe: dict[str, Any] | None = None  # the [grains] table of the case file that described the grains
        self.origin = ""  # description of the file that the grains come from
        self.title = ""  # what a figure says instead of the numbers of grains
        self.planned: tuple[float, float, str | None] = (math.inf, math.inf, None)  # end of a resumed run
        self.start = grains.copy()
        integrator = Verlet() if stepping is None else checked_integrator(stepping)
        self.forces = fitting_forces(self.forces, integrator)
        parts = (grains, self.forces, self.box, integrator, self.neighbours, int(self.seed or 0))
        saved = None if restart is None else restart[0].get("cutoff")
        moved = (self.driven, self._walls)
        self._engine = build_engine(*parts, *moved, fresh=restart is None, contacts=contacts, cutoff=saved)
        self.stepping, self.neighbours = self._engine.stepping, self._engine.neighbours
        self.temperature = kinetic_temperature(grains)
        self.ledger = Ledger(
            [*(f.column for f, _, _ in self._engine.long_range), *(f.name for f in self._engine.external)],
            wall_columns(self._walls),
            rigid=self._engine.state.at_rest is not None,
        )
        written = None if restart is None else restart[1].get("case_in_file")
        self.writer = None if out is None else RunWriter(out, overwrite, restart is not None, written)
        self._clock, self._exclusive = WallClock(), Exclusive()
        self._measured: StepTimer | None = None
        self._has_begun = restart is not None
        # engine, counts of contacts, and numbers of clusters for these
        self._clusters: tuple[Any, Any, dict[str, float]] = (None, None, {})
        self._frame_times: list[float] = []  # [s], of all frames so far
        self._chosen: Chosen | None = None  # cadence of frames of the present or last run, if the user gives none
        self._met: tuple[Any, int] | None = None  # the condition that was met, and the step
        self._notes_shown: set[str] = set()  # kinds of notes that were shown as warnings
        self._warned: list[str] = []
        self._failure = ""  # why the simulation cannot continue
        self._updating = False  # whether an updater acts now
        self._changing = False  # whether the block of a `change` is open
        self._owed: tuple[int, list[int]] = (-1, [])  # step, and updaters that have still to act at it
        self._stops = False  # whether the updater that acts ends the run
        self._stopped_by = ""  # the updater that ended the last run
        self._next_id = len(grains)  # identity of the next grain that is added
        if restart is not None:
            arrays, meta = restart
            self._engine.load_state(arrays, meta.get("output_time"))
            self.temperature, self._clock = meta["temperature"], WallClock(meta["wall_seconds"], meta.get("wall_times"))
            self._choices_at_start, self._warned = meta.get("choices", {}), list(meta.get("warnings", []))
            self.origin = self._choices_at_start.get("start", "")
            self._next_id = int(meta.get("next_id", len(grains)))
            self._chosen = Chosen(*meta["chosen_cadence"]) if meta.get("chosen_cadence") else None
            check_updaters(updaters, self.updaters, meta.get("updaters", []))
            if "ledger" in arrays:  # a state without a ledger starts a new one
                self.ledger.from_array(arrays["ledger"], meta["ledger"])
                self._notes_shown = set(self._notes(self.ledger.rows))
                every_row = [row["time"] for row in self.ledger.rows]
                self._frame_times = arrays["frame_times"].tolist() if "frame_times" in arrays else every_row
            if meta.get("condition_met"):
                self._met = (meta["condition_met"], self.steps)
        else:
            self._warn_of_engine()
        self._engine.warnings.clear()
        self._built = True

    @property
    @exclusive
    def state(self) -> State:
        """State of the simulation at `time`: grains, contacts, box and clock."""
        return self._engine.state

    @property
    @exclusive
    def regular_state(self) -> State:
        """State after the last regular step, not later than `time`: that of checkpoints, from which a run continues."""
        return self._engine.regular_state

    @property
    def time(self) -> float:
        """Simulation time [s]."""
        return self._engine.time

    @property
    def steps(self) -> int:
        """Number of regular steps taken so far."""
        return self._engine.steps

    @property
    def wall_seconds(self) -> float:
        """Wall time spent in all calls of `run` so far, earlier processes included [s]."""
        return self._clock.total

    @property
    def wall_times(self) -> dict[str, float]:
        """Parts of `wall_seconds` [s]: start, stepping, output, compilation (also loading compiled code) and other."""
        return self._clock.parts

    @property
    @exclusive
    def is_sound(self) -> bool:
        """Whether the state is finite and the energy error is below the abort threshold."""
        return not self.ledger.runs_away(self._log_row())

    @property
    def met_condition(self) -> str | None:
        """The condition that ended the last run, if the simulation is still at that step; "given" for a function."""
        if self._met is None or self._met[1] != self.steps:
            return None
        return GIVEN if callable(self._met[0]) else str(self._met[0])

    @property
    @exclusive
    def grains(self) -> Grains:
        """State of the grains at `time`, as read-only arrays; to be read again after each run."""
        return self.state.grains

    @property
    @exclusive
    def contacts(self) -> ContactTable:
        """Table of the present contacts: displacements, shares of their limits, loads, energies and losses."""
        self._begin()
        return ContactTable(self.state, self._engine.law, self._engine._current_table(self.state))

    @property
    @exclusive
    def walls(self) -> tuple[WallState, ...]:
        """The walls at `time`: position, velocity, force, impulse, work, number of contacts."""
        self._begin()
        return wall_states(self._walls, self.state)

    @property
    @exclusive
    def choices(self) -> dict[str, str]:
        """Automatic choices with their reasons: boundary, cut-offs and neighbour search."""
        follower = self._engine.cutoff
        now = "" if follower is None else follower.present(self._engine.state)
        present = {"dipoles cut-off now": now} if now else {}
        if self._choices_at_start:
            return self._choices_at_start | present
        choices = {"start": self.origin} if self.origin else {}
        choices["boundary"] = self.box.describe()
        for force in self.forces:
            choose = getattr(force, "choose", None)
            if choose is not None:
                if follower is not None and force is follower.force:
                    radius, reason = follower.at_start
                else:
                    radius, reason = choose(self.start, self.box)
                length = "none" if radius is None else format_quantity(radius, "m")
                choices[f"{force.name} cut-off"] = f"{length} ({reason})"
        return choices | {"neighbours": self._engine.search} | present

    @exclusive
    def loads(self) -> dict[str, Any]:
        """Compute the present loads without taking a step.

        Returns
        -------
        dict[str, Any]
            `force` (N, 3) [N], `torque` (N, 3) [N m], `field` (N, 3) [T], and `energy`, a dictionary [J] by name.
        """
        self._begin()
        row = self._log_row()
        own = [*(f.column for f, _, _ in self._engine.long_range), *(f.name for f in self._engine.external)]
        names = dict.fromkeys(("normal", "sliding", "rolling", "twisting", "magnetic", *own))
        return {
            "force": self.grains.force.copy(),
            "torque": self.grains.torque.copy(),
            "field": self.grains.field.copy(),
            "energy": {name: row[name] for name in names},
        }

    @exclusive
    def at_grains(self) -> dict[str, np.ndarray]:
        """Compute flux density and energies of each grain.

        Returns
        -------
        dict[str, ndarray]
            `flux_density` (N, 3) [T] at the centres, from the other grains and from external fields. All others are
            energies (N,) [J] that sum to the columns of the ledger: `kinetic` (translation and rotation), `contacts`
            (half of each contact's elastic energy to each of its grains), and one for each long-range force (half of
            each pair energy; −½ μ·B for dipoles) and each per-grain force, under the names of their columns.
        """
        state, grains, contacts = self.state, self.grains, self.contacts
        external = [
            at(state.time) for force in self._engine.external if (at := getattr(force, "flux_density_at", None))
        ]
        flux = np.sum([grains.field, *(np.broadcast_to(b, grains.field.shape) for b in external)], axis=0)
        half = 0.5 * np.sum([contacts[name] for name in ELASTIC], axis=0)
        elastic = np.zeros(len(grains))
        for side in range(2):
            np.add.at(elastic, contacts["pair"][:, side], half)
        energies = {"kinetic": np.add(*kinetic_energies(grains)), "contacts": elastic}
        return {"flux_density": flux} | energies | self._engine.energies_at_grains()

    @exclusive
    @checked
    def run(self, until: Any = None, *, steps: Any = None, stop: Any = None) -> Result:
        """Run until a time, for a number of steps, or until a condition is met, whichever comes first.

        Parameters
        ----------
        until : float or str or callable, optional
            Absolute simulation time [s]; the state at the end of the run is that at exactly this time. Or a function,
            as for `stop`. A resumed run ends at its planned end by default.
        steps : int, optional
            Number of further steps, at least 1; a started r-RESPA cycle (`Verlet.far`) is completed.
        stop : str or callable, optional
            A condition that ends the run: columns of the ledger, compared with numbers with units, joined by `and`,
            `or` and parentheses, such as "mean_cluster_size >= 20 and time > 1 us"; or a function of the simulation
            that returns True or False and changes nothing. It is checked at the regular steps 0, 100, 200, …, or the
            ends of the r-RESPA cycles in which these lie, and so at moments that depend neither on output nor on
            interruptions. `wall` is the wall time of this call: where a condition holds only because of it, as "wall >
            23 h" does, the outcome is `WALL_TIME`, and the run can be resumed with the bits of an uninterrupted one.

        Returns
        -------
        Result
            Why and when the run ended.

        Raises
        ------
        BadInput
            If there is no stop criterion, one is out of range, or the run's folder cannot be used.
        FilesFailed
            If a file cannot be written, for example because the disk is full; files written before stay intact.
        Interrupted
            After Ctrl-C, SIGTERM, SIGUSR1, SIGUSR2, SIGHUP or SIGXCPU, when the checkpoint is written.
        """
        if self._failure:
            raise BadInput(f"this simulation cannot continue: {self._failure}")
        if self._clock.runs:
            raise BadInput("this simulation runs already; an updater or observer cannot call run")
        if self._changing:
            raise BadInput("run within `with sim.change()` is not possible; end the block first")
        criteria = stop_criteria(until, steps, stop, self.time, self.steps, self.planned)
        end, _, condition = criteria
        if condition is not None and not isinstance(condition, OwnCondition):
            condition.check(self.ledger.columns)
        self._chosen = chosen_cadence(self.time, end, self._chosen)
        try:
            with self._clock.run():
                with self._clock.measure("start"):
                    self._begin()
                    if self.writer:
                        self.writer.open(self, criteria)
                with Signals() as signals:
                    try:
                        outcome = run_loop(self, criteria, signals, self._timer)
                        self._timer.record()
                    finally:
                        self._engine.restore_user_order()
            return self._close(outcome, criteria)
        except FilesFailed as error:
            if self.writer:
                self.writer.rescue()
            self._failure = f"its files could not be written ({error}); continue with sand.resume, or start again"
            raise
        finally:
            if self.writer:
                self.writer.release()

    def stop(self) -> None:
        """End the present run; for the `act` of an updater, which may return True instead.

        Raises
        ------
        BadInput
            Outside of `act`.
        """
        if not self._updating:
            raise BadInput("stop ends a run from the act of an updater only; to end a run: run(until=…, stop=…)")
        self._stops = True

    @contextlib.contextmanager
    def change(self) -> Iterator[Change]:
        """Change grains, their velocities, spins, moments or charges, the box, or forces, at the present time.

        The change is made at the end of the `with` block, or not at all if an exception is raised in it. The change of
        the energy is the work of the user: it is added to `lost_outside`, with the opposite sign. The run continues
        from the state at `time`, also where no regular step ends. During a run, only an `Updater` may change it.

        Grains that stay keep the state of their contacts; contacts of removed grains vanish, and are not counted as
        broken. Automatic cut-offs stay as they were chosen, except those of an Ewald sum and of dipoles whose cut-off
        follows the clusters; a force given to `replace` has its cut-off chosen for the changed grains and box.

        Yields
        ------
        Change
            Arrays `velocity`, `spin`, `moment`, `charge` and own quantities (`change.own`), the `box`, and `remove`,
            `add`, `scale_box`, `replace`. A change of own quantities alone leaves the motion as it is, bit by bit.

        Raises
        ------
        BadInput
            If grains do not exist, overlap or lie outside the box, no grain would remain, a quantity is out of range,
            a force has no column in the ledger, or the contact model differs; all problems at once.
        """
        if self._failure:
            raise BadInput(f"this simulation cannot be changed: {self._failure}")
        if self._clock.runs and not self._updating:
            raise BadInput("a simulation that runs can be changed by an updater only: Simulation(updaters=[…])")
        if self._changing:
            raise BadInput("a change within a change is not possible; make both in one block of `with sim.change()`")
        with self._exclusive.held("change"):
            self._changing = True
            try:
                yield from self._change()
            finally:
                self._changing = False

    def _change(self) -> Iterator[Change]:
        """The change that the user makes, and its effect at the end of the block."""
        self._begin()
        present = tuple(as_chosen(force, self.start, self.box) for force in self.forces)
        pair = self.state.contacts.pair[:, : self.state.count[CONTACTS]].T.copy()
        change = Change(self.grains, present, self.box, pair, self._next_id)
        yield change
        if change.is_of_own:
            own = change.checked_grains().arrays.own
            for grains in (self._engine.state.grains, self._engine.regular_state.grains, self.start):
                grains.arrays.own[...] = own
            if self.writer:
                self.writer.changed(self)
            return
        seed, fixed = int(self.seed or 0), (self.driven, self._walls)
        engine, forces, driven = changed_engine(change, present, self._engine, self.ledger.columns, seed, *fixed)
        before = self._log_row()["total"]
        self._engine, self._next_id = engine, change._next_id
        start = self.grains.copy()
        for name, value in {"forces": forces, "box": change.box, "driven": driven, "start": start}.items():
            object.__setattr__(self, name, value)
        for text in truncation_warnings(self.grains, forces, change.box):
            self._warn(text, text.partition(",")[0])
        self._choices_at_start = {}  # chosen anew
        if change.regroups:  # the description of the grains in a case file no longer holds
            self.recipe = None
        engine.regular_state.lost[OUTSIDE] += before - self._log_row()["total"]
        if self.writer:
            self.writer.changed(self)

    @exclusive
    @checked
    def view(self, path: str | Path | None = None) -> Any:
        """Show the grains in motion: a widget in a notebook with anywidget, otherwise a page in the browser.

        Parameters
        ----------
        path : str or Path or None, optional
            File of the page; by default view.html in the run's folder, or in a temporary one.

        Returns
        -------
        Any
            The widget, or the path of the page; where the installation lacks the page, the figure, with a warning.
        """
        self._begin()
        return DISPLAYS["view"](self, path)

    @exclusive
    def figure(self) -> Any:
        """Draw the run so far: S(t), energies and losses, the aggregates in 3-D (matplotlib)."""
        self._begin()
        return DISPLAYS["figure"](self)

    @exclusive
    def copy(self) -> Simulation:
        """Return an independent simulation in memory, which continues with the same bits.

        It has the state, the ledger and the settings of this one, but no observers, and writes no files.
        """
        memo: dict[int, Any] = {}
        other = object.__new__(type(self))
        for name, value in vars(self).items():
            given = (
                None if name in ("writer", "_measured") else [] if name == "observers" else copy.deepcopy(value, memo)
            )
            object.__setattr__(other, name, given)
        other._clock.end()  # of a simulation that runs, in an observer
        object.__setattr__(other, "_updating", False)
        return other

    @exclusive
    def status(self) -> str:
        """Describe the simulation in one line: time, steps, contacts, clusters, energy error and speed."""
        self._begin()
        row = self._log_row()
        parts = [
            f"t = {format_quantity(self.time, 's')}",
            f"{self.steps} steps",
            f"{row['contacts']} contacts",
            f"{row['clusters']} clusters",
            f"largest {row['largest_cluster']}",
            f"energy error {self.ledger.with_row(row).drift:.2g}",
        ]
        if self._clock.stepping > 0.0 and self.steps:
            parts.append(f"{self.steps / self._clock.stepping:.2g} steps/s")
        return ", ".join(parts)

    def __repr__(self) -> str:
        names = ", ".join(force.name for force in self.forces) or "no forces"
        return (
            f"<simulation of {len(self.start)} grains ({names}) at t = {format_quantity(self.time, 's')} "
            f"after {self.steps} steps>"
        )

    def notes(self) -> list[str]:
        """What the run so far says about its own set-up, one text each.

        Contacts that vibrate, contacts that broke, and a cut-off of dipoles that half the box came to limit.
        """
        follower = self._engine.cutoff
        limited = "" if follower is None else follower.note(self.state)
        return [*self._notes(self.ledger.rows).values(), *([limited] if limited else [])]

    @property
    def warnings(self) -> list[str]:
        """Texts of the warnings about this run so far, also before it was resumed; each is shown once."""
        return list(self._warned)

    def _warn(self, text: str, about: str = "") -> None:
        """Warn once of each text, and of one text that begins with `about`; of these the latest is kept."""
        earlier = [k for k, one in enumerate(self._warned) if one == text or (about and one.startswith(about))]
        if earlier:
            self._warned[earlier[0]] = text
            return
        self._warned.append(text)
        warn(text)

    def _warn_of_engine(self) -> None:
        while self._engine.warnings:
            self._warn(self._engine.warnings.pop(0))
        for about, text in extreme_warnings(self._engine.clock).items():
            self._warn(text, about)

    def _notes(self, rows: Sequence[dict[str, float]]) -> dict[str, str]:
        damped = any(isinstance(force, Contact) and force.damping != "none" for force in self.forces)
        return vibration_notes(rows, self.temperature, len(self.start), damped=damped)

    def _begin(self) -> None:
        if not self._has_begun:
            self._engine.begin()
            self._has_begun = True
            self._record_output()

    @property
    def _timer(self) -> StepTimer:
        """What measures the cost of the runs; a new one after a change of forces."""
        if self._measured is None or not self._measured.is_valid:
            self._measured = StepTimer(self)
        return self._measured

    def _log_row(self) -> dict[str, float]:
        engine = self._engine
        found = engine.losses().tolist(), self._cluster_numbers(), engine.body_motion()
        energies = engine.contact_energies(), engine.force_energies()
        row = log_row(self.state, *found, *energies, wall_columns(self._walls))
        return dict.fromkeys(self.ledger.columns, 0.0) | row  # 0 for forces that a change left out

    def _cluster_numbers(self) -> dict[str, float]:
        """Numbers of clusters, found anew after contacts have formed or broken."""
        state, engine = self.state, self._engine
        key = (len(state.grains), *(int(state.count[k]) for k in (CONTACTS, MADE, BROKEN)))
        if self._clusters[:2] != (engine, key):
            self._clusters = engine, key, cluster_numbers(state)
        return self._clusters[2]

    def _count_row(self) -> dict[str, float]:
        """The part of a row of the ledger that needs no energies."""
        return count_row(self.state, self._cluster_numbers())

    def _record_output(self, with_frame: bool = True) -> None:
        """Add a row to the ledger, write it, with a frame or without, and call the observers."""
        with self._clock.measure("output"):
            self._write_output(with_frame)

    def _write_output(self, with_frame: bool) -> None:
        row = self._log_row()
        if not self.ledger.add(row):
            return
        if with_frame:
            self._frame_times.append(row["time"])
        for about, text in grain_warnings(self.grains, self.forces).items():
            if not any(one.startswith(about) for one in self._warned):
                self._warn(text)
        for kind, text in self._notes([self.ledger.rows[0], row]).items():
            if kind not in self._notes_shown:
                self._warn(text)
                self._notes_shown.add(kind)
        if self.writer:
            self.writer.write(self, row, with_frame)
        for observer in self.observers:
            observer.see(self, row)

    def _close(self, outcome: Outcome, criteria: StopCriteria) -> Result:
        grains = self._engine.limiting_grains() if outcome.is_physics else ()
        if outcome is Outcome.RUNAWAY:
            grains = tuple(sorted(np.argsort(np.add(*kinetic_energies(self.grains)))[-2:].tolist()))
        if outcome.is_physics:
            self._record_output()
        ledger = self.ledger.with_row(self._log_row())
        self._warn_of_engine()
        if is_mostly_awake(self):
            self._warn("clusters were awake most of the time: clusters = 'grains' (sand.Verlet) costs no more")
        if self.regular_state.count[LATE]:
            self._warn("grains of two bodies overlapped before their touch was seen; halve step_fraction in [stepping]")
        met = (self._stopped_by or criteria.stop or "") if outcome is Outcome.CONDITION_MET else ""
        result = Result(outcome, self.steps, self.time, ledger.drift, grains, met)
        if self.writer:
            self.writer.close(self, result, ledger)
        for observer in self.observers:
            observer.close(self, result)
        if outcome is Outcome.INTERRUPTED:
            raise Interrupted(result)
        return result
