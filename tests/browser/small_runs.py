"""Folders of small synthetic runs in the format of real ones; nothing is compiled.

Twelve grains in a periodic box: a chain of four across a face, a chain of four that makes contact with it in frame
4, a pair that separates in frame 6, and two single moving grains.
"""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from sand.basics.box import Box
from sand.basics.material import IRON, SILICA
from sand.basics.schema import MODES
from sand.basics.state import LOST
from sand.io.damage import sealed
from sand.io.ledger_table import LedgerFile
from sand.io.run_folder import LEDGER, SUMMARY, TRAJECTORY, write_json
from sand.io.trajectory import TrajectoryWriter
from sand.viewer.external_field import FieldDescription

R = 10e-9
"""Radius of a grain [m]."""
SIDE = 24.0
"""Of the box, in radii."""
FRAMES, GRAINS, MERGED, PARTED = 8, 12, 4, 6
STEP = 1e-9
"""Time between frames [s]."""
FIELD = FieldDescription("1 mT, constant", lambda time: (0.0, 0.0, 1e-3))
ENERGIES = ("translation", "rotation", "normal", "sliding", "rolling", "twisting", "magnetic")
COLUMNS = (
    *("step", "time"),
    *ENERGIES,
    *(f"lost_{name}" for name in LOST),
    *("total", "clusters", "largest_cluster", "mean_cluster_size", "contacts", "made", "broken"),
)


class Grains(SimpleNamespace):
    """Grains as `TrajectoryWriter` needs them."""

    own_units: ClassVar[dict[str, str]] = {}

    def __len__(self) -> int:
        return len(self.radius)

    @property
    def id(self) -> np.ndarray:
        """Identities: the indices."""
        return np.arange(len(self))

    @property
    def arrays(self) -> SimpleNamespace:
        """Components first, as in a state; no grain has crossed the box."""
        columns = {name: np.asarray(values).T for name, values in vars(self).items() if name != "materials"}
        return SimpleNamespace(**columns, id=self.id, image=np.zeros((3, len(self)), np.int32))


def positions(k: int) -> np.ndarray:
    """Positions (12, 3) in radii, inside the box."""
    drift = 0.4 * max(k - MERGED, 0)
    first = [(9.0 + 1.99 * i, -6.0, drift) for i in range(4)]
    second = [(16.96 + 1.99 * i, 6.0 - 3.0 * min(k, MERGED), drift) for i in range(4)]
    pair = [(2.0, 8.0, -6.0), (3.99, 8.0, -6.0 + 1.5 * max(k - PARTED + 1, 0))]
    alone = [(-4.0 + 0.8 * k, 3.0, 7.0), (-6.0, -1.0 + 0.5 * k, -7.0)]
    at = np.array(first + second + pair + alone)
    return at - SIDE * np.round(at / SIDE)


def pairs(k: int) -> np.ndarray:
    """Pairs of grains in contact, (C, 2)."""
    chains = [(i, i + 1) for start in (0, 4) for i in range(start, start + 3)]
    return np.array(chains + [(3, 4)] * (k >= MERGED) + [(8, 9)] * (k < PARTED))


def grains(at: np.ndarray, k: int = 0, *, moments: bool = True) -> Grains:
    """Grains at these positions [radii]; values differ between grains and frames."""
    n = len(at)
    one = np.arange(n)
    radius = np.where(one == GRAINS - 1, 1.5, 1.0) * R
    mass = 4 / 3 * np.pi * radius**3 * np.where(one == GRAINS - 2, SILICA.density, IRON.density)
    angle = 0.5 * one + 0.3 * k
    turned = np.column_stack([np.cos(angle), np.sin(angle), 0.3 * np.ones(n)])
    return Grains(
        position=at * R,
        radius=radius,
        mass=mass,
        materials=(IRON, SILICA),
        material=np.where(one == GRAINS - 2, 1, 0),
        velocity=turned * (1.0 + one)[:, None],
        spin=turned[:, ::-1] * 1e8 * (1.0 + one % 5)[:, None],
        charge=np.zeros(n),
        orientation=np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)),
        moment=turned * 6e-18 * moments,
    )


