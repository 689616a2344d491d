"""What a run leaves in its folder, and when."""

from __future__ import annotations

import contextlib
import math
import platform
import time as wall
from importlib import metadata
from pathlib import Path
from typing import Any

from ..compiler.jit import cache_folder
from ..errors import BadInput, FilesFailed
from ..io import run_folder as files
from ..io.checkpoint import checkpoint_name, write_checkpoint
from ..io.damage import sealed
from ..io.ledger_table import LedgerFile, keep_if_damaged
from ..io.lock import FolderLock
from ..io.run_folder import make_folder, plain, read_json, write_json, write_toml
from ..io.trajectory import TrajectoryWriter
from ..state.state import CLOCK, COUNT, LOST, STAGE
from ..version import __version__
from .displays import display
from .ledger import Ledger
from .outcome import Outcome, Result
from .serialise import case_of

Simulation = Any
"""`sand.Simulation`, which imports this module."""
CHECKPOINT_EVERY = 60.0
"""Seconds of wall time between checkpoints, at most."""
AT_OUTPUT_EVERY = 1.0
"""The same at outputs, at least; longer where checkpoints would take more than COST of the time."""
COST = 0.01


class RunWriter:
    """Keeps case.toml, trajectory.gsd, ledger.csv, checkpoints, summary.json and the figure.

    Parameters
    ----------
    out : str or Path
        the folder.
    overwrite : bool, optional
        an earlier run's files in it may be replaced.
    resumed : bool, optional
        the folder is that of the run itself, which goes on.

    A lock keeps all others from writing to the folder during each `run`, from `open` to `release`.
    """

    def __init__(self, out: str | Path, overwrite: bool = False, resumed: bool = False):
        self.folder = Path(out) if resumed else make_folder(out, overwrite=overwrite)
        self._resumed = resumed
        self.draws = True  # a figure at the end of each `run`
        self._trajectory: TrajectoryWriter | None = None
        self._ledger: LedgerFile | None = None
        self._saved, self._took = wall.monotonic(), 0.0
        self._ends = (math.inf, math.inf)
        self._case: dict[str, Any] = {}
        self._lock: FolderLock | None = None
        self._known = self._on_disk() if resumed else {}

    def open(self, simulation: Simulation, until: float, last_step: float) -> None:
        """Begin or go on with the files; called by each `run` with its end.

        Raises
        ------
        BadInput
            another process or simulation writes to the folder, or has written to it since this one did.
        FilesFailed
            nothing can be written.
        """
        lock = FolderLock(self.folder)
        try:
            self._refuse_others_files(simulation.steps)
        except BadInput:
            lock.release()
            raise
        self._lock = lock
        if (until, last_step) != self._ends:
            self._ends = (until, last_step)
            self._case = case_of(simulation, until, last_step)
            text = "as understood by SAND, all defaults filled in, SI units"
            write_toml(self.folder / files.CASE, self._case, text)
        if self._trajectory is not None:
            return
        if self._resumed:
            self._look_at_earlier(simulation)
        self._ledger = LedgerFile(self.folder / files.LEDGER, simulation.ledger.columns, simulation.ledger.rows)
        steps = simulation.steps if self._resumed else None
        self._trajectory = TrajectoryWriter(
            self.folder / files.TRAJECTORY, steps, [row["step"] for row in simulation.ledger.rows]
        )
        if not self._resumed:
            self._frame(simulation)
        self.save(simulation)

    def release(self) -> None:
        """Let others write to the folder; `open` takes the lock again."""
        if self._lock is not None:
            self._known = self._on_disk()
            self._lock.release()
            self._lock = None

    def _on_disk(self) -> dict[str, tuple[int, int]]:
        """Size and time of each checkpoint, by which those of others are told."""
        found = {}
        for path in self.folder.glob("checkpoint-*.npz"):
            with contextlib.suppress(OSError):
                found[path.name] = (path.stat().st_size, path.stat().st_mtime_ns)
        return found

    def _refuse_others_files(self, steps: int) -> None:
        """Raises BadInput if the folder holds what this simulation, which has taken so many steps, did not write."""
        found, first = self._on_disk(), self._trajectory is None
        begun = self._resumed or not first
        strange = any(self._known.get(name) != seen for name, seen in found.items())
        if first and self._resumed:  # someone may have gone on since the checkpoint was read
            strange |= bool(found) and max(found) != checkpoint_name(steps)
        if strange or (not begun and (self.folder / files.TRAJECTORY).exists()):
            told = "go on from what it left with sand.resume" if begun else "give another folder"
            raise BadInput(f"another run has written to {self.folder} since this simulation was made; {told}")

    def _look_at_earlier(self, simulation: Simulation) -> None:
        """Of a run that goes on: keep a ledger that was damaged, drop a summary of steps that are taken again."""
        try:
            keep_if_damaged(self.folder / files.LEDGER, simulation.ledger.columns, simulation.ledger.rows)
            with contextlib.suppress(BadInput):
                steps = read_json(self.folder / files.SUMMARY).get("steps")
                if isinstance(steps, int) and steps > simulation.steps:
                    (self.folder / files.SUMMARY).unlink()
        except OSError as error:
            raise FilesFailed(f"cannot write to folder {self.folder}: {error.strerror}") from error

    def write(self, simulation: Simulation, row: dict[str, float]) -> None:
        """A frame and a row."""
        if self._ledger is None:
            return
        self._ledger.append(row)
        self._frame(simulation)

    def _frame(self, simulation: Simulation) -> None:
        assert self._trajectory is not None
        w = simulation.state
        self._trajectory.write(w.steps, w.time, w.grains, w.box, simulation.contacts)

    def tick(self, simulation: Simulation, at_output: bool = False) -> None:
        """A checkpoint if the last one is old."""
        cheap = max(AT_OUTPUT_EVERY, self._took / COST)
        if wall.monotonic() - self._saved > (min(cheap, CHECKPOINT_EVERY) if at_output else CHECKPOINT_EVERY):
            self.save(simulation)

    def save(self, simulation: Simulation) -> None:
        """Write a checkpoint now; the trajectory is flushed first, so that nothing before it is lost.

        A state that is not fit to go on from is not written: the last good one stays.
        """
        assert simulation.state.count[STAGE] == 0
        begun = wall.monotonic()
        if self._trajectory is not None:
            self._trajectory.flush(sync=True)
        meta = {
            "steps": simulation.steps,
            "time": simulation.time,
            "until": None if math.isinf(self._ends[0]) else self._ends[0],
            "last_step": None if math.isinf(self._ends[1]) else int(self._ends[1]),
            "wall_seconds": simulation.wall_seconds,
            "temperature": simulation.temperature,
            "choices": simulation.choices,
            "case": plain(self._case),
            "ledger": simulation.ledger.columns,
            "clock": CLOCK,
            "count": COUNT,
            "lost": LOST,
        }
        if simulation.is_sound:
            arrays = {**simulation.state.to_arrays(), "ledger": simulation.ledger.to_array()}
            write_checkpoint(self.folder, arrays, meta)
        self._saved = wall.monotonic()
        self._took = self._saved - begun

    def flush(self) -> None:
        """Frames written so far can be read.  Raises FilesFailed."""
        if self._trajectory is not None:
            self._trajectory.flush()

    def rescue(self) -> None:
        """Keep what can be kept after a file could not be written."""
        if self._trajectory is not None:
            self._trajectory.rescue()

    def close(self, simulation: Simulation, result: Result, ledger: Ledger) -> None:
        """Checkpoint, summary and figure; a further `run` opens the trajectory again."""
        self.save(simulation)
        if self._trajectory is not None:
            self._trajectory.close()
        summary = summary_of(simulation, result, ledger) | (self._ledger.described() if self._ledger else {})
        write_json(self.folder / files.SUMMARY, sealed(plain(summary)))
        # whoever interrupts a run does not want to wait for its figure
        if self.draws and result.outcome is not Outcome.INTERRUPTED:
            self.draw(simulation)

    def draw(self, simulation: Simulation) -> None:
        """The figure of the run so far."""
        if simulation.ledger.rows:
            display("save figure", simulation, self.folder / files.FIGURE)


