"""What the page of a run is told: manifest, grains, frames, series, dimensions; see grainview/README.md."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.ledger_columns import Books
from ..analysis.tracking import SINGLE, Lineage
from ..errors import BadInput
from ..io import run_folder as files
from ..io.live_trajectory import LiveTrajectory
from ..plotting.palettes import colours, palettes
from ..plotting.style import BIG
from ..version import __version__
from . import dimensions
from .packets import frame_bytes, frame_packet, grains_packet
from .ranges import ranges_of
from .run_files import PROBLEM, RunBooks, killed_note, run_folder, summary_of
from .series import of_frames, of_ledger

FORMAT = 1
FOLLOWED = 8_000_000
"""Grains times frames through which clusters are followed before the page opens: about a second."""
STEADY = 1e-9
"""Directions of a field that differ by less are one."""

FieldDescription = tuple[str, Callable[[float], Sequence[float]]]
"""A magnetic field in words, and its flux density [T] at a time [s]."""


class RunDataset:
    """A run, told to a page; safe to be asked by several threads.

    Parameters
    ----------
    frames
        of a trajectory (`io.live_trajectory.Following`), or what looks like them.
    name : str
        of the run.
    place : str
        its folder, or its file.
    books : Callable[[], Books or None]
        the ledger so far; None where there is none.
    summary : Callable[[], Mapping[str, Any] or None]
        how the run ended; None while it has not, empty where nobody knows.
    field : FieldDescription or None, optional
        the magnetic field, if there is one.
    chosen : slice, optional
        which frames are told; all by default.
    compact : bool, optional
        frames in half precision.
    """

    def __init__(
        self,
        frames: Any,
        name: str,
        place: str,
        *,
        books: Callable[[], Books | None],
        summary: Callable[[], Mapping[str, Any] | None],
        field: FieldDescription | None = None,
        chosen: slice = slice(None),
        compact: bool = False,
    ):
        self.frames, self.name, self.place, self.compact = frames, name, place, compact
        self.notes, self._lock = list[str](), threading.RLock()
        self._ledger_columns, self._summary, self._field = books, summary, field
        self._asked = chosen
        self._begin()
        self.refresh()

    def _begin(self) -> None:
        """Of the first frame that is whole: what is the same in all."""
        first = self._first()
        self.grains_count, self.materials = len(first), list(first.materials)
        self.unit = float(first.radius.mean())
        self.periodic = [length is not None for length in first.box.lengths]
        self._grains = grains_packet(first, self.unit)
        self._lineage = Lineage(self.grains_count, self.frames.pairs)
        self._largest: dict[str, int] | None = None
        self._ranges: tuple[int, dict[str, list[float]]] | None = None
        self._directions: list[list[float]] = []
        self._generation = self.frames.generation

        self.chosen = _settled(self._asked, len(self.frames))

    def _first(self) -> Any:
        """Raises BadInput if no frame is whole."""
        for number in range(len(self.frames) - 1):
            try:
                return self.frames[number]
            except BadInput:
                continue
        return self.frames[len(self.frames) - 1]

    def refresh(self) -> None:
        """Take in what has come since."""
        with self._lock:
            self._ended = self._summary()  # before the frames: those that came before the end are all told with it
            self.frames.refresh()
            if self.frames.generation != self._generation:
                self._begin()

    def choose(self, chosen: slice, note: str = "") -> None:
        """Tell of these frames only; the `note` says why.  Raises BadInput if there are none.

        Numbers that count from the end count from that of now, so that the k-th frame told stays the same one.
        """
        if not range(len(self.frames))[chosen]:
            raise BadInput(f"{self.place} has {len(self.frames)} frames; none of them was chosen")
        self._asked, self.chosen = chosen, _settled(chosen, len(self.frames))
        self.notes += [note] if note else []

    @property
    def numbers(self) -> range:
        """Numbers in the file of the frames that are told."""
        return range(len(self.frames))[self.chosen]

    def __len__(self) -> int:
        return len(self.numbers)

    def manifest(self, since: int = 0) -> dict[str, Any]:
        """What the page has to know first; times and steps from a frame on."""
        with self._lock:
            numbers = np.array(self.numbers, dtype=int)
            summary = self._ended
            # a run that was resumed goes on although it has ended once
            running = summary is None or summary.get("steps", np.inf) < self.frames.steps[-1]
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
                "note": "; ".join(self._noted()) or None,
                "unit": self.unit,
                "materials": self.materials,
                "periodic": self.periodic,
                "field": self._told_field(numbers),
                "ranges": self.ranges(),
                "palettes": palettes(),
                "colours": colours() | {"named": self._named()},
                "dimensions": None,
            }

    def _named(self) -> dict[str, int]:
        """Places in `big` of the clusters that are the largest in the last frame, by name: they are to be told apart.

        Empty where it would take long to follow clusters so far. Of a run that goes on, as it was when first asked.
        """
        if self._largest is None:
            self._largest = {}
            if len(self.frames) * self.grains_count <= FOLLOWED:
                names, counts = np.unique(self._lineage.names(len(self.frames) - 1), return_counts=True)
                known = names != SINGLE
                order = np.argsort(-counts[known], kind="stable")[: len(BIG)]
                self._largest = {str(name): place for place, name in enumerate(names[known][order].tolist())}
        return self._largest

    def _noted(self) -> list[str]:
        torn = self.frames.incomplete
        left = [f"{torn} frame{'s' if torn > 1 else ''} at the end left out: not whole"] if torn else []
        silent = killed_note(self.frames.age) if self._ended is None else ""
        self._ledger_columns()  # looks whether the ledger is as it should be
        wrong = [getattr(self._ledger_columns, "problem", ""), (self._ended or {}).get(PROBLEM, "")]
        return [*self.notes, *left, *(text for text in (silent, *wrong) if text)]

    @property
    def size(self) -> int:
        """Bytes of all frames told, as sent."""
        contacts = self.frames.contacts[np.array(self.numbers, dtype=int)]
        return len(contacts) * frame_bytes(self.grains_count, 0, self.compact) + int(
            contacts.sum() * (frame_bytes(0, 1, self.compact) - frame_bytes(0, 0, self.compact))
        )

    def grains(self) -> bytes:
        """The packet of what stays."""
        return self._grains

    def read(self, k: int) -> tuple[Any, np.ndarray]:
        """The k-th frame told, and names (N,) of the clusters its grains are in.

        Raises
        ------
        BadInput
            there is none, or it is not whole.
        """
        with self._lock:
            if not 0 <= k < len(self):
                raise BadInput(f"there are {len(self)} frames, from 0 to {len(self) - 1}; there is no {k}")
            number = self.numbers[k]
            frame = self.frames[number]
            if len(frame) != self.grains_count:
                raise BadInput(f"frame {number} has {len(frame)} grains; the first has {self.grains_count}")
            return frame, self._lineage.names(number)

    def frame(self, k: int) -> bytes:
        """The packet of the k-th frame told.  Raises BadInput for one that is not there or not whole."""
        return self.packed(k, *self.read(k))

    def packed(self, k: int, frame: Any, names: np.ndarray) -> bytes:
        """The packet of what `read` gave."""
        return frame_packet(k, frame, names, self.unit, self.compact)

    def series(self) -> dict[str, Any]:
        """What happened over time, by the ledger; by the frames where there is none."""
        with self._lock:
            books = self._ledger_columns()
            return of_ledger(books) if books else of_frames(self.frames, self.grains_count)

    def dimension(self, k: int, grain: int) -> dict[str, Any]:
        """Fractal dimension of the cluster of a grain: `value` and `error`, or the `reason` why there are none.

        Raises
        ------
        BadInput
            there is no such frame or grain.
        """
        if not 0 <= grain < self.grains_count:
            raise BadInput(f"there are {self.grains_count} grains, from 0 to {self.grains_count - 1}; no {grain}")
        return dimensions.answer(*self.read(k), grain)

    def ranges(self) -> dict[str, list[float]]:
        """Least and most of quantities by name, SI: of all numbers in EXTREMES, nearly all in PERCENTILES."""
        with self._lock:
            count = len(self.frames)
            if self._ranges is None or count > 1.5 * self._ranges[0]:
                self._ranges = (count, ranges_of(self.frames))
            return self._ranges[1]

    def _told_field(self, numbers: np.ndarray) -> dict[str, Any] | None:
        if self._field is None or not numbers.size:
            return None
        text, at = self._field
        times = self.frames.times
        self._directions += [_direction(at(float(t))) for t in times[len(self._directions) :]]
        told = [self._directions[k] for k in numbers.tolist()]
        steady = np.ptp(np.array(told), axis=0).max() < STEADY
        return {"text": text, "direction": told[0]} | ({} if steady else {"directions": told})


def _settled(chosen: slice, count: int) -> slice:
    """The same slice of so many frames, with no number that counts from the end."""
    start, stop = chosen.start, chosen.stop
    if start is not None and start < 0:
        start = max(start + count, 0)
    if stop is not None and stop < 0:
        stop = max(stop + count, 0)
    return slice(start, stop, chosen.step)


def _direction(vector: Sequence[float]) -> list[float]:
    size = float(np.linalg.norm(vector))
    return [float(f"{part / size:.9g}") if size > 0.0 else 0.0 for part in vector]


def run_dataset(path: str | Path, field: FieldDescription | None = None) -> RunDataset:
    """The story of a run in a folder, or of a trajectory of SAND by itself.

    Raises
    ------
    BadInput
        there is no run, or no frame yet, or the file is foreign or broken.
    """
    place = Path(path)
    folder = run_folder(place)
    if folder is None:
        if not place.is_file():
            lacks = f"there is no {files.TRAJECTORY} in it" if place.is_dir() else "there is no such folder or file"
            raise BadInput(f"{path} is neither the folder of a run nor a trajectory: {lacks}")
        return RunDataset(LiveTrajectory(place), place.stem, str(path), books=lambda: None, summary=dict, field=field)
    frames = LiveTrajectory(folder / files.TRAJECTORY)
    name = folder.resolve().name
    return RunDataset(frames, name, str(path), books=RunBooks(folder), summary=lambda: summary_of(folder), field=field)
