"""Synthetic run folders, written without compiled kernels; the same bytes each time.

They have the format of a run: ballistic aggregates, rotating moments, contacts where surfaces overlap, forces and
fractions of limits that depend on the index of the contact.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

import sand
from sand.basics.box import Box
from sand.basics.own_quantities import OwnQuantities
from sand.io import run_folder as files
from sand.io.damage import sealed
from sand.io.ledger_table import LedgerFile
from sand.io.trajectory import TrajectoryWriter

RADIUS = 10e-9
SUNK = 0.997
"""Distance of centres of two touching grains over the sum of their radii."""
STEP = 1e-9
"""Time between frames [s]."""
CASE = '[forces.field]\nflux_density = ["3 mT", "0 T", "4 mT"]\n'


@dataclass
class Body:
    """Grains as `TrajectoryWriter` needs them, in SI."""

    position: np.ndarray
    radius: np.ndarray
    materials: tuple[Any, ...] = (sand.IRON, sand.SILICA)
    material: np.ndarray = field(init=False)
    seed: int = 1

    def __post_init__(self) -> None:
        count, rng = len(self.radius), np.random.default_rng(self.seed)
        self.id = np.arange(count)
        self.material = (np.arange(count) % 4 == 3).astype(np.uint32)
        # a name that objects of JavaScript have already, and letters beyond ASCII; `write` changes them in each frame
        own = {"constructor": 100.0 + np.arange(count, dtype=float), "Wärmestrom": np.linspace(-2.0, 3.0, count)}
        self.own = OwnQuantities(own, {"constructor": "K", "Wärmestrom": "W/m^2"})
        density = np.array([one.density for one in self.materials])[self.material]
        self.mass = density * 4.0 / 3.0 * np.pi * self.radius**3
        self.charge, self.image = np.zeros(count), np.zeros((count, 3), np.int32)
        self.orientation = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
        way = rng.normal(size=(count, 3))
        size = np.array([200.0, 0.0])[self.material] * self.mass  # non-magnetic grains have no arrow
        self.moment = way / np.linalg.norm(way, axis=1)[:, None] * size[:, None]
        self.velocity, self.spin = 3.0 * rng.normal(size=(count, 3)), 1e8 * rng.normal(size=(count, 3))

    @property
    def arrays(self) -> SimpleNamespace:
        """Components first, as in a state."""
        columns = {name: values.T for name, values in vars(self).items() if isinstance(values, np.ndarray)}
        return SimpleNamespace(**columns)

    @property
    def own_units(self) -> dict[str, str]:
        """Units of the own quantities, as of `sand.Grains`."""
        return self.own.units

    def __len__(self) -> int:
        return len(self.radius)


def ballistic(count: int, radius: np.ndarray | float, seed: int) -> np.ndarray:
    """Centres (N, 3) of an aggregate: grains arrive one by one from random directions and stick on contact."""
    rng, r = np.random.default_rng(seed), np.broadcast_to(np.asarray(radius, float), count)
    place, known, reach = np.zeros((count, 3)), 1, 2.0 * r.max()
    while known < count:
        way, aim = rng.normal(size=3), rng.normal(size=3)
        way /= np.linalg.norm(way)
        aim -= way * (aim @ way)
        aim *= (reach + r[known]) * np.sqrt(rng.random()) / np.linalg.norm(aim)
        apart = place[:known] - aim
        along = apart @ way
        touch = SUNK * (r[:known] + r[known])
        room = touch**2 - (apart**2).sum(1) + along**2
        met = room > 0.0
        if not met.any():
            continue
        place[known] = aim + way * np.min(along[met] - np.sqrt(room[met]))
        reach = max(reach, np.linalg.norm(place[known]) + r[known])
        known += 1
    return place


def rotated(vectors: np.ndarray, angle: float) -> np.ndarray:
    """Vectors (N, 3) rotated about z."""
    c, s = np.cos(angle), np.sin(angle)
    return vectors @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def contacts_of(body: Body, box: Box) -> dict[str, np.ndarray]:
    """All pairs of overlapping grains, with forces and fractions of limits that depend on the pair.

    Of every six contacts, four have one mode each at its limit; the fractions of one are NaN.
    """
    pair = box.close_pairs(body.position, 2.0 * body.radius.max()).astype(np.uint32)
    apart = box.nearest(body.position[pair[:, 0]] - body.position[pair[:, 1]])
    size = np.linalg.norm(apart, axis=1)
    overlap = body.radius[pair].sum(1) - size
    pair, apart, size, overlap = (some[overlap > 0.0] for some in (pair, apart, size, overlap))
    number = pair[:, 0] * 7919 + pair[:, 1] * 104729
    u = np.stack([np.mod(number * g, 1.0) for g in (0.6180339887, 0.7548776662, 0.5698402910, 0.8191725134)], axis=1)
    normal = (2.0 * u[:, 0] - 1.0) * 5e-9
    force = normal[:, None] * apart / size[:, None] + np.cross(apart / size[:, None], [1e-9, 2e-9, 3e-9])
    share = 0.9 * u
    kind = number % 6
    for mode in range(4):
        share[kind == mode, mode] = -1.0 if mode == 1 else 1.0
    share[kind == 5] = np.nan
    empty = np.zeros((len(pair), 3))
    columns = {f"{mode}_share": share[:, k] for k, mode in enumerate(("stretch", "slide", "roll", "twist"))}
    return {
        "pair": pair,
        "overlap": overlap,
        "formed": u[:, 1] * 1e-9,
        "force": force,
        "slide_vector": empty,
        "roll_vector": empty,
        "twist": np.zeros(len(pair)),
        **columns,
    }


def write(folder: Path, moments: list[Body], box: Box, rests: list[np.ndarray] | None = None) -> Path:
    """A folder with a frame per state, a ledger and a summary; `rests` (N,) of each: which grains are at rest."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / files.CASE).write_text(CASE)
    writer, rows, before = TrajectoryWriter(folder / files.TRAJECTORY), [], set()
    made = broken = 0
    for k, body in enumerate(moments):
        table = contacts_of(body, box)
        rest = None if rests is None else rests[k]
        body.own = OwnQuantities({name: (1.0 + k) * values for name, values in body.own.items()}, body.own.units)
        writer.write(1000 * k, STEP * k, body, box, table, at_rest=rest)  # type: ignore[arg-type]
        now = set(map(tuple, table["pair"].tolist()))
        made, broken, before = made + len(now - before) * (k > 0), broken + len(before - now), now
        energy = 1e-18 / (k + 1)
        rows.append({"step": 1000 * k, "time": STEP * k, "kinetic": energy, "total": energy})
        rows[-1] |= {} if rest is None else {"awake": int((~rest).sum())}
        rows[-1] |= {"contacts": len(now), "made": made, "broken": broken, **_sizes(len(body), table["pair"])}
    writer.close()
    LedgerFile(folder / files.LEDGER, list(rows[0]), rows)
    end = {"steps": 1000 * (len(moments) - 1), "outcome_text": "reached the end"}
    files.write_json(folder / files.SUMMARY, sealed(end))
    return folder


