"""Output of a run: which files are written to its folder, and when."""

from __future__ import annotations

import contextlib
import math
import platform
from importlib import metadata
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from ..basics.errors import BadInput, FilesFailed
from ..basics.paths import user_path
from ..basics.state import CLOCK, CONTACT_STEPS, COUNT, CUTOFF, GRAINS_AWAKE, LARGEST_OVERLAP, LOST, PHASE
from ..basics.version import __version__
from ..compiler.jit import cache_folder
from ..io import run_folder as files
from ..io.checkpoint import write_checkpoint
from ..io.checkpoint_files import checkpoint_files
from ..io.damage import sealed
from ..io.ledger_table import TEMPERATURES, LedgerFile, keep_if_damaged
from ..io.lock import FolderLock
from ..io.run_folder import make_folder, plain, read_json, write_json, write_toml
from ..io.trajectory import TrajectoryWriter
from .contact_table import measured_columns
from .displays import DISPLAYS
from .grain_quantities import virials_of
from .in_words import forces_in_words, grains_in_words
from .ledger import Ledger
from .outcome import UNFINISHED, Result
from .serialise import case_of
from .signals import Signals
from .stop import StopCriteria
from .updater import described

Simulation = Any
"""`sand.Simulation`, which imports this module."""
LONG_RUN = 100_000
"""Contact steps from which on a run with rigid clusters tells that its clusters were awake most of the time."""
CHECKPOINT_EVERY = 60.0
"""Longest wall time [s] between checkpoints."""
AT_OUTPUT_EVERY = 1.0
"""Shortest wall time [s] between checkpoints at outputs; longer where they would take more than COST of the time."""
COST = 0.01
"""Largest part of the wall time spent on checkpoints at outputs."""


