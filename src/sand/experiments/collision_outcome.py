"""What two bodies are before they collide, and what becomes of them."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..analysis.clusters import cluster_labels
from ..analysis.shape import gyration_radius
from ..grains import Grains
from ..simulation.simulation import Simulation
from ..state.state import LOST


class Approach(NamedTuple):
    """Two bodies, turned and aimed, before they meet."""

    target: Grains
    projectile: Grains
    grains: Grains  # of both, the target's first
    flight: float  # time until they can touch first [s], about
    speed: float  # [m/s]
    seed: int | None

    @property
    def check_every(self) -> float:
        """Time between frames [s]: a twentieth of that which the smallest grain takes for its own diameter.

        But no less than 30 sound crossings.
        """
        smallest = float(self.grains.radius.min())
        sound = max(math.sqrt(m.density / m.young_modulus) for m in self.grains.materials)
        return max(0.1 * smallest / self.speed, 30.0 * smallest * sound)


@dataclass(frozen=True)
class Collision:
    """The outcome of one collision; SI.

    Attributes
    ----------
    outcome : str
        "stick" (one body), "bounce" (two bodies of the same grains as before), "miss", or "fragment".
    speed, impact_parameter : float
        as asked; seed: of the orientations, None for as given.
    fragments : tuple[int, ...]
        grains of each body at the end, largest first.
    largest_remnant : float
        mass of the largest body over all mass.
    made, moved, broken : int
        contacts formed, moved (a limit passed in a step), broken during the collision.
    contacts_before, contacts_after : int
        their numbers.
    lost : dict[str, float]
        energy dissipated per channel [J]; impact_energy: m̄v²/2 [J].
    gyration_before : tuple[float, float]
        radii of gyration of target and projectile [m]; gyration_after: of the largest remnant.
    rebound : float
        relative speed of the two largest bodies at the end [m/s], 0 if there is one.
    time, steps
        of the simulation; drift: of its ledger; quiet: False if it was stopped while still busy.
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


def classify_collision(simulation: Simulation, start: Approach, before: int, quiet: bool) -> Collision:
    """What became of two bodies.

    Parameters
    ----------
    simulation : Simulation
        at its end.
    start : Approach
        what it began with.
    before : int
        contacts at the start.
    quiet : bool
        False if it was stopped while still busy.
    """
    target, projectile, begun, speed = start.target, start.projectile, start.grains, start.speed
    grains, row = simulation.grains, simulation.ledger.rows[-1]
    labels = cluster_labels(len(grains), simulation.contacts["pair"])
    masses = np.bincount(labels, weights=grains.mass)
    order = np.argsort(-masses, kind="stable")
    counts = np.bincount(labels)
    largest = labels == order[0]
    m1, m2 = float(target.mass.sum()), float(projectile.mass.sum())
    n = len(target)
    centres = [
        np.average(begun.position[part], axis=0, weights=begun.mass[part]) for part in (slice(n), slice(n, None))
    ]
    offset = centres[1] - centres[0]
    flight = begun.velocity[-1] - begun.velocity[0]
    flight = flight / np.linalg.norm(flight)
    return Collision(
        outcome=_outcome(labels, len(target), int(row["made"])),
        speed=speed,
        impact_parameter=float(np.linalg.norm(offset - (offset @ flight) * flight)),
        seed=start.seed,
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