def _sizes(count: int, pairs: np.ndarray) -> dict[str, float]:
    from sand.analysis.clusters import cluster_labels, cluster_sizes, mean_cluster_size

    labels = cluster_labels(count, pairs)
    largest = int(cluster_sizes(labels).max())
    return {"mean_cluster_size": mean_cluster_size(labels), "largest_cluster": largest, "clusters": labels.max() + 1}


def two(folder: Path) -> Path:
    """Two grains in contact that rotate about each other, in open space; three frames."""
    moments = []
    for k in range(3):
        body = Body(rotated(np.array([[-SUNK, 0.0, 0.0], [SUNK, 0.0, 0.0]]) * RADIUS, 0.4 * k), np.full(2, RADIUS))
        body.moment = rotated(body.moment, 0.7 * k)
        moments.append(body)
    return write(folder, moments, Box.open())


SIZES = (40, 16, 12, 8, 6, 4, 3, 2)
"""Grains of the clusters of `hundred` when all have met."""
SINGLES = 9
SIDE = 36 * RADIUS
MEETING, FIRST_PART = 3, 26
"""Frame of `hundred` from which the largest cluster is one; before, its first 26 grains and the others are apart."""
FRAMES = 6


def hundred(folder: Path, rests: list[np.ndarray] | None = None) -> Path:
    """100 grains of two sizes and materials in a periodic box: clusters cross faces, two merge.

    Clusters have the first indices, in the order of SIZES; the last nine grains are single.
    """
    rng, box = np.random.default_rng(5), Box.periodic(SIDE)
    radius = RADIUS * np.where(rng.random(sum(SIZES) + SINGLES) < 0.3, 1.4, 1.0)
    cells = np.array(list(itertools.product((0.0, 0.5), repeat=3))) * SIDE
    start, drift, first = np.zeros((len(radius), 3)), np.zeros((len(radius), 3)), 0
    for k, (count, cell) in enumerate(zip(SIZES, cells, strict=True)):
        own = slice(first, first + count)
        place = _joined(radius[own]) if k == 0 else ballistic(count, radius[own], seed=11 + k)
        start[own] = place - place.mean(0) + cell
        drift[own] = 0.6 * RADIUS * np.array([1.0, 0.4 * (-1) ** k, 0.3])
        first += count
    late = np.zeros((len(radius), 3))
    late[FIRST_PART : SIZES[0], 0] = 0.9 * RADIUS

    def at(k: int) -> np.ndarray:
        return box.wrap(start + k * drift + max(MEETING - k, 0) * late)

    drift[first:] = 0.6 * RADIUS * np.array([1.0, 0.0, 0.3])
    for i in range(first, len(radius)):  # where a grain fits in all frames
        while True:
            start[i] = (rng.random(3) - 0.5) * SIDE
            if all(_free(at(k), radius, i, box) for k in range(FRAMES)):
                break
    moments = []
    for k in range(FRAMES):
        body = Body(at(k), radius)
        body.moment, body.velocity = rotated(body.moment, 0.35 * k), body.velocity * (1.0 + 0.2 * k)
        moments.append(body)
    return write(folder, moments, box, rests)


