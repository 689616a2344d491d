"""Data of a run for the viewer page: manifest, grains, frames, time series, dimensions (see grainview/README.md)."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.ledger_columns import LedgerColumns
from ..analysis.quantities import own_label
from ..analysis.tracking import SINGLE, Lineage
from ..basics.errors import BadInput, NoSuchKey
from ..basics.paths import user_path
from ..basics.version import __version__
from ..io import run_folder as files
from ..io.live_trajectory import LiveTrajectory
from ..plotting.palettes import colours, palettes
from ..plotting.style import LARGEST_COLOURS
from ..simulation.contact_table import COLUMNS
from .by_identity import ByIdentity
from .dimensions import fit_dimension
from .packets import frame_bytes, frame_packet, grains_packet
from .run_files import PROBLEM, LedgerReader, find_run_folder, read_summary, stale_note
from .series import PERCENTILE_LIMITS, PERCENTILES, quantity_ranges, series_from_frames, series_from_ledger

if TYPE_CHECKING:
    from .external_field import FieldDescription

FORMAT = 1
MAX_TRACKED = 8_000_000
"""Grains × frames up to which clusters are tracked through the whole run before the page opens (about 1 s)."""
REQUESTS = {"manifest": ("since",), "grains": (), "series": (), "frame": ("k",), "dimension": ("k", "grain")}
"""Requests of the page, and the names of the numbers in them."""
DIRECTION_TOLERANCE = 1e-9
"""Field directions, and relative magnitudes, that differ by less count as constant."""


class RunDataset:
    """Data of a run for the viewer page; safe for use by several threads.

    Parameters
    ----------
    frames : LiveTrajectory or Snapshot
        Frames of the run.
    name : str
        Name of the run.
    source : str
        Path of the run folder or trajectory, for messages.
    ledger : callable
        Returns the present ledger (`LedgerColumns`), or None if there is none.
    summary : callable
        Returns the run summary; None while the run goes on, `{}` if it is unavailable.
    field : FieldDescription, optional
        External magnetic field.

    Attributes
    ----------
    compact : bool
        Whether frames are sent in half precision; False at first.
    notes : list of str
        Notes for the reader of the page.
    unit : float
        Unit of positions and radii on the page: the mean grain radius [m].
    """

    def __init__(
        self,
        frames: Any,
        name: str,
        source: str,
        *,
        ledger: Callable[[], LedgerColumns | None],
        summary: Callable[[], Mapping[str, Any] | None],
        field: FieldDescription | None = None,
    ):
        self.frames, self.name, self.source, self.compact = frames, name, source, False
        self.notes, self._lock = list[str](), threading.RLock()
        self._read_ledger, self._read_summary, self._field = ledger, summary, field
        self._requested = slice(None)
        self._initialise()
        self.refresh()

    def _initialise(self) -> None:
        """Set what is constant during a run from its first readable frame."""
        first = self._first_readable()
        self.grains_count, self.materials = len(first), list(first.materials)
        self.unit = float(first.radius.mean())
        self.periodic = [length is not None for length in first.box.lengths]
        self.says_rest = first.at_rest is not None
        self._grains, self.own = grains_packet(first, self.unit), first.own.units
        self._lineage = Lineage(self.grains_count, self.frames.pairs)
        self._largest: dict[str, int] | None = None
        self._ranges: tuple[int, dict[str, list[float]]] | None = None
        self._flux_densities: list[list[float]] = []
        self._generation = self.frames.generation
        self._selection = _absolute_slice(self._requested, len(self.frames))

    def _first_readable(self) -> Any:
        for number in range(len(self.frames) - 1):
            try:
                return self.frames[number]
            except BadInput:
                continue
        return self.frames[len(self.frames) - 1]

    def refresh(self) -> None:
        """Read the summary and look for new frames."""
        with self._lock:
            # The summary first: a run counts as ended only when all frames written before its end are known.
            self._summary = self._read_summary()
            self.frames.refresh()
            if self.frames.generation != self._generation:
                self._initialise()

    def select(self, frames: slice, note: str = "") -> None:
        """Restrict the dataset to some frames.

        Parameters
        ----------
        frames : slice
            Negative bounds count from the present end, so that the selected frames stay the same in a growing run.
        note : str, optional
            Description of the selection for the reader of the page.

        Raises
        ------
        BadInput
            If the selection is empty.
        """
        if not range(len(self.frames))[frames]:
            raise BadInput(f"{self.source} has {len(self.frames)} frames; the selection contains none of them")
        self._requested, self._selection = frames, _absolute_slice(frames, len(self.frames))
        self.notes += [note] if note else []

    @property
    def frame_numbers(self) -> range:
        """Numbers of the selected frames in the trajectory."""
        return range(len(self.frames))[self._selection]

    def __len__(self) -> int:
        return len(self.frame_numbers)

    def manifest(self, since: int = 0) -> dict[str, Any]:
        """Manifest of the run, with `times` and `steps` from selected frame `since` on."""
        with self._lock:
            numbers = np.array(self.frame_numbers, dtype=int)
            summary = self._summary
            # A resumed run has the summary of its first part until it ends again.
            running = summary is None or summary.get("time", np.inf) < self.frames.times[-1]
            return {
                "format": FORMAT,
                "name": self.name,
                "version": __version__,
                "generation": self._generation,
                "grains": self.grains_count,
                "times": self.frames.times[numbers[since:]].tolist(),
                "steps": self.frames.steps[numbers[since:]].tolist(),
                "bytes": self.size,
                "running": bool(running),
                "outcome": None if running or summary is None else summary.get("outcome_text"),
                "note": "; ".join(self._all_notes()) or None,
                "unit": self.unit,
                "materials": self.materials,
                "own": [
                    {"id": name, "label": own_label(name), "unit": "" if unit == "1" else unit}
                    for name, unit in self.own.items()
                ],
                "at_rest": self.says_rest,
                "periodic": self.periodic,
                "field": self._field_entry(numbers),
                "ranges": self.ranges(),
                "percentiles": {"limits": PERCENTILE_LIMITS, "of": PERCENTILES},
                "hints": {name: text for name, _, text in COLUMNS},
                "palettes": palettes(),
                "colours": colours() | {"named": self._largest_clusters()},
                "dimensions": None,
            }

    def _largest_clusters(self) -> dict[str, int]:
        """Colour index (in `big`) of the clusters that are largest in the last frame, by cluster name.

        Computed once, so that colours stay the same in a growing run; empty beyond MAX_TRACKED.
        """
        if self._largest is None:
            self._largest = {}
            if len(self.frames) * self.grains_count <= MAX_TRACKED:
                names, counts = np.unique(self._lineage.names(len(self.frames) - 1), return_counts=True)
                clusters = names != SINGLE
                order = np.argsort(-counts[clusters], kind="stable")[: len(LARGEST_COLOURS)]
                self._largest = {str(name): rank for rank, name in enumerate(names[clusters][order].tolist())}
        return self._largest

    def _all_notes(self) -> list[str]:
        torn = self.frames.incomplete
        incomplete = f"{torn} incomplete frame{'s' if torn > 1 else ''} at the end left out" if torn else ""
        stale = stale_note(self.frames.age) if self._summary is None else ""
        self._read_ledger()  # updates its `problem`
        problems = [getattr(self._read_ledger, "problem", ""), (self._summary or {}).get(PROBLEM, "")]
        return [text for text in (*self.notes, incomplete, stale, *problems) if text]

    @property
    def size(self) -> int:
        """Approximate size of all selected frames as sent [bytes]."""
        contacts = self.frames.contacts[np.array(self.frame_numbers, dtype=int)]
        per_contact = frame_bytes(0, 1, self.compact) - frame_bytes(0, 0, self.compact)
        return len(contacts) * frame_bytes(self.grains_count, 0, self.compact, len(self.own)) + int(
            contacts.sum() * per_contact
        )

    def answer(self, kind: str, *numbers: int) -> bytes | dict[str, Any]:
        """Answer a request of the page: a packet, or the content of JSON.

        Parameters
        ----------
        kind : str
            One of REQUESTS, which is also the name of the method that answers it.
        *numbers : int
            The numbers in the request.

        Raises
        ------
        NoSuchKey
            If there is no such frame or grain.
        BadInput
            If the frame is damaged.
        """
        if kind == "manifest":
            self.refresh()
        return getattr(self, kind)(*numbers)

    def grains(self) -> bytes:
        """Packet of the grain properties that do not change."""
        return self._grains

    def read(self, k: int) -> tuple[Any, np.ndarray]:
        """Read the k-th selected frame.

        Returns
        -------
        tuple of (Frame, ndarray)
            The frame, and the name (N,) of the cluster of each grain.

        Raises
        ------
        BadInput
            If there is no such frame, or it is damaged.
        """
        with self._lock:
            if not 0 <= k < len(self):
                raise NoSuchKey(f"there is no frame {k}; there are {len(self)} frames, 0 to {len(self) - 1}")
            number = self.frame_numbers[k]
            frame = self.frames[number]
            if len(frame) != self.grains_count:
                raise BadInput(f"frame {number} has {len(frame)} grains; the first frame has {self.grains_count}")
            return frame, self._lineage.names(number)

    def frame(self, k: int) -> bytes:
        """Packet of the k-th selected frame.

        Raises
        ------
        BadInput
            If there is no such frame, or it is damaged.
        """
        return self.packet(k, *self.read(k))

    def packet(self, k: int, frame: Any, names: np.ndarray) -> bytes:
        """Packet of the k-th selected frame from the result of `read`."""
        return frame_packet(k, frame, names, self.unit, self.compact)

    def series(self) -> dict[str, Any]:
        """Time series from the ledger, or from the frames if there is no ledger."""
        with self._lock:
            ledger = self._read_ledger()
            return series_from_ledger(ledger) if ledger else series_from_frames(self.frames, self.grains_count)

    def dimension(self, k: int, grain: int) -> dict[str, Any]:
        """Fractal dimension of the cluster of a grain in the k-th selected frame.

        Returns
        -------
        dict
            `value` and `error`, or the `reason` why there is no value.

        Raises
        ------
        BadInput
            If there is no such frame or grain.
        """
        if not 0 <= grain < self.grains_count:
            raise NoSuchKey(f"there is no grain {grain}; there are {self.grains_count}, 0 to {self.grains_count - 1}")
        return fit_dimension(*self.read(k), grain)

    def ranges(self) -> dict[str, list[float]]:
        """Ranges of the colour scales by quantity name, SI; computed again when the run has grown by half."""
        with self._lock:
            count = len(self.frames)
            if self._ranges is None or count > 1.5 * self._ranges[0]:
                self._ranges = (count, quantity_ranges(self.frames))
            return self._ranges[1]

    def flux_density(self, time: float) -> Sequence[float] | None:
        """External flux density [T] at a time [s]; None without a field."""
        return None if self._field is None else self._field.flux_density(time)

    def _field_entry(self, numbers: np.ndarray) -> dict[str, Any] | None:
        if self._field is None or not numbers.size:
            return None
        new_times = self.frames.times[len(self._flux_densities) :]
        self._flux_densities += [[float(b) for b in self._field.flux_density(float(t))] for t in new_times]
        densities = [self._flux_densities[k] for k in numbers.tolist()]
        sizes, directions = (
            [_rounded(float(np.linalg.norm(b))) for b in densities],
            [_unit_vector(b) for b in densities],
        )
        entry: dict[str, Any] = {"text": self._field.text, "direction": directions[0], "size": sizes[0]}
        if np.ptp(np.array(directions), axis=0).max() >= DIRECTION_TOLERANCE:
            entry["directions"] = directions
        if np.ptp(sizes) > DIRECTION_TOLERANCE * max(sizes):
            entry["sizes"] = sizes
        return entry


def _absolute_slice(selection: slice, count: int) -> slice:
    """The same slice of `count` frames without negative bounds."""
    start, stop = (
        max(bound + count, 0) if bound is not None and bound < 0 else bound
        for bound in (selection.start, selection.stop)
    )
    return slice(start, stop, selection.step)


def _unit_vector(vector: Sequence[float]) -> list[float]:
    size = float(np.linalg.norm(vector))
    return [_rounded(component / size) if size > 0.0 else 0.0 for component in vector]


def _rounded(value: float) -> float:
    """The number with nine digits, to shorten what is sent."""
    return float(f"{value:.9g}")


def frames_dataset(path: Path, frames: Any, field: FieldDescription | None = None) -> RunDataset:
    """The frames of a file without a run, for the viewer."""
    return RunDataset(ByIdentity(frames), path.stem, str(path), ledger=lambda: None, summary=dict, field=field)


def run_dataset(path: str | Path, field: FieldDescription | None = None) -> RunDataset:
    """Open a run folder, or a trajectory written by SAND, for the viewer.

    Raises
    ------
    BadInput
        If there is no run, no frame yet, or the trajectory is damaged or was written by another program.
    """
    source = user_path(path)
    folder = find_run_folder(source)
    if folder is None:
        if not source.is_file():
            reason = f"there is no {files.TRAJECTORY} in it" if source.is_dir() else "there is no such folder or file"
            raise BadInput(f"{path} is neither a run folder nor a trajectory: {reason}")
        return frames_dataset(source, LiveTrajectory(source), field)
    frames = ByIdentity(LiveTrajectory(folder / files.TRAJECTORY))
    name, ledger = folder.resolve().name, LedgerReader(folder)
    return RunDataset(frames, name, str(path), ledger=ledger, summary=lambda: read_summary(folder), field=field)