class RunWriter:
    """Writes case.toml, trajectory.gsd, ledger.csv, checkpoints, summary.json and the figure.

    A lock keeps all other processes and simulations from writing to the folder during each `run`, from `open` to
    `release`.

    Parameters
    ----------
    out : str or Path
        The folder.
    overwrite : bool, optional
        Whether files of an earlier run in it may be replaced.
    resumed : bool, optional
        Whether the folder is that of this run, which continues.
    written : dict or None, optional
        The case in its case.toml, where it may differ from the present one.
    """

    def __init__(
        self, out: str | Path, overwrite: bool = False, resumed: bool = False, written: dict[str, Any] | None = None
    ):
        self.folder = user_path(out) if resumed else make_folder(out, overwrite=overwrite)
        self._resumed = resumed
        self.draws = True  # a figure at the end of each `run`
        self._trajectory: TrajectoryWriter | None = None
        self._ledger: LedgerFile | None = None
        self._saved, self._took = monotonic(), 0.0
        self._ends: tuple[float, float, str | None] = (math.inf, math.inf, None)
        self._case: dict[str, Any] = {}
        self._lock: FolderLock | None = None
        self._changed = False  # by the user or an updater since case.toml was written
        self._written = written  # the case in case.toml
        kept = checkpoint_files(self.folder) if resumed else []
        # the checkpoint from which this simulation continues, or the last one that it wrote
        self._own: tuple[str, int] | None = _stamp(kept[-1]) if kept else None

    def open(self, simulation: Simulation, criteria: StopCriteria) -> None:
        """Create the files or continue them; called by each `run` with its stop criteria.

        Raises
        ------
        BadInput
            If another process or simulation writes to the folder, or has written to it since this one did.
        FilesFailed
            If a file cannot be written.
        """
        self._lock = FolderLock(self.folder)
        self._refuse_others_files(simulation.steps)
        before, self._ends = plain(self._case), (criteria.time, criteria.step, criteria.stop)
        self._case = case_of(simulation, *self._ends)
        case = plain(self._case)
        # by a change, or by a setting such as `frame_every`
        changed, self._changed = self._changed or _without_ends(case) != _without_ends(before), False
        if self._trajectory is None:
            self._open_files(simulation)
        elif changed:
            self.save(simulation)
        # after the checkpoint, which names the case in the file before, so that one of both fits
        if changed or case != before:
            write_toml(self.folder / files.CASE, case, "the complete case in SI units, with all defaults")
            self._written = case

    def _open_files(self, simulation: Simulation) -> None:
        """Open ledger and trajectory, or create them, and write a checkpoint."""
        if self._resumed:
            self._clean_up_earlier(simulation)
        self._stop_beside_others()
        self._ledger = LedgerFile(self.folder / files.LEDGER, simulation.ledger.columns, simulation.ledger.rows)
        times = simulation.ledger.frame_times
        resumed_at = (times[-1] if times else -math.inf) if self._resumed else None
        self._trajectory = TrajectoryWriter(
            self.folder / files.TRAJECTORY, resumed_at, times, simulation._warnings.show
        )
        if not self._resumed:
            self._frame(simulation)
        self.save(simulation)

    def changed(self, simulation: Simulation) -> None:
        """Note that the user or an updater changed the simulation: the next `open` writes case.toml and a checkpoint.

        Checkpoints have the changed case at once, so that at any time one of them and case.toml fit together.
        """
        self._changed = True
        if self._case:
            self._case = case_of(simulation, *self._ends)

    def release(self) -> None:
        """Close the ledger and release the lock of the folder; the next row and `open` take them again."""
        Signals.saving.discard(self)
        if self._ledger is not None:
            self._ledger.close()
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    def _refuse_others_files(self, steps: int) -> None:
        """Raise BadInput if the folder holds files that this simulation, at step `steps`, did not write."""
        begun = self._resumed or self._trajectory is not None
        kept = checkpoint_files(self.folder)
        begun_by_others = not begun and (self.folder / files.TRAJECTORY).exists()
        strange = _stamp(kept[-1]) != self._own if kept else begun_by_others
        if strange:
            advice = "continue its run with sand.resume" if begun else "give another folder"
            raise BadInput(f"another run has written to {self.folder} since this simulation was created; {advice}")

    def _stop_beside_others(self) -> None:
        """Raise BadInput if another process has begun to write to the folder, where the file system has no locks."""
        kept = [_stamp(path) for path in checkpoint_files(self.folder)[-1:]]
        taken = self._lock is not None and not self._lock.is_held
        if taken or (self._own is not None and kept and kept[0] > self._own):
            raise BadInput(
                f"another process has begun to write to {self.folder}, whose file system has no locks; this run stops "
                "and writes nothing more to it. Continue the other one when it has ended: sand resume"
            )

    def _clean_up_earlier(self, simulation: Simulation) -> None:
        """Of a resumed run: keep a copy of a damaged ledger, and delete a summary of steps that are taken again."""
        try:
            ledger = simulation.ledger
            keep_if_damaged(self.folder / files.LEDGER, ledger.columns, ledger.rows, simulation._warnings.show)
            with contextlib.suppress(BadInput):
                steps = read_json(self.folder / files.SUMMARY).get("steps")
                if isinstance(steps, int) and steps > simulation.steps:
                    (self.folder / files.SUMMARY).unlink()
        except OSError as error:
            raise FilesFailed(f"cannot write to folder {self.folder}: {error.strerror}") from error

    def write(self, simulation: Simulation, row: dict[str, float], with_frame: bool = True) -> None:
        """Write a row of the ledger, and a frame."""
        if self._ledger is None:
            return
        if self._lock is not None and not self._lock.is_held:
            self._stop_beside_others()
        self._ledger.append(row)
        if with_frame:
            self._frame(simulation)

    def _frame(self, simulation: Simulation) -> None:
        assert self._trajectory is not None
        w, engine = simulation.state, simulation._engine
        contacts = measured_columns(w, engine.law, engine.table_of(w))
        virial = virials_of(simulation, contacts) if simulation.ledger.stress else None
        self._trajectory.write(w.steps, w.time, w.grains, w.box, contacts, at_rest=w.at_rest, virial=virial)

    def tick(self, simulation: Simulation, at_output: bool = False, due: bool = False) -> None:
        """Write a checkpoint if it is due by the cadence of the simulation, or if the last one is old enough."""
        if simulation.checkpoint_every is None:
            cheap = max(AT_OUTPUT_EVERY, self._took / COST)
            due = monotonic() - self._saved > (min(cheap, CHECKPOINT_EVERY) if at_output else CHECKPOINT_EVERY)
        if due:
            self.save(simulation)

    def save(self, simulation: Simulation) -> None:
        """Write the regular state as a checkpoint; the trajectory is flushed first, so that no frame can be lost.

        An unsound state is not written: the last good checkpoint stays.
        """
        self._stop_beside_others()
        regular = simulation.regular_state
        assert regular.count[PHASE] == 0
        begun = monotonic()
        if self._trajectory is not None:
            self._trajectory.flush(sync=True)
        meta = {
            "steps": simulation.steps,
            "time": regular.time,
            "output_time": simulation.time,
            "until": None if math.isinf(self._ends[0]) else self._ends[0],
            "last_step": None if math.isinf(self._ends[1]) else int(self._ends[1]),
            "stop": self._ends[2],
            "condition_met": simulation.met_condition,
            "wall_seconds": simulation.wall_seconds,
            "wall_times": simulation.wall_times,
            "temperature": simulation.temperature,
            "choices": simulation.choices,
            "warnings": simulation.warnings,
            "case": plain(self._case),
            **({} if self._written is None else {"case_written": self._written}),
            "next_id": simulation._system.next_id,
            "own": regular.grains.own_units,
            "chosen_cadence": None if simulation.frame_every is not None else simulation._continuation.chosen,
            "updaters": described(simulation.updaters),
            "ledger": simulation.ledger.columns,
            "clock": CLOCK,
            "count": COUNT,
            "lost": LOST,
            "cutoff": CUTOFF,
        }
        if simulation.is_sound:
            ledger = simulation.ledger
            arrays = {**regular.to_arrays(), "ledger": ledger.to_array()}
            if len(ledger.frame_times) < len(ledger.rows):  # otherwise every row has a frame
                arrays["frame_times"] = np.array(ledger.frame_times)
            self._own = _stamp(write_checkpoint(self.folder, arrays, meta))
        self._saved = monotonic()
        self._took = self._saved - begun

    def flush(self) -> None:
        """Make the frames written so far readable.  Raises FilesFailed."""
        if self._trajectory is not None:
            self._trajectory.flush()

    def rescue(self) -> None:
        """Flush what can be flushed after another file could not be written."""
        if self._trajectory is not None:
            self._trajectory.rescue()

    def close(self, simulation: Simulation, result: Result) -> None:
        """Write checkpoint, summary and figure; a further `run` opens the trajectory again."""
        self.save(simulation)
        if self._trajectory is not None:
            self._trajectory.close()
        summary = summary_of(simulation, result) | (self._ledger.described() if self._ledger else {})
        write_json(self.folder / files.SUMMARY, sealed(plain(summary)))
        Signals.saving.discard(self)
        # no figure after an interruption: the user is waiting for the prompt, or the wall time ends
        if self.draws and result.outcome not in UNFINISHED:
            self.draw(simulation)

    def draw(self, simulation: Simulation) -> None:
        """Draw the figure of the run so far."""
        if simulation.ledger.rows:
            with simulation._timer.figure():
                DISPLAYS["save figure"](simulation, self.folder / files.FIGURE)