def resting(folder: Path) -> Path:
    """As `hundred`, but all grains are at rest except, from frame MEETING on, the two clusters that merge.

    From frame MEETING + 2 on they are at rest again, and the smallest cluster is awake.
    """
    number = np.arange(sum(SIZES) + SINGLES)
    small = (number >= sum(SIZES[:-1])) & (number < sum(SIZES))
    awake = [number < 0, number < SIZES[0], small]
    return hundred(folder, [~awake[(k >= MEETING) + (k >= MEETING + 2)] for k in range(FRAMES)])


def _joined(radius: np.ndarray) -> np.ndarray:
    """Two aggregates side by side along x in contact at one point."""
    one, other = (ballistic(len(r), r, seed) for r, seed in ((radius[:FIRST_PART], 11), (radius[FIRST_PART:], 12)))
    across = other[:, None] - one[None]
    room = (SUNK * (radius[FIRST_PART:, None] + radius[None, :FIRST_PART])) ** 2 - (across[..., 1:] ** 2).sum(-1)
    shift = np.max(np.where(room > 0.0, np.sqrt(np.maximum(room, 0.0)) - across[..., 0], -np.inf))
    return np.vstack([one, other + np.array([shift, 0.0, 0.0])])


def _free(place: np.ndarray, radius: np.ndarray, i: int, box: Box) -> bool:
    apart = np.linalg.norm(box.nearest(place[:i] - place[i]), axis=1)
    return bool((apart > radius[:i] + radius[i] + 0.3 * RADIUS).all())


def many(folder: Path, bodies: int = 5, each: int = 2000, frames: int = 3) -> Path:
    """Large rotating aggregates side by side in open space; 5 of 2000 grains by default."""
    place = ballistic(each, RADIUS, seed=3)
    apart = 2.1 * np.linalg.norm(place, axis=1).max()
    side = int(np.ceil(bodies ** (1 / 3) - 1e-9))
    grid = np.array(list(itertools.islice(itertools.product(range(side), repeat=3), bodies)), float)
    grid = (grid - grid.mean(0)) * apart
    moments = []
    for k in range(frames):
        parts = [rotated(place, 0.02 * k * (1 + b % 3) + 1.3 * b) + grid[b] for b in range(bodies)]
        body = Body(np.vstack(parts), np.full(bodies * each, RADIUS))
        body.moment = rotated(body.moment, 0.02 * k)
        moments.append(body)
    return write(folder, moments, Box.open())


def unequal(folder: Path) -> Path:
    """A row of grains of 10 and 25 nm in contact, in open space, most of them large; one frame."""
    radius = np.array([1.0, 2.5, 1.0, 2.5, 2.5]) * RADIUS
    along = np.concatenate([[0.0], np.cumsum(SUNK * (radius[1:] + radius[:-1]))])
    place = np.stack([along - along.mean(), 0.0 * along, 0.0 * along], axis=1)
    return write(folder, [Body(place, radius)], Box.open())


KINDS = {"two": two, "unequal": unequal, "hundred": hundred, "resting": resting, "ten-thousand": many}