def contacts(pair: np.ndarray, k: int = 0) -> dict[str, np.ndarray]:
    """Columns of a table of contacts."""
    pair = np.asarray(pair, np.uint32).reshape(-1, 2)
    count = len(pair)
    size = np.arange(1, count + 1, dtype=float)
    table = {name: np.zeros((count, 3)) for name in ("slide_vector", "roll_vector")}
    shares = {f"{mode}_share": (0.2 * size + 0.1 * m) % 1.05 for m, mode in enumerate(MODES)}
    return {
        **table,
        **shares,
        "pair": pair,
        "overlap": 1e-10 * size,
        "formed": np.full(count, 0.25 * STEP * k),
        "force": np.column_stack([1e-8 * (size - 3.0), 0.2e-8 * size, np.zeros(count)]),
        "twist": np.zeros(count),
    }


def at_rest(k: float) -> np.ndarray:
    """Grains at rest (12,): all, but for the two chains from when they have made contact until the pair separates."""
    return ~((np.arange(GRAINS) < 8) & (MERGED - 0.5 <= k < PARTED - 0.5))


def row(at: float) -> dict[str, float]:
    """A row of the ledger at a time in frames; an event has happened half a frame before the frame that shows it."""
    merged, parted = at >= MERGED - 0.5, at >= PARTED - 0.5
    told = dict.fromkeys(COLUMNS, 0.0)
    told |= {name: 1e-18 * (k + 1) * (1 + 0.1 * at) for k, name in enumerate(ENERGIES)}
    told |= {f"lost_{name}": 1e-19 * (k + 1) * at for k, name in enumerate(LOST)}
    clusters = 5 - merged + parted
    told |= {"step": int(100 * at), "time": at * STEP, "clusters": clusters, "largest_cluster": 8 if merged else 4}
    told |= {"mean_cluster_size": 12 / clusters, "contacts": 7 + merged - parted}
    total = math.fsum(told[name] for name in COLUMNS[2 : COLUMNS.index("total")])
    return told | {"made": 7 + int(merged), "broken": int(parted), "total": total}


class SmallRun:
    """A run folder with any number of frames.

    Args:
        folder: of the run; created.
        frames: number of frames, of eight, written at first.
        ended: whether the summary is there.
        box: periodic by default.
        rigid: whether frames and ledger say which grains are at rest.
    """

    def __init__(
        self,
        folder: Path,
        frames: int = FRAMES,
        *,
        ended: bool = True,
        box: Box | None = None,
        rigid: bool = False,
    ):
        self.folder, self.count, self.rigid = folder, 0, rigid
        self.box = box or Box.periodic(SIDE * R)
        folder.mkdir(parents=True, exist_ok=True)
        self.ledger = LedgerFile(folder / LEDGER, (*COLUMNS, "awake") if rigid else COLUMNS)
        self.writer = TrajectoryWriter(folder / TRAJECTORY)
        self.append(frames)
        if ended:
            self.end()

    def append(self, frames: int) -> None:
        """Write this many more frames, and two ledger rows per frame."""
        for k in range(self.count, self.count + frames):
            for at in (k - 0.5, k) if k else (0,):
                self.ledger.append(row(at) | {"awake": int((~at_rest(at)).sum())})
            parts = 100 * k, k * STEP, grains(positions(k), k), self.box, contacts(pairs(k), k)
            self.writer.write(*parts, at_rest=at_rest(k) if self.rigid else None)
        self.count += frames
        self.writer.flush()

    def end(self) -> None:
        """Write the summary."""
        self.writer.close()
        write_json(self.folder / SUMMARY, sealed({"outcome_text": "ended as wished", "steps": 100 * (self.count - 1)}))


def written(folder: Path, frames: list[tuple[Any, np.ndarray]], box: Box | None = None) -> Path:
    """A trajectory with one set of grains and pairs per frame, without a ledger."""
    folder.mkdir(parents=True, exist_ok=True)
    writer = TrajectoryWriter(folder / TRAJECTORY)
    for k, (some, pair) in enumerate(frames):
        writer.write(100 * k, k * STEP, some, box or Box.open(), contacts(pair, k))
    writer.close()
    write_json(folder / SUMMARY, sealed({"outcome_text": "ended as wished", "steps": 100 * (len(frames) - 1)}))
    return folder