def summary_of(simulation: Simulation, result: Result, ledger: Ledger) -> dict[str, Any]:
    """Everything a table of many runs wants to know of one."""
    last = ledger.rows[-1]
    grain_steps = result.steps * len(simulation.grains)
    return {
        "outcome": result.outcome.name.lower(),
        "outcome_text": result.outcome.value,
        "grains_concerned": list(result.grains),
        "time": result.time,
        "steps": result.steps,
        "grains": len(simulation.grains),
        "contacts": last["contacts"],
        "contacts_made": last["made"],
        "contacts_moved": last["moved"],
        "contacts_broken": last["broken"],
        "clusters": last["clusters"],
        "mean_cluster_size": last["mean_cluster_size"],
        "largest_cluster": last["largest_cluster"],
        "dissipated": ledger.dissipated,
        "drift": result.drift,
        "drift_per_kT": ledger.drift_per_kT(simulation.temperature, len(simulation.grains)),
        "temperature_at_start": simulation.temperature,
        "seed": simulation.seed,
        "choices": simulation.choices,
        "wall_seconds": simulation.wall_seconds,
        "ns_per_grain_step": 1e9 * simulation.wall_seconds / grain_steps if grain_steps else None,
        "versions": versions(),
        "source_digest": cache_folder().name,
        "sand": __version__,
    }


def versions() -> dict[str, str]:
    """Of Python and of the packages that can change a number."""
    packages = {name: metadata.version(name) for name in ("numpy", "numba")}
    return {"python": platform.python_version(), **packages}
