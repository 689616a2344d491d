"""The simulation object: composes forces, box and integrator, and runs them."""

from __future__ import annotations

import contextlib
import copy
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.box import Box, as_box
from ..basics.errors import BadInput, FilesFailed
from ..basics.grains import Grains
from ..basics.initial_pairs import StrainedContacts
from ..basics.state import State
from ..basics.temperature import kinetic_temperature
from ..basics.units import format_quantity, seed_given
from ..components import components_of, read_components
from ..components.deformation import Deformation
from ..components.driven import Driven
from ..components.walls import Wall, WallState, wall_states
from ..contact.model import Contact
from ..engine.assemble import build_engine, fitting_forces
from ..engine.component import Component, in_use
from ..engine.measures import force_columns, refuse_forces_without_virial
from ..forces.base import Force
from ..integrate.integrator import Integrator
from ..integrate.registry import checked_integrator
from ..integrate.verlet import Verlet
from ..limits.solid_limits import grain_warnings
from ..neighbours.search import Neighbours
from .cadence import Chosen, chosen_cadence
from .change import Change
from .changed_engine import changed
from .choices import choices_of
from .condition import GIVEN, Condition
from .contact_table import Contacts, ContactTable
from .cost.cost import Cost, StepTimer, expected_cost
from .displays import DISPLAYS
from .exclusive import Exclusive, exclusive
from .grain_quantities import loads_of, quantities_at_grains
from .ledger import Ledger
from .observers import Observer
from .outcome import Result
from .run_loop import Continuation, RunLoop
from .run_warnings import RunWarnings
from .run_writer import RunWriter
from .settings import Origin, Output, ReadOnlySettings, held_by, read_forces
from .signals import Signals
from .stop import stop_criteria
from .stress import Stress, check_stress_rows, stress_of, volume_of
from .updater import Updater, check_updaters
from .vibration import vibration_notes
from .wall_clock import WallClock