def _without_ends(case: dict[str, Any]) -> dict[str, Any]:
    """A case without the ends of its run, which `sand resume` lets the user change."""
    return {**case, "run": case.get("run", {}) | {"until": None, "steps": None, "stop": None}}


def _stamp(path: Path) -> tuple[str, int]:
    """Name and modification time [ns] of a file, to recognise files of other runs."""
    return path.name, path.stat().st_mtime_ns


def summary_of(simulation: Simulation, result: Result) -> dict[str, Any]:
    """Build the content of summary.json."""
    ledger = simulation.present_ledger
    last = ledger.rows[-1]
    grain_steps = result.steps * len(simulation.grains)
    return {
        "outcome": result.outcome.name.lower(),
        "outcome_text": result.outcome.value + (f": {result.condition}" if result.condition else ""),
        "condition": result.condition or None,
        "grains_concerned": list(result.grains),
        "time": result.time,
        "steps": result.steps,
        "grains": len(simulation.grains),
        "contacts": last["contacts"],
        **{f"contacts_{name}": last[name] for name in ("made", "moved", "broken")},
        **{name: last[name] for name in ("clusters", "mean_cluster_size", "largest_cluster")},
        "largest_overlap": float(simulation.regular_state.clock[LARGEST_OVERLAP]),
        **{name: last.get(name) for name in TEMPERATURES},
        **rigid_clusters(simulation, ledger),
        "dissipated": ledger.dissipated,
        "drift": result.drift,
        "drift_per_kT": ledger.drift_per_kT(simulation.temperature, len(simulation.grains)),
        "temperature_at_start": simulation.temperature,
        "grains_in_words": grains_in_words(simulation.grains, simulation.temperature),
        "forces_in_words": forces_in_words(simulation.forces),
        "notes": simulation.notes(),
        "warnings": simulation.warnings,
        "seed": simulation.seed,
        "choices": simulation.choices,
        "wall_seconds": simulation.wall_seconds,
        **{f"wall_{part}": seconds for part, seconds in simulation.wall_times.items()},
        "ns_per_grain_step": 1e9 * simulation.wall_times["stepping"] / grain_steps if grain_steps else None,
        "versions": versions(),
        "source_digest": cache_folder().name,
        "sand": __version__,
    }


def is_mostly_awake(simulation: Simulation) -> bool:
    """Whether the grains of a long run with rigid clusters were awake more than half of the time."""
    state = simulation.regular_state
    if state.count[CONTACT_STEPS] < LONG_RUN:
        return False
    return bool(state.clock[GRAINS_AWAKE] > 0.5 * state.time)


def rigid_clusters(simulation: Simulation, ledger: Ledger) -> dict[str, Any]:
    """What rigid clusters did, and the energy removed at rest; or nothing."""
    found = simulation._engine.stepper.summary(simulation.regular_state)
    dissipated = ledger.dissipated
    removed = {"quieting_per_dissipated": ledger.rows[-1]["lost_quieting"] / dissipated if dissipated else 0.0}
    return {"rigid_clusters": found | removed} if found else {}


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that affect results."""
    packages = {name: metadata.version(name) for name in ("numpy", "numba")}
    return {"python": platform.python_version(), **packages}
