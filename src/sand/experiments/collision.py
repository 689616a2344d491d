"""Two bodies collide: what becomes of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.clusters import cluster_labels
from ..analysis.shape import gyration_radius
from ..core.arguments import checked
from ..core.errors import BadInput
from ..core.grains import Grains
from ..core.units import si
from ..core.world import LOST
from ..forces.base import Force
from ..forces.contact import Contact
from ..run.simulation import Simulation
from ..setup.encounters import encounter, turned_at_random
from ..stepping.adaptive import Adaptive
from ..stepping.verlet import Verlet

QUIET = 3
"""A collision is over after this many looks in a row without a contact made, moved or broken."""
LOOKS = 400
"""It is stopped after this many looks at the latest."""


@dataclass(frozen=True)
class Collision:
    """The outcome of one collision; SI.

    Attributes:
        outcome: "stick" (one body), "bounce" (two bodies of the same grains as before), "miss", or "fragment".
        speed, impact_parameter: as asked; seed: of the orientations, None for as given.
        fragments: grains of each body at the end, largest first.
        largest_remnant: mass of the largest body over all mass.
        made, moved, broken: contacts formed, moved (a limit passed in a step), broken during the collision.
        contacts_before, contacts_after: their numbers.
        lost: energy dissipated per channel [J]; impact_energy: m̄v²/2 [J].
        gyration_before: radii of gyration of target and projectile [m]; gyration_after: of the largest remnant.
        rebound: relative speed of the two largest bodies at the end [m/s], 0 if there is one.
        time, steps: of the simulation; drift: of its ledger; quiet: False if it was stopped while still busy.
    """

    outcome: str
    speed: float
    impact_parameter: float
    seed: int | None
    fragments: tuple[int, ...]
    largest_remnant: float
    made: int
    moved: int
    broken: int
    contacts_before: int
    contacts_after: int
    impact_energy: float
    lost: dict[str, float] = field(hash=False)
    gyration_before: tuple[float, float] = (0.0, 0.0)
    gyration_after: float = 0.0
    rebound: float = 0.0
    time: float = 0.0
    steps: int = 0
    drift: float = 0.0
    quiet: bool = True

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


@checked
def collide(
    target: Grains,
    projectile: Grains,
    *,
    speed: Any,
    impact_parameter: Any = 0.0,
    along: Any = "x",
    seed: int | None = None,
    forces: Sequence[Force] | None = None,
    stepping: Verlet | Adaptive | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    observers: Sequence[Any] = (),
) -> tuple[Collision, Simulation]:
    """Let a projectile hit a target in open space and wait until nothing happens any more.

    Args:
        target, projectile: bodies at rest, from `sand.setup` or of one's own.
        speed, impact_parameter, along: see `sand.setup.encounter`.
        seed: turn both bodies at random first; None leaves them as they are.
        forces: `[sand.Contact()]` by default.
        stepping, out, overwrite, observers: as for `sand.Simulation`.

    Returns:
        The outcome, and the simulation as it ended.

    Raises:
        BadInput: see `encounter` and `Simulation`.
    """
    v = si(speed, "m/s", "speed", above=0.0)
    if seed is not None:
        rng = np.random.default_rng(seed)
        target, projectile = turned_at_random(target, rng), turned_at_random(projectile, rng)
    met = encounter(target, projectile, speed=v, impact_parameter=impact_parameter, along=along)
    simulation = Simulation(
        met.grains,
        [Contact()] if forces is None else forces,
        stepping=stepping,
        seed=seed,
        out=out,
        overwrite=overwrite,
        observers=observers,
        frame_every=_look_every(met.grains, v),
    )
    before = len(simulation.contacts["pair"])
    quiet = _until_quiet(simulation, met.flight, met.grains, v)
    return _judge(simulation, target, projectile, v, impact_parameter, seed, before, quiet), simulation


def _look_every(grains: Grains, speed: float) -> float:
    """A twentieth of the time the smallest grain takes for its own diameter, but no less than 30 sound crossings."""
    smallest = float(grains.radius.min())
    sound = max(math.sqrt(m.density / m.young_modulus) for m in grains.materials)
    return max(0.1 * smallest / speed, 30.0 * smallest * sound)


def _until_quiet(simulation: Simulation, flight: float, grains: Grains, speed: float) -> bool:
    """Run on until contacts neither form, move nor break for a while; False if that never comes."""
    every = _look_every(grains, speed)
    across = float(np.ptp(grains.position, axis=0).max())
    simulation.run(until=flight)
    calm, last = 0, (-1, -1, -1)
    for _ in range(LOOKS):
        result = simulation.run(until=simulation.time + 10.0 * every)
        if result.outcome.is_physics:
            raise BadInput(f"the collision cannot be computed: {result}")
        row = simulation.ledger.rows[-1]
        now = (int(row["made"]), int(row["moved"]), int(row["broken"]))
        calm = calm + 1 if now == last else 0
        last = now
        met = now[0] > 0 or simulation.time > flight + across / speed
        if met and calm >= QUIET:
            return True
    return False


def _judge(
    simulation: Simulation,
    target: Grains,
    projectile: Grains,
    speed: float,
    impact_parameter: Any,
    seed: int | None,
    before: int,
    quiet: bool,
) -> Collision:
    grains, row = simulation.grains, simulation.ledger.rows[-1]
    labels = cluster_labels(len(grains), simulation.contacts["pair"])
    masses = np.bincount(labels, weights=grains.mass)
    order = np.argsort(-masses, kind="stable")
    counts = np.bincount(labels)
    largest = labels == order[0]
    m1, m2 = float(target.mass.sum()), float(projectile.mass.sum())
    begun, n = simulation.start, len(target)
    centres = [
        np.average(begun.position[part], axis=0, weights=begun.mass[part]) for part in (slice(n), slice(n, None))
    ]
    offset = centres[1] - centres[0]
    flight = simulation.start.velocity[-1] - simulation.start.velocity[0]
    flight = flight / np.linalg.norm(flight)
    return Collision(
        outcome=_outcome(labels, len(target), int(row["made"])),
        speed=speed,
        impact_parameter=float(np.linalg.norm(offset - (offset @ flight) * flight)),
        seed=seed,
        fragments=tuple(int(counts[k]) for k in order),
        largest_remnant=float(masses[order[0]] / masses.sum()),
        made=int(row["made"]),
        moved=int(row["moved"]),
        broken=int(row["broken"]),
        contacts_before=before,
        contacts_after=int(row["contacts"]),
        impact_energy=0.5 * m1 * m2 / (m1 + m2) * speed**2,
        lost={name: row[f"lost_{name}"] for name in LOST},
        gyration_before=(
            gyration_radius(target.position, target.mass),
            gyration_radius(projectile.position, projectile.mass),
        ),
        gyration_after=gyration_radius(grains.position[largest], grains.mass[largest]),
        rebound=_rebound(grains, labels, order),
        time=simulation.time,
        steps=simulation.steps,
        drift=simulation.ledger.drift,
        quiet=quiet,
    )


def _outcome(labels: np.ndarray, first: int, made: int) -> str:
    bodies = int(labels.max()) + 1
    if bodies == 1:
        return "stick"
    same = bodies == 2 and len(set(labels[:first].tolist())) == 1 and len(set(labels[first:].tolist())) == 1
    if not same:
        return "fragment"
    return "bounce" if made else "miss"


def _rebound(grains: Grains, labels: np.ndarray, order: np.ndarray) -> float:
    if len(order) < 2:
        return 0.0
    mean = [np.average(grains.velocity[labels == k], axis=0, weights=grains.mass[labels == k]) for k in order[:2]]
    return float(np.linalg.norm(mean[0] - mean[1]))


@checked
def collide_many(
    build: Callable[[int], tuple[Grains, Grains]],
    seeds: Sequence[int],
    executor: Executor | None = None,
    **options: Any,
) -> list[Collision]:
    """The same collision for many seeds: other aggregates, other orientations.

    Args:
        build: makes target and projectile for a seed; a module-level function if processes are to run it.
        seeds: one collision each; results come in their order, whatever the executor.
        executor: any `concurrent.futures.Executor`; None: one after the other here.
        options: passed on to `collide`.
    """
    if executor is None:
        return [_one(build, seed, options) for seed in seeds]
    waiting = [executor.submit(_one, build, seed, options) for seed in seeds]
    return [future.result() for future in waiting]


def _one(build: Callable[[int], tuple[Grains, Grains]], seed: int, options: dict[str, Any]) -> Collision:
    target, projectile = build(seed)
    return collide(target, projectile, seed=seed, **options)[0]
