"""Files of a population of dilute dust: ledger, one row per draw, aggregates, frames, and checkpoints."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from ..analysis.frame_statistics import COLUMNS, aggregate_statistics
from ..basics.box import Box
from ..basics.grains import Grains
from ..basics.schema import MODES
from ..basics.version import __version__
from ..io import run_folder as files
from ..io.checkpoint import newest_checkpoint, read_archive, write_checkpoint
from ..io.checkpoint_files import checkpoint_files
from ..io.damage import sealed
from ..io.ledger_table import LedgerFile
from ..io.table import GrowingTable, write_table
from ..io.trajectory import Frames, TrajectoryWriter
from .dilute_encounters import HIT_CHANGES, REPELLED, Encounter, Encounters
from .dilute_state import arrays_of, set_apart
from .scattering.flights import ENDS

CHECKPOINT_EVERY = 30.0
"""Wall time [s] after which a checkpoint is written, at the next draw."""
SHOWN_EVERY = 0.5
"""Wall time [s] between two lines of progress."""
FRAMES_PER_DECADE = 10
"""Frames per decade of S."""
END_CODES = {name: code for code, name in enumerate((*ENDS[:3], REPELLED))}
"""Ends of encounters in encounters.csv: 0 hit, 1 miss, 2 bound, 3 repelled before a flight."""
LEDGER_COLUMNS = (
    *("step", "time", "mean_cluster_size", "clusters", "largest_cluster", "grains", "volume", "number_ratio"),
    *("flights", "hits", "bound", "others", "to_gas", "flight_error", "touch_energy", *HIT_CHANGES),
)
"""Columns of the ledger, a row after each hit with all counts until then: draws, time [s], S, bodies, grains of the
largest and of all, V [m³], n/n₀, flights, hits, flights without hit or escape, mean number of encounters with others
during flights that hit, without their contact phases; then sums over all hits [J]: kinetic energy that bodies leave to
the gas (0 with hits = "stick"), error of flights, energy at the touch, and changes in contact phases by channel."""
OWN_COLUMNS = ("translation", "rotation")
"""Columns of a population whose bodies keep their motion, instead of `to_gas`: mean energies of motion and of rotation
of a body [k_BT], 3/2 each in equilibrium."""


def ledger_columns(own: bool) -> tuple[str, ...]:
    """Columns of the ledger of a population; `own` of one whose bodies keep their motion."""
    return (*(name for name in LEDGER_COLUMNS if name != "to_gas"), *OWN_COLUMNS) if own else LEDGER_COLUMNS


def ledger_row(now: Encounters, start: float, before: dict[str, Any], hit: Encounter | None) -> dict[str, Any]:
    """A row of the ledger; `start` is n₀ [1/m³], `before` the last row."""
    population = now.population
    row: dict[str, Any] = {
        "step": now.event, "time": now.time, "mean_cluster_size": population.mean_size,
        "clusters": len(population.bodies), "largest_cluster": int(population.grains.max()),
        "grains": int(population.grains.sum()), "volume": population.volume,
        "number_ratio": len(population.bodies) / population.volume / start, "flights": now.flights,
        "hits": now.hits_seen, "bound": now.bound, "others": now.others / max(now.hits_seen, 1),
    }  # fmt: skip
    row |= dict(zip(OWN_COLUMNS, population.temperatures, strict=True))
    sums = {name: before.get(name, 0.0) for name in LEDGER_COLUMNS if name not in row}
    if hit is not None:
        kinetic = hit.touch_kinetic + hit.touch_rotation
        sums["touch_energy"] += kinetic + hit.touch_potential
        sums["flight_error"] += hit.flight_error
        if hit.energies:
            sums["to_gas"] += kinetic + hit.energies["kinetic"]
            for name in HIT_CHANGES:
                sums[name] += hit.energies[name]
    return row | sums


def encounter_row(encounter: Encounter) -> list[float]:
    """Numbers of encounters.csv."""
    row = encounter.row() | {"end": END_CODES[encounter.end]}
    return [float(row[name]) for name in ENCOUNTER_COLUMNS]


ENCOUNTER_COLUMNS = (*(name for name in Encounter._fields if name != "energies"), *HIT_CHANGES)
"""Columns of encounters.csv, see `dilute_encounters.Encounter`."""


class PopulationFiles:
    """Writes the files of a population; a run that is killed anywhere continues from its checkpoint with equal bits.

    Parameters
    ----------
    folder : Path
        The folder, which exists.
    case : dict
        Settings for case.toml and checkpoints.
    kind : Grains
        Grains whose materials and own quantities all grains have.
    kept : tuple or None, optional
        Arrays and metadata of the checkpoint from which it continues.
    own : bool, optional
        Whether bodies keep their motion.
    """

    def __init__(
        self, folder: Path, case: dict[str, Any], kind: Grains, kept: tuple[dict, dict] | None = None, own: bool = False
    ):
        self.folder, self.case, self.kind, self.columns = folder, case, kind, ledger_columns(own)
        arrays, meta = kept or ({}, {})
        rows = [dict(zip(self.columns, row, strict=True)) for row in arrays.get("ledger", np.zeros((0, 0))).tolist()]
        self.rows = [row | {name: int(row[name]) for name in WHOLE} for row in rows]
        self.frame_times: list[float] = arrays.get("frame_times", np.zeros(0)).tolist()
        resumed, drawn = kept is not None, meta.get("event")
        files.write_toml(folder / files.CASE, case, "settings of a population of dilute dust, read by sand resume")
        self.ledger = LedgerFile(folder / files.LEDGER, self.columns, self.rows)
        self.table = GrowingTable(folder / files.ENCOUNTERS, ENCOUNTER_COLUMNS, resume=resumed, most=drawn)
        last = self.frame_times[-1] if self.frame_times else -math.inf
        self.trajectory = TrajectoryWriter(folder / files.TRAJECTORY, last if resumed else None, self.frame_times)
        self.waiting: list[list[float]] = []
        self.saved = monotonic()

    def begin(self, now: Encounters, start: float) -> None:
        """The first row, frame and checkpoint of a new population."""
        if not self.rows:
            self.add_row(self.row(now, start))
            self.frame(now)
            self.save(now)

    def row(self, now: Encounters, start: float, hit: Encounter | None = None) -> dict[str, Any]:
        """The row of the ledger after a hit, or of the present state."""
        row = ledger_row(now, start, self.rows[-1] if self.rows else {}, hit)
        return {name: row[name] for name in self.columns}

    def add_row(self, row: dict[str, Any]) -> None:
        """A row of the ledger."""
        self.rows.append(row)
        self.ledger.append(row)

    def add(self, now: Encounters, encounter: Encounter, start: float) -> None:
        """A draw; after a hit a row of the ledger, a frame at ten values of S per decade; a checkpoint if it is due."""
        self.waiting.append(encounter_row(encounter))
        if encounter.end == "hit":
            before = self.rows[-1]
            self.add_row(self.row(now, start, encounter))
            if _frames_until(self.rows[-1]["mean_cluster_size"]) > _frames_until(before["mean_cluster_size"]):
                self.frame(now)
        if monotonic() - self.saved > CHECKPOINT_EVERY:
            self.save(now)

    def frame(self, now: Encounters) -> None:
        """A frame with all bodies on a lattice, unless there is one of this time."""
        if self.frame_times and now.time <= self.frame_times[-1]:
            return
        grains, contacts = set_apart(now.population.bodies, self.kind)
        count, (i, j) = len(contacts.pair), contacts.pair.T
        apart = np.linalg.norm(grains.position[i] - grains.position[j], axis=1)
        columns = {
            "pair": contacts.pair, "overlap": grains.radius[i] + grains.radius[j] - apart, "formed": np.zeros(count),
            "force": np.zeros((count, 3)), "slide_vector": contacts.slide, "roll_vector": contacts.roll,
            "twist": contacts.twist, **{f"{mode}_share": np.zeros(count) for mode in MODES},
        }  # fmt: skip
        self.trajectory.write(now.event, now.time, grains, Box.open(), columns)
        self.frame_times.append(now.time)

    def save(self, now: Encounters) -> None:
        """Write what waits, and a checkpoint."""
        self.table.add(self.waiting)
        self.waiting = []
        self.trajectory.close()
        arrays, meta = arrays_of(now)
        arrays |= {"ledger": np.array([[row[name] for name in self.columns] for row in self.rows])}
        arrays |= {"frame_times": np.array(self.frame_times)}
        write_checkpoint(self.folder, arrays, {"steps": now.event, "case": self.case, "kind": POPULATION, **meta})
        self.saved = monotonic()

    def finish(self, now: Encounters, outcome: str) -> dict[str, Any]:
        """The last checkpoint and frame, the table of aggregates, and the summary."""
        self.save(now)  # without the frame of this end, which a run with a later end does not have
        self.frame(now)
        self.trajectory.close()
        self.ledger.close()
        rows = aggregate_rows(self.folder / files.TRAJECTORY, now)
        write_table(self.folder / files.AGGREGATES, rows, (*IDENTITY, *COLUMNS))
        summary = {"outcome": outcome, **self.rows[-1], **self.ledger.described(), "sand": __version__}
        files.write_json(self.folder / files.SUMMARY, sealed(files.plain(summary)))
        return summary


class HitsSeen:
    """An observer of a population that shows its state, at most twice a second.

    Parameters
    ----------
    show : callable
        Called with a text such as ":  S 12.3  n/n0 0.12  1,210 hits  3,900 flights  31 hits/s".
    """

    def __init__(self, show: Callable[[str], None]):
        self.show, self.last, self.hits = show, monotonic(), 0

    def see(self, simulation: Any, row: dict[str, Any]) -> None:
        """Show a row of the ledger."""
        elapsed = monotonic() - self.last
        if elapsed > SHOWN_EVERY:
            speed = max(row["hits"] - self.hits, 0) / elapsed
            numbers = f"S {row['mean_cluster_size']:.1f}  n/n0 {row['number_ratio']:.3f}  {row['hits']:,} hits"
            self.show(f":  {numbers}  {row['flights']:,} flights  {speed:.0f} hits/s")
            self.last, self.hits = monotonic(), row["hits"]


IDENTITY = ("body", "born", "copy")
"""First columns of aggregates.csv, before those of `analysis.frame_statistics`; the table may have no rows."""
WHOLE = ("step", "clusters", "largest_cluster", "grains", "flights", "hits", "bound")
"""Columns of whole numbers."""
POPULATION = "dilute population"
"""What its checkpoints are, in their metadata."""


def _frames_until(size: float) -> int:
    """Number of frames until this S, at ten values per decade; 1e-9 for rounding of powers of ten."""
    return math.floor(FRAMES_PER_DECADE * math.log10(size) + 1e-9)


def aggregate_rows(path: Path, now: Encounters) -> list[dict[str, Any]]:
    """Aggregates of at least two grains at the last frame: their statistics, and which ones are copies."""
    frames = Frames(path)
    found = aggregate_statistics(frames[-1], 2)
    frames.close()
    order = sorted(now.population.bodies, key=lambda body: (-len(body), body.number, body.copy))
    bodies = [body for body in order if len(body) > 1]
    rows = [{name: column[k].item() for name, column in found.items()} for k in range(len(bodies))]
    return [
        {"body": body.number, "born": body.born, "copy": body.copy, **row}
        for body, row in zip(bodies, rows, strict=True)
    ]


def kept_population(folder: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]] | None:
    """Arrays and metadata of the newest checkpoint of a folder; None without one.  Raises BadInput."""
    return newest_checkpoint(folder, read=read_archive) if checkpoint_files(folder) else None