@dataclass(frozen=True)
class System:
    """What is simulated; a change replaces it.

    Attributes
    ----------
    start : Grains
        The grains at the start, or after the last change.
    next_id : int
        Identity of the next grain that is added.
    """

    start: Grains
    forces: tuple[Force, ...]
    box: Box
    stepping: Integrator
    neighbours: Neighbours
    seed: int | None
    given: dict[str, Component]
    next_id: int


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
        Integrator: `sand.Verlet()`, the default, `sand.RigidClusters()`, or one of your own.
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
    deformation : Deformation or None, optional
        How a periodic box is deformed, such as `sand.Deformation("-1e4 1/s")`; velocities of grains are then those
        relative to its flow.
    stress : bool, optional
        Whether rows of the ledger have the pressure tensor, and frames the shares of the grains in it: see `stress`.
    restart : tuple[dict[str, ndarray], dict[str, Any]] or None, optional
        Arrays and metadata of a checkpoint in `out` from which to continue; used by `sand.resume`.

    Raises
    ------
    BadInput
        If arguments are invalid or do not fit together; all problems at once, one line each.
    """

    forces: tuple[Force, ...] = held_by("_system", "forces", "Forces of the simulation.")
    stepping: Integrator = held_by("_system", "stepping", "Integrator.")
    neighbours: Neighbours = held_by("_system", "neighbours", "Settings of the neighbour search, as resolved.")
    seed: int | None = held_by("_system", "seed", "Seed of random forces.")
    start: Grains = held_by("_system", "start", "Grains at the start, or after the last change.")
    observers: list[Observer] = held_by("_output", "observers", "Observers; assignable.")
    updaters: list[Updater] = held_by("_output", "updaters", "Updaters; assignable.")
    frame_every: float | str | None = held_by("_output", "frame_every", "When frames are written; assignable.")
    row_every: float | str | None = held_by("_output", "row_every", "When rows are added; assignable.")
    checkpoint_every: float | str | None = held_by("_output", "checkpoint_every", "When checkpoints are written.")
    temperature: float = held_by("_origin", "temperature", "Kinetic temperature at the start [K].")
    recipe: dict[str, Any] | None = held_by("_origin", "recipe", "Table [grains] of the case file.")
    origin: str = held_by("_origin", "origin", "Description of the file that the grains come from.")
    title: str = held_by("_origin", "title", 'Title of the figure; "": the numbers of grains.')
    planned: tuple[float, float, str | None] = held_by("_origin", "planned", "Planned end: time [s], step, condition.")

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
        deformation: Deformation | None = None,
        stress: bool = False,
        restart: tuple[dict[str, np.ndarray], dict[str, Any]] | None = None,
    ):
        given = read_components(walls=walls, driven=driven, deformation=deformation)
        forces, box = read_forces(forces), as_box(box)
        seed = None if seed is None else seed_given(seed, bits=63)
        self._output = Output(observers, frame_every, () if updaters is None else updaters, row_every, checkpoint_every)
        integrator = Verlet() if stepping is None else checked_integrator(stepping)
        forces = fitting_forces(forces, integrator)
        extra = components_of(given, forces, grains, box)
        parts = (grains, forces, box, integrator, neighbours or Neighbours(), int(seed or 0), extra)
        arrays, meta = ({}, {}) if restart is None else restart
        is_new = restart is None
        self._engine = engine = build_engine(*parts, fresh=is_new, contacts=contacts, saved=arrays)
        fitted = engine.stepping, engine.neighbours
        self._system = System(grains.copy(), forces, box, *fitted, seed, given, meta.get("next_id", len(grains)))
        self._origin = Origin(meta.get("temperature", kinetic_temperature(grains)), choices=meta.get("choices", {}))
        self._origin.origin = self._origin.choices.get("start", "")
        awake = engine.state.at_rest is not None
        self.ledger = Ledger(force_columns(engine), in_use(given), awake=awake, stress=stress)
        if stress:
            check_stress_rows(engine)
        self.writer = None if out is None else RunWriter(out, overwrite, not is_new, meta.get("case_in_file"))
        self._clock, self._exclusive = WallClock(meta.get("wall_seconds", 0.0), meta.get("wall_times")), Exclusive()
        self._measured: StepTimer | None = None
        self._has_begun = not is_new
        self._warnings, self._continuation = RunWarnings(meta.get("warnings", [])), Continuation()
        self._run: RunLoop | None = None  # the present run
        if is_new:
            self._warnings.take(engine)
        else:
            self._continue(arrays, meta)
            check_updaters(updaters, self.updaters, meta.get("updaters", []))
        engine.warnings.clear()
        self._built = True

    def _continue(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        """Take state, ledger and what runs leave for the next one from a checkpoint."""
        self._engine.load_state(arrays, meta.get("output_time"))
        if meta.get("chosen_cadence"):
            self._continuation.chosen = Chosen(*meta["chosen_cadence"])
        if meta.get("condition_met"):
            self._continuation.met = (meta["condition_met"], self.steps)
        if "ledger" in arrays:  # a state without a ledger starts a new one
            self.ledger.from_array(arrays["ledger"], meta["ledger"], arrays.get("frame_times"))
            self._warnings.kinds = set(self._notes(self.ledger.rows))

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
        condition, step = self._continuation.met or (None, -1)
        if step != self.steps:
            return None
        return GIVEN if callable(condition) else str(condition)

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
        return ContactTable(self.state, self._engine.law, self._engine.table_of(self.state))

    @property
    @exclusive
    def walls(self) -> tuple[WallState, ...]:
        """The walls at `time`: their motion, force, impulse, work, contacts, pressure, gap, and filling factor."""
        self._begin()
        return wall_states(self._system.given["walls"].items, self.state)

    @property
    @exclusive
    def wall_contacts(self) -> Contacts:
        """Table of the present contacts with walls: columns by name, (C,) or (C, 3), as of `contacts`.

        `grain` and `wall` are indices of grains and of `walls`, `force` [N] and `torque` [N m] act on the grain.
        """
        self._begin()
        walls: Any = self._system.given["walls"]
        return Contacts(*walls.contact_table(self.state, self._engine.law, self._engine.table_of(self.state)))

    @property
    def driven(self) -> tuple[Driven, ...]:
        """The grains with prescribed motion."""
        return self._system.given["driven"].items

    @property
    def deformation(self) -> Deformation | None:
        """How the box is deformed; None if it is not."""
        return next(iter(self._system.given["deformation"].items), None)

    @property
    @exclusive
    def box(self) -> Box:
        """Box at `time`."""
        return self._engine.box

    @property
    @exclusive
    def strain_rate(self) -> np.ndarray:
        """Present rates of strain A (3, 3) [1/s] of the box: velocities in the laboratory are velocity + A position."""
        rates, cell = np.zeros((3, 3)), self.state.cell
        if cell is not None:
            rates[(0, 1, 2, 0), (0, 1, 2, 2)] = cell.span[[6, 7, 8, 10]]
        return rates

    @property
    @exclusive
    def choices(self) -> dict[str, str]:
        """Automatic choices with their reasons: boundary, cut-offs and neighbour search."""
        return choices_of(self)

    @exclusive
    def loads(self) -> dict[str, Any]:
        """Compute the present loads without taking a step.

        Returns
        -------
        dict[str, Any]
            `force` (N, 3) [N], `torque` (N, 3) [N m], `field` (N, 3) [T], and `energy`, a dictionary [J] by name.
            Those of contacts are left out on grains of clusters that move as rigid bodies.
        """
        self._begin()
        return loads_of(self)

    @exclusive
    @checked
    def stress(self, volume: Any = None) -> Stress:
        """Compute the present stress: a pressure tensor P = W/V, positive in compression.

        W is the sum of these virials [J], with the nearest images l and r of separations, and forces f and F on the
        first grain of a pair:

            contacts        W_ab = Σ l_a f_b, dashpots included
            kinetic         W_ab = Σ m v_a v_b, relative to the box; in boxes without walls, along open axes, to the
                            centre of mass
            walls           W_ab = Σ h n_a F_b, with h n from the wall to the centre of the grain
            pair forces     W_ab = Σ r_a F_b, cut-offs included
            Ewald sums      of all images: real part as pairs, and the reciprocal part, W_ab = −∂U/∂ε_ba

        It is that of one instant, which oscillates as contacts vibrate: means over time are those of equilibrium.
        Forces of fields and of a gas on single grains have no part in it. The trace of W is 3U for the energy U of
        dipoles, and U for charges and gravitation, if they are summed without a smooth cut-off.

        Parameters
        ----------
        volume : float or str, optional
            V [m³]; by default that of the periodic box, or between two walls that face each other across the only open
            axis. In other boxes it has to be given.

        Returns
        -------
        Stress
            `total` and `parts` (3, 3) [Pa], `pressure` [Pa], `volume` [m³], `asymmetry` (3,) [Pa], and the couple
            stress of the contacts, `couple` (3, 3) [N/m].

        Raises
        ------
        BadInput
            If no volume is known, or a force is summed by a tree, or by loops of your own without a virial.

        Notes
        -----
        Contacts: Love 1927; Weber 1966, Bull. Liaison P. et Ch. 20, 3; Christoffersen, Mehrabadi &
        Nemat-Nasser 1981, J. Appl. Mech. 48, 339. Ewald sums: Nosé & Klein 1983, Mol. Phys. 50, 1055; Aguado & Madden
        2003, J. Chem. Phys. 119, 7471. In clusters at rest, with `sand.RigidClusters`, the forces of
        contacts are those with which all grains move as one rigid body.
        """
        size = volume_of(self._engine, volume)
        refuse_forces_without_virial(self._engine)
        self._begin()
        return stress_of(self._engine, size)

    @exclusive
    def at_grains(self) -> dict[str, np.ndarray]:
        """Compute flux density, share of the virial of contacts, and energies of each grain.

        Returns
        -------
        dict[str, ndarray]
            `flux_density` (N, 3) [T] at the centres, from the other grains and from external fields. `virial` (N, 3, 3)
            [J], the share in the virial of contacts and walls (`stress`): of each contact, force times the arm from the
            point that divides the distance of the centres as the radii. Over the volume of the grain it is the mean
            pressure tensor in it. All others are energies (N,) [J] that sum to the columns of the ledger: `kinetic`
            (translation and rotation), `contacts` (half of each contact's elastic energy to each of its grains), and
            one for each long-range force (half of each pair energy; −½ μ·B for dipoles) and each per-grain force, under
            the names of their columns.
        """
        return quantities_at_grains(self)

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
            Number of further steps, at least 1; the last r-RESPA cycle (`Verlet.far`) is completed.
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
        last = self._continuation
        if last.failure:
            raise BadInput(f"this simulation cannot continue: {last.failure}")
        if self._clock.runs:
            raise BadInput("this simulation runs already; an updater or observer cannot call run")
        if "change" in self._exclusive:
            raise BadInput("run within `with sim.change()` is not possible; end the block first")
        criteria = stop_criteria(until, steps, stop, self.time, self.steps, self.planned)
        if isinstance(criteria.condition, Condition):
            criteria.condition.check(self.ledger.columns)
        last.chosen = chosen_cadence(self.time, criteria.time, last.chosen)
        try:
            with self._clock.run():
                with self._clock.measure("start"):
                    self._begin()
                    if self.writer:
                        self.writer.open(self, criteria)
                with Signals() as signals:
                    self._run = RunLoop(self, criteria, signals)
                    try:
                        outcome = self._run.run()
                        self._timer.record()
                    finally:
                        self._engine.restore_user_order()
            return self._run.close(outcome)
        except FilesFailed as error:
            if self.writer:
                self.writer.rescue()
            last.failure = f"its files could not be written ({error}); continue with sand.resume, or start again"
            raise
        finally:
            self._run = None
            if self.writer:
                self.writer.release()

    def stop(self) -> None:
        """End the present run; for the `act` of an updater, which may return True instead.

        Raises
        ------
        BadInput
            Outside of `act`.
        """
        if self._run is None or not self._run.updates.acting:
            raise BadInput("stop ends a run from the act of an updater only; to end a run: run(until=…, stop=…)")
        self._run.updates.stops = True

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
            Arrays `velocity`, `spin`, `moment`, `charge` and own quantities (`change.own`), the `box`, its
            `deformation`, and `remove`, `add`, `scale_box`, `replace`. A change of own quantities alone leaves the
            motion as it is, bit by bit.

        Raises
        ------
        BadInput
            If grains do not exist, overlap or lie outside the box, no grain would remain, a quantity is out of range,
            a force has no column in the ledger, or the contact model differs; all problems at once.
        """
        if self._continuation.failure:
            raise BadInput(f"this simulation cannot be changed: {self._continuation.failure}")
        if self._clock.runs and not (self._run and self._run.updates.acting):
            raise BadInput("a simulation that runs can be changed by an updater only: Simulation(updaters=[…])")
        if "change" in self._exclusive:
            raise BadInput("a change within a change is not possible; make both in one block of `with sim.change()`")
        with self._exclusive.held("change"):
            self._begin()
            yield from changed(self)

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
        memo: dict[int, Any] = {id(self.observers): []}
        other = object.__new__(type(self))
        for name, value in vars(self).items():
            left_out = name in ("writer", "_measured", "_run")
            object.__setattr__(other, name, None if left_out else copy.deepcopy(value, memo))
        other._clock.end()  # of a simulation that runs, in an observer
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
        if (seconds := self.wall_times["stepping"]) > 0.0 and self.steps:
            parts.append(f"{self.steps / seconds:.2g} steps/s")
        return ", ".join(parts)

    def expected_cost(self, end: float = math.inf, last_step: float = math.inf, condition: str | None = None) -> Cost:
        """Expected steps, wall time, memory and disk space of a run that has not begun, as `sand info` says.

        Parameters
        ----------
        end, last_step : float, optional
            Planned end: time [s] and step, infinite where not set.
        condition : str or None, optional
            Condition that may end it earlier.
        """
        return expected_cost(self, end, last_step, condition)

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
        found = [text for each in self._engine.components for text in each.notes(self.state)]
        return [*self._notes(self.ledger.rows).values(), *found]

    @property
    def warnings(self) -> list[str]:
        """Texts of the warnings about this run so far, also before it was resumed; each is shown once."""
        return list(self._warnings.texts)

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

    @property
    @exclusive
    def present_ledger(self) -> Ledger:
        """The ledger with a row of the present state as its last one."""
        return self.ledger.with_row(self._log_row())

    def _log_row(self) -> dict[str, float]:
        return self.ledger.row_of(self._engine)

    def _record_output(self, with_frame: bool = True) -> None:
        """Add a row to the ledger, write it, with a frame or without, and call the observers."""
        with self._clock.measure("output"):
            self._write_output(with_frame)

    def _write_output(self, with_frame: bool) -> None:
        row = self._log_row()
        if not self.ledger.add(row, with_frame):
            return
        notes = grain_warnings(self.grains, self.forces) | self._notes([self.ledger.rows[0], row])
        for kind, text in notes.items():
            self._warnings.show_first(kind, text)
        if self.writer:
            self.writer.write(self, row, with_frame)
        for observer in self.observers:
            observer.see(self, row)
